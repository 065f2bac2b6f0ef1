# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages made from a scene: states, points of contact, markers and their labels."""

from bodies import as_shapely
from builders import box, SECOND
from monitors import square
import numpy as np
import pytest
from rclpy.serialization import deserialize_message as deserialize
from sat_collision import Polygon
from sat_collision.geometry.overlap import clip, contact_marks
from sat_collision.messages.interfaces import (
    DiagnosticArray, Marker, PointCloud2, serialize, Time)
from sat_collision.messages.markers import Markers, MAX_CONTACTS, MAX_DRAWN
from sat_collision.messages.outputs import contact_cloud
from sat_collision.messages.states import coordinate_step, in_words, States
from sat_collision.scene.footprints import State, Status
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
import shapely
import shapes


def collision(count, *reasons):
    """Return the state of a footprint in contact with some obstacles."""
    return State(Status.COLLISION, tuple(ObstacleId('lidar', key) for key in range(count)),
                 reasons, 0.1)


@pytest.mark.parametrize('state, margin, words', [
    (State(Status.CLEAR, (), (), 0.1), 0.0, 'clear'),
    (State(Status.UNKNOWN, (), ('it is silent', 'it is stale'), None), 0.0,
     'unknown: it is silent; it is stale'),
    (collision(1), 0.0, 'in contact with lidar/0'),
    (collision(3), 0.0, 'in contact with lidar/0, lidar/1, lidar/2'),
    (collision(12), 0.0, 'in contact with lidar/0, lidar/1, lidar/2 and 9 more'),
    (collision(1, 'radar is silent'), 0.0, 'in contact with lidar/0'),
    (collision(2), 0.25, 'within 0.25 m of lidar/0, lidar/1'),
    (collision(0, 'clear for less than release_delay, 0.5 s'), 0.0,
     'collision: clear for less than release_delay, 0.5 s')])
def test_state_in_words(state, margin, words):
    """With at most three obstacles; reasons if there is no contact."""
    assert in_words(state, margin) == words


@pytest.mark.parametrize('body, origin, step', [
    (square(0), None, 2.0**-23),
    (square(10_000), None, 2.0**-10),
    (square(-10_000), None, 2.0**-10),
    (Polygon([(1, -10_000)]), None, 2.0**-10),
    (square(10_000), ('base', 0), 0.0),
    (None, None, 0.0)], ids=['near', 'far', 'far on the other side', 'far along y',
                             'moved far away from another frame', 'none'])
def test_coordinate_step(body, origin, step):
    """The float32 step at the coordinate furthest from 0, of those that were sent here."""
    scene = Scene(Settings((FootprintSettings('robot', '/robot'),), ()))
    if body:
        scene.footprint('robot', body.packed, 'map', SECOND, SECOND, origin)
    assert coordinate_step(scene, 'robot') == step


FIELDS = ['x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth', 'obstacle']
KINDS = {7: '<f4', 6: '<u4'}


def scene_of(bodies, margin=0.0):
    """Return a scene with a robot from 0 to 1 and a set of obstacles."""
    scene = Scene(Settings(
        (FootprintSettings('robot', '/robot', timeout=0.0),),
        (ObstacleSettings('map', '/map', timeout=60.0),), margin=margin))
    scene.footprint('robot', Polygon(box(0, 0)).packed, 'map', SECOND, 9 * SECOND)
    for number, body in enumerate(bodies, 1):
        scene.obstacle('map', Polygon(body).packed, 'map', SECOND, 9 * SECOND, number=number)
    return scene


def test_state_says_of_each_source_how_it_is_known_and_how_to_be_rid_of_a_trail():
    """Also in contact, which may be with where an obstacle was."""
    scene = scene_of([box(0.5, 0), box(9, 9)])
    states = States('/node', scene.settings)
    states.write_moving('robot', scene, None, None)
    states.update(scene)
    known = {one.key: one.value for one in states.statuses[0].values}
    assert (known['state'], known['source map']) == (
        'collision', '2 polygons of the last 60 s, by timeout; obstacles of source map are '
        'released only 60 s after they were last sent: to release them at once, send an empty '
        'polygon after the last one of each set, and set map.set_end: empty_polygon')


