# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What docs/stability.md promises, from the code: a line for each name, with type and default.

Run as a program it writes test/surface.txt, with which test_architecture.py compares the code.
"""

import argparse
import ast
from collections.abc import Mapping
import inspect
from pathlib import Path
import runpy
import sys
from types import SimpleNamespace
from unittest.mock import patch

ROOT = Path(__file__).resolve().parents[2]
STORED = ROOT / 'test' / 'surface.txt'
sys.path[:0] = [str(ROOT), str(ROOT / 'docs')]

from generate import parameters  # noqa: E402
import sat_collision  # noqa: E402
from sat_collision.messages import outputs, states  # noqa: E402
from sat_collision.messages.interfaces import type_name  # noqa: E402
from sat_collision.node import __main__ as node_main  # noqa: E402
from sat_collision.replay import __main__ as replay_main  # noqa: E402
from sat_collision.replay.arguments import _parser as replay_parser  # noqa: E402
from sat_collision.replay.model import configuration, result  # noqa: E402
from sat_collision.replay.output import formats  # noqa: E402
from sat_collision.scene.footprints import State, Status  # noqa: E402
from sat_collision.scene.scene import Scene  # noqa: E402
from sat_collision.scene.settings import (  # noqa: E402
    FootprintSettings, ObstacleSettings, Settings)

_FOR_DEVELOPERS = {'audit', 'bench', 'test'}
_SETTINGS = Settings((FootprintSettings('<footprint>', '/footprint', path='/plan'),),
                     (ObstacleSettings('<source>', '/obstacles'),))


def surface():
    """Return the lines, without line breaks."""
    return [*_parameters(), *_topics(), *_state_keys(), *_json(), *_columns(), *_commands(),
            *_exit_statuses(), *(line.replace("'", '') for line in _python())]


def _parameters():
    for name, default, spec in parameters():
        allowed = spec.choices or spec.limits
        yield ' '.join(filter(None, (
            f'parameter {name}:', f'{type(default).__name__} = {default!r}',
            f'in {allowed}' if allowed else '', 'live' if spec.live else '',
            'lockable' if spec.safety else '', 'any type' if spec.is_any_type else '')))


class _Node:
    """Stands in for a node, and keeps its topics with their types."""

    def __init__(self):
        self.topics = {}

    def get_fully_qualified_name(self):
        return '~'

    def get_clock(self):
        return None

    def create_publisher(self, kind, topic, qos):
        self.topics[topic] = type_name(kind)
        return SimpleNamespace(get_subscription_count=lambda: 0)


def _topics():
    node = _Node()
    outputs.Outputs(node, _SETTINGS, Scene(_SETTINGS))
    for topic, kind in node.topics.items():
        yield f'publishes {topic}: {kind}'
    for field in outputs._FIELDS:
        yield f'field of contacts {field.name}: datatype {field.datatype}'
    for kind, choice in configuration._KINDS.items():
        yield f'subscribes type {choice}: {kind}'
    for kind in (configuration._ODOMETRY, configuration.TWIST_TYPE,
                 configuration._STAMPED_TWIST, configuration.TRANSFORM_TYPE):
        yield f'subscribes {kind}'


def _state_keys():
    shown = states.States('~', _SETTINGS)
    shown.write('<footprint>', State(Status.CLEAR, (), (), None), 0.0)
    for value in shown.statuses[0].values:
        yield f'state key {value.key}'
    for status, level in states._LEVELS.items():
        # A byte of ROS, or an integer of rosbags.
        yield f'state {status.value}: level {level if isinstance(level, int) else level[0]}'


def _json():
    """All keys with all types: of a result with everything in it, and of one with nothing."""
    nearest = result.Least(1.0, 1, 'o', 1.0, 1.0)
    footprint = result.FootprintResult(
        'f', '/f', True, clear=1, least=nearest, separation=[(1, 1.0), (2, None)],
        soonest=result.Soonest(1.0, 1, 'o'), time_to_collision=[(1, 1.0), (2, None)],
        last=2, plans=1, plans_unknown={'reason': 1}, refused=['s'])
    whole = result.Result(
        'bag', result.Options(max_undetermined=1.0, min_ttc=1.0, fail_on='plan'), 1, 1, 2,
        'digest', [footprint],
        [result.SourceResult('s', '/s', 1, {'reason': 1}, {'reason': 'example'})],
        [result.Contact('f', 'o', 1, 2, normal=[1.0, 0.0], points=[[1.0, 1.0]],
                        between=[1, None])],
        *[[result.Unknown('f', 1, 2, ['reason'])]] * 2, ['problem'], ['note'],
        plan_contacts=[result.PlanContact('f', 'o', 1, 2, 1.0, 1.0)])
    nothing = result.Result('bag', footprints=[result.FootprintResult('f', '/f', True)])
    types = {}
    for one in ([whole], [nothing]):
        _note_types(formats.as_dict(one), '', types)
    yield f'json schema {formats.SCHEMA}'
    for key, kinds in types.items():
        yield f'json {key}: {" or ".join(sorted(kinds))}'


def _note_types(value, path, types):
    """Add the types of a value, and of all that is in it, by their paths."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            by_name = path.endswith(('rejected', 'examples', 'verdicts', 'plans_unknown'))
            _note_types(inner, f'{path}.{"<name>" if by_name else key}'.lstrip('.'), types)
    elif isinstance(value, (list, tuple)):
        for inner in value:
            _note_types(inner, f'{path}[]', types)
    else:
        types.setdefault(path, set()).add('null' if value is None else type(value).__name__)


