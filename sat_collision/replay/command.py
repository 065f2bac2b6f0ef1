# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The command replay_check."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
import contextlib
from dataclasses import fields
from functools import partial
import os
from pathlib import Path
import sys
import traceback

from sat_collision.extras import in_one_line, missing, printable, unexpected
from sat_collision.replay.bag.storage import check_bag_writer
from sat_collision.replay.model.configuration import (
    check_values, parameter_of_text, parameters_of_file)
from sat_collision.replay.model.result import Options, overall, Result, SEVERITY, Verdict
from sat_collision.replay.output.formats import (
    BaselineError, differences_from, read_baseline, write_csv, write_json, write_junit,
    write_junit_of_differences)
from sat_collision.replay.output.text import Progress, report, report_all, with_colour
from sat_collision.replay.parallel import (
    check_alone, check_here, check_on_cluster, check_one, failed, name_for_outputs)
from sat_collision.scene.parameters import ParameterError

_LOGS = ('-wal', '-shm', '-journal')
_OF_RECORDING = ('.mcap', '.db3', '.zstd', *(f'.db3{end}' for end in _LOGS))
_PICTURES = ('.png', '.svg', '.pdf')
# What writes all results into one file, by option.
_WRITERS: dict[str, Callable[[list[Result], str], None]] = {
    'json': write_json, 'csv': write_csv, 'junit': write_junit}


def run(arguments: argparse.Namespace) -> int:
    """Do what the command line says, and return the exit status."""
    try:
        return _run(arguments)
    except (ParameterError, BaselineError, OSError) as error:
        print(f'replay_check: {in_one_line(error)}', file=sys.stderr)
    except ModuleNotFoundError as error:
        print(f'replay_check: {missing(error)}', file=sys.stderr)
    except Exception as error:
        if arguments.debug:
            traceback.print_exc()
        print(f'replay_check: {unexpected(error)}', file=sys.stderr)
    return int(Verdict.BAD_INPUT)


def _run(arguments: argparse.Namespace) -> int:
    if example := arguments.write_example:
        check_bag_writer()
        from sat_collision.replay.output.bag import write_example
        write_example(example)
        # An installation in a ROS workspace keeps commands in lib/sat_collision, not on the path.
        is_in_workspace = Path(sys.argv[0]).parent.name == 'sat_collision'
        prefix = 'ros2 run sat_collision ' if is_in_workspace else ''
        print(f'wrote {example}; check it with\n'
              f'  {prefix}replay_check {example} --params-file {example}/params.yaml')
        return int(Verdict.CLEAR)
    options = _options(arguments)
    _check_outputs(arguments)
    expect = arguments.expect
    baseline = read_baseline(expect) if expect else None
    terminal = _Terminal()
    results = _check_all(arguments, options, terminal)
    verdict = overall(results)
    writers = {option: partial(write, results) for option, write in _WRITERS.items()}
    if baseline is not None:
        differences = differences_from(baseline, results)
        writers['junit'] = partial(write_junit_of_differences, differences, expect)
        lines = [f'{name}: {line}' for name, found in differences for line in found]
        terminal.say(lines or [f'as expected by {expect}'])
        verdict = Verdict.COLLISION if lines else Verdict.CLEAR
    faults = [f'standard output: {in_one_line(terminal.fault)}'] if terminal.fault else []
    # The report has these, too, as problems; but a collision that is expected would hide them.
    faults += [problem for result in results for problem in result.bag_faults]
    outputs = [(option, partial(write, path)) for option, write in writers.items()
               if (path := getattr(arguments, option))]
    outputs += [('plot', partial(_draw, *drawing))
                for drawing in _drawings(results, arguments.plot)]
    for option, write in outputs:
        try:
            write()
        except Exception as error:
            if arguments.debug:
                traceback.print_exc()
            words = in_one_line(error) if isinstance(error, OSError) else unexpected(error)
            faults.append(f'--{option}: {words}')
    for fault in faults:
        print(f'replay_check: {printable(fault)}', file=sys.stderr)
        verdict = max(verdict, Verdict.BAD_INPUT, key=SEVERITY.index)
    return int(verdict)