def test_states_packed_one_by_one_are_one_message():
    """Whatever the lengths of their texts."""
    names = ['r', 'ro', 'rob', 'robo', 'robot']
    states = States('/node', Settings(
        tuple(FootprintSettings(name, '/' + name) for name in names), obstacles=()))
    for k, name in enumerate(names):
        states.write(name, collision(k, 'e' * k), 0.0)
        states.pack(name)
    message = deserialize(states.message(Time(sec=5, nanosec=6)), DiagnosticArray)
    assert (message.header.stamp, list(message.status)) == (
        Time(sec=5, nanosec=6), states.statuses)


def cloud_of(bodies, margin=0.0):
    """Return the points of the serialised cloud, as a subscriber finds them, and the state."""
    scene = scene_of(bodies, margin)
    cloud = deserialize(serialize(contact_cloud(scene, 'robot', Time(sec=9))), PointCloud2)
    assert (cloud.header.stamp.sec, cloud.header.frame_id) == (9, 'map')
    assert [field.name for field in cloud.fields] == FIELDS
    kind = np.dtype({'names': FIELDS, 'formats': [KINDS[field.datatype] for field in cloud.fields],
                     'offsets': [field.offset for field in cloud.fields],
                     'itemsize': cloud.point_step})
    assert cloud.row_step == len(cloud.data) == cloud.width * cloud.point_step
    assert (cloud.height, cloud.is_dense, cloud.is_bigendian) == (1, True, False)
    points = np.frombuffer(bytes(cloud.data), kind)
    return [tuple(point.tolist()) for point in np.sort(points)], scene.state('robot')


def test_points_of_contact_have_position_normal_depth_and_obstacle():
    """An edge on the right, a point inside near the lower edge, and an obstacle apart."""
    points, state = cloud_of([box(1, 0.25, 1, 0.5), box(9, 9), [(0.5, 0.125)]])
    assert [obstacle.key for obstacle in state.contacts] == [0, 2]
    assert points == [(0.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.125, 1),
                      (1.0, 0.25, 0.0, -1.0, 0.0, 0.0, 0.0, 0),
                      (1.0, 0.75, 0.0, -1.0, 0.0, 0.0, 0.0, 0)]


@pytest.mark.parametrize('body, points', [
    # The depth is minus the distance, and the point still one of the footprint.
    ([(1.25, 0.5)], [(1.0, 0.5, 0.0, -1.0, 0.0, 0.0, -0.25, 0)]), (box(9, 9), [])],
    ids=['within the margin', 'apart'])
def test_points_of_contact_with_a_margin(body, points):
    assert cloud_of([body], margin=0.5)[0] == points


def test_number_of_obstacles_in_a_cloud_is_limited():
    points, state = cloud_of([[(0.5, 0.001 * k)] for k in range(MAX_CONTACTS + 5)])
    assert len(state.contacts) == MAX_CONTACTS + 5
    assert len(points) == MAX_CONTACTS


def test_markers_draw_the_normals():
    """From each point of contact, by the depth, but long enough to be seen."""
    markers = {marker.ns: marker for marker in Markers().message(
        scene_of([box(1, 0.25, 1, 0.5), box(-0.5, 0.5, 1, 1)])).markers}
    ends = [(point.x, point.y) for point in markers['contacts/normals'].points]
    assert {(1, 0.25), (0.75, 0.25), (1, 0.75), (0.75, 0.75)} <= set(ends)
    assert {(0.0, 1.0), (0.5, 1.0)} <= set(ends) or {(0.0, 0.5), (0.0, 1.0)} <= set(ends)


U_SHAPE = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]


def marks(one, other):
    return contact_marks(Polygon(one), Polygon(other))


def test_overlap_of_convex_bodies_against_shapely():
    random = np.random.default_rng(7)
    overlaps = 0
    for _ in range(200):
        rings = []
        for _ in range(2):
            angles = np.sort(random.uniform(0, 2 * np.pi, random.integers(3, 12)))
            rings.append(np.column_stack([np.cos(angles), np.sin(angles)])
                         + random.uniform(-1, 1, 2))
        bodies = [as_shapely(ring) for ring in rings]
        shared = clip(*rings)
        area = shapely.intersection(*bodies).area
        assert shapely.Polygon(shared).area == pytest.approx(area, abs=1e-9) if len(shared) else (
            area == 0.0)
        overlaps += area > 0.0
    assert overlaps > 50


