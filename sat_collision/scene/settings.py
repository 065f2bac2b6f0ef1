# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The settings of a monitor, each with its default, limits and meaning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

from sat_collision.geometry.body.polygon import MAX_VERTICES
from sat_collision.scene.velocity import VELOCITY_LASTS

POLYGON = 'polygon'
POLYGON_INSTANCE = 'polygon_instance'
POLYGON_COLLECTION = 'polygon_collection'
POLYGON_2D = 'polygon_2d'
FOOTPRINT_TYPES = POLYGON, POLYGON_2D
OBSTACLE_TYPES = POLYGON, POLYGON_INSTANCE, POLYGON_COLLECTION
# What ends a set of obstacles.
NONE, EMPTY_POLYGON, NEW_STAMP, EACH_MESSAGE = SET_ENDS = (
    'none', 'empty_polygon', 'new_stamp', 'each_message')

# Times are ints in ns; this one is later than all.
NEVER = float('inf')
# Stamps further than this from the present are by another clock, ns.
FAR = 3600 * 10**9
BY_ANOTHER_CLOCK = ('more than an hour from the clock of this node: set use_sim_time: true, here '
                    'and for the publisher, where a recording or a simulation publishes /clock')

# The topic of the frame of an outline, unless it has odometry.
TF = '/tf'

# The default sources. Their names differ from those of the lists: with 'obstacles.topic' beside
# 'obstacles' a parameter would be both a value and a prefix.
DEFAULT_FOOTPRINT = 'footprint'
DEFAULT_SOURCE = 'obstacle'
DEFAULT_SOURCE_TOPIC = 'obstacles'

_DAY = 86400.0
_SPEC = 'spec'


class Spec(NamedTuple):
    """The meaning of a setting, and its allowed values."""

    description: str  # for users; begins with the unit where there is one
    live: bool = False  # whether it can be changed while the node runs
    limits: tuple[float, float] | None = None  # the least and the greatest value
    choices: tuple[str, ...] = ()  # the values it may have; empty for any
    # Whether it influences what is clear, so that `lock_parameters` fixes it.
    safety: bool = False
    is_any_type: bool = False  # whether its value need not have the type of the default


def _setting(description: str, **more: Any) -> Mapping[str, Spec]:
    """Return the metadata of a field that is a setting; more is as Spec has it."""
    return {_SPEC: Spec(description, **more)}


def in_ns(timeout: float) -> float:
    """Return a timeout of s in ns, NEVER for 0.0."""
    return max(round(timeout * 1e9), 1) if timeout else NEVER


def specs(kind: type) -> dict[str, tuple[Any, Spec]]:
    """Return default and Spec of every setting of a class by name; MISSING for no default."""
    return {one.name: (one.default, one.metadata[_SPEC])
            for one in fields(kind) if _SPEC in one.metadata}


@dataclass(frozen=True, slots=True)
class CommandSettings:
    """The commands of a footprint: a topic with a name of its own, and how long (s) one holds."""

    name: str
    topic: str
    timeout: float
    enabled: bool


@dataclass(frozen=True, slots=True)
class PathSettings:
    """The path of a footprint: a topic with a name of its own."""

    name: str
    topic: str
    enabled: bool


