# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages: the bytes that publishers send, written without ROS, and ROS's own objects."""

import math
import struct

_ENCAPSULATIONS = {'<': b'\0\1\0\0', '>': b'\0\0\0\0'}
SECOND = 10**9


def box(x, y=0.0, width=1.0, height=1.0):
    """Return the corners of a box with its lower left one at (x, y)."""
    return [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]


def serialised(points, stamp=1000 * SECOND, frame_id='map', instance=None, order='<'):
    """
    Write a PolygonStamped, or a PolygonInstanceStamped if there is an id.

    Points are (x, y) or (x, y, z), the stamp is in ns, and '>' is the order of a big-endian
    publisher.
    """
    body = _with_count(_header(stamp, frame_id, order), points, order)
    body += b''.join(struct.pack(order + 'fff', x, y, *(z or (0.0,))) for x, y, *z in points)
    if instance is not None:
        body += bytes(-len(body) % 8) + struct.pack(order + 'q', instance)
    return _ENCAPSULATIONS[order] + body


def collection(polygons, stamp=1000 * SECOND, frame_id='map', order='<', colors=0):
    """Write a Polygon2DCollection of polygons, each a list of (x, y), and of so many colours."""
    body = _with_count(_header(stamp, frame_id, order), polygons, order)
    for points in polygons:
        body = _with_points_2d(body, points, order)
    return _ENCAPSULATIONS[order] + body + struct.pack(
        f'{order}I{4 * colors}f', colors, *[0.5] * 4 * colors)


def polygon_2d(points, stamp=1000 * SECOND, frame_id='map', order='<'):
    """Write a Polygon2DStamped."""
    return _ENCAPSULATIONS[order] + _with_points_2d(_header(stamp, frame_id, order), points, order)


def _header(stamp, frame_id, order):
    return _with_name(struct.pack(order + 'iI', *divmod(stamp, SECOND)), frame_id, order)


def _with_name(body, name, order):
    text = name.encode() + b'\0'
    return _with_count(body, text, order) + text


def _with_count(body, items, order):
    return body + bytes(-len(body) % 4) + struct.pack(order + 'I', len(items))


def _with_doubles(body, numbers, order):
    return body + bytes(-len(body) % 8) + struct.pack(f'{order}{len(numbers)}d', *numbers)


def _pose(numbers):
    """Return a translation and a quaternion: as they are, or of x, y and maybe a heading."""
    if len(numbers) == 7:
        return numbers
    x, y, yaw = (*numbers, 0.0)[:3]
    return x, y, 0.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def _with_points_2d(body, points, order):
    """Append the points of a polygon; padding is not zero, as from the middleware."""
    body = _with_count(body, points, order)
    if len(points):
        body += b'\xaa' * (-len(body) % 8)
    return body + b''.join(struct.pack(order + '2d', x, y) for x, y in points)


def transforms(*links):
    """
    Write a TFMessage of links: parent, child, stamp in ns, x and y, and the heading if not 0.

    A link that ends with seven numbers has these for its translation and quaternion.
    """
    body = struct.pack('<I', len(links))
    for parent, child, stamp, *numbers in links:
        body = _with_name(body + _header(stamp, parent, '<'), child, '<')
        body = _with_doubles(body, _pose(numbers), '<')
    return b'\0\1\0\0' + body


def odometry(parent, child, stamp, x, y, yaw=0.0, order='<', twist=(0.0, 0.0, 0.0)):
    """Write an Odometry, which stands still unless a twist (vx, vy, omega) is given."""
    vx, vy, omega = twist
    covariance = [0.0] * 36
    return _ENCAPSULATIONS[order] + _with_doubles(
        _with_name(_header(stamp, parent, order), child, order),
        [*_pose((x, y, yaw)), *covariance, vx, vy, 0.0, 0.0, 0.0, omega, *covariance], order)


def command(vx, vy=0.0, omega=0.0, stamp=0, frame_id='', order='<'):
    """Write a TwistStamped; components out of the plane are nonsense, as they are not read."""
    return _ENCAPSULATIONS[order] + _with_doubles(
        _header(stamp, frame_id, order), (vx, vy, math.nan, 7.0, 8.0, omega), order)


def path(poses, stamp=0, frame_id='odom', order='<', pose_frame=''):
    """
    Write a Path of x, y and yaw, or of x, y, z and a quaternion.

    The frames of the poses are all the same, or given one by one.
    """
    body = _with_count(_header(stamp, frame_id, order), poses, order)
    frames = [pose_frame] * len(poses) if isinstance(pose_frame, str) else pose_frame
    for frame, numbers in zip(frames, poses, strict=True):
        body = _with_name(body + struct.pack(order + 'iI', 7, 8), frame, order)
        body = _with_doubles(body, _pose(numbers), order)
    return _ENCAPSULATIONS[order] + body


def polygon_message(points, stamp=1000 * SECOND, frame_id='map', instance=None):
    """Build the message that `serialised` writes."""
    from geometry_msgs.msg import Point32, PolygonInstanceStamped, PolygonStamped
    message = PolygonStamped() if instance is None else PolygonInstanceStamped()
    message.header.frame_id = frame_id
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
    polygon = message.polygon
    if instance is not None:
        polygon.id = instance
        polygon = polygon.polygon
    polygon.points = [Point32(**dict(zip('xyz', map(float, point)))) for point in points]
    return message
