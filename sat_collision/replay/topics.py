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

"""Which topics of a recording are footprints and which are obstacles, unless somebody says."""

import re

from sat_collision.replay.configuration import NODE, settings_of
from sat_collision.scene.parameters import ParameterError
from sat_collision.scene.settings import POLYGON, POLYGON_INSTANCE

_KINDS = {'geometry_msgs/msg/PolygonStamped': POLYGON,
          'geometry_msgs/msg/PolygonInstanceStamped': POLYGON_INSTANCE}
_TYPES = {kind: name for name, kind in _KINDS.items()}


def settings_for(types, parameters, footprints=(), obstacles=(), node=NODE):
    """
    Return the Settings to check a recording with.

    What neither the parameters nor the names say is found by type and name, where only one
    reading is possible: the topics that the node has by default; else the one footprint topic,
    which must be alone in its type or in having 'footprint' in its name, and the one other topic.
    A kind that has no topic keeps the default, and is never heard.

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
    parameters = dict(parameters)
    for kind, topics in (('footprints', footprints), ('obstacles', obstacles)):
        if topics:
            parameters.update(_named(kind, topics))
    polygons = {topic: _KINDS[kind] for topic, kind in types.items() if kind in _KINDS}
    default = settings_of({}, node)
    wanted = {'footprints': default.footprints[0].topic, 'obstacles': default.obstacles[0].topic}
    said = [kind for kind in wanted if _is_said(kind, parameters) or wanted[kind] in polygons]
    settings = settings_of(parameters, node)
    taken = {source.topic for kind in said for source in getattr(settings, kind)}
    free = {topic: kind for topic, kind in polygons.items() if topic not in taken}
    for kind, topic in _detected(free, [kind for kind in wanted if kind not in said]).items():
        parameters.update(_named(kind, [topic]))
    for source in settings_of(parameters, node).obstacles:
        if source.topic in polygons:
            parameters.setdefault(f'{source.name}.type', polygons[source.topic])
    return settings_of(parameters, node)


def wrong_types(settings, types):
    """Return (name, problem) of each source whose topic the recording has with another type."""
    for source in (*settings.footprints, *settings.obstacles):
        wanted = _TYPES[getattr(source, 'type', POLYGON)]
        found = types.get(source.topic, wanted)
        if found != wanted:
            yield source.name, f'{source.name}: {source.topic} is of type {found}, not {wanted}'


def missing_topics(settings, types):
    """Return a sentence for each source whose topic the recording does not have."""
    return [f'{source.name}: the recording has no topic {source.topic}'
            for source in (*settings.footprints, *settings.obstacles)
            if source.enabled and source.topic not in types]


def _is_said(kind, parameters):
    """Return whether the parameters say anything of the topics of footprints or obstacles."""
    return kind in parameters or f'{kind.removesuffix("s")}.topic' in parameters or (
        f'{kind}.topic' in parameters)


def _named(kind, topics):
    """Return the parameters that name sources, given as TOPIC or NAME:=TOPIC."""
    sources = {}
    for text in topics:
        if ':=' in text:
            name, topic = text.split(':=', 1)
        else:
            name, topic = re.sub(r'\W+', '_', text.strip('/~'), flags=re.ASCII), text
        if name in sources:
            raise ParameterError(f"the name '{name}' is used twice in {kind}")
        sources[name] = topic
    return {kind: list(sources), **{f'{name}.topic': topic for name, topic in sources.items()}}


def _detected(polygons, kinds):
    """Return the topic of each kind of which there is any."""
    found = {}
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
        missing = ' and '.join(f'--{kind.removesuffix("s") if kind == "footprints" else kind}'
                               for kind in kinds)
        raise ParameterError(f'which topics are footprints, which obstacles? Say {missing}, '
                             f'of: {listed}')
    return found
