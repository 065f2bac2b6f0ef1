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

"""The points of contacts as a cloud, and the region that two bodies share."""

from builders import box, SECOND
import numpy as np
import pytest
from sat_collision import Polygon
from sat_collision.messages.interfaces import deserialize, PointCloud2, serialize, Time
from sat_collision.messages.outputs import contact_cloud, MOST_CONTACTS
from sat_collision.messages.shared_region import clip, contact_marks
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
import shapely

FIELDS = ['x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth', 'obstacle']
KINDS = {7: '<f4', 6: '<u4'}


def scene_of(bodies, margin=0.0):
    """Return a scene of a robot from 0 to 1, and of a set of obstacles."""
    scene = Scene(Settings(
        (FootprintSettings('robot', '/robot', timeout=0.0),),
        (ObstacleSettings('map', '/map', timeout=60.0),), margin=margin))
    scene.footprint('robot', Polygon(box(0, 0)).packed, 'map', SECOND, 9 * SECOND)
    for number, body in enumerate(bodies, 1):
        scene.obstacle('map', Polygon(body).packed, 'map', SECOND, 9 * SECOND, number=number)
    return scene


def cloud_of(bodies, margin=0.0):
    """Return the cloud after its way through the wire, and its points as any reader finds them."""
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


def test_points_have_place_normal_depth_and_obstacle():
    """An edge on the right, a point below, deep; what is apart has no points."""
    points, state = cloud_of([box(1, 0.25, 1, 0.5), box(9, 9), [(0.5, 0.125)]])
    assert [obstacle.key for obstacle in state.contacts] == [0, 2]
    assert points == [(0.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.125, 1),
                      (1.0, 0.25, 0.0, -1.0, 0.0, 0.0, 0.0, 0),
                      (1.0, 0.75, 0.0, -1.0, 0.0, 0.0, 0.0, 0)]


def test_bodies_within_the_margin_have_a_negative_depth():
    """Their distance; the point is still one of the footprint."""
    points, _ = cloud_of([[(1.25, 0.5)]], margin=0.5)
    assert points == [(1.0, 0.5, 0.0, -1.0, 0.0, 0.0, -0.25, 0)]


def test_a_footprint_in_no_contact_has_no_points():
    """The cloud is empty, and still says stamp and frame."""
    assert cloud_of([box(9, 9)])[0] == []


def test_no_more_obstacles_than_there_is_time_for():
    """Who touches very many sees the points of some."""
    points, state = cloud_of([[(0.5, 0.001 * k)] for k in range(MOST_CONTACTS + 5)])
    assert len(state.contacts) == MOST_CONTACTS + 5
    assert len(points) == MOST_CONTACTS


def test_markers_draw_the_normals():
    """From each point of contact, as far as the way out, and long enough to be seen."""
    pytest.importorskip('visualization_msgs')
    from sat_collision.messages.markers import Markers
    markers = {marker.ns: marker for marker in Markers().message(
        scene_of([box(1, 0.25, 1, 0.5), box(-0.5, 0.5, 1, 1)])).markers}
    ends = [(point.x, point.y) for point in markers['contacts/normals'].points]
    assert {(1, 0.25), (0.75, 0.25), (1, 0.75), (0.75, 0.75)} <= set(ends)
    assert {(0.0, 1.0), (0.5, 1.0)} <= set(ends) or {(0.0, 0.5), (0.0, 1.0)} <= set(ends)


U_SHAPE = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]


def shape(ring):
    """Return the shapely body of a ring."""
    kind = {1: shapely.Point, 2: shapely.LineString}.get(len(ring), shapely.Polygon)
    return kind(ring if len(ring) > 1 else ring[0])


def marks(one, other):
    return contact_marks(Polygon(one), Polygon(other))


def test_overlap_of_convex_bodies_is_what_shapely_says():
    """Random polygons around a circle, of which many overlap."""
    random = np.random.default_rng(7)
    overlaps = 0
    for _ in range(200):
        rings = []
        for _ in range(2):
            angles = np.sort(random.uniform(0, 2 * np.pi, random.integers(3, 12)))
            rings.append(np.column_stack([np.cos(angles), np.sin(angles)])
                         + random.uniform(-1, 1, 2))
        bodies = [shape(ring) for ring in rings]
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
def test_touching_is_marked_by_what_is_shared(one, other, x, y):
    """A point, a segment or an area, whoever is the footprint; near the origin and far away."""
    one, other = ([(px + x, py + y) for px, py in ring] for ring in (one, other))
    wanted = shapely.intersection(shape(one), shape(other))
    for found in (marks(one, other), marks(other, one)):
        assert found and {min(len(mark), 3) for mark in found} == {wanted_size(wanted)}
        shared = shapely.union_all([shape(mark) for mark in found])
        assert shapely.hausdorff_distance(shared, wanted) < 1e-6 * (1 + abs(y) / 1e3)


def wanted_size(body):
    """Return how many points a mark of a body has at least."""
    return {0.0: 1 if body.length == 0.0 else 2}.get(body.area, 3)


def test_within_the_margin_the_gap_is_marked():
    """From one body to the other, where they are nearest."""
    mark, = marks(box(0, 0), box(1.5, 0.5))
    assert sorted(mark[:, 0].tolist()) == [1.0, 1.5]


def test_bodies_of_very_many_parts_are_marked_where_they_are_deepest():
    """Two combs in each other: one segment between their nearest points, and soon."""
    comb = [(x / 2, 3 if x % 2 else 1) for x in range(200)] + [(100, 0), (0, 0)]
    (mark,) = marks(comb, [(x, -y) for x, y in reversed(comb)])
    assert mark.shape == (2, 2) and np.allclose(mark[:, 1], 0.0)