def _options(arguments: argparse.Namespace) -> Options:
    """Return the command line as Options; wrong parameters raise a ParameterError."""
    parameters = {}
    for path in arguments.params_file:
        parameters.update(parameters_of_file(path, arguments.node))
    parameters.update(parameter_of_text(text) for text in arguments.param)
    check_values(parameters)
    given = {name: getattr(arguments, name)
             for name in vars(arguments).keys() & {field.name for field in fields(Options)}}
    return Options(parameters=parameters, keyframes=bool(arguments.plot),
                   content=bool(arguments.json or arguments.expect), **given)


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Raise OSError where a path is an input or another output, or cannot be written."""
    several, plot, write_bag = len(arguments.bags) > 1, arguments.plot, arguments.write_bag
    if write_bag:
        written = [Path(write_bag, name_for_outputs(path)) for path in arguments.bags]
        for bag in written if several else [Path(write_bag)]:
            if os.path.lexists(bag):
                raise OSError(f'--write-bag: {bag} already exists')
        check_bag_writer()
    in_folder = several and plot and not _is_page(plot)
    if plot and not _is_page(plot):
        is_picture = Path(plot).suffix.lower() in _PICTURES
        if in_folder and is_picture:
            raise OSError(f'--plot: a picture shows one recording: name a folder instead of {plot}'
                          ', or end it in .html for a page of all')
        if not in_folder and not is_picture:
            raise OSError(f'--plot: {plot} should end in .html for a page, or in .png, .svg or '
                          '.pdf for a picture')
        try:
            import matplotlib  # noqa: F401
        except ModuleNotFoundError as error:
            raise OSError(f'--plot: {missing(error)}') from None
    name, count = Counter(map(name_for_outputs, arguments.bags)).most_common(1)[0]
    if count > 1 and (write_bag or in_folder):
        raise OSError(f'{count} recordings are called {name}, and what is written of each would '
                      'have the same name: check them one by one')
    inputs = [file for path in (*arguments.bags, *arguments.params_file, arguments.expect) if path
              for file in _files_of(Path(path))]
    taken: dict[Path, str] = {}
    files = [(f'--{option}', getattr(arguments, option)) for option in _WRITERS]
    for option, text in (*files, ('--plot', None if in_folder else plot)):
        if text is None:
            continue
        path = Path(text)
        if path.exists() and any(path.samefile(file) for file in inputs):
            raise OSError(f'{option}: {text} is an input, which is not overwritten')
        if path.is_dir():
            raise OSError(f'{option}: {text} is a directory')
        if not path.parent.is_dir():
            raise OSError(f'{option}: there is no directory {path.parent}')
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            raise OSError(f'{option}: {text} cannot be written')
        other = taken.setdefault(path.resolve(), option)
        if other != option and path != Path(os.devnull):
            raise OSError(f'{other} and {option} name the same file, {text}')
    for option, text in (('--write-bag', write_bag), ('--plot', plot if in_folder else None)):
        if text is not None:
            there = next(path for path in (Path(text), *Path(text).absolute().parents)
                         if path.is_symlink() or path.exists())
            if not there.is_dir():
                raise OSError(f'{option}: {there} is not a directory')
            if not os.access(there, os.W_OK):
                raise OSError(f'{option}: {there} cannot be written to')


def _files_of(path: Path) -> list[Path]:
    """Return the files that an input consists of; none where they cannot be looked at."""
    named = [path]
    if os.path.isdir(path):
        with contextlib.suppress(OSError):
            named = [file for file in path.iterdir()
                     if file.name == 'metadata.yaml' or file.name.endswith(_OF_RECORDING)]
    return [file for one in named for end in ('', *_LOGS)
            if os.path.exists(file := Path(f'{os.path.realpath(one)}{end}'))]


def _check_all(arguments: argparse.Namespace, options: Options, terminal: _Terminal
               ) -> list[Result]:
    """Check and report each recording, and return the results."""
    strays = [bag for bag in arguments.bags if not os.path.exists(bag)]
    if strays and (arguments.footprints or arguments.obstacles):
        print(f'replay_check: {printable(strays[0])} is taken for a recording; each topic needs '
              'an option of its own, --obstacles A --obstacles B', file=sys.stderr)
    results: list[Result] = []
    for result in _results(arguments, options):
        terminal.say(report(result), result.verdict)
        results.append(result)
    if len(results) > 1:
        terminal.say(report_all(results), overall(results))
    return results


def _results(arguments: argparse.Namespace, options: Options) -> Iterator[Result]:
    """Yield results in the order of the command, and show progress meanwhile."""
    bags, several = arguments.bags, len(arguments.bags) > 1
    if arguments.dask or several and arguments.jobs > 1:
        if arguments.dask:
            print(f'replay_check: connecting to {arguments.dask}', file=sys.stderr)
            results = check_on_cluster(bags, options, arguments.dask)
        else:
            results = check_here(bags, options, arguments.jobs)
        progress = Progress(f'{len(bags)} recordings')
        left = [*bags]
        waiting: dict[str, list[Result]] = {bag: [] for bag in bags}
        for count, result in enumerate(results, 1):
            progress.clear()
            waiting[result.bag].append(result)
            while left and waiting[left[0]]:
                yield waiting[left.pop(0)].pop()
            if count < len(bags):
                progress.show(count / len(bags))
        return
    for number, bag in enumerate(bags, 1):
        progress = Progress(
            f'{number} of {len(bags)}: {printable(Path(bag).name)}' if several else '')
        try:
            result = (check_one if several else check_alone)(bag, options, progress.show)
        except Exception as error:
            result = failed(bag, options, error)
        finally:
            progress.clear()
        yield result


class _Terminal:
    """Standard output; after a fault nothing more is printed, and all else goes on."""

    fault: OSError | None = None

    def say(self, lines: Iterable[str], verdict: Verdict | None = None) -> None:
        """Print lines as far as can be encoded; it is no fault if a reader such as `head` ends."""
        lines = [*map(printable, lines)]
        if verdict is not None:
            lines = with_colour(lines, verdict, sys.stdout)
        encoding = sys.stdout.encoding or 'utf-8'
        text = '\n'.join(lines).encode(encoding, 'backslashreplace').decode(encoding)
        try:
            print(text, flush=True)
        except OSError as error:
            if not isinstance(error, BrokenPipeError):
                self.fault = error
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _drawings(results: list[Result], plot: str | None) -> Iterator[tuple[list[Result], str]]:
    """Yield what to draw, and where: a page of all, or a picture of each."""
    if plot and (_is_page(plot) or len(results) == 1):
        yield results, plot
    elif plot:
        for result in results:
            yield [result], str(Path(plot, f'{name_for_outputs(result.bag)}.png'))


def _draw(results: list[Result], path: str) -> None:
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    if _is_page(path):
        from sat_collision.replay.output.page import write_page
        write_page(results, path)
    else:
        from sat_collision.replay.output.figure import write_picture
        write_picture(results[0], path)


def _is_page(path: str) -> bool:
    return Path(path).suffix.lower() == '.html'
