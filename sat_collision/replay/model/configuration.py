# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Settings to check a recording with: from parameter files, single values, and its topics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from difflib import get_close_matches
from functools import partial
import math
from pathlib import Path
import re
from typing import Any, TypeAlias

from sat_collision.extras import in_one_line
from sat_collision.replay.model.result import NODE
from sat_collision.scene.parameters import (
    check_names_given, declare_parameters, DEFAULT_NAMES, is_name_of, ParameterError,
    parameters_by_node, read_settings, type_problem, without_value)
from sat_collision.scene.settings import (
    CommandSettings, EMPTY_POLYGON, FOOTPRINT_TYPES, FootprintSettings, OBSTACLE_TYPES,
    ObstacleSettings, PathSettings, POLYGON, POLYGON_2D, POLYGON_COLLECTION, POLYGON_INSTANCE,
    Settings, Spec, TF)
import yaml

Source: TypeAlias = FootprintSettings | ObstacleSettings | CommandSettings | PathSettings

TRANSFORM_TYPE = 'tf2_msgs/msg/TFMessage'
TWIST_TYPE = 'geometry_msgs/msg/Twist'
_ODOMETRY = 'nav_msgs/msg/Odometry'
_PATH = 'nav_msgs/msg/Path'
_STAMPED_TWIST = 'geometry_msgs/msg/TwistStamped'
_KINDS = {'geometry_msgs/msg/PolygonStamped': POLYGON,
          'polygon_msgs/msg/Polygon2DStamped': POLYGON_2D,
          'polygon_msgs/msg/Polygon2DCollection': POLYGON_COLLECTION,
          'geometry_msgs/msg/PolygonInstanceStamped': POLYGON_INSTANCE}
