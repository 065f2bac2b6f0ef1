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

"""The bag that replay writes, against what the live node publishes, and without any ROS."""

import math
import subprocess
import sys
import textwrap

import pytest
from recordings import box, drive, SOURCE, START, write
from rosbags.highlevel import AnyReader
from sat_collision.replay.model.options import Options
from sat_collision.replay.run import check

SECOND = 10**9
WITHOUT_ROS = """
    import importlib.abc, sys
    class NoRos(importlib.abc.MetaPathFinder):
        def find_spec(self, name, path=None, target=None):
            if name.split('.')[0] in ('rclpy', 'rcl_interfaces') or '_msgs' in name or (
                    name.split('.')[0] == 'builtin_interfaces'):
                raise ImportError(name)
    sys.meta_path.insert(0, NoRos())
"""


def written(path):
    """Return the messages of a written bag by topic, each with its time since START."""
    found = {}
    with AnyReader([path]) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append(((time - START) / SECOND, message))
    return found


def run_without_ros(program, *arguments):
    """Run a program in a process that cannot import ROS; return its output."""
    return subprocess.run([sys.executable, '-c',
                           textwrap.dedent(WITHOUT_ROS) + textwrap.dedent(program),
                           *arguments], check=True, capture_output=True, text=True).stdout


def test_written_bag_has_the_flags_at_the_right_times(tmp_path):
    """Raised when the contact begins, lowered when it ends, repeated at publish_rate."""
    check(write(tmp_path / 'bag', drive()), Options(as_live=True, write_bag=str(tmp_path / 'out')))
    topics = written(tmp_path / 'out')
    assert set(topics) == {f'/footprint_monitor/{name}' for name in (
        'collision', 'footprint/collision', 'footprint/separation', 'footprint/contacts',
        'footprint/time_to_collision', 'state', 'markers')}
    for name in ('collision', 'footprint/collision'):
        flags = [(time, flag.data) for time, flag in topics[f'/footprint_monitor/{name}']]
        changes = [flags[0]] + [b for a, b in zip(flags, flags[1:]) if a[1] != b[1]]
        assert changes == [(0.0, True), (0.1, False), (4.0, True), (5.0, False)]
        assert len(flags) >= 100
    for time, array in topics['/footprint_monitor/state']:
        status, = array.status
        values = {pair.key: pair.value for pair in status.values}
        stamp = array.header.stamp
        assert (stamp.sec * SECOND + stamp.nanosec - START) / SECOND == time
        if 4.05 < time < 4.95:
            assert (status.level, values['obstacles in contact']) == (2, f'{SOURCE}/0')
    separations = dict(topics['/footprint_monitor/footprint/separation'])
    assert math.isnan(separations[0.0].data)
    assert (separations[2.0].data, separations[4.5].data) == (2.0, -0.25)
    soonest = dict(topics['/footprint_monitor/footprint/time_to_collision'])
    assert math.isnan(soonest[0.0].data) and math.isinf(soonest[2.0].data)
    assert soonest[4.5].data == 0.0
    markers = topics['/footprint_monitor/markers']
    assert len(markers) == 101
    assert {marker.ns for marker in dict(markers)[4.5].markers} >= {
        'footprint/fill', f'{SOURCE}/outline', 'contacts/regions'}


def test_written_markers_follow_bodies_whose_state_stays(tmp_path):
    """A robot drives and meets nothing: it is drawn where it was at each time."""
    messages = [message for k in range(21) for message in (
        ('/footprint', k / 10, box(k / 4)), ('/obstacles', k / 10, box(50)))]
    check(write(tmp_path / 'bag', messages),
          Options(as_live=True, write_bag=str(tmp_path / 'out')))
    places = {}
    for time, array in written(tmp_path / 'out')['/footprint_monitor/markers']:
        for marker in array.markers:
            if marker.ns == 'footprint/outline':
                places[time] = min(point.x for point in marker.points)
    assert places == {k / 10: k / 4 for k in range(21)}


def test_written_bag_is_the_same_without_ros(tmp_path):
    """Message classes of rosbags in place of rclpy's: all messages are equal."""
    pytest.importorskip('rclpy')
    bag = write(tmp_path / 'bag', drive(2.0, contact=(1.0, 1.5)))
    check(bag, Options(as_live=True, write_bag=str(tmp_path / 'ros')))
    out = run_without_ros("""
        from sat_collision.replay.model.options import Options
        from sat_collision.replay.run import check
        result = check(sys.argv[1], Options(as_live=True, write_bag=sys.argv[2]))
        print(result.problems, len(result.contacts), 'rclpy' in sys.modules)
    """, str(bag), str(tmp_path / 'plain'))
    assert out == '[] 1 False\n'
    with_ros, without = written(tmp_path / 'ros'), written(tmp_path / 'plain')
    assert len(with_ros) == 7
    assert repr(with_ros) == repr(without)


def test_other_encodings_are_read_without_ros():
    """Big-endian messages go through rosbags' decoder, damaged ones through none."""
    rclpy = pytest.importorskip('rclpy')
    assert rclpy
    out = run_without_ros("""
        import struct
        from sat_collision.messages.cdr import decode, MessageError
        from sat_collision.messages.rosbags_interfaces import message_class, STORE
        for instance, kind in ((False, 'geometry_msgs/msg/PolygonStamped'),
                               (True, 'geometry_msgs/msg/PolygonInstanceStamped')):
            message = message_class(kind)()
            message.header.frame_id = 'map'
            message.header.stamp.sec = 5
            inner = message.polygon.polygon if instance else message.polygon
            point = message_class('geometry_msgs/msg/Point32')
            inner.points = [point(x=1.0, y=2.0), point(x=3.0)]
            data = bytes(STORE.serialize_cdr(message, kind, little_endian=False))
            stamp, frame_id, (buffer, at, count), identity = decode(data, instance)
            points = list(struct.iter_unpack('=fff', buffer[at:at + 12 * count]))
            print(stamp, frame_id, points, identity)
            for bad in (data[:-1], data + bytes(8), b'\\0\\3' + data[2:], data[:9]):
                try:
                    decode(bad, instance)
                    print('accepted', bad)
                except MessageError:
                    pass
    """)
    points = '[(1.0, 2.0, 0.0), (3.0, 0.0, 0.0)]'
    assert out.splitlines() == [f'5000000000 map {points} None', f'5000000000 map {points} 0']


def test_markers_of_points_and_silence_are_written(tmp_path):
    """A gap without any message is filled at the rate: silence would mean that the node died."""
    messages = [(topic, time, points) for time in (0.0, 3.0)
                for topic, points in (('/footprint', box(0)), ('/obstacles', [(2.0, 0.5)]))]
    check(write(tmp_path / 'bag', messages),
          Options(as_live=True, write_bag=str(tmp_path / 'out')))
    flags = written(tmp_path / 'out')['/footprint_monitor/collision']
    assert max(b[0] - a[0] for a, b in zip(flags, flags[1:])) <= 0.1001
    assert any(flag.data for time, flag in flags if time > 1.0)
