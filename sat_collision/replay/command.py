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
from collections.abc import Iterable, Iterator, Sequence
import os
from pathlib import Path
import sys
import traceback
from typing import NoReturn

from rosbags.rosbag2 import WriterError
from sat_collision.replay.configuration import (
    NODE, parameter_of_text, parameters_of_file, settings_of)
from sat_collision.replay.destinations import check_outputs, check_picture, OutputError
from sat_collision.replay.example import write_example
from sat_collision.replay.expectation import differences, ExpectationError
from sat_collision.replay.formats import write_csv, write_json, write_junit
from sat_collision.replay.options import HEADER, Options, RECEIVE
from sat_collision.replay.parallel import (
    check_here, check_on_cluster, check_one, failed, unforeseen)
from sat_collision.replay.progress import Progress
from sat_collision.replay.report import report, report_all
from sat_collision.replay.result import overall, Result, Verdict
from sat_collision.replay.run import check
from sat_collision.replay.unpacking import in_words, Limits
from sat_collision.scene.parameters import ParameterError

_DESCRIPTION = """\
Check recordings for collisions with the scene of the live node.

Exit status: 0 clear; 1 collision; 2 unknown (for longer than --max-unknown, or no data); 3 bad
input. Where several apply, a collision comes before bad input, and bad input before unknown.
With --expect: 0 as expected; 1 different; 3 bad input. What nobody foresaw is bad input too.
"""


def main(args: Sequence[str] | None = None) -> int:
    """Run the command and return the exit status."""
    parser = _parser()
    options = parser.parse_args(args)
    try:
        return _run(options, parser)
    except (ParameterError, ExpectationError, OutputError, WriterError, OSError) as error:
        print(f'replay_check: {in_words(error)}', file=sys.stderr)
    except ModuleNotFoundError as error:
        print(f'replay_check: {error.name} is not installed', file=sys.stderr)
    except Exception as error:
        if options.debug:
            traceback.print_exc()
        print(f'replay_check: {unforeseen(error)}', file=sys.stderr)
    return int(Verdict.BAD_INPUT)


