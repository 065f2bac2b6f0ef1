# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The parameters of a monitor by name, and the Settings that they make. No ROS."""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from difflib import get_close_matches
import math
import re
from typing import Any, TypeAlias

import numpy as np
from sat_collision.geometry.body.polygon import Polygon, PolygonError
from sat_collision.scene.settings import (
    DEFAULT_FOOTPRINT, DEFAULT_SOURCE, DEFAULT_SOURCE_TOPIC, EACH_MESSAGE, EMPTY_POLYGON,
    FootprintSettings, NEW_STAMP, NONE, ObstacleSettings, POLYGON_COLLECTION, POLYGON_INSTANCE,
    Settings, Spec, specs, TF)

# By the parameters that list names.
DEFAULT_NAMES = {'footprints': DEFAULT_FOOTPRINT, 'obstacles': DEFAULT_SOURCE}
# Parameters that every node of rclpy has.
_OF_EVERY_NODE = ('qos_overrides', 'start_type_description_service', 'use_sim_time')
_SEND_ENDS = (f'write set_end: {EMPTY_POLYGON}, and send an empty polygon after the last '
              'obstacle of')
# Former parameters of a source, and what to write instead.
_REMOVED = {
    'set_quiet': f'{_SEND_ENDS} each set',
    'set_window': f'{_SEND_ENDS} each set; or write set_end: {NEW_STAMP}, if all polygons of a '
                  'set have one stamp and the next set a newer one',
    'settle_time': f'{_SEND_ENDS} the map',
    'accumulate': 'remove it: each polygon counts until its timeout, unless set_end is given'}
_TYPES = {bool: 'true or false', int: 'a whole number', float: 'a double', str: 'a text',
          list: 'a list of texts'}
# In s; turns of a loop that is well take less.
_LEAST_WATCHDOG = 0.05
_RESERVED = frozenset((*specs(Settings), *_OF_EVERY_NODE))

# The vertices of a footprint, rounded to float32 as a message would carry them.
Outline: TypeAlias = tuple[tuple[float, float], ...]
# A disc is enlarged by more than rounding to float32 may take from it.
_ROUNDED = 1.0 + 1e-6


class ParameterError(ValueError):
    """Parameters are invalid; the message is for the user, in one line."""

    def __init__(self, message: object) -> None:
        super().__init__(' '.join(str(message).split()))


def declare_parameters(declare: Callable[[str, Any, Spec], Any]) -> tuple[list[str], list[str]]:
    """
    Declare every parameter; return the names of the footprints and of the sources of obstacles.

    `declare` takes name, default and Spec of a parameter and returns the value that it was given.
    A name that cannot be used raises a ParameterError.
    """
    monitor = specs(Settings)
    footprints, obstacles = (
        list(declare(name, [default], monitor.pop(name)[1]))
        for name, default in DEFAULT_NAMES.items())
    _check_names(footprints, obstacles)
    for name, (default, spec) in monitor.items():
        declare(name, default, spec)
    for kind, names in ((FootprintSettings, footprints), (ObstacleSettings, obstacles)):
        for name in names:
            for field, (default, spec) in specs(kind).items():
                declare(f'{name}.{field}', _default(kind, name, field, default), spec)
    return footprints, obstacles


def check_names_given(given: Iterable[str], known: Collection[str]) -> None:
    """
    Raise a ParameterError for an unknown name: a mistyped one would silently keep its default.

    `given` are the names that files and the command line have for the node, `known` those that
    were declared.
    """
    owners = {one.rpartition('.')[0] for one in known}
    for name in given:
        if name not in known and name.partition('.')[0] not in _OF_EVERY_NODE:
            hint = ''
            owner, _, field = name.rpartition('.')
            if remedy := _REMOVED.get(field):
                hint = f' any more: {remedy}'
            elif owner and not _nearest(owner, owners):
                named = ', '.join(sorted(owners - {''}))
                hint = f": name '{owner}' in footprints or obstacles, which name {named}"
            elif nearest := _nearest(name, known):
                hint = f': did you mean {nearest}?'
            raise ParameterError(f"there is no parameter '{name}'{hint}")


