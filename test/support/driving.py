# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A robot that drives in the frame odom, and sees with a laser."""

from dataclasses import replace
import math

from builders import box
from monitors import nanoseconds, World
from sat_collision.messages.transform_listener import TF, TF_STATIC
from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON_INSTANCE, Settings)

SETTINGS = Settings(
    frame_id='odom', footprints=(FootprintSettings('robot', '/footprint'),),
    obstacles=(ObstacleSettings('lidar', '/polygons', type=POLYGON_INSTANCE, max_count=5),))
SETS = replace(SETTINGS, obstacles=(
    ObstacleSettings('lidar', '/polygons', timeout=5.0, set_end='empty_polygon'),))


class Robot(World):
    """
    The monitor of a robot whose fixed frame is odom.

    The robot moves along x at 1 m/s from 0 at 0 s and is a box of 1 m; its laser, 1 m ahead of
    its origin, is rotated to the left. With the default settings the source is known, and empty.
    """

    def __init__(self, settings=SETTINGS):
        super().__init__(settings)
        for self.time in (-3.1, -1.5, 0.0) if settings is SETTINGS else ():
            self.see((), self.time)
        self.receive_transforms(TF_STATIC, ('base', 'laser', 0, 1.0, 0.0, math.pi / 2))

    def move(self, time, x=None, child='base'):
        """Receive the transform of the base, or of another frame, now."""
        x = time if x is None else x
        self.receive_transforms(TF, ('odom', child, nanoseconds(time), x, 0.0))
        return self

    def stand(self, x, time=None):
        """Send a footprint in the fixed frame."""
        assert self.send('robot', box(x), time) is None
        return self

    def see(self, points, time=None, frame_id='laser', instance=1):
        """Send an obstacle, with an id if the source gives ids."""
        has_ids = self.settings.obstacles[0].type == POLYGON_INSTANCE
        return self.send('lidar', points, time, frame_id, instance if has_ids else None)

    def see_all(self, *polygons, frame_id='odom'):
        """Send a whole set that was seen now."""
        for points in (*polygons, ()):
            self.see(points, None, frame_id)
        return self

    @property
    def seen(self):
        """The bounds of all obstacles."""
        return [polygon.bounds for _, polygon in self.scene.obstacles]


def robot_that_sees_nothing():
    """Return a robot whose pose is known from 0 to 1 s, in an empty world."""
    robot = Robot()
    for k in range(11):
        robot.move(k / 10)
    robot.at(1.0).stand(0)
    robot.see((), 1.0)
    return robot
