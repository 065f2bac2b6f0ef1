# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Decoding of serialised messages, against rclpy and rosbags."""

from collections import Counter
from contextlib import suppress
from functools import partial
import struct
import subprocess
import sys
import tracemalloc
from typing import Callable, NamedTuple

from builders import (
    box, collection, command, odometry, path, polygon_2d, polygon_message, SECOND, serialised,
    transforms)
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
from monitors import START
import numpy as np
import pytest
from rclpy.serialization import deserialize_message as deserialize
from recordings import TYPES
from sat_collision.messages.cdr import (
    decode, decode_collection, decode_command, decode_odometry, decode_path, decode_polygon_2d,
    decode_transforms, header_stamp, MessageError, stamped)
from sat_collision.messages.interfaces import serialize
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings

POINTS = [(1.0, 2.0, 3.0), (-4.0, 0.125, 0.0), (1e30, -0.0, 5.0)]
PAIRS = [(600_000.1, 2.0), (-4.0, 0.125), (1e300, -0.0)]
POSES = [(k, 0.5 * k, 0.0, 0.1, 0.2, 0.3, 0.4) for k in range(8)]
STAMP = 7 * SECOND + 8
TF = 'tf2_msgs/msg/TFMessage'
NAMES = ('a', 'map', 'odom', 'größe', 'base_footprint')


class Kind(NamedTuple):
    """A type of message: a valid one, which may be given an order, and two decoders."""

    good: Callable
    read: Callable
    reference: Callable
    stamp_at: int = 4  # of the first stamp, which is followed by the length of a name and the name


def read_polygon(data, with_id=False):
    stamp, frame_id, (points, start, count, step), identity = decode(data, with_id)
    assert step == 3
    points = struct.iter_unpack('=fff', points[start:start + 12 * count])
    return stamp, frame_id, list(points), identity


def read_by_rclpy(data, with_id=False):
    message = deserialize(data, PolygonInstanceStamped if with_id else PolygonStamped)
    polygon = message.polygon.polygon if with_id else message.polygon
    return (stamp_of(message.header), message.header.frame_id,
            [(p.x, p.y, p.z) for p in polygon.points], message.polygon.id if with_id else None)


def read_polygon_2d(data):
    stamp, frame_id, (points, start, count, step), _ = decode_polygon_2d(data)
    assert step == 2
    return stamp, frame_id, points_2d(points, start, count)


def read_collection(data):
    stamp, frame_id, (payload, spans, _, _), _ = decode_collection(data)
    spans = np.asarray(spans).reshape(-1, 2).tolist()
    return stamp, frame_id, [points_2d(payload, start, count) for start, count in spans]


def points_2d(data, start, count):
    return [*struct.iter_unpack('=2d', data[start:start + 16 * count])]


def stamp_of(header):
    return header.stamp.sec * SECOND + header.stamp.nanosec


def numbers_of(place, rotation):
    return place.x, place.y, place.z, rotation.x, rotation.y, rotation.z, rotation.w


def read_transforms_by_rosbags(data):
    return [(one.header.frame_id, one.child_frame_id, stamp_of(one.header),
             numbers_of(one.transform.translation, one.transform.rotation))
            for one in TYPES.deserialize_cdr(data, TF).transforms]


def by_rosbags(name, contents):
    """Return a decoder of a type: stamp, frame and what a function finds in its message."""
    def read(data):
        message = TYPES.deserialize_cdr(data, name)
        return stamp_of(message.header), message.header.frame_id, contents(message)
    return read


def pairs_of(polygon):
    return [(point.x, point.y) for point in polygon.points]


def twist_of(twist):
    return twist.linear.x, twist.linear.y, twist.angular.z


def read_odometry_by_rosbags(data):
    message = TYPES.deserialize_cdr(data, 'nav_msgs/msg/Odometry')
    pose = message.pose.pose
    return ((message.header.frame_id, message.child_frame_id, stamp_of(message.header),
             numbers_of(pose.position, pose.orientation)), twist_of(message.twist.twist))


def read_path(data):
    """Read a path, of which more poses than there are would be refused."""
    stamp, frame_id, poses = decode_path(data, len(POSES))
    if isinstance(poses, int):
        raise MessageError(f'{poses} poses')
    return stamp, frame_id, poses.tolist()


def some_links(seed, count):
    rng = np.random.default_rng(seed)
    return [(*rng.choice(NAMES, 2).tolist(), int(rng.integers(-2**31, 2**31)) * SECOND
             + int(rng.integers(SECOND)), tuple(rng.normal(size=7).tolist()))
            for _ in range(count)]


