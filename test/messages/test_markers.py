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

"""Markers of a scene, and where their labels stand."""

import itertools

from builders import box, SECOND
import numpy as np
import pytest
from sat_collision import Polygon
from sat_collision.messages.markers import Labels, Markers
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
import shapely
from visualization_msgs.msg import Marker

U_SHAPE = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
GREEN, RED, GREY = 'green', 'red', 'grey'


@pytest.fixture
def scene():
    """Return a scene of two footprints and two sources, of which a set has ended just now."""
    scene = Scene(Settings(
        tuple(FootprintSettings(name, f'/{name}', timeout=0.0) for name in ('a', 'b')),
        tuple(ObstacleSettings(name, f'/{name}', timeout=100.0) for name in ('map', 'people'))))
    for name in ('map', 'people'):
        end(scene, name, SECOND // 2)
    return scene


def place(scene, name, points, stamp=SECOND, frame_id='map'):
    """Put a body where its points are."""
    put = scene.footprint if name in ('a', 'b') else scene.obstacle
    put(name, Polygon(points).packed if points else None, frame_id, stamp, 9 * SECOND)


def end(scene, name='map', stamp=SECOND):
    """End a set of a source."""
    place(scene, name, None, stamp)


def drawn(scene, markers=None):
    """Return the markers by namespace and id, checked for what holds of all."""
    first, *rest = (markers or Markers()).message(scene).markers
    assert first.action == Marker.DELETEALL
    assert all(marker.action == Marker.ADD for marker in rest)
    assert {marker.header.frame_id for marker in rest} <= {scene.frame_id}
    lifetimes = {(marker.lifetime.sec, marker.lifetime.nanosec) for marker in rest}
    assert lifetimes <= {(0, 300_000_000)}
    by_name = {(marker.ns, marker.id): marker for marker in rest}
    assert len(by_name) == len(rest), 'a marker would replace another'
    return by_name


def colour(marker):
    """Return green, red or grey, None for any other colour."""
    r, g, b = marker.color.r, marker.color.g, marker.color.b
    if r == g == b:
        return GREY
    return GREEN if g > 3 * r and g > 3 * b else RED if r > 3 * g and r > 3 * b else None


def xy(marker):
    return np.array([(point.x, point.y) for point in marker.points])


def test_footprints_are_green_red_or_grey(scene):
    """One is clear, one in contact; then a source is not known and the clear one is grey."""
    place(scene, 'a', box(0, 0))
    place(scene, 'b', box(5, 5))
    place(scene, 'map', box(5.5, 5.5))
    end(scene)
    end(scene, 'people')
    markers = drawn(scene)
    for part in ('fill', 'outline'):
        assert colour(markers[f'a/{part}', 0]) == GREEN
        assert colour(markers[f'b/{part}', 0]) == RED
    scene.refuse('people', 'not finite', 9 * SECOND, 9 * SECOND)
    markers = drawn(scene)
    assert colour(markers['a/fill', 0]) == GREY and colour(markers['b/fill', 0]) == RED


def test_obstacles_are_neutral_or_red(scene):
    """Of three obstacles of one source, one is in contact."""
    place(scene, 'a', box(0, 0))
    for points in (box(3, 0), box(1, 0), box(5, 0)):
        place(scene, 'map', points)
    markers = drawn(scene)
    assert colour(markers['map/fill', 0]) is None and colour(markers['map/fill', 1]) == RED
    assert len(markers['map/outline', 0].points) == 2 * 2 * 4
    assert set(map(tuple, xy(markers['map/outline', 1]))) == set(box(1, 0))


def test_outline_is_closed_and_fill_covers_a_body_that_is_not_convex(scene):
    """The triangles of a U add up to its area and stay inside."""
    place(scene, 'a', U_SHAPE)
    markers = drawn(scene)
    assert markers['a/fill', 0].type == Marker.TRIANGLE_LIST
    triangles = shapely.polygons(xy(markers['a/fill', 0]).reshape(-1, 3, 2))
    body = shapely.Polygon(U_SHAPE)
    assert shapely.area(triangles).sum() == pytest.approx(body.area)
    assert shapely.union_all(triangles).equals(body)
    assert markers['a/outline', 0].type == Marker.LINE_LIST
    lines = shapely.MultiLineString(list(xy(markers['a/outline', 0]).reshape(-1, 2, 2)))
    assert lines.equals(body.exterior)


def test_points_and_segments_are_drawn(scene):
    """A point as a sphere, a segment as one line; neither has a fill."""
    place(scene, 'a', box(0, 0))
    place(scene, 'map', [(3, 3)])
    place(scene, 'people', [(4, 4), (5, 6), (4.5, 5)])
    markers = drawn(scene)
    assert markers['map/points', 0].type == Marker.SPHERE_LIST
    assert xy(markers['map/points', 0]).tolist() == [[3, 3]]
    assert sorted(xy(markers['people/outline', 0]).tolist()) == [[4, 4], [5, 6]]
    names = {ns for ns, _ in markers}
    assert not names & {'map/fill', 'map/outline', 'people/fill', 'people/points'}


def test_contacts_are_marked_and_named(scene):
    """Two footprints share a region, one a point, one a segment with an obstacle."""
    place(scene, 'a', box(0, 0, 2, 2))
    place(scene, 'b', box(5, 0, 2, 2))
    place(scene, 'map', box(1, 1, 5, 2))
    place(scene, 'map', [(0, -1), (0, 1)])
    place(scene, 'people', [(0.5, 0.5)])
    markers = drawn(scene)
    regions = xy(markers['contacts/regions', 0]).reshape(-1, 3, 2)
    shared = shapely.union_all([shapely.box(1, 1, 2, 2), shapely.box(5, 1, 6, 2)])
    assert shapely.union_all(shapely.polygons(regions)).equals(shared)
    assert sorted(xy(markers['contacts/segments', 0]).tolist()) == [[0, 0], [0, 1]]
    assert xy(markers['contacts/points', 0]).tolist() == [[0.5, 0.5]]
    assert markers['a/name', 0].text == 'a: in contact with map/0, map/1, people/0'
    assert markers['b/name', 0].text == 'b: in contact with map/0'
    assert ('nearest/axis', 0) in markers, 'b and people are apart'


def test_footprints_are_named_beside_their_bodies(scene):
    """As long as no set is whole, nothing is known of them."""
    place(scene, 'a', box(0, 0))
    place(scene, 'b', box(5, 5))
    assert {drawn(scene)[f'{name}/name', 0].text for name in 'ab'} == {'a: unknown', 'b: unknown'}
    for name in ('map', 'people'):
        place(scene, name, box(9, 9))
        end(scene, name)
    text = drawn(scene)['a/name', 0]
    assert text.text == 'a' and colour(text) == GREEN
    assert text.pose.position.y > 1.0


def test_nearest_clear_pair_and_its_axis(scene):
    """Of four pairs apart the nearest: its closest points, its distance, the axis through them."""
    place(scene, 'a', box(0, 0))
    place(scene, 'b', box(0, 20))
    place(scene, 'map', box(3, 0.5))
    place(scene, 'people', box(2, 30))
    end(scene)
    end(scene, 'people')
    markers = drawn(scene)
    assert xy(markers['nearest/points', 0])[:, 0].tolist() == [1, 3]
    assert markers['nearest/distance', 0].text == 'a - map/0: 2 m'
    left, right = xy(markers['nearest/axis', 0])
    assert left[1] == right[1] and left[0] < 1 and right[0] > 3
    place(scene, 'people', box(0, 21.5), 2 * SECOND)
    end(scene, 'people', 2 * SECOND)
    assert drawn(scene)['nearest/distance', 0].text == 'b - people/0: 0.5 m'


def test_pairs_in_contact_and_unknown_footprints_have_no_axis(scene):
    """Only one pair, that touches, then overlaps, then is apart; then a source is refused."""
    place(scene, 'a', box(0, 0))
    for k, x in enumerate((1, 0.5), 1):
        place(scene, 'map', box(x, 0), k * SECOND)
        assert ('nearest/axis', 0) not in drawn(scene)
    place(scene, 'map', box(3, 0), 3 * SECOND)
    end(scene, stamp=3 * SECOND)
    end(scene, 'people')
    assert ('nearest/axis', 0) in drawn(scene)
    scene.refuse('people', 'not finite', 9 * SECOND, 9 * SECOND)
    assert ('nearest/axis', 0) not in drawn(scene)


def test_what_is_gone_is_not_drawn_any_more(scene):
    """A footprint refused, obstacles replaced, then a backward step: a lone DELETEALL."""
    markers = Markers()
    place(scene, 'a', box(0, 0))
    place(scene, 'b', box(5, 5))
    place(scene, 'map', box(7, 7))
    assert {'a/fill', 'b/fill', 'map/fill'} <= {ns for ns, _ in drawn(scene, markers)}
    scene.refuse('b', 'not finite', 9 * SECOND, 9 * SECOND)
    assert not [ns for ns, _ in drawn(scene, markers) if ns.startswith('b/')]
    scene.pass_time(SECOND)
    assert drawn(scene, markers) == {}


def test_only_new_polygons_are_made_into_points_again(scene):
    """The points of a body that stayed where it was are the very same objects."""
    markers = Markers()
    place(scene, 'a', box(0, 0))
    place(scene, 'map', box(7, 7))
    before = drawn(scene, markers)
    place(scene, 'map', box(8, 7), 2 * SECOND)
    end(scene, stamp=2 * SECOND)
    after = drawn(scene, markers)
    assert after['a/fill', 0].points[0] is before['a/fill', 0].points[0]
    assert xy(after['map/outline', 0])[0].tolist() == [8, 7]


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
