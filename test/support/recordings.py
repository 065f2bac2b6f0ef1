# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recordings made for a test: polygons by topic and time, written by rosbags."""

from dataclasses import replace
import itertools
from operator import itemgetter
from pathlib import Path
import subprocess
import sys
import tempfile

from builders import SECOND, serialised
from compiled import plain_python
from published import load
import pytest

pytest.importorskip('rosbags')

from rosbags.interfaces import (  # noqa: E402
    Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime)
from rosbags.rosbag2 import (  # noqa: E402
    CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer)
from rosbags.typesys import get_types_from_msg, get_typestore, Stores  # noqa: E402
from sat_collision.messages.cdr import decode  # noqa: E402
from sat_collision.messages.rosbags_interfaces import STORE  # noqa: E402
from sat_collision.replay.arguments import parse  # noqa: E402
from sat_collision.replay.check import check as check_as_given  # noqa: E402
from sat_collision.replay.command import run as run_command  # noqa: E402
from sat_collision.replay.model.configuration import settings_of  # noqa: E402
from sat_collision.replay.model.result import Options  # noqa: E402

NAMES = ('autoware_ego_trajectory_boxes', 'commonroad_USA_Lanker-1_1_ego1247',
         'tysik_front_scan_polygons')
LOST = 'rosbag2_interfaces/msg/MessagesLostEvent'
TYPES = get_typestore(Stores.ROS2_JAZZY)
for fields, name in (
        ('float64 x\nfloat64 y', 'polygon_msgs/msg/Point2D'),
        ('Point2D[] points', 'polygon_msgs/msg/Polygon2D'),
        ('std_msgs/Header header\nPolygon2D polygon', 'polygon_msgs/msg/Polygon2DStamped'),
        ('std_msgs/Header header\nPolygon2D[] polygons\nstd_msgs/ColorRGBA[] colors',
         'polygon_msgs/msg/Polygon2DCollection'),
        ('string topic_name\nuint64 messages_lost_in_transport\n'
         'uint64 messages_lost_in_recorder', f'{LOST}TopicStat'),
        ('string node_name\nMessagesLostEventTopicStat[] messages_lost_statistics', LOST)):
    TYPES.register(get_types_from_msg(fields, name))
_FOLDER = tempfile.TemporaryDirectory(prefix='sat_collision_recordings_')

START = 1_700_000_000 * 10**9
POLYGON = 'geometry_msgs/msg/PolygonStamped'
POLYGON_2D = 'polygon_msgs/msg/Polygon2DStamped'
COLLECTION = 'polygon_msgs/msg/Polygon2DCollection'
LOST_TOPIC = '/events/rosbag2_messages_lost'
INSTANCE = 'geometry_msgs/msg/PolygonInstanceStamped'
VOLATILE, LATCHED = (
    Qos(QosHistory.KEEP_LAST, 10, QosReliability.RELIABLE, durability, *[QosTime(0, 0)] * 2,
        QosLiveliness.AUTOMATIC, QosTime(0, 0), False)
    for durability in (QosDurability.VOLATILE, QosDurability.TRANSIENT_LOCAL))
# The name of the default source of obstacles.
SOURCE = settings_of({}).obstacles[0].name
MARKS, STAMPS, EACH = 'empty_polygon', 'new_stamp', 'each_message'

DECLARED = f'--param={SOURCE}.set_end:={MARKS}'


def declared(set_end, *names):
    """Return parameters that declare what ends the sets of some sources, the default one."""
    return {f'{name}.set_end': set_end for name in names or (SOURCE,)}


def check(path, options=Options(), progress=None, set_end=MARKS):
    """Check a recording whose default source, if it has that, ends its sets so; None for none."""
    if set_end and not options.obstacles and 'obstacles' not in options.parameters:
        options = replace(options, parameters={**declared(set_end), **options.parameters})
    return check_as_given(path, options, progress)


def main(arguments, set_end=MARKS):
    """Run the command on recordings whose default source ends its sets so; None for none."""
    return run_command(parse(
        [*arguments, *([f'--param={SOURCE}.set_end:={set_end}'] if set_end else [])]))


def nanoseconds(time):
    """Return the time of a recording for seconds since its beginning."""
    return START + round(time * 1e9)


def since(result, *times):
    """Return times in seconds since the recording begins."""
    return [None if time is None else (time - result.origin) / SECOND for time in times]


def times(result, intervals=None):
    """Return when each of some intervals, by default the contacts, begins and ends, in s."""
    return since(result, *(time for one in (result.contacts if intervals is None else intervals)
                           for time in (one.first, one.last)))


