# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Checks of many recordings at a time: by processes of this machine, or by workers of a Dask cluster.

A recording that cannot be checked gives a Result that says why.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import as_completed, ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace
import multiprocessing
import os
from pathlib import Path
import re
import shutil
import signal
import tempfile
import threading
import time
import traceback
from uuid import uuid4

from sat_collision.extras import in_one_line, unexpected
from sat_collision.replay.check import check, OnProgress
from sat_collision.replay.model.result import Options, Result

# How often a recording is tried in all whose process or worker dies.
_ATTEMPTS = 3
# How long to wait for a scheduler, s.
_TIMEOUT = 10
# For how long a cluster may have no worker, s: some start workers when they are needed.
_NO_WORKER = 60.0


def name_for_outputs(path: str) -> str:
    """Return what to call the bag or picture of a recording: as it, without a storage's ending."""
    return re.sub(r'(?<=.)\.(mcap|db3)(\.zstd)?$', '', Path(os.path.abspath(path)).name)


def check_one(path: str, options: Options, progress: OnProgress | None = None) -> Result:
    """Check one of several recordings; a bag written for it is in the folder of all."""
    if options.write_bag:
        options = replace(options, write_bag=str(Path(options.write_bag, name_for_outputs(path))))
    return check_alone(path, options, progress)


def check_alone(path: str, options: Options, progress: OnProgress | None = None) -> Result:
    """
    Check a recording; until a bag written for it is whole, it is in a hidden folder beside.

    An attempt whose process dies leaves nothing that the next one finds. Where an earlier attempt
    wrote the bag, but its result was lost, the bag stays. One that cannot be written is a problem
    of the result.
    """
    if not options.write_bag:
        return check(path, options, progress)
    bag = Path(options.write_bag)
    # Folders of tempfile are no choice: some of its versions fail where they cannot be removed.
    folder = Path(bag.parent, f'{_unfinished(tempfile.tempdir)}{uuid4().hex}')
    try:
        unfinished = folder / bag.name
        result = check(path, replace(options, write_bag=str(unfinished)), progress)
        is_whole = os.path.exists(unfinished / 'metadata.yaml') and not result.bag_faults
        try:
            if is_whole and not bag.exists():
                unfinished.rename(bag)
        except OSError as error:
            result.add_bag_fault(error)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return result


def _unfinished(temporary: str | None) -> str:
    """Return how folders begin in which processes with this folder for temporary files write."""
    return f'.unfinished_{Path(temporary or "").name}_'


def check_here(paths: Iterable[str], options: Options, jobs: int) -> Iterator[Result]:
    """Yield the Result of each recording when it is there, from processes of this machine."""
    # However they end, their temporary files are removed.
    with tempfile.TemporaryDirectory(prefix='replay_check_') as folder:
        try:
            yield from _check_in_processes(paths, options, jobs, folder)
        finally:
            if options.write_bag:
                for left in Path(options.write_bag).glob(f'{_unfinished(folder)}*'):
                    shutil.rmtree(left, ignore_errors=True)


def _check_in_processes(paths: Iterable[str], options: Options, jobs: int,
                        folder: str) -> Iterator[Result]:
    again = []
    others = multiprocessing.active_children()
    pool = _pool(jobs, folder)
    try:
        futures = {pool.submit(check_one, path, options): path for path in paths}
        for future in as_completed(futures):
            if future.exception():
                again.append(futures[future])
            else:
                yield future.result()
        pool.shutdown()
        # When a process dies, all running checks fail: run them again one by one.
        for path in again:
            for _ in range(_ATTEMPTS - 1):
                pool = _pool(1, folder)
                future = pool.submit(check_one, path, options)
                error = future.exception()
                pool.shutdown()
                if not error:
                    break
            yield failed(path, options, error, _ATTEMPTS) if error else future.result()
    except BaseException:
        # End running checks, and cancel pending ones.
        pool.shutdown(wait=False, cancel_futures=True)
        processes = [one for one in multiprocessing.active_children() if one not in others]
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()
        raise


def _pool(jobs: int, folder: str) -> ProcessPoolExecutor:
    """Return a pool of processes with a folder for temporary files."""
    return ProcessPoolExecutor(jobs, multiprocessing.get_context('spawn'), _begin, (folder,))


def _begin(folder: str) -> None:
    """Let a process end silently when it is interrupted at the terminal, and with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    tempfile.tempdir = folder
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent is killed, from which it would wait for work for ever."""
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(1)


def check_on_cluster(paths: Sequence[str], options: Options, address: str) -> Iterator[Result]:
    """
    Yield the Result of each recording when it is there, from the workers of a Dask cluster.

    Workers must see the same paths, and have this package. The scheduler gives the recordings of a
    lost worker to others; those that are left when there is no worker any more fail. If no
    scheduler answers at the address, an OSError is raised.
    """
    import distributed
    try:
        connected = distributed.Client(address, timeout=_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise OSError(
            f'--dask: no scheduler answers at {address}: {in_one_line(error)}') from error
    with connected as client:
        there = options if options.write_bag is None else replace(
            options, write_bag=_there(options.write_bag))
        work = check_one if len(paths) > 1 else check_alone
        futures = {client.submit(work, _there(path), there, pure=False,
                                 retries=_ATTEMPTS - 1, key=f'replay_check-{number}-{path}'): path
                   for number, path in enumerate(paths)}
        has_worker = time.monotonic()
        while futures:
            with client.as_current(), suppress(distributed.TimeoutError):
                distributed.wait([*futures], 1.0, 'FIRST_COMPLETED')
            if client.nthreads():
                has_worker = time.monotonic()
            elif time.monotonic() > has_worker + _NO_WORKER:
                gone = OSError('the cluster has no worker left')
                yield from (failed(path, options, gone) for path in futures.values())
                return
            for future in [one for one in futures if one.done()]:
                try:
                    fault = future.exception(_NO_WORKER)
                    result = None if fault else future.result(_NO_WORKER)
                except distributed.TimeoutError:
                    # It was lost with its worker, and is found anew.
                    continue
                path = futures.pop(future)
                yield (failed(path, options, fault, _ATTEMPTS) if result is None
                       else _as_given(result, path))


def _there(path: str) -> str:
    """Return what a path is in any folder; a `..` in it may follow a link, and stays."""
    return str(Path(path).absolute())


def _as_given(result: Result, path: str) -> Result:
    """Return a result of a worker with the path that was given."""
    there = _there(path)
    return replace(result, bag=path, problems=[
        problem.replace(there, path, 1) for problem in result.problems])


def failed(path: str, options: Options, error: BaseException, attempts: int = 1) -> Result:
    """Return the Result of a recording that could not be checked."""
    if options.debug:
        traceback.print_exception(type(error), error, error.__traceback__)
    tried = f', {attempts} attempts failed' if attempts > 1 else ''
    return Result(str(path), options,
                  problems=[f'{path}: not checked{tried}: {unexpected(error)}'])