def _columns():
    for name in formats._COLUMNS:
        yield f'csv column {name}'


def _commands():
    with patch('setuptools.setup') as setup:
        runpy.run_path(str(ROOT / 'setup.py'))
    for line in setup.call_args.kwargs['entry_points']['console_scripts']:
        yield f'command {line.partition(" =")[0]}'
    for name in sorted({*setup.call_args.kwargs['extras_require']} - _FOR_DEVELOPERS):
        yield f'extra {name}'
    for action in replay_parser()._actions:
        has_default = action.default not in (None, False, [], argparse.SUPPRESS)
        yield ' '.join(filter(None, (
            'replay_check option', ', '.join(action.option_strings) or action.dest,
            action.metavar, f'in {action.choices}' if action.choices else '',
            f'= {action.default}' if has_default else '')))
    launch = ROOT / 'launch' / 'footprint_monitor.launch.py'
    for node in ast.parse(launch.read_text()).body:
        if isinstance(node, ast.Assign) and node.targets[0].id == 'ARGUMENTS':
            for name, (default, _) in ast.literal_eval(node.value).items():
                yield f'{launch.name} argument {name} = {default!r}'


def _exit_statuses():
    for verdict in result.Verdict:
        yield f'replay_check exit status {int(verdict)}: {verdict.words}'
    yield f'replay_check exit status {replay_main._STATUS_OF_INTERRUPTED}: interrupted'
    yield f'footprint_monitor exit status {node_main._STATUS_OF_BAD_ARGUMENTS}: bad arguments'


def _python():
    for name in sat_collision.__all__:
        thing = getattr(sat_collision, name)
        if not inspect.isclass(thing):
            shown = inspect.signature(thing) if callable(thing) else f': {type(thing).__name__}'
            yield f'python {name}{shown}'
            continue
        yield f'python class {name}({", ".join(base.__name__ for base in thing.__bases__)})'
        if issubclass(thing, BaseException) or '__init__' in vars(thing):
            yield f'python {name}{inspect.signature(thing)}'
        for field in getattr(thing, '_fields', ()):
            yield f'python {name}.{field}: {thing.__annotations__[field].__forward_arg__}'
        for member in getattr(thing, '__members__', ()):
            yield f'python {name}.{member} = {thing[member].value}'
        for method, value in vars(thing).items():
            function = getattr(value, 'fget', None) or getattr(value, '__func__', value)
            if inspect.isfunction(function) and _is_public(method, function, thing):
                shown = (': ' + function.__annotations__['return'] if isinstance(value, property)
                         else inspect.signature(function))
                yield f'python {name}.{method}{shown}'


def _is_public(name, function, owner):
    """Tell whether a method is for users: special ones are, unless they were generated."""
    written = function.__code__.co_filename == inspect.getfile(owner)
    return name[0] != '_' or name[:2] == '__' and name != '__init__' and written


if __name__ == '__main__':
    STORED.write_text('\n'.join(surface()) + '\n')
