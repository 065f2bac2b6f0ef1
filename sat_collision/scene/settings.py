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

"""What a monitor is configured with, as plain data; the defaults stand here and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass

from sat_collision.geometry.polygon import MAX_VERTICES

POLYGON = 'polygon'
POLYGON_INSTANCE = 'polygon_instance'


@dataclass(frozen=True, slots=True)
class FootprintSettings:
    """
    One footprint: a body of ours, on a geometry_msgs/PolygonStamped topic of its own.

    Attributes
    ----------
    name, topic : str
        Name in states and parameters, and the topic that it comes on.
    timeout : float
        Age in seconds of the header stamp beyond which the footprint is unknown; 0 for never.
    enabled : bool
        False leaves the footprint out: its state is unknown, and it raises no common flag.

    """

    name: str
    topic: str
    timeout: float = 1.0
    enabled: bool = True


@dataclass(frozen=True, slots=True)
class ObstacleSettings:
    """
    One source of obstacles.

    Attributes
    ----------
    name, topic : str
        Name in states and parameters, and the topic that the obstacles come on.
    type : str
        'polygon' for geometry_msgs/PolygonStamped, whose messages form sets by their stamps, or
        'polygon_instance' for geometry_msgs/PolygonInstanceStamped, where the id is the identity.
    timeout : float
        Seconds after its header stamp that an obstacle is forgotten, and that a source silent for
        so long is not trusted any more; 0 for never, as a latched map needs.
    enabled : bool
        False ignores the source's messages and drops its obstacles.
    set_window : float
        Seconds from the first stamp of a set within which messages are different obstacles of it.
    accumulate : bool
        True keeps every polygon until its timeout, for publishers that send obstacles one by one.
    max_count : int
        The most obstacles held; beyond it the source is in trouble, never silently truncated.

    """

    name: str
    topic: str
    type: str = POLYGON  # noqa: A003, the parameter's name
    timeout: float = 2.0
    enabled: bool = True
    set_window: float = 0.02
    accumulate: bool = False
    max_count: int = 10_000


@dataclass(frozen=True, slots=True)
class Settings:
    """
    Everything a monitor is configured with.

    Attributes
    ----------
    footprints : tuple of FootprintSettings
    obstacles : tuple of ObstacleSettings
    frame_id : str
        The frame everything must be in; empty for that of the first good footprint.
    enabled : bool
        False checks nothing: every state is unknown.
    unknown_is_collision : bool
        Whether a flag is raised for an unknown footprint too.
    margin : float
        Metres: a footprint collides when its separation from an obstacle is no more. 0 means
        contact, decided exactly.
    resolution : float
        Metres: coordinates that float32 cannot tell apart by so much are warned of.
    release_delay : float
        Seconds that a footprint must have been clear before it is reported so.
    max_vertices : int
        The most vertices of one polygon; a message with more is refused.
    publish_rate, marker_rate : float
        How often flags and states, and markers, are published without any change, in Hz.

    """

    footprints: tuple[FootprintSettings, ...]
    obstacles: tuple[ObstacleSettings, ...]
    frame_id: str = ''
    enabled: bool = True
    unknown_is_collision: bool = True
    margin: float = 0.0
    resolution: float = 0.001
    release_delay: float = 0.0
    max_vertices: int = MAX_VERTICES
    publish_rate: float = 10.0
    marker_rate: float = 10.0
