# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bags and pictures written by a replay."""

from dataclasses import replace
import functools
from itertools import combinations
import math
from pathlib import Path
import subprocess
import sys
import tempfile
import textwrap

from compiled import plain_python
import numpy as np
import pytest
from recordings import box, check, content_of, drive, published, SOURCE, START, write
from rosbags.highlevel import AnyReader
from sat_collision.replay.model.configuration import parameters_of_file
from sat_collision.replay.model.result import joined, Options
from sat_collision.replay.output.bag import write_example

pytest.importorskip('matplotlib')

from matplotlib.colors import to_hex  # noqa: E402, I100
from matplotlib.text import Text  # noqa: E402
from sat_collision.replay.output.figure import draw_picture, write_picture  # noqa: E402
from sat_collision.replay.output.text import GREY, lanes_of, RED  # noqa: E402

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


def written(path, messages):
    """Return the messages of the bag written for a recording by topic, with times since START."""
    check(write(path / 'bag', messages), Options(as_live=True, write_bag=str(path / 'out')))
    found = {}
    with AnyReader([path / 'out']) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append(((time - START) / SECOND, message))
    return found


def run_without_ros(program, *arguments):
    """Run a program that cannot import ROS; return its output."""
    return subprocess.run([sys.executable, '-c',
                           textwrap.dedent(WITHOUT_ROS) + textwrap.dedent(program),
                           *arguments], check=True, capture_output=True, text=True,
                          env=plain_python()).stdout


def test_written_bag_has_all_topics_at_the_right_times(tmp_path):
    """Flags change with the contact and are repeated at publish_rate."""
    topics = written(tmp_path, drive())
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


def test_written_markers_follow_bodies_in_an_unchanged_state(tmp_path):
    messages = [message for k in range(21) for message in (
        ('/footprint', k / 10, box(k / 4)), ('/obstacles', k / 10, box(50)))]
    assert {time: min(point.x for point in marker.points)
            for time, array in written(tmp_path, messages)['/footprint_monitor/markers']
            for marker in array.markers if marker.ns == 'footprint/outline'} == {
        k / 10: k / 4 for k in range(21)}


def test_written_bag_is_the_same_without_ros_and_numba(tmp_path):
    """Byte for byte, with several contacts, although ROS leaves padding as it finds memory."""
    pytest.importorskip('rclpy')
    bag = published('commonroad_USA_Lanker-1_1_ego1247')
    check(bag, Options(parameters={'margin': 12.0}, duration=1.0, as_live=True,
                       write_bag=str(tmp_path / 'ros')), set_end=None)
    out = run_without_ros("""
        from sat_collision.replay.model.result import Options
        from sat_collision.replay.check import check
        result = check(sys.argv[1], Options(parameters={'margin': 12.0}, duration=1.0,
                                            as_live=True, write_bag=sys.argv[2]))
        print(result.problems, len(result.contacts), 'rclpy' in sys.modules)
    """, str(bag), str(tmp_path / 'plain'))
    assert out == '[] 19 False\n'
    with_ros = content_of(tmp_path / 'ros')
    assert len({topic for topic, *_ in with_ros}) == 7
    assert with_ros == content_of(tmp_path / 'plain')


def test_big_endian_messages_are_read_without_ros():
    """By rosbags' decoder; damaged ones are refused."""
    pytest.importorskip('rclpy')
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
            stamp, frame_id, (buffer, at, count, _), identity = decode(data, instance)
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


def test_written_flags_continue_through_a_gap_in_messages(tmp_path):
    """Silence would mean that the node died."""
    messages = [(topic, time, points) for time in (0.0, 3.0)
                for topic, points in (('/footprint', box(0)), ('/obstacles', [(2.0, 0.5)]))]
    flags = written(tmp_path, messages)['/footprint_monitor/collision']
    assert max(b[0] - a[0] for a, b in zip(flags, flags[1:])) <= 0.1001
    assert any(flag.data for time, flag in flags if time > 1.0)


