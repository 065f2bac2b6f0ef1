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

"""Where and how a footprint touches obstacles, as sensor_msgs/PointCloud2."""

from __future__ import annotations

from itertools import islice
import sys
from typing import Any

import numpy as np
from sat_collision.geometry.contact import contact
from sat_collision.messages.interfaces import octets, PointCloud2, PointField
from sat_collision.scene.scene import Scene

# Of no more obstacles, each of which costs time.
MOST_CONTACTS = 50

_NUMBERS = ('x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth')
_POINT = np.dtype([*((name, np.float32) for name in _NUMBERS), ('obstacle', np.uint32)])
_FIELDS = [
    *(PointField(name=name, offset=4 * k, count=1, datatype=PointField.FLOAT32)
      for k, name in enumerate(_NUMBERS)),
    PointField(name='obstacle', offset=4 * len(_NUMBERS), count=1, datatype=PointField.UINT32)]


def contact_cloud(scene: Scene, name: str, stamp: Any) -> Any:
    """
    Return the points of contact of a footprint; none while it is in no contact.

    Each point is one of the footprint, in the fixed frame, with z = 0. Its normal is the unit
    vector from the obstacle to the footprint; moved by depth (m) along it, the footprint is out
    of the obstacle. Where bodies within the margin are apart, minus the depth is their distance.
    The obstacle is the place of its name in what the state of that stamp lists, from 0 on.

    Parameters
    ----------
    scene : Scene
    name : str
        Of the footprint.
    stamp : builtin_interfaces.msg.Time

    """
    places = {obstacle: k for k, obstacle in enumerate(scene.state(name).contacts)}
    rows = []
    for obstacle, own, other in islice(scene.contacts(name), MOST_CONTACTS):
        if obstacle in places:
            found = contact(own, other)
            depth = -found.separation if found.separation > 0.0 else found.depth
            rows += [(x, y, 0.0, *found.normal, 0.0, depth, places[obstacle])
                     for x, y in found.points_a]
    points = np.array(rows, _POINT)
    cloud = PointCloud2(height=1, width=len(points), fields=_FIELDS, is_dense=True,
                        is_bigendian=sys.byteorder == 'big', point_step=_POINT.itemsize,
                        row_step=points.nbytes, data=octets(points.tobytes()))
    cloud.header.stamp = stamp
    cloud.header.frame_id = scene.frame_id
    return cloud
