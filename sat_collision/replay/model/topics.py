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

"""Which topics of a recording are footprints and which are obstacles, where nobody says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from difflib import get_close_matches
import re
from typing import TypeAlias

from sat_collision.replay.model.configuration import settings_of
from sat_collision.replay.model.options import NODE
from sat_collision.scene.parameters import ParameterError
from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON, POLYGON_INSTANCE, Settings)

Source: TypeAlias = FootprintSettings | ObstacleSettings

_KINDS = {'geometry_msgs/msg/PolygonStamped': POLYGON,
          'geometry_msgs/msg/PolygonInstanceStamped': POLYGON_INSTANCE}
_TYPES = {kind: name for name, kind in _KINDS.items()}
TRANSFORM_TYPE = 'tf2_msgs/msg/TFMessage'
_ODOMETRY = 'nav_msgs/msg/Odometry'
_PARAMETERS = {field.name for field in fields(Settings)}
_OPTIONS = {'footprints': '--footprint', 'obstacles': '--obstacles'}


def settings_for(types: Mapping[str, str], parameters: Mapping[str, object],
                 footprints: Iterable[str] = (), obstacles: Iterable[str] = (),
                 node: str = NODE) -> Settings:
    """
    Return the Settings to check a recording with.

    What neither the parameters nor the names say is found by type and name, where only one
    reading is possible: the topics that the node has by default; else the one footprint topic,
    which must be alone in its type or in having 'footprint' in its name, and the one other topic.
    A kind that has no topic keeps the default, and receives nothing.

    Parameters
    ----------
    types : dict
        Types of the recording's topics.
    parameters : dict
        Parameters of the node by dotted name.
    footprints, obstacles : iterable of str
        Topics, or NAME:=TOPIC.
    node : str
        Full name of the node.

    Raises
    ------
    ParameterError
        If the parameters make no sense or the topics are ambiguous; lists the candidates.

    """
    default = settings_of({}, node)
    defaults: dict[str, Source] = {'footprints': default.footprints[0],
                                   'obstacles': default.obstacles[0]}
    values = dict(parameters)
    for kind, topics in (('footprints', footprints), ('obstacles', obstacles)):
        if topics:
            values.update(_named(kind, topics, defaults[kind].name))
    polygons = {topic: _KINDS[kind] for topic, kind in types.items() if kind in _KINDS}
    said = [kind for kind, source in defaults.items()
            if kind in values or f'{source.name}.topic' in values or source.topic in polygons
            or isinstance(source, FootprintSettings) and _has_outline(source.name, values)]
    settings = settings_of(values, node, False)
    taken = {source.topic for kind in said for source in getattr(settings, kind)}
    free = {topic: kind for topic, kind in polygons.items() if topic not in taken}
    for kind, topic in _detected(free, [kind for kind in defaults if kind not in said]).items():
        values.update(_named(kind, [topic], defaults[kind].name))
    for source in settings_of(values, node, False).obstacles:
        if source.topic in polygons:
            values.setdefault(f'{source.name}.type', polygons[source.topic])
    return settings_of(values, node)


def all_sources(settings: Settings) -> tuple[Source, ...]:
    """Return what the settings have a topic for: footprints and sources of obstacles."""
    return *settings.footprints, *settings.obstacles


def wrong_types(settings: Settings, types: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Return (name, problem) of each source whose topic the recording has with another type."""
    for source in all_sources(settings):
        wanted = _type_of(source)
        found = types.get(source.topic, wanted)
        if found != wanted:
            yield source.name, f'{source.name}: {source.topic} has the type {found}, not {wanted}'


def missing_topics(settings: Settings, types: Mapping[str, str]) -> list[str]:
    """Return a sentence for each source whose topic the recording lacks, with what it has."""
    taken = {source.topic for source in all_sources(settings)}
    candidates = [f'{topic} ({_KINDS[kind]})' for topic, kind in types.items()
                  if kind in _KINDS and topic not in taken]
    instead = f'; it has {", ".join(candidates)}' if candidates else ''
    notes = []
    for source in all_sources(settings):
        if source.enabled and source.topic not in types:
            nearest = get_close_matches(source.topic, types, 1)
            hint = f'; did you mean {nearest[0]}?' if nearest else instead
            notes.append(f'{source.name}: the recording has no topic {source.topic}{hint}')
    return notes


def is_subscribed(source: Source) -> bool:
    """Return whether a source has a topic of its own, instead of a frame of /tf."""
    return not (isinstance(source, FootprintSettings) and source.has_outline
                and not source.odometry)


def _type_of(source: Source) -> str:
    """Return the type that the topic of a source should have."""
    if isinstance(source, ObstacleSettings):
        return _TYPES[source.type]
    if source.has_outline:
        return _ODOMETRY if source.odometry else TRANSFORM_TYPE
    return _TYPES[POLYGON]


def _has_outline(name: str, values: Mapping[str, object]) -> bool:
    return f'{name}.points' in values or f'{name}.radius' in values


def _named(kind: str, topics: Iterable[str], default: str) -> dict[str, object]:
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
                name = default
        if name in sources:
            raise ParameterError(f"the name '{name}' is used twice in {kind}")
        sources[name] = topic
    return {kind: list(sources), **{f'{name}.topic': topic for name, topic in sources.items()}}


def _detected(polygons: Mapping[str, str], kinds: list[str]) -> dict[str, str]:
    """Return the topic of each kind of which there is any."""
    found: dict[str, str] = {}
    certain = True
    if 'footprints' in kinds:
        plain = [topic for topic, kind in polygons.items() if kind == POLYGON]
        named = [topic for topic in plain if 'footprint' in topic.lower()]
        candidates = plain if len(plain) == 1 else named
        certain = len(candidates) == 1 or not plain
        found.update(zip(['footprints'], candidates))
    if 'obstacles' in kinds:
        others = [topic for topic in polygons if topic not in found.values()]
        certain = certain and len(others) <= 1
        found.update(zip(['obstacles'], others))
    if not certain:
        listed = ', '.join(f'{topic} ({_TYPES[kind]})' for topic, kind in polygons.items())
        options = ' and '.join(_OPTIONS[kind] for kind in kinds)
        raise ParameterError('cannot tell which topics are footprints and which are obstacles: '
                             f'choose with {options} from {listed}')
    return found