@pytest.mark.parametrize('x, y', [(0.0, 0.0), (5e5, 5e6)])
@pytest.mark.parametrize('one, other', [
    (box(0, 0), box(1, 0)),
    (box(0, 0), box(1, 1)),
    (box(0, 0, 3, 3), [(1, 1)]),
    (box(0, 0, 3, 3), [(-1, 1), (2, 2)]),
    (box(0, 0), [(1, -1), (1, 3)]),
    ([(0, 0), (4, 0)], [(2, -1), (2, 2)]),
    ([(0, 0), (4, 0)], [(1, 0), (6, 0)]),
    ([(0, 0), (4, 0)], [(4, 0), (6, 2)]),
    ([(1, 1)], [(1, 1)]),
    (U_SHAPE, [(1.5, 2), (2, 2)]),
    (U_SHAPE, box(1, 1)),
    (U_SHAPE, box(0.5, 1.5, 2, 1)),
], ids=str)
def test_marks_of_contacts_against_shapely(one, other, x, y):
    """A point, a segment or an area, in either order, near the origin and far away."""
    one, other = ([(px + x, py + y) for px, py in ring] for ring in (one, other))
    wanted = shapely.intersection(as_shapely(one), as_shapely(other))
    for found in (marks(one, other), marks(other, one)):
        assert {min(len(mark), 3) - 1 for mark in found} == {shapely.get_dimensions(wanted)}
        shared = shapely.union_all([as_shapely(mark) for mark in found])
        assert shapely.hausdorff_distance(shared, wanted) < 1e-6 * (1 + abs(y) / 1e3)


def test_mark_within_the_margin_spans_the_gap():
    mark, = marks(box(0, 0), box(1.5, 0.5))
    assert sorted(mark[:, 0].tolist()) == [1.0, 1.5]


def test_mark_of_bodies_with_many_parts_is_one_segment():
    """Two combs in each other; it connects their nearest points."""
    comb = [(x / 2, 3 if x % 2 else 1) for x in range(200)] + [(100, 0), (0, 0)]
    (mark,) = marks(comb, [(x, -y) for x, y in reversed(comb)])
    assert mark.shape == (2, 2) and np.allclose(mark[:, 1], 0.0)


GREEN, RED, GREY = 'green', 'red', 'grey'