@dataclass(frozen=True, slots=True)
class FootprintSettings:
    """One footprint, with a name and a topic of its own."""

    name: str
    topic: str = field(metadata=_setting(
        'topic of the footprint, geometry_msgs/PolygonStamped; by default its name'))
    type: str = field(default=POLYGON, metadata=_setting(  # noqa: A003, the parameter's name
        'polygon is geometry_msgs/PolygonStamped; polygon_2d is polygon_msgs/Polygon2DStamped, '
        'whose coordinates are float64', choices=FOOTPRINT_TYPES))
    timeout: float = field(default=1.0, metadata=_setting(
        's; a footprint older than this by its header stamp is unknown; 0.0 for never',
        live=True, safety=True, limits=(0.0, _DAY)))
    enabled: bool = field(default=True, metadata=_setting(
        'false disables the footprint: its state is unknown, and it does not raise the common '
        'flag', live=True, safety=True))
    obstacles: tuple[str, ...] = field(default=(), metadata=_setting(
        'names of the sources whose obstacles it must not touch, and whose faults make it '
        "unknown; [''] for all", live=True, safety=True))
    points: str | tuple[float, ...] = field(default='', metadata=_setting(
        'm; the outline of a footprint without a topic, which moves with its frame_id: '
        "[x1, y1, x2, y2, ...], all with a decimal point, or Nav2's string in quotes, "
        "'[[x1, y1], [x2, y2], ...]'; empty for none",
        live=True, safety=True, is_any_type=True))
    radius: float = field(default=0.0, metadata=_setting(
        'm; instead of points, the radius of a disc round the origin of the frame; 0.0 for none',
        live=True, safety=True, limits=(0.0, 1000.0)))
    radius_vertices: int = field(default=16, metadata=_setting(
        'number of vertices of the polygon round that disc, which covers all of it',
        limits=(3, 1000)))
    frame_id: str = field(default='', metadata=_setting(
        'the frame that the outline is in and moves with, such as base_link; its pose comes from '
        '/tf, and the age of the footprint is that of the transform'))
    rate: float = field(default=50.0, metadata=_setting(
        'Hz; max rate at which the outline is placed', limits=(0.1, 1000.0)))
    odometry: str = field(default='', metadata=_setting(
        'topic of nav_msgs/Odometry that gives the pose of the frame; empty for /tf'))
    cmd_vel: str = field(default='', metadata=_setting(
        'topic of the commands by which contacts are predicted, geometry_msgs/TwistStamped or '
        'Twist in the frame of the outline; empty to predict by the measured velocity'))
    path: str = field(default='', metadata=_setting(
        'topic of nav_msgs/Path; the latest path is checked ahead of the robot, which must have '
        'an outline; empty for none'))
    min_time_to_collision: float = field(default=0.0, metadata=_setting(
        's; also raises the flag if the footprint will be in contact within this time, should it '
        'keep its velocity; 0.0 for contact alone', live=True, safety=True, limits=(0.0, 60.0)))

    @property
    def has_outline(self) -> bool:
        """Whether it has an outline as a parameter instead of a topic."""
        return bool(self.points) or self.radius > 0.0

    @property
    def command(self) -> CommandSettings | None:
        """Its commands, if any; each holds for its timeout, and no longer than VELOCITY_LASTS."""
        longest = VELOCITY_LASTS / 1e9
        return CommandSettings(f'{self.name}.cmd_vel', self.cmd_vel,
                               min(self.timeout or longest, longest),
                               self.enabled) if self.cmd_vel else None

    @property
    def path_settings(self) -> PathSettings | None:
        """Its path, if it has one."""
        return PathSettings(f'{self.name}.path', self.path, self.enabled) if self.path else None

    def monitors(self, source: str) -> bool:
        """Return whether the obstacles of a source, and its faults, concern the footprint."""
        return not self.obstacles or source in self.obstacles