_TYPES = {kind: name for name, kind in _KINDS.items()}
_TYPES_OF = {'footprints': FOOTPRINT_TYPES, 'obstacles': OBSTACLE_TYPES}
_PARAMETERS = {field.name for field in fields(Settings)}
_OPTIONS = {'footprints': '--footprint', 'obstacles': '--obstacles'}
_TOPIC = re.compile(r'(~/|/)?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)


class _Loader(yaml.SafeLoader):
    """YAML as rcl reads it: 1e3 is a number too, and there are no aliases."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError('it has an alias (*), which no parameter file can have')
        return super().compose_node(parent, index)


_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(r'[-+]?[0-9]+[eE][-+]?[0-9]+$'), list('-+0123456789'))


def parameters_of_file(path: str | Path, node: str = NODE) -> dict[str, Any]:
    """
    Return the parameters that a ROS 2 parameter file has for a node, by their dotted names.

    ParameterError says why it is not a parameter file, or that it has nothing for this node.
    """
    try:
        with open(path, encoding='utf-8') as file:
            content = yaml.load(file, _Loader)
    except OSError as error:
        raise ParameterError(f'cannot read {path}: {error.strerror}') from error
    except Exception as error:  # whatever the constructors of YAML's types raise
        raise ParameterError(f'{path} is not a parameter file: {in_one_line(error)}') from error
    if not isinstance(content, dict):
        raise ParameterError(f'{path} is not a parameter file: it does not list nodes by name')
    found = dict(parameters_by_node(content))
    if not found:
        raise ParameterError(f"{path} is not a parameter file: it has no 'ros__parameters'")
    for name, values in found.items():
        if not isinstance(values, dict):
            raise ParameterError(f"{path}: 'ros__parameters' of {name} has no parameters")
    own = [values for name, values in found.items() if is_name_of(name, node)]
    if not own:
        nearest = get_close_matches(node, [name for name in found if '*' not in name], 1, 0.0)
        hint = f'; did you mean --node {nearest[0]}?' if nearest else ''
        raise ParameterError(
            f'{path} has no parameters for {node}, only for {", ".join(found)}{hint}')
    return {key: value for values in own for key, value in _flat(values)}


def parameter_of_text(text: str) -> tuple[str, Any]:
    """Return name and value of a parameter written as NAME:=VALUE, the value in YAML."""
    name, given, value = text.partition(':=')
    if not (given and name):
        hint = '' if given or '=' not in text else f': {text.replace("=", ":=", 1)}'
        raise ParameterError(f"'{text}' does not have the form NAME:=VALUE{hint}")
    try:
        return name, yaml.load(value, _Loader)
    except Exception as error:  # as above
        raise ParameterError(f'{text}: {in_one_line(error)}') from error


def check_values(parameters: Mapping[str, Any]) -> None:
    """Raise ParameterError for parameters that are wrong whatever a recording has."""
    _, values = _declared(parameters)
    check_names_given([name for name in parameters if '.' not in name], values)


def settings_of(parameters: Mapping[str, Any], node: str = NODE) -> Settings:
    """Return the Settings that dotted parameters make; ParameterError as from the node."""
    names, values = _declared(parameters)
    check_names_given(parameters, values)
    return read_settings(names['footprints'], names['obstacles'], values.__getitem__,
                         partial(_resolved, node))


def _declared(parameters: Mapping[str, Any]) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the names in footprints and obstacles, and the values of all their parameters."""
    values: dict[str, Any] = {}

    def declare(name: str, default: Any, spec: Spec) -> Any:
        values[name] = _checked(name, parameters.get(name, default), default, spec)
        return values[name]
    return dict(zip(DEFAULT_NAMES, declare_parameters(declare))), values


def _resolved(node: str, topic: str) -> str:
    if not _TOPIC.fullmatch(topic):
        raise ValueError(f"'{topic}' is not a valid topic name")
    if topic.startswith('~'):
        return node + topic[1:]
    return topic if topic.startswith('/') else f'{node.rpartition("/")[0]}/{topic}'


def _flat(values: Mapping[str, Any], prefix: str = '') -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value


def _checked(name: str, value: Any, default: Any, spec: Spec) -> Any:
    """Return a value that has the type of the default and is within limits, as the node would."""
    if value is None or value == []:
        raise ParameterError(without_value(name))
    if spec.is_any_type:
        return value
    if problem := type_problem(name, value, default):
        raise ParameterError(problem)
    if spec.choices and value not in spec.choices:
        raise ParameterError(f"{name}: '{value}' is not one of {', '.join(spec.choices)}")
    if spec.limits and not (spec.limits[0] <= value <= spec.limits[1] and math.isfinite(value)):
        least, greatest = spec.limits
        raise ParameterError(f'{name}: {value} is not between {least} and {greatest}')
    return value


def settings_for(types: Mapping[str, str], parameters: Mapping[str, object],
                 footprints: Iterable[str] = (), obstacles: Iterable[str] = (),
                 node: str = NODE) -> Settings:
    """
    Return the Settings to check a recording with, whose topics have these types.

    Parameters are by dotted name, footprints and obstacles are TOPIC or NAME:=TOPIC. Topics that
    none of them names are found by type and name, if that is unambiguous: the node's default
    topics; else the only topic of a footprint's type or the only one of them with 'footprint' in
    its name, and the only other topic. If it is ambiguous a ParameterError lists the candidates.
    A kind for which no topic is found keeps the default, and receives nothing.
    """
    values = dict(parameters)
    for kind, given in zip(DEFAULT_NAMES, (footprints, obstacles)):
        if given:
            values.update(_named(kind, given))
    polygons = {topic: _KINDS[kind] for topic, kind in types.items() if kind in _KINDS}
    topics = _topics(values, node)
    said = [kind for kind, name in DEFAULT_NAMES.items()
            if kind in values or topics[kind][name] in polygons
            or values.keys() & {f'{name}.topic', f'{name}.points', f'{name}.radius'}]
    taken = {topic for kind in said for topic in topics[kind].values()}
    free = {topic: kind for topic, kind in polygons.items() if topic not in taken}
    for kind, topic in _detected(free, [kind for kind in DEFAULT_NAMES if kind not in said],
                                 taken.difference(types)).items():
        values.update(_named(kind, [topic]))
    for kind, own in _topics(values, node).items():
        for name, topic in own.items():
            found = polygons.get(topic)
            if found in _TYPES_OF[kind]:
                values.setdefault(f'{name}.type', found)
    return settings_of(values, node)


def _topics(parameters: Mapping[str, Any], node: str) -> dict[str, dict[str, str]]:
    """Return the topics in footprints and obstacles by name; in full, unless they are invalid."""
    names, values = _declared(parameters)

    def topic_of(name: str) -> str:
        topic: str = values[f'{name}.topic']
        if values.get(f'{name}.points') or values.get(f'{name}.radius'):
            topic = values[f'{name}.odometry'] or TF
        return _resolved(node, topic) if _TOPIC.fullmatch(topic) else topic
    return {kind: {name: topic_of(name) for name in own} for kind, own in names.items()}


def all_sources(settings: Settings) -> tuple[Source, ...]:
    """Return all settings that have a topic: footprints, sources, commands, paths."""
    return (*settings.inputs,
            *(one.command for one in settings.footprints if one.command),
            *(path for one in settings.footprints if (path := one.path_settings)))


def wrong_types(settings: Settings, types: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield (name, problem) of each source whose topic the recording has with another type."""
    for source in all_sources(settings):
        wanted = _types_of(source)
        if types.get(source.topic, wanted[0]) not in wanted:
            yield source.name, (f'{source.name}: {source.topic} has the type '
                                f'{types[source.topic]}, not {" or ".join(wanted)}')


def has_marks(source: Source) -> bool:
    """Return whether a source is enabled, and an empty polygon ends each of its sets."""
    return (isinstance(source, ObstacleSettings) and source.enabled
            and source.set_end == EMPTY_POLYGON)


def is_map(source: Source) -> bool:
    """Return whether a source is enabled, and does not age."""
    return isinstance(source, ObstacleSettings) and source.enabled and not source.timeout


def check_shared_topics(inputs: Iterable[FootprintSettings | ObstacleSettings]) -> None:
    """
    Raise ParameterError if inputs of one topic differ in what their messages are ordered by.

    `StampOrder` orders the messages of a topic in one way: with the mark of their set, as those of
    a map, or each by its stamp.
    """
    taken: dict[str, FootprintSettings | ObstacleSettings] = {}
    for one in inputs:
        if one.enabled and is_subscribed(one):
            other = taken.setdefault(one.topic, one)
            if (has_marks(one), is_map(one)) != (has_marks(other), is_map(other)):
                raise ParameterError(
                    f'{one.topic}: only one of {other.name} and {one.name} ends its sets with a '
                    'mark, or is a map, so by recorded motion one would count at a wrong time: '
                    'check one of them at a time, or both with --as-live')


def missing_topics(settings: Settings, types: Mapping[str, str]) -> Iterator[str]:
    """Yield a sentence for each source whose topic the recording lacks, with what it has."""
    taken = {source.topic for source in all_sources(settings)}
    candidates = [f'{topic} ({_KINDS[kind]})' for topic, kind in types.items()
                  if kind in _KINDS and topic not in taken]
    for source in all_sources(settings):
        if source.enabled and source.topic not in types:
            kind = 'obstacles' if isinstance(source, ObstacleSettings) else 'footprints'
            if nearest := get_close_matches(
                    source.topic, [topic for topic in types if topic.startswith('/')], 1):
                hint = f'did you mean {nearest[0]}?'
            elif candidates and _types_of(source)[0] in _KINDS:
                hint = f'it has {", ".join(candidates)}: choose with {_OPTIONS[kind]}'
            else:
                hint = 'record it, too'
            yield f'{source.name}: the recording has no topic {source.topic}; {hint}'


def is_subscribed(source: Source) -> bool:
    """Return whether a source has a topic of its own, instead of a frame of /tf."""
    return not (isinstance(source, FootprintSettings) and source.has_outline
                and not source.odometry)


def _types_of(source: Source) -> tuple[str, ...]:
    """Return the types that the topic of a source may have."""
    if isinstance(source, CommandSettings):
        return _STAMPED_TWIST, TWIST_TYPE
    if isinstance(source, PathSettings):
        return _PATH,
    if isinstance(source, FootprintSettings) and source.has_outline:
        return _ODOMETRY if source.odometry else TRANSFORM_TYPE,
    return _TYPES[source.type],


def _named(kind: str, topics: Iterable[str]) -> dict[str, object]:
    """
    Return the parameters that name sources, given as TOPIC or NAME:=TOPIC.

    A topic called like a parameter of the node, which no source may be, has the default name.
    """
    sources: dict[str, str] = {}
    for text in topics:
        if ':=' in text:
            name, topic = text.split(':=', 1)
        else:
            name, topic = re.sub(r'\W+', '_', text.strip('/~'), flags=re.ASCII), text
            if name in _PARAMETERS:
                name = DEFAULT_NAMES[kind]
        if name in sources:
            raise ParameterError(f"the name '{name}' is used twice in {kind}")
        sources[name] = topic
    return {kind: list(sources), **{f'{name}.topic': topic for name, topic in sources.items()}}


def _detected(polygons: Mapping[str, str], kinds: list[str], missing: set[str]) -> dict[str, str]:
    """Return the topic detected for each kind, if any; a refusal names what is missing."""
    plain = [topic for topic, kind in polygons.items()
             if 'footprints' in kinds and kind in FOOTPRINT_TYPES]
    named = [topic for topic in plain if 'footprint' in topic.lower()]
    candidates = plain if len(plain) == 1 else named
    found = dict(zip(['footprints'], candidates))
    others = [topic for topic in polygons if 'obstacles' in kinds and topic not in found.values()]
    found.update(zip(['obstacles'], others))
    if plain and len(candidates) != 1 or len(others) > 1:
        listed = ', '.join(f'{topic} ({_TYPES[kind]})' for topic, kind in polygons.items())
        options = ' and '.join(_OPTIONS[kind] for kind in kinds)
        absent = ''.join(f'the recording has no topic {topic}; ' for topic in sorted(missing))
        raise ParameterError(f'{absent}cannot tell which topics are footprints and which are '
                             f'obstacles: choose with {options} from {listed}')
    return found