@pytest.fixture
def scene():
    """Return a scene of two footprints and two sources with an empty set each."""
    scene = Scene(Settings(
        tuple(FootprintSettings(name, f'/{name}', timeout=0.0) for name in ('a', 'b')),
        tuple(ObstacleSettings(name, f'/{name}', timeout=100.0, set_end='empty_polygon',
                               assume_no_loss=True) for name in ('map', 'people'))))
    for name in ('map', 'people'):
        see(scene, name, stamp=SECOND // 2)
    return scene


def place(scene, name, *bodies, stamp=SECOND):
    """Put a footprint, or some obstacles, where their points are."""
    put = scene.footprint if name in ('a', 'b') else scene.obstacle
    for points in bodies:
        put(name, Polygon(points).packed if points else None, 'map', stamp, 9 * SECOND)


def see(scene, name, *bodies, stamp=SECOND):
    """Put the obstacles of a whole set where their points are."""
    place(scene, name, *bodies, None, stamp=stamp)


def drawn(scene, markers=None):
    """Return the markers by namespace and id, after checks that apply to all."""
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
    """Clear, in contact, and unknown."""
    place(scene, 'a', box(0, 0))
    place(scene, 'b', box(5, 5))
    see(scene, 'map', box(5.5, 5.5))
    see(scene, 'people')
    markers = drawn(scene)
    for part in ('fill', 'outline'):
        assert colour(markers[f'a/{part}', 0]) == GREEN
        assert colour(markers[f'b/{part}', 0]) == RED
    scene.refuse('people', 'not finite', 9 * SECOND, 9 * SECOND)
    markers = drawn(scene)
    assert colour(markers['a/fill', 0]) == GREY and colour(markers['b/fill', 0]) == RED


def test_obstacles_are_neutral_or_red(scene):
    """Red in contact."""
    place(scene, 'a', box(0, 0))
    place(scene, 'map', box(3, 0), box(1, 0), box(5, 0))
    markers = drawn(scene)
    assert colour(markers['map/fill', 0]) is None and colour(markers['map/fill', 1]) == RED
    assert len(markers['map/outline', 0].points) == 2 * 2 * 4
    assert set(map(tuple, xy(markers['map/outline', 1]))) == set(box(1, 0))


def test_outline_and_fill_of_a_non_convex_body(scene):
    """The triangles of the fill cover it exactly."""
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
    """A point as a sphere, a segment as a line; neither has a fill."""
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
    """Regions, a point and a segment shared with obstacles."""
    place(scene, 'a', box(0, 0, 2, 2))
    place(scene, 'b', box(5, 0, 2, 2))
    place(scene, 'map', box(1, 1, 5, 2), [(0, -1), (0, 1)])
    place(scene, 'people', [(0.5, 0.5)])
    markers = drawn(scene)
    regions = xy(markers['contacts/regions', 2]).reshape(-1, 3, 2)
    shared = shapely.union_all([shapely.box(1, 1, 2, 2), shapely.box(5, 1, 6, 2)])
    assert shapely.union_all(shapely.polygons(regions)).equals(shared)
    assert sorted(xy(markers['contacts/segments', 2]).tolist()) == [[0, 0], [0, 1]]
    assert xy(markers['contacts/points', 2]).tolist() == [[0.5, 0.5]]
    assert markers['a/name', 0].text == 'a: in contact with map/0, map/1, people/0'
    assert markers['b/name', 0].text == 'b: in contact with map/0'
    assert ('nearest/axis', 2) in markers, 'b and people are apart'


def test_labels_of_footprints(scene):
    """With the status unless it is clear."""
    place(scene, 'a', box(0, 0))
    place(scene, 'b', box(5, 5))
    assert {drawn(scene)[f'{name}/name', 0].text for name in 'ab'} == {'a: unknown', 'b: unknown'}
    for name in ('map', 'people'):
        see(scene, name, box(9, 9))
    text = drawn(scene)['a/name', 0]
    assert text.text == 'a' and colour(text) == GREEN
    assert text.pose.position.x == 0.5 and 1.0 < text.pose.position.y < 1.5


def test_nearest_pair_and_its_axis(scene):
    """Closest points, distance and separating axis."""
    place(scene, 'a', box(0, 0))
    place(scene, 'b', box(0, 20))
    see(scene, 'map', box(3, 0.5))
    see(scene, 'people', box(2, 30))
    markers = drawn(scene)
    assert xy(markers['nearest/points', 2])[:, 0].tolist() == [1, 3]
    assert markers['nearest/distance', 0].text == 'a - map/0: 2 m'
    left, right = xy(markers['nearest/axis', 2])
    assert left[1] == right[1] and left[0] < 1 and right[0] > 3
    see(scene, 'people', box(0, 21.5), stamp=2 * SECOND)
    assert drawn(scene)['nearest/distance', 0].text == 'b - people/0: 0.5 m'


def test_pairs_in_contact_and_unknown_footprints_have_no_axis(scene):
    place(scene, 'a', box(0, 0))
    for k, x in enumerate((1, 0.5), 1):
        see(scene, 'map', box(x, 0), stamp=k * SECOND)
        assert ('nearest/axis', 2) not in drawn(scene)
    see(scene, 'map', box(3, 0), stamp=3 * SECOND)
    see(scene, 'people')
    assert ('nearest/axis', 2) in drawn(scene)
    scene.refuse('people', 'not finite', 9 * SECOND, 9 * SECOND)
    assert ('nearest/axis', 2) not in drawn(scene)


def test_removed_bodies_are_not_drawn(scene):
    """A refused footprint; after a step back in time only DELETEALL is left in the end."""
    markers = Markers()
    place(scene, 'a', box(0, 0))
    place(scene, 'b', box(5, 5))
    place(scene, 'map', box(7, 7))
    assert {'a/fill', 'b/fill', 'map/fill'} <= {ns for ns, _ in drawn(scene, markers)}
    scene.refuse('b', 'not finite', 9 * SECOND, 9 * SECOND)
    assert not [ns for ns, _ in drawn(scene, markers) if ns.startswith('b/')]
    scene.pass_time(SECOND)
    assert {ns for ns, _ in drawn(scene, markers)} == {'map/fill', 'map/outline'}
    scene.pass_time(101 * SECOND + 1)
    assert drawn(scene, markers) == {}


def test_obstacles_of_one_name_are_all_drawn(scene):
    """Those of a set that is not whole yet, beside that of the set before, which touches."""
    place(scene, 'a', box(0, 0))
    see(scene, 'map', box(0.5, 0))
    place(scene, 'map', box(7, 7))
    markers = drawn(scene)
    assert [len(markers['map/outline', touching].points) for touching in (0, 1)] == [8, 8]
    assert {point.x for point in markers['map/outline', 0].points} == {7, 8}


def test_bodies_may_be_called_as_what_is_drawn_of_pairs():
    """Points, each of which is one: `drawn` finds that no marker replaces another."""
    scene = Scene(Settings(
        tuple(FootprintSettings(name, f'/{name}', timeout=0.0) for name in ('nearest', 'limit')),
        (ObstacleSettings('contacts', '/contacts', timeout=100.0, set_end='each_message'),)))
    for name, stamp in (('nearest', 0), ('limit', 2)):
        scene.footprint(name, Polygon([(stamp, 0)]).packed, 'map', SECOND, 9 * SECOND)
    scene.obstacle('contacts', Polygon([(0, 0)]).packed, 'map', SECOND, 9 * SECOND, number=1)
    markers = drawn(scene)
    assert {('contacts/points', 1), ('contacts/points', 2), ('nearest/points', 0),
            ('nearest/points', 2)} <= markers.keys()


def test_only_the_nearest_of_very_many_obstacles_are_drawn(scene):
    """Drawing all of them would hold up the flags; a text says so."""
    place(scene, 'a', box(1000, 0))
    place(scene, 'b', box(0, 100))
    see(scene, 'map', *([(x, 0)] for x in range(MAX_DRAWN - 1)), [(0, 90)], [(1000, 0.5)])
    markers = drawn(scene)
    assert markers.pop(('limit/text', 0)).text == f'the {MAX_DRAWN} nearest obstacles are drawn'
    assert len(xy(markers['map/points', 0])) + len(xy(markers['map/points', 1])) == MAX_DRAWN
    place(scene, 'people', [(5000, 0)], [(0, 95)])
    markers = drawn(scene)
    assert xy(markers['people/points', 0]).tolist() == [[0, 95]]
    assert len(xy(markers['map/points', 0])) + len(xy(markers['map/points', 1])) == MAX_DRAWN - 1


def test_fewer_obstacles_of_many_vertices_are_drawn(scene):
    """And their contacts: each pair of convex parts takes time."""
    place(scene, 'a', box(0, 0))
    see(scene, 'map', *((shapes.star(64) + 0.01 * k).tolist() for k in range(40)))
    markers = drawn(scene)
    count = len(markers['map/outline', 1].points) // 256
    assert 10 < count < 40
    assert markers['limit/text', 0].text == f'the {count} nearest obstacles are drawn'
    cloud = contact_cloud(scene, 'a', Time(sec=9))
    found = np.frombuffer(bytes(cloud.data), np.uint32).reshape(-1, cloud.point_step // 4)[:, -1]
    assert 1 < len({*found.tolist()}) < 40
    place(scene, 'b', shapes.star(64).tolist())
    assert contact_cloud(scene, 'b', Time(sec=9)).width > 0


def test_points_of_unchanged_polygons_are_reused(scene):
    markers = Markers()
    place(scene, 'a', box(0, 0))
    see(scene, 'map', box(7, 7))
    before = drawn(scene, markers)
    see(scene, 'map', box(8, 7), stamp=2 * SECOND)
    after = drawn(scene, markers)
    assert after['a/fill', 0].points[0] is before['a/fill', 0].points[0]
    assert xy(after['map/outline', 0])[0].tolist() == [8, 7]