def written(*links, order='<'):
    """Return the bytes of a TFMessage, as rosbags writes them."""
    types = TYPES.types
    message = types[TF]([types['geometry_msgs/msg/TransformStamped'](
        types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](*divmod(stamp, SECOND)),
                                     parent), child,
        types['geometry_msgs/msg/Transform'](
            types['geometry_msgs/msg/Vector3'](x, y, z),
            types['geometry_msgs/msg/Quaternion'](*rotation)))
        for parent, child, stamp, (x, y, z, *rotation) in links])
    return bytes(TYPES.serialize_cdr(message, TF, little_endian=order == '<'))


KINDS = {
    'polygon': Kind(partial(serialised, POINTS, STAMP), read_polygon, read_by_rclpy),
    'instance': Kind(partial(serialised, POINTS, STAMP, instance=-9),
                     partial(read_polygon, with_id=True), partial(read_by_rclpy, with_id=True)),
    'polygon 2d': Kind(
        partial(polygon_2d, PAIRS, STAMP), read_polygon_2d,
        by_rosbags('polygon_msgs/msg/Polygon2DStamped', lambda one: pairs_of(one.polygon))),
    'collection': Kind(
        partial(collection, [PAIRS, [], PAIRS[:1]], STAMP, colors=1), read_collection,
        by_rosbags('polygon_msgs/msg/Polygon2DCollection',
                   lambda one: [*map(pairs_of, one.polygons)])),
    'transforms': Kind(partial(written, ('map', 'odom', STAMP, (0.5,) * 7), *some_links(1, 2)),
                       decode_transforms, read_transforms_by_rosbags, 8),
    'odometry': Kind(partial(odometry, 'map', 'base', STAMP, 1.0, 2.0, 3.0,
                             twist=(0.5, -0.25, 2.0)), decode_odometry, read_odometry_by_rosbags),
    'command': Kind(
        partial(command, 0.5, -0.25, 3.0, STAMP, 'map'), decode_command,
        by_rosbags('geometry_msgs/msg/TwistStamped', lambda one: twist_of(one.twist))),
    'path': Kind(
        partial(path, POSES, STAMP, 'map', pose_frame='map'), read_path,
        by_rosbags('nav_msgs/msg/Path', lambda one: [
            [*numbers_of(each.pose.position, each.pose.orientation)] for each in one.poses]))}
# Larger messages of those kinds that have no fixed size, and what the node reads them with.
LARGE = {
    'polygon': (serialised(100 * POINTS, STAMP), partial(decode, instance=False)),
    'instance': (serialised(100 * POINTS, STAMP, instance=9), partial(decode, instance=True)),
    'polygon 2d': (polygon_2d(60 * PAIRS, STAMP), decode_polygon_2d),
    'collection': (collection(40 * [PAIRS, []], STAMP), decode_collection),
    'transforms': (written(*some_links(2, 25)), decode_transforms)}
EVERY_KIND = pytest.mark.parametrize('kind', KINDS.values(), ids=KINDS)


def changed(data, at, form, *values):
    """Return bytes with other values at an offset."""
    data = bytearray(data)
    struct.pack_into(form, data, at, *values)
    return bytes(data)


def accepted(kind, messages):
    """Return how many messages are not refused; these must be read as the reference does."""
    count = 0
    for message in messages:
        try:
            received = kind.read(message)
        except MessageError:
            continue
        count += 1
        np.testing.assert_equal(received, kind.reference(message))
    return count


def variants(data, with_bytes=True):
    """Yield a message with each byte changed, and each word that may be a length."""
    for at in range(len(data) if with_bytes else 0):
        for value in {0, 1, 127, 128, 255, data[at] ^ 1} - {data[at]}:
            yield changed(data, at, 'B', value)
    for at in range(4, len(data) - 3, 4):
        word, = struct.unpack_from('<I', data, at)
        for value in (word - 1) % 2**32, (word + 1) % 2**32, len(data), 2**31 - 1, 2**32 - 1:
            yield changed(data, at, '<I', value)


@EVERY_KIND
@pytest.mark.parametrize('order', '<>')
def test_both_byte_orders(kind, order):
    data = kind.good(order=order)
    assert kind.read(data) == kind.reference(data)
    assert kind.read(data) == kind.read(kind.good())


@EVERY_KIND
def test_every_truncation_is_refused(kind):
    data = kind.good()
    for size in range(len(data)):
        with pytest.raises(MessageError):
            kind.read(data[:size])


@EVERY_KIND
@pytest.mark.parametrize('size', (1, 3, 4, 8, 12, 64))
def test_trailing_bytes_are_refused(kind, size):
    """It may be a message of another type."""
    with pytest.raises(MessageError, match='bytes where the contents need'):
        kind.read(kind.good() + bytes(size))