CROWD = 9
_FOLDER = tempfile.TemporaryDirectory(prefix='sat_collision_drawings_')
FOLDER = Path(_FOLDER.name)


@functools.cache
def of_warehouse():
    """Return the result of the example."""
    path = FOLDER / 'warehouse'
    write_example(path)
    parameters = parameters_of_file(str(path / 'params.yaml'), '/footprint_monitor')
    return check(path, Options(parameters=parameters, keyframes=True))


def of_crowd():
    """Return the result of robots with long names side by side, all in contact."""
    names = [f'robot_with_a_long_name_number_{k}' for k in range(CROWD)]
    messages = []
    for tick in range(301):
        time = tick / 10
        messages += [(f'/robots/{name}', time, box(1.2 * k)) for k, name in enumerate(names)]
        met = tick % 20 < 2
        messages += [('/obstacles', time, box(1.2 * k, 0.9 if met else 3.0, 0.4))
                     for k in range(CROWD)]
        messages.append(('/obstacles', time, []))
    bag = write(FOLDER / ('recording_of_a_crowd_' + 'whose_name_is_long_' * 6), messages)
    topics = tuple(f'{name}:=/robots/{name}' for name in names)
    return check(bag, Options(footprints=topics, obstacles=('/obstacles',), keyframes=True))


@functools.cache
def of_nothing():
    """Return the result of a recording without obstacles."""
    return check(write(FOLDER / 'nothing', [('/footprint', k / 10, box(0)) for k in range(20)]),
                 Options(keyframes=True))


@functools.cache
def of_long():
    """Return the result of a short contact in five minutes."""
    return check(write(FOLDER / 'long', drive(300.0, rate=4.0, contact=(170.0, 170.2))),
                 Options(keyframes=True))


@functools.cache
def of_overlaps():
    """Return the result of a robot that two obstacles touch, for a while both."""
    return check(write(FOLDER / 'overlaps', [message for k in range(100) for message in (
        ('/footprint', k / 10, box(0)),
        ('/obstacles', k / 10, box(0.75 if 20 <= k < 50 else 3)),
        ('/obstacles', k / 10, box(-0.75 if 30 <= k < 60 or k > 80 else -4)),
        ('/obstacles', k / 10, []))]), Options(keyframes=True))


def of_published(name, marks=()):
    return pytest.param(lambda: check(published(name), Options(keyframes=True)), id=name,
                        marks=marks)


@functools.cache
def drawn(made):
    """Return the picture of a result."""
    return draw_picture(made())


RESULTS = [of_warehouse, pytest.param(of_crowd, marks=pytest.mark.long), of_nothing, of_long,
           of_published('tysik_front_scan_polygons'),
           of_published('autoware_ego_trajectory_boxes', pytest.mark.long),
           of_published('commonroad_BEL_Zaventem-1_2_T-1', pytest.mark.long)]


def texts(figure):
    """Return all visible texts of a figure, with their bounds in pixels."""
    figure.canvas.draw()
    unseen = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            unseen.update(text for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks())
                          if not low <= tick.get_loc() <= high
                          for text in (tick.label1, tick.label2))
    return [(text.get_text(), text.get_window_extent()) for text in figure.findobj(Text)
            if text.get_visible() and text.get_text().strip() and text not in unseen]


@pytest.mark.parametrize('made', RESULTS)
def test_texts_of_a_picture_do_not_overlap(made):
    figure = drawn(made)
    found = texts(figure)
    assert len(found) > 5
    for text, bounds in found:
        assert figure.bbox.x0 <= bounds.x0 and bounds.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= bounds.y0 and bounds.y1 <= figure.bbox.y1, text
    for (text, bounds), (other, covered) in combinations(found, 2):
        assert not bounds.overlaps(covered), (text, other)


@pytest.mark.parametrize('ending, begin', [
    ('png', b'\x89PNG'), ('svg', b'<?xml'), ('PDF', b'%PDF-')])
