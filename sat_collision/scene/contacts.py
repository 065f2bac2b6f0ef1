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

"""Which footprints meet which obstacles, kept up to date one body at a time."""

import numpy as np
from sat_collision.geometry.polygon_set import PolygonSet
from sat_collision.scene import express


class Placeable:
    """
    What can be placed: a footprint or an obstacle.

    Attributes
    ----------
    row : int or None
        Its row among the placed bodies of its kind.
    meets : set of Placeable
        The bodies of the other kind that share a point with it.

    """

    __slots__ = ('row', 'meets', '_kind', '_polygon')

    def __init__(self):
        self.row = None
        self.meets = set()

    @property
    def polygon(self):
        """Where the body is, None if nowhere; the same Polygon while it stays there."""
        if self.row is None:
            return None
        # A message may have moved it since in the packed arrays alone.
        polygons = self._kind.polygons
        if not polygons.holds(self.row, self._polygon):
            self._polygon = polygons.convex_polygon(self.row)
        return self._polygon

    def put(self, kind, row, polygon):
        """Take note of where it was placed."""
        self._kind = kind
        self.row = row
        self._polygon = polygon


class Contacts:
    """
    The placed footprints and obstacles, and which of them share a point.

    Placing a body decides it against the bodies of the other kind alone: everything else stays as
    it was decided before.

    Parameters
    ----------
    margin : float
        Metres up to which bodies apart count as meeting.

    Attributes
    ----------
    changed : set of Placeable
        Footprints that have gained or lost a contact; the reader empties it.
    packed : tuple or None
        What `pack` returned, while it is true.

    """

    def __init__(self, margin=0.0):
        self.changed = set()
        self._margin = margin
        self._footprints = _Kind()
        self._obstacles = _Kind()
        self.packed = None
        self._found = None

    def pack(self):
        """Return bounds, rows, blocks and used_rows of the footprints, then of the obstacles."""
        footprints, obstacles = self._footprints.polygons, self._obstacles.polygons
        self.packed = (
            footprints.bounds, footprints.rows, footprints.blocks, footprints.used_rows,
            obstacles.bounds, obstacles.rows, obstacles.blocks, obstacles.used_rows)
        self._found = np.empty(obstacles.used_rows, np.int64)
        return self.packed

    def use_margin(self, margin):
        """Decide everything anew by another margin, if it is another."""
        if margin != self._margin:
            self._margin = margin
            for footprint in self._footprints.bodies.values():
                self._meet_obstacles(footprint, footprint.polygon)

    def place_footprint(self, footprint, polygon):
        """Put a footprint where a polygon is, or move it there."""
        self.packed = None
        self._footprints.place(footprint, polygon)
        self._meet_obstacles(footprint, polygon)

    def _meet_obstacles(self, footprint, polygon):
        if _meet(footprint, self._obstacles.within(polygon, self._margin)):
            self.changed.add(footprint)

    def move_footprint(self, footprint, data, frame, most):
        """
        Move a placed footprint by an ordinary message; return its stamp or NOT_ORDINARY.

        As for all messages that go the short way, there must be no margin.
        """
        packed = self.packed or self.pack()
        stamp, hits = express.move_footprint(
            data, frame, most, footprint.row, self._found, *packed)
        if stamp != express.NOT_ORDINARY and (hits or footprint.meets):
            if _meet(footprint, self._obstacles.of_rows(self._found[:hits]) if hits else ()):
                self.changed.add(footprint)
        return stamp

    def remove_footprint(self, footprint):
        """Take a footprint away, if it is placed."""
        if self._footprints.remove(footprint) and _meet(footprint, ()):
            self.changed.add(footprint)

    def place_obstacle(self, obstacle, polygon):
        """Put an obstacle where a polygon is, or move it there."""
        self.packed = None
        self._obstacles.place(obstacle, polygon)
        footprints = self._footprints.within(polygon, self._margin)
        if footprints or obstacle.meets:
            self.changed.update(_meet(obstacle, footprints))

    def is_at(self, obstacle, polygon):
        """Tell whether an obstacle is where a polygon is already."""
        return obstacle.row is not None and self._obstacles.polygons.holds(obstacle.row, polygon)

    def remove_obstacle(self, obstacle):
        """Take an obstacle away, if it is placed."""
        if self._obstacles.remove(obstacle):
            self.changed.update(_meet(obstacle, ()))

    def nearest(self, footprint):
        """Return the name, separation and closest points of what is nearest, None if nothing."""
        return footprint.polygon and self._obstacles.nearest(footprint.polygon)


class _Kind:
    """The placed bodies of one kind, by row."""

    def __init__(self):
        self.polygons = PolygonSet()
        self.bodies = {}

    def place(self, body, polygon):
        row = body.row
        if row is not None:
            self.polygons.replace(row, polygon)
        else:
            row = self.polygons.append(polygon)
            self.bodies[row] = body
        body.put(self, row, polygon)

    def remove(self, body):
        """Return whether the body was there to be removed."""
        if body.row is None:
            return False
        self.polygons.remove(body.row)
        del self.bodies[body.row]
        body.row = None
        return True

    def within(self, polygon, margin):
        return self.of_rows(self.polygons.within(polygon, margin))

    def of_rows(self, rows):
        return map(self.bodies.__getitem__, rows.tolist()) if len(rows) else ()

    def nearest(self, polygon):
        if not self.bodies:
            return None
        row, *found = self.polygons.nearest(polygon)
        return self.bodies[row].name, *found


def _meet(body, others):
    """Let a body meet these others and no more; return those for which this is a change."""
    gained_or_lost = body.meets.symmetric_difference(others)
    for other in gained_or_lost:
        other.meets.symmetric_difference_update((body,))
    body.meets ^= gained_or_lost
    return gained_or_lost
