# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Many recordings: on the processors of this machine, or on a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import as_completed, ProcessPoolExecutor
from dataclasses import replace
import multiprocessing
from pathlib import Path
import signal
import traceback

from sat_collision.replay.bag.storage import in_words
from sat_collision.replay.model.result import Options, Result
from sat_collision.replay.run import check, OnProgress

_ATTEMPTS = 3
# How long to wait for a scheduler, s.
_TIMEOUT = 10


def check_one(path: str, options: Options, progress: OnProgress | None = None) -> Result:
    """Check one of several recordings; a bag written for it has a directory of its own."""
    if options.write_bag:
        options = replace(options, write_bag=str(Path(options.write_bag, Path(path).stem)))
    return check(path, options, progress)


def check_here(paths: Iterable[str], options: Options, jobs: int) -> Iterator[Result]:
    """
    Yield the Result of each recording as soon as it is there, from processes of this machine.

    A recording whose process died or failed is tried again, up to three times in all.
    """
    again = []
    pool = _pool(jobs)
    try:
        futures = {pool.submit(check_one, path, options): path for path in paths}
        for future in as_completed(futures):
            if future.exception():
                again.append(futures[future])
            else:
                yield future.result()
    except BaseException:
        # End running checks, and cancel pending ones.
        pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    pool.shutdown()
    # When a process dies, all running checks fail: run them again one by one.
    for path in again:
        for _ in range(_ATTEMPTS - 1):
            with _pool(1) as pool:
                future = pool.submit(check_one, path, options)
            error = future.exception()
            if not error:
                break
        yield failed(path, options, error, _ATTEMPTS) if error else future.result()


def _pool(jobs: int) -> ProcessPoolExecutor:
    # Processes that are interrupted at the terminal end silently.
    return ProcessPoolExecutor(jobs, multiprocessing.get_context('spawn'),
                               signal.signal, (signal.SIGINT, signal.SIG_DFL))


def check_on_cluster(paths: Iterable[str], options: Options, address: str) -> Iterator[Result]:
    """
    Yield the Result of each recording as soon as it is there, from the workers of a Dask cluster.

    The scheduler gives the recordings of a lost worker to others. Workers must see the same
    paths, and have this package.

    Raises
    ------
    OSError
        If no scheduler answers at the address.

    """
    import distributed
    try:
        connected = distributed.Client(address, timeout=_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise OSError(f'--dask: no scheduler answers at {address}: {in_words(error)}') from error
    with connected as client:
        futures = {client.submit(check_one, path, options, pure=False, retries=_ATTEMPTS - 1,
                                 key=f'replay_check-{number}-{path}'): path
                   for number, path in enumerate(paths)}
        for future in distributed.as_completed(list(futures), loop=client.loop):
            path = futures[future]
            fault = future.exception()
            yield failed(path, options, fault, _ATTEMPTS) if fault else future.result()


def failed(path: str, options: Options, error: BaseException, attempts: int = 1) -> Result:
    """Return the Result of a recording that could not be checked."""
    if options.debug:
        traceback.print_exception(type(error), error, error.__traceback__)
    tried = f', {attempts} attempts failed' if attempts > 1 else ''
    return Result(str(path), options,
                  problems=[f'{path}: not checked{tried}: {unexpected(error)}'])


def unexpected(error: BaseException) -> str:
    """Return what an unexpected error says."""
    return f'{type(error).__name__}: {in_words(error)} (--debug shows where)'
