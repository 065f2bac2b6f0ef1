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

"""The parameters: what there is, what each may be, and how they add up to Settings. No ROS."""

from __future__ import annotations

from dataclasses import fields
from typing import NamedTuple

from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON, POLYGON_INSTANCE, Settings)


class ParameterError(ValueError):
    """These parameters make no sense; the message is for the user, in one line."""

    def __init__(self, message):
        super().__init__(' '.join(str(message).split()))


class Spec(NamedTuple):
    """What a parameter means and may be; `live` if it can be changed while the node runs."""

    description: str
    live: bool = False
    limits: tuple | None = None
    choices: tuple = ()


_RATE = (0.1, 50.0)
_DAY = 86400.0

_MONITOR = {
    'frame_id': Spec('Frame that all bodies must be in; empty for that of the first footprint'),
    'enabled': Spec('False checks nothing: all footprints are unknown', live=True),
    'unknown_is_collision': Spec('Raise the flag of a footprint whose state is unknown too',
                                 live=True),
    'margin': Spec('Metres up to which bodies apart count as a collision too; 0 for contact',
                   live=True, limits=(0.0, 1000.0)),
    'resolution': Spec('Metres: warn of coordinates whose float32 step is larger', live=True,
                       limits=(0.0, 1000.0)),
    'release_delay': Spec('Seconds clear before a flag falls; a rise is never delayed',
                          live=True, limits=(0.0, _DAY)),
    'max_vertices': Spec('The most vertices of a polygon; one with more is refused',
                         limits=(1, 1_000_000)),
    'publish_rate': Spec('Flags and states without any change, Hz', live=True, limits=_RATE),
    'marker_rate': Spec('Markers while somebody subscribes, Hz', live=True, limits=_RATE),
}
_FOOTPRINT = {
    'topic': Spec('Topic of the footprint, geometry_msgs/PolygonStamped'),
    'timeout': Spec('Age in seconds beyond which the footprint is unknown; 0 for never',
                    live=True, limits=(0.0, _DAY)),
    'enabled': Spec('False leaves the footprint out of the common flag', live=True),
}
_OBSTACLES = {
    'topic': Spec('Topic of the obstacles, one polygon a message'),
    'type': Spec('polygon (PolygonStamped) or polygon_instance (PolygonInstanceStamped)',
                 choices=(POLYGON, POLYGON_INSTANCE)),
    'timeout': Spec('Age in seconds beyond which an obstacle is forgotten, and silence beyond '
                    'which footprints are unknown; 0 for never', live=True, limits=(0.0, _DAY)),
    'enabled': Spec('False ignores the topic', live=True),
    'set_window': Spec('Seconds between the first and the last stamp of one set of obstacles',
                       live=True, limits=(0.0, 60.0)),
    'accumulate': Spec('Keep every polygon until its timeout instead of forming sets', live=True),
    'max_count': Spec('The most obstacles of this topic; more make the footprints unknown',
                      live=True, limits=(1, 1_000_000)),
}


def declare_parameters(declare):
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
        If a name is none.

    """
    footprints = declare('footprints', ['footprint'],
                         Spec('Names of the footprints: bodies of ours'))
    obstacles = declare('obstacles', ['obstacles'], Spec('Names of the sources of obstacles'))
    _check_names(footprints, obstacles)
    for kind, specs, names in ((Settings, _MONITOR, ['']),
                               (FootprintSettings, _FOOTPRINT, footprints),
                               (ObstacleSettings, _OBSTACLES, obstacles)):
        defaults = {field.name: field.default for field in fields(kind)}
        for name in names:
            for field, spec in specs.items():
                declare(f'{name}.{field}' if name else field,
                        name if field == 'topic' else defaults[field], spec)
    return footprints, obstacles


def read_settings(footprints, obstacles, value, resolve):
    """
    Put the values of all parameters together.

    Parameters
    ----------
    footprints, obstacles : list of str
        As `declare_parameters` returns them.
    value : callable
        Takes the name of a parameter and returns its value.
    resolve : callable
        Takes the name of a topic and returns it in full.

    Returns
    -------
    Settings

    """
    def source(kind, specs, name):
        values = {field: value(f'{name}.{field}') for field in specs}
        try:
            values['topic'] = resolve(values['topic'])
        except (RuntimeError, ValueError) as error:  # rcl's are RuntimeErrors
            raise ParameterError(f'{name}.topic: {error}') from error
        return kind(name=name, **values)

    return Settings(
        footprints=tuple(source(FootprintSettings, _FOOTPRINT, name) for name in footprints),
        obstacles=tuple(source(ObstacleSettings, _OBSTACLES, name) for name in obstacles),
        **{field: value(field) for field in _MONITOR})


def _check_names(footprints, obstacles):
    names = [*footprints, *obstacles]
    for name in names:
        if not (name.isascii() and name.isidentifier()):
            raise ParameterError(f"'{name}' in footprints or obstacles is no name: use letters, "
                                 'digits and underscores, and <name>.topic for the topic')
        if names.count(name) > 1:
            raise ParameterError(f"the name '{name}' is used twice in footprints and obstacles")
