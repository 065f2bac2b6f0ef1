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

"""The command replay_check."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
import os
from pathlib import Path
import sys
import traceback

from sat_collision.replay import plot
from sat_collision.replay.arguments import parse
from sat_collision.replay.bag_writer import check_bag_writer
from sat_collision.replay.colours import with_colour
from sat_collision.replay.configuration import (
    parameter_of_text, parameters_of_file, settings_of)
from sat_collision.replay.destinations import check_outputs, check_picture, is_page, OutputError
from sat_collision.replay.expectation import differences, ExpectationError
from sat_collision.replay.formats import write_csv, write_json, write_junit
from sat_collision.replay.options import Options
from sat_collision.replay.parallel import (
    check_here, check_on_cluster, check_one, failed, unforeseen)
from sat_collision.replay.progress import Progress
from sat_collision.replay.report import report, report_all
from sat_collision.replay.result import overall, Result
from sat_collision.replay.run import check
from sat_collision.replay.unpacking import in_words, Limits
from sat_collision.replay.verdict import Verdict
from sat_collision.scene.parameters import ParameterError


def main(args: Sequence[str] | None = None) -> int:
    """Run the command and return the exit status."""
    return run(parse(args))


def run(options: argparse.Namespace) -> int:
    """Do what the command line says, and return the exit status."""
    try:
        return _run(options)
    except (ParameterError, ExpectationError, OutputError, OSError) as error:
        print(f'replay_check: {in_words(error)}', file=sys.stderr)
    except ModuleNotFoundError as error:
        print(f'replay_check: {error.name} is not installed', file=sys.stderr)
    except Exception as error:
        if options.debug:
            traceback.print_exc()
        print(f'replay_check: {unforeseen(error)}', file=sys.stderr)
    return int(Verdict.BAD_INPUT)


def _run(options: argparse.Namespace) -> int:
    if options.write_example:
        check_bag_writer()
        from sat_collision.replay.example import write_example
        write_example(options.write_example)
        print(f'wrote {options.write_example}; check it with\n  replay_check '
              f'{options.write_example} --params-file {options.write_example}/params.yaml')
        return 0
    several = len(options.bags) > 1
    _check_destinations(options, several)
    strays = [bag for bag in options.bags if not Path(bag).exists()]
    if strays and (options.footprint or options.obstacles):
        print(f'replay_check: {strays[0]} is taken for a recording; each topic needs an option '
              'of its own, --obstacles A --obstacles B', file=sys.stderr)
    results: list[Result] = []
    for result in _results(options, several):
        if options.plot and not (several and is_page(options.plot)):
            path = _of_bag(options.plot, result.bag, '.png') if several else options.plot
            _draw(partial(plot.plot, result, path), result, options)
        _say(with_colour(report(result), result.verdict, sys.stdout))
        results.append(result)
    if several:
        order = {bag: place for place, bag in enumerate(options.bags)}
        results.sort(key=lambda result: order[result.bag])
        _say(with_colour(report_all(results), overall(results), sys.stdout))
        if options.plot and is_page(options.plot):
            _draw(partial(plot.plot_all, results, options.plot), results[0], options)
    for path, write in ((options.json, write_json), (options.csv, write_csv),
                        (options.junit, write_junit)):
        if path:
            write(results, path)
    if options.expect:
        lines = differences(results, options.expect)
        _say(lines or [f'as expected by {options.expect}'])
        return int(Verdict.COLLISION if lines else Verdict.CLEAR)
    return int(overall(results))


def _results(options: argparse.Namespace, several: bool) -> Iterator[Result]:
    """Yield results as they come."""
    settings = _options(options)
    if options.dask:
        return _counted(check_on_cluster(options.bags, settings, options.dask), len(options.bags))
    if several and options.jobs > 1:
        return _counted(check_here(options.bags, settings, options.jobs), len(options.bags))
    return _one_by_one(options.bags, settings, several)


def _counted(results: Iterator[Result], total: int) -> Iterator[Result]:
    """Yield results, and show meanwhile how many there are."""
    progress = Progress(f'{total} recordings')
    for count, result in enumerate(results, 1):
        progress.clear()
        yield result
        if count < total:
            progress.show(count / total)


def _one_by_one(bags: Sequence[str], settings: Options, several: bool) -> Iterator[Result]:
    for number, bag in enumerate(bags, 1):
        progress = Progress(f'{number} of {len(bags)}: {Path(bag).name}' if several else '')
        try:
            result = (check_one if several else check)(bag, settings, progress.show)
        except Exception as error:
            result = failed(bag, settings, error)
        finally:
            progress.clear()
        yield result


def _options(options: argparse.Namespace) -> Options:
    """Return what the command line says as Options; parameters that are wrong are found here."""
    parameters = {}
    for path in options.params_file:
        parameters.update(parameters_of_file(path, options.node))
    parameters.update(parameter_of_text(text) for text in options.param)
    settings_of(parameters, options.node, False)
    return Options(
        parameters=parameters, footprints=tuple(options.footprint),
        obstacles=tuple(options.obstacles), node=options.node, as_live=options.as_live,
        clock=options.clock,
        start=options.start, duration=options.duration, max_unknown=options.max_unknown,
        max_undecided=options.max_undecided, sample=options.sample, film=bool(options.plot),
        write_bag=options.write_bag,
        limits=Limits(options.max_memory, options.max_disk), debug=options.debug)


def _check_destinations(options: argparse.Namespace, several: bool) -> None:
    if options.write_bag and not several and Path(options.write_bag).exists():
        raise OutputError(f'--write-bag: {options.write_bag} already exists')
    if options.write_bag:
        check_bag_writer()
    in_folder = several and options.plot and not is_page(options.plot)
    if options.plot:
        check_picture('a.png' if in_folder else options.plot)
    files = {'--json': options.json, '--csv': options.csv, '--junit': options.junit}
    folders = {'--write-bag': options.write_bag, '--plot': options.plot if in_folder else None}
    check_outputs(files if in_folder else {**files, '--plot': options.plot}, folders,
                  [*options.bags, *options.params_file, *filter(None, [options.expect])])


def _say(lines: Iterable[str]) -> None:
    """Print lines; once nobody reads them any more, as behind `head`, go on without."""
    try:
        print('\n'.join(lines), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _draw(draw: Callable[[], None], result: Result, options: argparse.Namespace) -> None:
    """Draw; what cannot be drawn is a problem of its recording only."""
    try:
        draw()
    except Exception as error:
        if options.debug:
            traceback.print_exc()
        result.problems.append(f'{result.bag}: no picture: {unforeseen(error)}')


def _of_bag(folder: str, bag: str, suffix: str) -> str:
    Path(folder).mkdir(parents=True, exist_ok=True)
    return str(Path(folder, Path(bag).stem + suffix))