def test_picture_of_the_same_result_is_the_same_file(tmp_path, monkeypatch, ending, begin):
    """Neither the time of drawing nor random names are in it."""
    path = tmp_path / f'a.{ending}'
    pictures = set()
    for time in ('1000000000', '2000000000'):
        monkeypatch.setenv('SOURCE_DATE_EPOCH', time)
        write_picture(of_long(), str(path))
        pictures.add(path.read_bytes())
    picture, = pictures
    assert picture.startswith(begin)


def test_dollars_in_a_name_are_no_formula(tmp_path):
    """Neither one that can be drawn nor one that cannot."""
    drawn = []
    for name in ('a$^$b', 'a$x$b', 'axb'):
        path = tmp_path / 'a.svg'
        write_picture(replace(of_nothing(), bag=name), str(path))
        drawn.append(path.read_bytes())
    assert len({*drawn}) == 3


def test_texts_of_a_picture():
    """The recording's name, and obstacles beside their bars and bodies."""
    written = [text for text, _ in texts(drawn(of_warehouse))]
    assert 'warehouse: collision' in written
    assert '9.698 s: amr and people/0, 0.394 m deep' in written
    # In its row, and in the scene of its contact.
    assert [written.count(name) for name in ('amr', 'forklift', 'cart')] == [2, 2, 2]
    # Beside its bar, and beside its body if there is room.
    assert [written.count(f'{name}') for name in ('people/0', 'warehouse/2', 'warehouse/6')] == [
        2, 2, 1]
    titles = [text for text in written if ' s: ' in text and ' and ' in text]
    assert titles == sorted(titles, key=lambda text: float(text.split()[0])) and len(titles) == 3


def test_overlapping_bars_have_their_own_rows():
    lane, = lanes_of(of_overlaps())
    bars = sorted((bar.first, bar.row) for bar in lane.bars if bar.contact)
    assert [row for _, row in bars] == [0, 1, 0]
    # In the third row is when it is not known which of them came or went.
    assert lane.end == 3
    assert {bar.text for bar in lane.bars if bar.row == 2} == {'undetermined'}


@pytest.mark.parametrize('made', [of_warehouse, of_overlaps, of_long])
def test_bars_shades_curves_and_dots_of_a_picture(made):
    """Each has its time; short bars are widened around their middle."""
    result = made()
    curves, rows, *_ = drawn(made).axes
    lanes = lanes_of(result)
    assert [*rows.get_yticks()] == [(lane.first + lane.end - 1) / 2 for lane in lanes]
    for colour in (RED, GREY):
        bars, shades = (np.array(sorted(
            (patch.get_y() + patch.get_height() / 2, *patch.get_bbox().intervalx)
            for patch in axes.patches if to_hex(patch.get_facecolor()) == colour))
            for axes in (rows, curves))
        least = result.duration / 250
        wanted = [(bar.row, (bar.first + bar.last) / 2, max(bar.last - bar.first, least) / 2)
                  for lane in lanes for bar in lane.bars
                  if (bar.contact is not None) is (colour == RED)]
        assert bars == pytest.approx(np.array(sorted(
            (row, middle - half, middle + half) for row, middle, half in wanted)), abs=1e-6)
        assert shades[:, 1:] == pytest.approx(np.array(joined(map(tuple, bars[:, 1:]))))
    for line, footprint in zip(curves.lines, result.footprints):
        assert [*line.get_xdata()] == [result.since(time) for time, _ in footprint.separation]
    dots = [line.get_xdata()[0] for line in curves.lines if line.get_marker() == 'o']
    assert sorted(dots) == pytest.approx(sorted(
        result.since(contact.deepest) for contact in result.contacts))


def test_short_contact_is_visible_on_a_long_axis():
    """At least two pixels wide."""
    assert len(of_long().contacts) == 1
    curves, rows, _ = drawn(of_long).axes
    for axes in (curves, rows):
        bar, = (patch for patch in axes.patches if to_hex(patch.get_facecolor()) == RED)
        assert bar.get_window_extent().width >= 2.0
