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

"""Clouds of the points where footprints touch."""

from builders import box, SECOND
import numpy as np
import pytest
from sat_collision import Polygon
from sat_collision.messages.interfaces import deserialize, PointCloud2, serialize, Time
from sat_collision.messages.outputs import contact_cloud, MOST_CONTACTS
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings

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
