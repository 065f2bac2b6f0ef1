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

from sat_collision.express import express, NOT_ORDINARY
from sat_collision.polygon_set import PolygonSet


class Placeable:
    """
    What can be placed: a footprint or an obstacle.

    Attributes
    ----------
    polygon : Polygon or None
        Where the body was placed; None while it is nowhere. Of an obstacle, `Contacts.polygon`
        knows better.
    row : int or None
        Its row among the placed bodies of its kind.
    meets : set of Placeable
        The bodies of the other kind that share a point with it.

    """

    __slots__ = ('polygon', 'row', 'meets')

    def __init__(self):
        self.polygon = None
        self.row = None
        self.meets = set()


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

    """

    def __init__(self, margin=0.0):
        self.changed = set()
        self._margin = margin
        self._footprints = _Kind()
        self._obstacles = _Kind()

    def use_margin(self, margin):
        """Decide everything anew by another margin, if it is another."""
        if margin != self._margin:
            self._margin = margin
            for footprint in self._footprints.bodies.values():
                self._meet_obstacles(footprint)

    def place_footprint(self, footprint, polygon):
        """Put a footprint where a polygon is, or move it there."""
        self._footprints.place(footprint, polygon)
        self._meet_obstacles(footprint)

    def _meet_obstacles(self, footprint):
        if _meet(footprint, self._obstacles.within(footprint.polygon, self._margin)):
            self.changed.add(footprint)

    def remove_footprint(self, footprint):
        """Take a footprint away, if it is placed."""
        if self._footprints.remove(footprint) and _meet(footprint, ()):
            self.changed.add(footprint)

    def place_obstacle(self, obstacle, polygon):
        """Put an obstacle where a polygon is, or move it there."""
        self._obstacles.place(obstacle, polygon)
        footprints = self._footprints.within(polygon, self._margin)
        if footprints or obstacle.meets:
            self.changed.update(_meet(obstacle, footprints))

    def polygon(self, obstacle):
        """Return where an obstacle is, None if nowhere; the same Polygon while it stays there."""
        row = obstacle.row
        polygons = self._obstacles.polygons
        if row is not None and not polygons.holds(row, obstacle.polygon):
            obstacle.polygon = polygons.convex_polygon(row)
        return obstacle.polygon

    def is_at(self, obstacle, polygon):
        """Tell whether an obstacle is where a polygon is already."""
        return obstacle.row is not None and self._obstacles.polygons.holds(obstacle.row, polygon)

    def express(self, obstacle, data, frame, most, now, last_time, set_start, set_window, prints,
                place):
        """Take an ordinary message for an obstacle that is placed; see `express.express`."""
        if self._margin != 0.0:
            return NOT_ORDINARY
        obstacles = self._obstacles.polygons
        footprints = self._footprints.polygons
        return express(data, frame, most, now, last_time, set_start, set_window, prints, place,
                       obstacle.row, obstacles.bounds, obstacles.rows, obstacles.blocks,
                       footprints.bounds, footprints.rows, footprints.blocks,
                       footprints.used_rows)

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
        body.polygon = polygon
        if body.row is not None:
            self.polygons.replace(body.row, polygon)
        else:
            body.row = self.polygons.append(polygon)
            self.bodies[body.row] = body

    def remove(self, body):
        """Return whether the body was there to be removed."""
        if body.row is None:
            return False
        self.polygons.remove(body.row)
        del self.bodies[body.row]
        body.row = body.polygon = None
        return True

    def within(self, polygon, margin):
        rows = self.polygons.within(polygon, margin)
        return [self.bodies[row] for row in rows.tolist()] if len(rows) else ()

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
