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

"""Texts beside bodies: over none of them, and over no other text."""

import itertools

from builders import box
import numpy as np
from sat_collision.messages.markers import Labels
import shapely

HEIGHT = 0.25


def labels(*bodies):
    rings = [np.array(body, float) for body in bodies]
    return Labels([(ring, (*ring.min(0), *ring.max(0))) for ring in rings], HEIGHT)


def bounds(body):
    x, y = np.array(body).T
    return min(x), min(y), max(x), max(y)


def room(place, text):
    """Return the box that a text takes, which is 0.6 of its height wide for each character."""
    (x, y), width = place, 0.3 * HEIGHT * len(text)
    return shapely.box(x - width, y - HEIGHT / 2, x + width, y + HEIGHT / 2)


def test_text_is_above_its_body():
    """In the middle, and near."""
    x, y = labels(box(0, 0)).place('robot', (0, 0, 1, 1))
    assert x == 0.5 and 1.0 < y - HEIGHT / 2 < 1.2


def test_texts_cover_neither_bodies_nor_each_other():
    """A crowd: robots in two rows, a wall above them and one that is slanted."""
    robots = [box(2 * i, 2 * j) for i in range(3) for j in range(2)]
    walls = [[(-5, 3.2), (10, 3.2)], [(-2, -3), (9, -0.2)]]
    found = labels(*robots, *walls)
    rooms = [room(found.place(text, bounds(robot)), text)
             for robot in robots for text in ('robot', 'in contact')]
    bodies = [*map(shapely.Polygon, robots), *map(shapely.LineString, walls)]
    assert not any(one.intersects(body) for one in rooms for body in bodies)
    assert not any(one.intersects(other) for one, other in itertools.combinations(rooms, 2))


def test_where_there_is_no_room_the_least_is_covered():
    """Everywhere is a body; one place covers none but the big one."""
    x, y = labels(box(-50, -50, 100, 100), box(-2, 1.01, 9, 9)).place('robot', (0, 0, 1, 1))
    assert y < 0.0
