# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The command line of replay_check.

Slow imports are avoided, so that help, errors and completion come at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from difflib import get_close_matches
from functools import partial
import os
from pathlib import Path
from typing import Any, NoReturn

from sat_collision import __version__
from sat_collision.replay.bag.storage import Limits
from sat_collision.replay.model.result import HEADER, NODE, PLAN, RECEIVE, Verdict

_UNRECOGNIZED = 'unrecognized arguments: '
_DESCRIPTION = """\
Check recordings for collisions with the scene of the live node.

Exit status: 0 clear; 1 collision, or less than --min-ttc before one, or by --fail-on; 2 unknown
(for longer than --max-unknown, or no data); 3 bad input. Where several apply, a collision comes
before bad input, and bad input before unknown.
With --expect: 0 as expected; 1 different; 3 bad input. An unexpected error is bad input too.
"""


def parse(args: Sequence[str] | None = None) -> argparse.Namespace:
    """
    Return the options of the command line.

    Help, an error, and completion for a shell end the process.
    """
    parser = _parser()
    if '_ARGCOMPLETE' in os.environ:
        import argcomplete
        argcomplete.autocomplete(parser)
    options = parser.parse_args(args)
    options.bags = [str(Path(bag)) for bag in options.bags]  # one name, however it is written
    options.limits = Limits(int(1e9 * options.max_memory), int(1e9 * options.max_disk))
    if not (options.bags or options.write_example):
        parser.error('name at least one recording (BAG)')
    if options.bags and options.write_example:
        parser.error('--write-example only writes an example: check recordings without it')
    if options.write_bag and not options.as_live:
        parser.error('--write-bag writes what the node would have published: it needs --as-live')
    if options.min_ttc is not None and options.as_live:
        parser.error('--min-ttc uses recorded motion: it cannot be combined with --as-live')
    return options


class _Parser(argparse.ArgumentParser):
    """A parser whose errors end the process with the exit status of bad input."""

    def error(self, message: str) -> NoReturn:
        if message.startswith(_UNRECOGNIZED):
            message += self._advice(message[len(_UNRECOGNIZED):].split()[0])
        self.exit(int(Verdict.BAD_INPUT), f'{self.prog}: {message} (--help lists the options)\n')

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        if not arg_string:  # such as an unset variable of a shell
            raise argparse.ArgumentError(action, 'is empty: give a value, or leave it out')
        return super()._get_value(action, arg_string)

    def _advice(self, text: str) -> str:
        if not text.startswith('-'):
            return '; each topic needs an option of its own: --obstacles A --obstacles B'
        nearest = get_close_matches(text.partition('=')[0], self._option_string_actions, 1)
        return f'; did you mean {nearest[0]}?' if nearest else ''


def _parser() -> argparse.ArgumentParser:
    parser = _Parser('replay_check', allow_abbrev=False, description=_DESCRIPTION,
                     formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add('--version', action='version', version=f'sat_collision {__version__}')
    add('bags', nargs='*', metavar='BAG', help='rosbag2 directory or storage file')
    add = parser.add_argument_group('what to check').add_argument
    add('--params-file', action='append', default=[], metavar='FILE',
        help="the node's ROS 2 parameter file; later files override earlier ones")
    add('-p', '--param', action='append', default=[], metavar='NAME:=VALUE',
        help='one parameter of the node; overrides the files')
    add('--footprint', type=_topic, action='append', default=[], metavar='[NAME:=]TOPIC',
        dest='footprints', help='a footprint and its topic')
    add('--obstacles', type=_topic, action='append', default=[], metavar='[NAME:=]TOPIC',
        help='a source of obstacles and its topic')
    add('--node', type=_node, default=NODE,
        help='full name of the node, for parameter files and topics (%(default)s)')
    add('--as-live', action='store_true',
        help='report what the node would have said, instead of contacts by recorded motion')
    add('--clock', choices=(RECEIVE, HEADER), default=RECEIVE,
        help='time of a message: when it was received, or its header stamp (%(default)s)')
    add('--start', type=_seconds, default=0.0, metavar='S',
        help='start S seconds into the recording')
    add('--duration', type=_seconds, metavar='S', help='check S seconds of it')
    add('--sample', type=_period, default=0.1, metavar='S',
        help='with --as-live, measure separations every S seconds (%(default)s)')
    add = parser.add_argument_group('verdict').add_argument
    add('--max-unknown', type=_seconds, default=1.0, metavar='S',
        help='how many seconds in all a footprint may be unknown (%(default)s)')
    add('--max-undetermined', type=_seconds, default=0.0, metavar='S',
        help='for how many seconds in all it may be unknown how something moved (%(default)s)')
    add('--min-ttc', type=_seconds, metavar='S',
        help='measure times to collision, and fail on one of less than S seconds; 0 fails on none')
    add('--fail-on', choices=[PLAN],
        help='fail on a plan (of <footprint>.path) in contact, too; one that is unknown, or none '
        'at all, makes the verdict unknown')
    add('--expect', metavar='FILE', help='compare with a result that --json wrote before')
    add = parser.add_argument_group('output').add_argument
    add('--json', metavar='FILE', help='write the result; docs/replay_json.md has the schema')
    add('--csv', metavar='FILE',
        help='write a row for each contact, unknown or undetermined time, prediction and plan')
    add('--junit', metavar='FILE', help='write a test suite for each recording')
    add('--plot', metavar='FILE',
        help='draw a picture (.png, .svg, .pdf) or a page (.html); for several recordings, one '
        'page or a directory of pictures')
    add('--write-bag', metavar='DIR',
        help='with --as-live, write what the node would publish; for several recordings, a '
        'directory of bags')
    add('--write-example', metavar='DIR',
        help='only write an example recording, of the demo scene')
    add = parser.add_argument_group('many recordings').add_argument
    add('--jobs', type=_count, default=1, metavar='N', help='check N recordings at a time')
    add('--dask', metavar='ADDRESS', help='check on the Dask cluster with this scheduler')
    add = parser.add_argument_group('limits, for each recording').add_argument
    add('--max-memory', type=_gigabytes, default=Limits.memory / 1e9, metavar='GB',
        help='memory for decompressed data (%(default)g)')
    add('--max-disk', type=_gigabytes, default=Limits.disk / 1e9, metavar='GB',
        help='disk for temporary files (%(default)g)')
    add('--debug', action='store_true', help='show where an unexpected error is raised')
    return parser


def _node(text: str) -> str:
    return '/' + text.strip('/')


def _topic(text: str) -> str:
    name, given, topic = text.partition('=')
    if given and not name.endswith(':'):
        raise argparse.ArgumentTypeError(f"'{text}' names a topic as {name}:={topic}")
    return text


def _number(words: str, least: float, greatest: float, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float('nan')
    if not least <= value <= greatest:
        raise argparse.ArgumentTypeError(f"'{text}' is not {words}")
    return value


_seconds = partial(_number, 'a number of seconds from 0 to 1e12', 0.0, 1e12)
_period = partial(_number, 'a number of seconds between 0.001 and 1000000', 1e-3, 1e6)
_gigabytes = partial(_number, 'a number of GB between 0.001 and 1000000', 1e-3, 1e6)


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 1 to 1000")
    return int(text)
