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

"""The parameters of a monitor by name, and how they add up to Settings. No ROS."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from difflib import get_close_matches
import re
from typing import Any

from sat_collision.scene.outlines import check, OutlineError
from sat_collision.scene.settings import (
    DEFAULT_FOOTPRINT, DEFAULT_SOURCE, DEFAULT_SOURCE_TOPIC, FootprintSettings, ObstacleSettings,
    POLYGON_INSTANCE, Settings, Spec, specs, TF)

_LISTS = {'footprints': DEFAULT_FOOTPRINT, 'obstacles': DEFAULT_SOURCE}
# What every node of rclpy has beside these parameters.
_OF_EVERY_NODE = ('qos_overrides', 'start_type_description_service', 'use_sim_time')
# Parameters of a source that there were before, and what to do instead.
_REMOVED = {'set_quiet': 'remove it: a pause does not end a set, which ends with an empty polygon '
                         'of its stamp, or when the next one begins'}
_TYPES = {bool: 'true or false', int: 'a whole number', float: 'a double', str: 'a text',
          list: 'a list of texts'}
_RESERVED = frozenset((*specs(Settings), *_OF_EVERY_NODE))


class ParameterError(ValueError):
    """Parameters are invalid; the message is for the user, in one line."""

    def __init__(self, message: object) -> None:
        super().__init__(' '.join(str(message).split()))


def declare_parameters(
        declare: Callable[[str, Any, Spec], Any]) -> tuple[list[str], list[str]]:
    """
    Declare every parameter of the settings.

    Parameters
    ----------
    declare : callable
        Takes name, default and Spec of a parameter and returns the value that it was given.

    Returns
    -------
    list of str, list of str
        The names of the footprints and of the sources of obstacles.

    Raises
    ------
    ParameterError
        If a source cannot have the name that it was given.

    """
    monitor = specs(Settings)
    footprints, obstacles = (
        list(declare(name, [default], monitor.pop(name)[1])) for name, default in _LISTS.items())
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
    Reject unknown parameters: a mistyped one would silently keep its default.

    Parameters
    ----------
    given : iterable of str
        The names that files and the command line have for the node.
    known : collection of str
        The names that were declared.

    Raises
    ------
    ParameterError
        If a name is neither known nor one that every node has.

    """
    for name in given:
        if name not in known and name.partition('.')[0] not in _OF_EVERY_NODE:
            hint = ''
            if remedy := _REMOVED.get(name.rpartition('.')[2]):
                hint = f' any more: {remedy}'
            elif stranger := _not_named(name, known):
                hint = f": name '{stranger}' in footprints or obstacles, where it is not"
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


def read_settings(footprints: Iterable[str], obstacles: Iterable[str],
                  value: Callable[[str], Any], resolve: Callable[[str], str]) -> Settings:
    """
    Put the values of all parameters together.

    Parameters
    ----------
    footprints, obstacles : iterable of str
        As `declare_parameters` returns them.
    value : callable
        Takes the name of a parameter and returns its value.
    resolve : callable
        Takes the name of a topic and returns it in full.

    Returns
    -------
    Settings

    Raises
    ------
    ParameterError
        If a topic cannot have the name that it was given, an outline makes no sense, or a
        footprint has sources that there are not.

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
        settings = FootprintSettings(name=name, **{
            **found, 'points': _numbers(f'{name}.points', found['points']),
            'obstacles': _sources_of(name, found['obstacles'], sources)})
        if settings.odometry:
            settings = replace(settings, topic=resolved(f'{name}.odometry', settings.odometry))
        elif settings.has_outline:
            settings = replace(settings, topic=resolved(f'{name}.points', TF))
        if settings.cmd_vel:
            settings = replace(settings, cmd_vel=resolved(f'{name}.cmd_vel', settings.cmd_vel))
        return settings

    sources = list(obstacles)
    settings = Settings(
        footprints=tuple(map(footprint, footprints)),
        obstacles=tuple(ObstacleSettings(name=name, **values(ObstacleSettings, name))
                        for name in sources),
        **{name: value(name) for name in specs(Settings) if name not in _LISTS})
    for source in settings.obstacles:
        if source.moving and source.type != POLYGON_INSTANCE:
            raise ParameterError(f'{source.name}.moving: only ids tell which obstacle has moved: '
                                 f'set {source.name}.type to {POLYGON_INSTANCE}')
    try:
        check(settings)
    except OutlineError as error:
        raise ParameterError(error) from error
    return settings


def _numbers(name: str, given: Any) -> str | tuple[float, ...]:
    """Return the value of a parameter that is a string or an array of numbers."""
    if isinstance(given, str):
        return given
    if isinstance(given, Sequence) and all(type(one) in (int, float) for one in given):
        return tuple(map(float, given))
    raise ParameterError(f"parameter '{name}' is {given!r}, but must be a string or an array of "
                         'numbers')


def _not_named(name: str, known: Iterable[str]) -> str:
    """Return the footprint or source that a parameter is of if none has a name like it."""
    owner = name.rpartition('.')[0]
    return '' if _nearest(owner, {one.rpartition('.')[0] for one in known}) else owner


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
    """Return the sources that a footprint was given, which must be there."""
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
