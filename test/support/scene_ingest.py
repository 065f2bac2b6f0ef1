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

"""Two ways to give a scene the same events: by polygons, and by messages through a monitor."""

import math

from builders import box, serialised
import numpy as np
from sat_collision.geometry.polygon import Polygon
from sat_collision.messages.rejections import UNDECODABLE
from sat_collision.monitor import Monitor
from sat_collision.scene.obstacle_store import OTHER_FRAME
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import POLYGON_INSTANCE

BAD_POINTS = {'not finite': ((0, 0), (1, math.nan), (1, 1)),
              'self-intersecting': ((5, 5), (6, 6), (6, 5), (5, 6))}


class ByPolygons:
    """
    A scene that receives polygons.

    A message returns why the scene refuses it, None if it does not, or does not say.
    """

    def __init__(self, settings):
        self.scene = Scene(settings)
        self._sources = {source.name: source for source in settings.obstacles}

    def place(self, name, ring, stamp, now, instance, number, frame_id='map'):
        body = Polygon(ring).packed if ring else None
        if name not in self._sources:
            refusal = self.scene.footprint(name, body, frame_id, stamp, now, number=number)
            if refusal is None and self.scene.is_tracked(name):
                self.scene.track(name, np.array(ring))
            return refusal
        refusal = self.scene.obstacle(name, body, frame_id, stamp, now, instance, number)
        if refusal is None and ring and self._sources[name].moving:
            self.scene.track_obstacle(name, instance, np.array(ring), stamp, now)
        return refusal

    def refuse(self, name, reason, stamp, now, instance, number):
        if reason == OTHER_FRAME:
            return self.place(name, box(0), stamp, now, instance, number, 'cam')
        if reason == UNDECODABLE:
            stamp = instance = None
        self.scene.refuse(name, reason, now, stamp, instance, number)
        return None


class ByMessages:
    """A monitor that receives the same as serialised messages."""

    def __init__(self, settings):
        self._monitor = Monitor(settings)
        self._with_ids = {source.name for source in settings.obstacles
                          if source.type == POLYGON_INSTANCE}
        self.scene = self._monitor.scene

    def place(self, name, ring, stamp, now, instance, number):
        if not ring and name in self._with_ids:
            instance = 0
        return self._receive(name, serialised(ring, stamp, 'map', instance), now, number)

    def refuse(self, name, reason, stamp, now, instance, number):
        data = serialised(BAD_POINTS.get(reason, box(0)), stamp,
                          'cam' if reason == OTHER_FRAME else 'map', instance)
        return self._receive(name, data[:9] if reason == UNDECODABLE else data, now, number)

    def _receive(self, name, data, now, number):
        rejection = self._monitor.receive(name, data, now, number)
        return rejection and rejection.reason