@EVERY_KIND
@pytest.mark.parametrize('length', (0, 5, 2**31, 2**32 - 1))
def test_wrong_length_of_a_name_is_refused(kind, length):
    """Beyond the message, or without room for the NUL."""
    with pytest.raises(MessageError):
        kind.read(changed(kind.good(), kind.stamp_at + 8, '<I', length))


@EVERY_KIND
@pytest.mark.parametrize('text, words', [
    (b'mapx', None), (b'm\xffp\0', 'UTF-8'), (b'm\0p\0', 'does not end where it says')],
    ids=('no NUL', 'not UTF-8', 'NUL within'))
def test_invalid_names_are_refused(kind, text, words):
    with pytest.raises(MessageError, match=words):
        kind.read(kind.good().replace(b'map\0', text, 1))


@EVERY_KIND
def test_nanoseconds_beyond_a_second_are_refused(kind):
    with pytest.raises(MessageError, match='make more than a second'):
        kind.read(changed(kind.good(), kind.stamp_at + 4, '<I', SECOND))


@EVERY_KIND
@pytest.mark.parametrize('data', (b'', b'\0', b'\xff\xff\0\0', b'\0\1\0\0', b'\0\1\0\0\0\0\0',
                                  b'\0\3\0\0\0\0\0\0', b'no CDR at all'))
def test_foreign_bytes_are_refused(kind, data):
    with pytest.raises(MessageError):
        kind.read(data)


@EVERY_KIND
@pytest.mark.parametrize('count', [1000, pytest.param(3000, marks=pytest.mark.long)])
def test_damaged_bytes_are_refused_or_read_as_the_reference_does(kind, count):
    random = np.random.default_rng(5)
    messages = []
    for _ in range(count):
        damaged = bytearray(kind.good())
        for at in random.integers(len(damaged), size=random.integers(1, 4)):
            damaged[at] = random.integers(256)
        messages.append(bytes(damaged))
    assert count / 10 < accepted(kind, messages) < 0.98 * count


@EVERY_KIND
def test_every_byte_and_length_changed(kind):
    """Each byte and each aligned word, one at a time: refused, or read as the reference does."""
    assert accepted(kind, variants(kind.good())) > 100


@pytest.mark.parametrize('name', LARGE)
def test_no_length_makes_a_decoder_work_for_more_than_was_received(name):
    """Memory stays within some times the bytes received, whatever a length promises."""
    data, read = LARGE[name]

    def memory(message):
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        with suppress(MessageError):
            read(message)
        return tracemalloc.get_traced_memory()[1] - before

    read(data)
    tracemalloc.start()
    try:
        for message in variants(data, with_bytes=False):
            # What one reading alone needs, a module loaded by its first error or another thread's
            # share, is not its own.
            assert any(memory(message) < 10 * len(data) for _ in range(3))
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize('kind, message', [
    ('polygon', serialised), ('polygon_instance', partial(serialised, instance=1)),
    ('polygon_collection', lambda ring, stamp: collection([ring], stamp))])
def test_what_is_good_counts_after_any_damaged_message(kind, message):
    """A set of one message is known after each, and the footprint beside it, too."""
    end = 'none' if kind == 'polygon_collection' else 'each_message'
    now = START
    monitor = Monitor(Settings(
        (FootprintSettings('robot', '/robot', timeout=60.0),),
        (ObstacleSettings('lidar', '/lidar', type=kind, set_end=end, timeout=60.0),),
        frame_id='map'))
    numbers = Counter()

    def receive(name, data):
        numbers[name] += 1
        return monitor.receive(name, data, now, numbers[name])
    refused = 0
    for data in variants(message(box(5), START)):
        now += SECOND // 1000
        refused += receive('lidar', data) is not None
        refused += receive('robot', data) is not None
        assert not receive('lidar', message(box(0.5), now))
        assert not receive('robot', serialised(box(0), now))
        assert sorted(box(0.5)) in [sorted(map(tuple, one.vertices.tolist()))
                                    for _, one in monitor.scene.obstacles]
        assert not monitor.scene.source_faults
        assert monitor.scene.state('robot').status.value == 'collision'
    assert refused > 300


@EVERY_KIND
def test_random_bytes_are_refused_or_read_as_the_reference_does(kind):
    random = np.random.default_rng(6)
    accepted(kind, (b'\0\1\0\0' + bytes(random.integers(
        0, random.choice([2, 8, 256]), random.integers(200), np.uint8)) for _ in range(2000)))


@pytest.mark.parametrize('instance', (None, -9))
@pytest.mark.parametrize('length', range(10))
@pytest.mark.parametrize('count', range(4))
def test_every_alignment_of_polygons(instance, length, count):
    """The length of frame_id shifts the points and, with their number, the padding of the id."""
    frame_id = 'frame_name'[:length]
    points = [(k, 0.5 * k, -k) for k in range(count)]
    message = polygon_message(points, STAMP, frame_id, instance)
    data = serialize(message)
    assert read_polygon(data, instance is not None) == (STAMP, frame_id, points, instance)
    ours = serialised(points, STAMP, frame_id, instance)
    assert len(ours) == len(data) and deserialize(ours, type(message)) == message