def box(x, y=0.0, size=1.0):
    """Return the corners of a square."""
    return [(x, y), (x + size, y), (x + size, y + size), (x, y + size)]


def write(path, messages, storage='mcap', compression=None, types=None, latched=(),
          publishers=1):
    """
    Write (topic, seconds, points) and (topic, seconds, bytes) to a bag by time; return its path.

    `compression` is None, 'file', 'message' or 'storage'; types are POLYGON by default;
    `latched` topics are recorded with transient-local durability. Each topic is recorded as one
    of so many publishers.
    """
    writer = Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if compression:
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        topics = {}
        for topic, time, content in sorted(messages, key=itemgetter(1)):
            if topic not in topics:
                kind = (types or {}).get(topic, POLYGON)
                topics[topic] = writer.add_connection(
                    topic, kind, typestore=TYPES if kind in TYPES.types else STORE,
                    offered_qos_profiles=publishers * [LATCHED if topic in latched else VOLATILE])
            stamp = nanoseconds(time)
            data = content if isinstance(content, bytes) else serialised(content, stamp)
            writer.write(topics[topic], stamp, data)
    return Path(path)


def at(time, points, delay=0.0, topic='/obstacles'):
    """Return a message stamped at a time and received later."""
    return topic, time + delay, serialised(points, START + round(time * SECOND))


def samples(places, topic='/footprint', every=0.1, size=1.0):
    """Return messages of a body that is at one place after the other."""
    return [(topic, k * every, box(x, size=size)) for k, x in enumerate(places)]


def run(tmp_path, messages, set_end=STAMPS, **options):
    """Write and check messages."""
    bag = write(tmp_path / 'bag', messages, types={'/tracks': INSTANCE})
    return check(bag, Options(**options), set_end=set_end)


def losses(time, recorder='/rosbag2_recorder', **lost):
    """Return an event of a recorder at a time: lost on the way and by it, by topic."""
    kind, event = TYPES.types[f'{LOST}TopicStat'], TYPES.types[LOST]
    return LOST_TOPIC, time, bytes(TYPES.serialize_cdr(event(recorder, [
        kind(f'/{topic}', *counts) for topic, counts in lost.items()]), LOST))


def published(name, storage='mcap'):
    """Return a recording of test/data as a bag, written on first use."""
    path = Path(_FOLDER.name, f'{name}_{storage}')
    if path.exists():
        return path
    recording = load('recordings')[name]
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
        topics = [writer.add_connection(topic, POLYGON, typestore=STORE)
                  for topic in ('/footprint', '/obstacles')]
        for stamp, *outlines in recording['sets']:
            for k, outline in enumerate(outlines):
                points = list(zip(outline[::2], outline[1::2]))
                writer.write(topics[k > 0], stamp + k * recording['apart'],
                             serialised(points, stamp, recording['frame_id']))
    return path


def by_stamp(bag):
    """Yield (stamp, [(topic, data), ...]) for each run of messages with one stamp."""
    with Reader(bag) as reader:
        connections = [c for c in reader.connections if c.topic in ('/footprint', '/obstacles')]
        messages = [(decode(data, False)[0], connection.topic, data)
                    for connection, _, data in reader.messages(connections)]
    for stamp, run in itertools.groupby(messages, key=lambda message: message[0]):
        yield stamp, [(topic, data) for _, topic, data in run]


def content_of(bag):
    """Return topic, type, time and bytes of each message as it is stored."""
    with Reader(bag) as reader:
        return [(connection.topic, connection.msgtype, time, bytes(data))
                for connection, time, data in reader.messages()]


def run_without(modules, *arguments):
    """Run the command in another process that cannot import some modules."""
    program = f"""
import sys
sys.modules.update(dict.fromkeys({modules!r}))
from sat_collision.replay.__main__ import main
sys.exit(main(sys.argv[1:]))
"""
    return subprocess.run([sys.executable, '-c', program, *arguments], capture_output=True,
                          text=True, env=plain_python())


def drive(duration=10.0, rate=10.0, contact=(4.0, 5.0)):
    """
    Return a robot that stands at 0 and one obstacle that touches it for a while.

    An empty polygon ends each set.
    """
    messages = []
    for tick in range(round(duration * rate) + 1):
        time = tick / rate
        touching = contact[0] <= time < contact[1]
        messages += [('/footprint', time, box(0.0)),
                     ('/obstacles', time, box(0.75 if touching else 3.0)),
                     ('/obstacles', time, [])]
    return messages