def parameters_by_node(content: Any, namespace: str = '') -> Iterator[tuple[str, Any]]:
    """Yield name and parameters of every node in a parameter file, with wildcards as they are."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == 'ros__parameters':
            yield namespace or '/', value
        else:
            yield from parameters_by_node(value, f'{namespace}/{str(key).strip("/")}')


def is_name_of(name: str, node: str) -> bool:
    """Return whether a name with wildcards, * for one token and ** for any, is that of a node."""
    expression = re.escape(name).replace(r'/\*\*', '(/[^/]+)*').replace(r'\*', '[^/]+')
    return re.fullmatch(expression, node) is not None


def type_problem(name: str, value: object, default: object) -> str | None:
    """Return what is wrong with the type of a value and what to write, None if it is right."""
    wanted = type(default)
    if type(value) is wanted and (not isinstance(value, list) or all(
            isinstance(item, str) for item in value)):
        return None
    hint = ''
    if wanted is float and type(value) is int:
        hint = f': write {float(value)}'
    elif wanted is str and isinstance(value, (bool, int, float)):
        hint = f': write "{value}", in quotes'
    elif wanted is list and isinstance(value, str):
        hint = f': write [{value}]'
    return f"parameter '{name}' is {value!r}, but must be {_TYPES[wanted]}{hint}"


def without_value(name: str) -> str:
    """Say that a parameter has no value, which is how ROS 2 takes an empty array in a file."""
    return f"parameter '{name}' has no value: give it one, or leave it out"


def read_settings(footprints: Iterable[str], obstacles: Iterable[str],
                  value: Callable[[str], Any], resolve: Callable[[str], str]) -> Settings:
    """
    Return the Settings that the values of all parameters make, or raise a ParameterError.

    `footprints` and `obstacles` are as `declare_parameters` returns them. `value` takes the name
    of a parameter and returns its value, `resolve` takes that of a topic and returns it in full.
    """
    def resolved(name: str, topic: str) -> str:
        try:
            return resolve(topic)
        except (RuntimeError, ValueError) as error:  # rcl's are RuntimeErrors
            raise ParameterError(f'{name}: {error}') from error

    def values(kind: type, name: str) -> dict[str, Any]:
        found = {field: value(f'{name}.{field}') for field in specs(kind)}
        found['topic'] = resolved(f'{name}.topic', found['topic'])
        return found

    def footprint(name: str) -> FootprintSettings:
        found = values(FootprintSettings, name)
        found['points'] = _numbers(f'{name}.points', found['points'])
        found['obstacles'] = _sources_of(name, found['obstacles'], sources)
        for field in ('cmd_vel', 'path'):
            found[field] = found[field] and resolved(f'{name}.{field}', found[field])
        settings = FootprintSettings(name=name, **found)
        if settings.odometry:
            return replace(settings, topic=resolved(f'{name}.odometry', settings.odometry))
        if settings.has_outline:
            return replace(settings, topic=resolved(f'{name}.points', TF))
        return settings

    sources = list(obstacles)
    settings = Settings(
        footprints=tuple(map(footprint, footprints)),
        obstacles=tuple(ObstacleSettings(name=name, **values(ObstacleSettings, name))
                        for name in sources),
        **{name: value(name) for name in specs(Settings) if name not in DEFAULT_NAMES})
    if 0.0 < settings.watchdog < _LEAST_WATCHDOG:
        raise ParameterError(f'watchdog is {settings.watchdog:g} s, within which a turn of the '
                             f'node may end late: set {_LEAST_WATCHDOG:g} or more, or 0.0 for '
                             'never')
    for source in settings.obstacles:
        if source.moving and source.type != POLYGON_INSTANCE:
            raise ParameterError(f'{source.name}.moving: only ids tell which obstacle has moved: '
                                 f'set {source.name}.type to {POLYGON_INSTANCE}')
        if source.moving and source.set_end != NONE:
            raise ParameterError(f'{source.name}.moving: obstacles that move are known by their '
                                 f'ids alone: set {source.name}.set_end to {NONE}')
        if source.type == POLYGON_COLLECTION and source.set_end not in (NONE, EACH_MESSAGE):
            raise ParameterError(f'{source.name}.set_end: each message of {POLYGON_COLLECTION} is '
                                 f'a set: leave set_end out')
        if not source.timeout and source.ending not in (EMPTY_POLYGON, EACH_MESSAGE):
            raise ParameterError(
                f'{source.name}.timeout is 0.0, for a map, which must say where it ends: set '
                f'{source.name}.set_end to {EMPTY_POLYGON} and send an empty polygon after its '
                f'last obstacle, or to {EACH_MESSAGE} if it is a single polygon')
        if source.max_count == 1 and source.ending == NONE and source.type != POLYGON_INSTANCE:
            raise ParameterError(f'{source.name}.max_count: 1 is a limit, and declares nothing: '
                                 f'write {source.name}.set_end: {EACH_MESSAGE}, if each message '
                                 'is all that the publisher sees')
    check_outlines(settings)
    return settings


def outline_of(settings: FootprintSettings, max_vertices: int) -> Outline:
    """Return the outline of a footprint that has one; ParameterError if it is invalid."""
    name = settings.name
    if settings.points and settings.radius:
        raise ParameterError(f'{name}.points and {name}.radius are both given: choose one')
    pairs = _pairs(settings) if settings.points else _disc(settings)
    with np.errstate(over='ignore'):  # it is not finite then, which is reported
        vertices = np.array(pairs, np.float32).astype(np.float64)
    try:
        Polygon(vertices, max_vertices)
    except PolygonError as error:
        raise ParameterError(f'{name}.points are not a simple polygon: {error}') from error
    return tuple((x, y) for x, y in vertices.tolist())


def check_outlines(settings: Settings) -> None:
    """Raise a ParameterError where the settings of an outline are invalid."""
    for one in settings.footprints:
        name = one.name
        if one.has_outline:
            if not one.frame_id or one.frame_id[0] == '/':
                raise ParameterError(f'{name}.frame_id: an outline needs the frame that it moves '
                                     'with, such as base_link, without a slash before it')
            if not settings.frame_id:
                raise ParameterError(f'frame_id: the outline of {name} needs the fixed frame that '
                                     'it moves in, such as odom')
            if one.odometry and one.frame_id == settings.frame_id:
                raise ParameterError(f'{name}.frame_id: {one.frame_id} is the fixed frame, which '
                                     'no odometry moves: give the frame of the robot')
            outline_of(one, settings.max_vertices)
        elif one.cmd_vel or one.path:
            given = 'cmd_vel: a command is in' if one.cmd_vel else 'path: a path moves'
            raise ParameterError(f'{name}.{given} the frame of the robot, and a footprint that is '
                                 f'published does not say where that is: give {name}.points or '
                                 f'{name}.radius, and {name}.frame_id, instead')
        elif one.frame_id or one.odometry:
            given = 'frame_id' if one.frame_id else 'odometry'
            raise ParameterError(f'{name}.{given} is for an outline: give {name}.points or '
                                 f'{name}.radius, too')


def _pairs(settings: FootprintSettings) -> list[tuple[float, float]]:
    points, name = settings.points, settings.name
    if not isinstance(points, str):
        if len(points) % 2:
            raise ParameterError(f'{name}.points has {len(points)} numbers, but each point has '
                                 'two')
        return list(zip(points[::2], points[1::2]))
    try:
        listed = ast.literal_eval(points.strip())
        pairs = [(float(x), float(y)) for x, y in listed]
        # Sets, keys, strings and booleans can be unpacked and converted, too.
        if not (pairs and {*map(type, (listed, *listed))} <= {list, tuple}
                and {type(value) for pair in listed for value in pair} <= {int, float}):
            raise ValueError('not a list of points')
    # All that Python's parser, and numbers beyond the largest double, may raise.
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError,
            OverflowError) as error:
        raise ParameterError(f'{name}.points: a string must have the form '
                             "'[[x1, y1], [x2, y2], ...]'") from error
    return pairs


def _disc(settings: FootprintSettings) -> list[tuple[float, float]]:
    """Return the corners of a regular polygon round the disc."""
    count = settings.radius_vertices
    reach = _ROUNDED * settings.radius / math.cos(math.pi / count)
    return [(reach * math.cos(angle), reach * math.sin(angle))
            for angle in (math.tau * k / count for k in range(count))]


def _numbers(name: str, given: Any) -> str | tuple[float, ...]:
    """Return the value of a parameter that is a string or an array of numbers."""
    if isinstance(given, str):
        return given
    if isinstance(given, Sequence) and all(type(one) in (int, float) for one in given):
        try:
            return tuple(map(float, given))
        except OverflowError as error:
            raise ParameterError(f'{name} has a number beyond the largest double') from error
    raise ParameterError(f"parameter '{name}' is {given!r}, but must be a string or an array of "
                         'numbers')


def _nearest(wrong: str, names: Iterable[str]) -> str:
    """Return the most similar of some names, empty if none is similar."""
    return next(iter(get_close_matches(wrong, names, n=1)), '')


def _default(kind: type, name: str, field: str, default: Any) -> Any:
    """Return the default of a parameter of a footprint or source; a list is never empty."""
    if field == 'topic':
        is_default = kind is ObstacleSettings and name == DEFAULT_SOURCE
        return DEFAULT_SOURCE_TOPIC if is_default else name
    # A parameter file cannot say that a list of strings is empty: it would have no type.
    return [''] if default == () else default


def _sources_of(name: str, given: Iterable[str], sources: Iterable[str]) -> tuple[str, ...]:
    """Return the sources given to a footprint; ParameterError for an unknown one."""
    for one in filter(None, given):
        if one not in sources:
            nearest = _nearest(one, sources)
            hint = f"; did you mean '{nearest}'?" if nearest else ''
            raise ParameterError(f"{name}.obstacles: there is no obstacle source '{one}'{hint}")
    return tuple(filter(None, given))


def _check_names(footprints: list[str], obstacles: list[str]) -> None:
    names = [*footprints, *obstacles]
    for name in names:
        if not (name.isascii() and name.isidentifier()):
            raise ParameterError(f"footprints or obstacles: '{name}' cannot be a name: use "
                                 'letters, digits and underscores, and <name>.topic for the topic')
        if name in _RESERVED:
            raise ParameterError(f"footprints or obstacles: '{name}' cannot be a name, because a "
                                 'parameter is called so: choose another')
        if names.count(name) > 1:
            raise ParameterError(f"footprints or obstacles: the name '{name}' is used twice: "
                                 'choose another')