@dataclass(frozen=True, slots=True)
class ObstacleSettings:
    """One source of obstacles, with a name and a topic of its own."""

    name: str
    topic: str = field(metadata=_setting(
        "topic of the obstacles, one polygon per message; by default the source's name, but "
        f'{DEFAULT_SOURCE_TOPIC} for the source {DEFAULT_SOURCE}'))
    type: str = field(default=POLYGON, metadata=_setting(  # noqa: A003, the parameter's name
        'polygon is geometry_msgs/PolygonStamped; polygon_instance is PolygonInstanceStamped, '
        'whose ids identify obstacles; polygon_collection is polygon_msgs/Polygon2DCollection, '
        'of which each message is a whole set', choices=OBSTACLE_TYPES))
    set_end: str = field(default=NONE, metadata=_setting(
        'what ends a set, which is all that the publisher sees: empty_polygon, one after the last '
        'obstacle; new_stamp, as all of a set have one stamp and the next set a newer one; '
        'each_message, as each is a whole set. none needs no sets, but holds an obstacle for one '
        'timeout after it was last sent, so that moving ones leave a trail, and what counts may '
        'be two timeouts old; to be rid of that, send an empty polygon after each set and choose '
        'empty_polygon, or lower timeout',
        choices=SET_ENDS, safety=True))
    timeout: float = field(default=2.0, metadata=_setting(
        's; within this the publisher must send all that it sees: one that does not, or is silent '
        'for longer, makes the footprints unknown; 0.0 for a map, which does not age and needs '
        'set_end empty_polygon or each_message',
        live=True, safety=True, limits=(0.0, _DAY)))
    enabled: bool = field(default=True, metadata=_setting(
        'false ignores the source and drops its obstacles', live=True, safety=True))
    assume_no_loss: bool = field(default=False, metadata=_setting(
        'true promises that the middleware loses no message, where it gives no numbers that '
        'would show it, as Cyclone DDS; false leaves a source unknown there, unless each of its '
        'messages is a whole set', safety=True))
    max_count: int = field(default=100_000, metadata=_setting(
        'max number of obstacles in a set; with set_end none, of all that are held; more are '
        'refused and make the footprints unknown', live=True, safety=True,
        limits=(1, 1_000_000)))
    moving: bool = field(default=False, metadata=_setting(
        'true predicts contacts as if each obstacle kept its velocity between the last two '
        'messages of its id, so type must be polygon_instance and set_end none; false as if all '
        'stood still',
        live=True, safety=True))

    @property
    def ending(self) -> str:
        """What ends a set of it, one of SET_ENDS."""
        return EACH_MESSAGE if self.type == POLYGON_COLLECTION else self.set_end


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything a monitor is configured with; as parameters the first two are lists of names."""

    footprints: tuple[FootprintSettings, ...] = field(metadata=_setting(
        'names of the footprints; each has parameters of its own, such as footprint.topic'))
    obstacles: tuple[ObstacleSettings, ...] = field(metadata=_setting(
        'names of the sources of obstacles; each has parameters of its own, such as '
        'obstacle.topic'))
    frame_id: str = field(default='', metadata=_setting(
        'the fixed frame, to which messages in other frames are transformed by /tf; empty for the '
        'common frame of the footprints of the last second, which all messages must be in'))
    transform_timeout: float = field(default=0.2, metadata=_setting(
        's; a message waits this long for the transform at its stamp, then it is refused',
        live=True, safety=True, limits=(0.0, 10.0)))
    max_tf_gap: float = field(default=0.5, metadata=_setting(
        's; transforms further apart in time are not interpolated: where the frame was is unknown',
        live=True, safety=True, limits=(0.0, _DAY)))
    max_tilt: float = field(default=0.0873, metadata=_setting(
        'rad; a message is refused if its frame is tilted out of the plane by more; 0.0873 is 5 '
        'degrees', live=True, safety=True, limits=(0.0, 1.5)))
    tf_cache_time: float = field(default=10.0, metadata=_setting(
        's; for how long before the newest transform of a frame older ones are kept',
        limits=(0.1, 3600.0)))
    future_tolerance: float = field(default=1.0, metadata=_setting(
        's; a message stamped further ahead of the clock is refused', live=True, safety=True,
        # A batch may bring messages that were stamped after the clock was read for it.
        limits=(0.05, _DAY)))
    clock_timeout: float = field(default=2.0, metadata=_setting(
        's by the wall clock; simulated time that stands still for this long makes the footprints '
        'unknown; 0.0 for never', live=True, safety=True, limits=(0.0, _DAY)))
    enabled: bool = field(default=True, metadata=_setting(
        'false checks nothing: every state is unknown', live=True, safety=True))
    unknown_is_collision: bool = field(default=True, metadata=_setting(
        'true also raises the flag of a footprint whose state is unknown', live=True, safety=True))
    margin: float = field(default=0.0, metadata=_setting(
        'm; a footprint collides if its separation from an obstacle is at most this; 0.0 is '
        'contact, decided exactly', live=True, safety=True, limits=(0.0, 1000.0)))
    horizon: float = field(default=3.0, metadata=_setting(
        's; how far ahead contacts are predicted, while somebody subscribes to a topic with '
        'predictions; 0.0 for not at all', live=True, limits=(0.0, 60.0)))
    resolution: float = field(default=0.001, metadata=_setting(
        'm; ~/state warns of footprints whose coordinates have larger float32 steps',
        live=True, limits=(0.0, 1000.0)))
    release_delay: float = field(default=0.0, metadata=_setting(
        's; a footprint must have been clear for this long before its flag falls; a rise is never '
        'delayed', live=True, safety=True, limits=(0.0, _DAY)))
    max_vertices: int = field(default=MAX_VERTICES, metadata=_setting(
        'max number of vertices of a polygon; a message with more is refused',
        limits=(1, 1_000_000)))
    max_path_poses: int = field(default=10_000, metadata=_setting(
        'max number of poses of a path; one with more is refused', live=True,
        limits=(1, 1_000_000)))
    publish_rate: float = field(default=10.0, metadata=_setting(
        'Hz; how often flags and states are published without any change',
        # Subscribers take a flag older than 0.3 s for a raised one.
        live=True, limits=(5.0, 50.0)))
    marker_rate: float = field(default=10.0, metadata=_setting(
        'Hz; how often markers are published while somebody subscribes',
        live=True, limits=(0.1, 50.0)))
    max_batch_delay: float = field(default=0.005, metadata=_setting(
        's; for how long the node lets messages gather when they are frequent, which saves '
        'processor time and delays an answer by at most this; 0.0 for never',
        live=True, limits=(0.0, 0.1)))
    watchdog: float = field(default=0.3, metadata=_setting(
        's; when the node has not processed messages for this long, a separate thread raises all '
        'flags; 0.05 or more, or 0.0 for never', live=True, safety=True, limits=(0.0, 60.0)))
    lock_parameters: bool = field(default=False, metadata=_setting(
        'true refuses to change, once the node runs, what a clear state depends on: the '
        'parameters marked with a +, and use_sim_time'))

    @property
    def inputs(self) -> tuple[FootprintSettings | ObstacleSettings, ...]:
        """The footprints and the sources of obstacles."""
        return *self.footprints, *self.obstacles