def _run(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    if options.write_example:
        write_example(options.write_example)
        print(f'wrote {options.write_example}; check it with\n  replay_check '
              f'{options.write_example} --params-file {options.write_example}/params.yaml')
        return 0
    if not options.bags:
        parser.error('name at least one recording (BAG)')
    several = len(options.bags) > 1
    _check_destinations(options, several)
    strays = [bag for bag in options.bags if not Path(bag).exists()]
    if strays and (options.footprint or options.obstacles):
        print(f'replay_check: {strays[0]} is taken for a recording; each topic needs an option '
              'of its own, --obstacles A --obstacles B', file=sys.stderr)
    results: list[Result] = []
    for result in _results(options, several):
        if options.plot:
            _draw(result, options, several)
        _say(report(result))
        results.append(result)
    if several:
        order = {bag: place for place, bag in enumerate(options.bags)}
        results.sort(key=lambda result: order[result.bag])
        _say(report_all(results))
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
        return check_on_cluster(options.bags, settings, options.dask)
    if several and options.jobs > 1:
        return check_here(options.bags, settings, options.jobs)
    return _one_by_one(options.bags, settings, several)


def _one_by_one(bags: Iterable[str], settings: Options, several: bool) -> Iterator[Result]:
    for bag in bags:
        progress = Progress()
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
    settings_of(parameters, options.node)
    return Options(
        parameters=parameters, footprints=tuple(options.footprint),
        obstacles=tuple(options.obstacles), node=options.node, as_live=options.as_live,
        clock=options.clock,
        start=options.start, duration=options.duration, max_unknown=options.max_unknown,
        sample=options.sample, picture=bool(options.plot), write_bag=options.write_bag,
        limits=Limits(options.max_memory, options.max_disk), debug=options.debug)


def _check_destinations(options: argparse.Namespace, several: bool) -> None:
    if options.write_bag and not several and Path(options.write_bag).exists():
        raise OutputError(f'--write-bag: {options.write_bag} already exists')
    if options.plot and not several:
        check_picture(options.plot)
    files = {'--json': options.json, '--csv': options.csv, '--junit': options.junit}
    folders = {'--write-bag': options.write_bag, '--plot': options.plot if several else None}
    check_outputs(files if several else {**files, '--plot': options.plot}, folders,
                  [*options.bags, *options.params_file, *filter(None, [options.expect])])


def _say(lines: Iterable[str]) -> None:
    """Print lines; once nobody reads them any more, as behind `head`, go on without."""
    try:
        print('\n'.join(lines), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _draw(result: Result, options: argparse.Namespace, several: bool) -> None:
    """Draw a picture; one that cannot be drawn is a problem of its recording only."""
    from sat_collision.replay.plot import plot
    try:
        plot(result, _of_bag(options.plot, result.bag, '.png') if several else options.plot)
    except Exception as error:
        if options.debug:
            traceback.print_exc()
        result.problems.append(f'{result.bag}: no picture: {unforeseen(error)}')


def _of_bag(folder: str, bag: str, suffix: str) -> str:
    Path(folder).mkdir(parents=True, exist_ok=True)
    return str(Path(folder, Path(bag).stem + suffix))


class _Parser(argparse.ArgumentParser):
    """A parser that ends with the exit status of bad input where it finds an error."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        if message.startswith('unrecognized arguments'):
            message += ' (each topic needs an option of its own: --obstacles A --obstacles B)'
        self.exit(int(Verdict.BAD_INPUT), f'{self.prog}: {message}\n')


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        'replay_check', description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add('bags', nargs='*', metavar='BAG', help='rosbag2 directory or storage file')
    scene = parser.add_argument_group('what to check')
    add = scene.add_argument
    add('--params-file', action='append', default=[], metavar='FILE',
        help="the node's ROS 2 parameter file; later files override earlier ones")
    add('-p', '--param', action='append', default=[], metavar='NAME:=VALUE',
        help='one parameter of the node; overrides the files')
    add('--footprint', action='append', default=[], metavar='[NAME:=]TOPIC',
        help='a footprint and its topic')
    add('--obstacles', action='append', default=[], metavar='[NAME:=]TOPIC',
        help='a source of obstacles and its topic')
    add('--node', type=_node, default=NODE,
        help='full name of the node, for parameter files and topics (%(default)s)')
    add('--as-live', action='store_true',
        help='tell what the monitor would have said; without, what touched by recorded motion')
    add('--clock', choices=(RECEIVE, HEADER), default=RECEIVE,
        help='time of a message: when it was received, or its header stamp (%(default)s)')
    add('--start', type=_seconds, default=0.0, metavar='S',
        help='start S seconds into the recording')
    add('--duration', type=_seconds, metavar='S', help='check S seconds of it')
    add('--sample', type=_period, default=0.1, metavar='S',
        help='with --as-live, measure separations every S seconds (%(default)s)')
    verdict = parser.add_argument_group('verdict')
    add = verdict.add_argument
    add('--max-unknown', type=_seconds, default=1.0, metavar='S',
        help='how many seconds in all a footprint may be unknown (%(default)s)')
    add('--expect', metavar='FILE', help='compare with a result that --json wrote before')
    output = parser.add_argument_group('output')
    add = output.add_argument
    add('--json', metavar='FILE', help='write the result; docs/replay.md has the schema')
    add('--csv', metavar='FILE', help='write a row for each contact and each unknown interval')
    add('--junit', metavar='FILE', help='write a test suite for each recording')
    add('--plot', metavar='FILE',
        help='draw a picture; for several recordings, a directory of pictures')
    add('--write-bag', metavar='DIR',
        help='write what the node would publish; for several recordings, a directory of bags')
    add('--write-example', metavar='DIR',
        help='only write an example recording, of the demo scene')
    many = parser.add_argument_group('many recordings')
    add = many.add_argument
    add('--jobs', type=_count, default=1, metavar='N', help='check N recordings at a time')
    add('--dask', metavar='ADDRESS', help='check on the Dask cluster with this scheduler')
    limits = parser.add_argument_group('limits, for each recording')
    add = limits.add_argument
    add('--max-memory', type=_bytes, default=Limits.memory, metavar='GB',
        help=f'memory for what is unpacked ({Limits.memory / 1e9:g})')
    add('--max-disk', type=_bytes, default=Limits.disk, metavar='GB',
        help=f'disk for temporary files ({Limits.disk / 1e9:g})')
    add('--debug', action='store_true', help='show where an error that nobody foresaw is raised')
    return parser


def _node(text: str) -> str:
    return '/' + text.strip('/')


def _seconds(text: str) -> float:
    return _number(text, 0.0, sys.float_info.max, 'a number of seconds, 0 or more')


def _period(text: str) -> float:
    return _number(text, 1e-3, 1e6, 'a number of seconds between 0.001 and 1000000')


def _count(text: str) -> int:
    value = _number(text, 1, 1000, 'a whole number from 1 to 1000')
    if value != int(value):
        raise argparse.ArgumentTypeError(f'{text} is not a whole number')
    return int(value)


def _bytes(text: str) -> int:
    return int(1e9 * _number(text, 1e-3, 1e6, 'a number of GB between 0.001 and 1000000'))


def _number(text: str, least: float, most: float, words: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float('nan')
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f"'{text}' is not {words}")
    return value