@pytest.mark.parametrize('parent', range(1, 10))
@pytest.mark.parametrize('child', range(1, 10))
def test_every_alignment_of_transforms(parent, child):
    """The lengths of the names shift the numbers and the next transform."""
    link = 'abcdefghij'[:parent], 'abcdefghij'[:child], -1, (1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8)
    assert decode_transforms(written(link, link)) == [link, link]
    ours = transforms((*link[:3], *link[3]), (*link[:3], *link[3]))
    assert decode_transforms(ours) == [link, link]
    pose = odometry(link[0], link[1], -1, 1.0, 2.0)
    assert decode_odometry(pose) == read_odometry_by_rosbags(pose)


@pytest.mark.parametrize('count', range(6))
@pytest.mark.parametrize('order', '<>')
def test_any_number_of_transforms(count, order):
    for seed in range(20):
        links = some_links(seed, count)
        assert decode_transforms(written(*links, order=order)) == links


@pytest.mark.parametrize('instance', (None, 2**63 - 1))
def test_extreme_values(instance):
    """Time before 1970, the largest id, a frame name beyond ASCII, NaN and infinity."""
    data = serialize(polygon_message([(np.inf, -np.inf, np.nan)], -1, 'größe', instance))
    stamp, frame_id, points, identity = read_polygon(data, instance is not None)
    assert (stamp, frame_id, identity) == (-1, 'größe', instance)
    np.testing.assert_array_equal(points, [(np.inf, -np.inf, np.nan)])
    link = 'map', 'odom', 0, (np.nan, np.inf, -np.inf, 0.0, -0.0, 1e308, 5e-324)
    (_, _, _, numbers), = decode_transforms(written(link))
    np.testing.assert_array_equal(numbers, link[-1])


@pytest.mark.parametrize('name, at', [('polygon', 20), ('instance', 20), ('polygon 2d', 20),
                                      ('collection', 20), ('collection', 24), ('transforms', 4)])
@pytest.mark.parametrize('count', (2, 4, 200_000_000, 2**32 - 1))
def test_wrong_number_of_points_is_refused(name, at, count):
    """A decoder might read no points at all, which would mean no obstacle."""
    with pytest.raises(MessageError):
        KINDS[name].read(changed(KINDS[name].good(), at, '<I', count))


def test_twist_is_a_command_without_stamp_and_frame():
    for order, head in (('<', b'\0\1\0\0'), ('>', b'\0\0\0\0')):
        twist = head + struct.pack(f'{order}6d', 0.5, -0.25, 9.0, 9.0, 9.0, 3.0)
        assert decode_command(stamped(twist)) == (0, '', (0.5, -0.25, 3.0))


@pytest.mark.parametrize('order', '<>')
@pytest.mark.parametrize('sec, nanosec', [(7, 8), (-1, 999_999_999), (0, 0), (5, SECOND)])
def test_header_stamp(sec, nanosec, order):
    """An invalid stamp counts as none."""
    data = changed(serialised(POINTS, order=order), 4, f'{order}iI', sec, nanosec)
    assert header_stamp(data) == (sec * SECOND + nanosec if nanosec < SECOND else 0)
    assert header_stamp(data[:11]) == header_stamp(b'\0\7' + data[2:]) == 0


def test_decoding_needs_neither_ros_nor_rosbags():
    program = ('import sys; from sat_collision.messages.cdr import decode, decode_transforms; '
               f'assert decode({KINDS["instance"].good()!r}, True)[-1] == -9; '
               f'assert len(decode_transforms({KINDS["transforms"].good()!r})) == 3; '
               'assert not {"rclpy", "geometry_msgs", "rosbags"} & set(sys.modules)')
    subprocess.run([sys.executable, '-c', program], check=True)


@pytest.mark.parametrize('length', [3, 4, 5, 8])
@pytest.mark.parametrize('order', ['<', '>'])
def test_each_pose_may_have_the_frame_of_the_path_or_none(order, length):
    """However long it is, and in whatever order."""
    frame = 'odometry'[:length]
    for frames in ('', frame, [frame, *[''] * 7], ['', '', *[frame] * 6], [frame, ''] * 4):
        assert read_path(path(POSES, 5, frame, order, frames)) == (5, frame, [*map(list, POSES)])
    for place in range(8):
        frames = [frame] * 8
        frames[place] = frame[:-1] + 'x'
        with pytest.raises(MessageError, match='another frame'):
            decode_path(path(POSES, 5, frame, order, frames), 8)
