# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
See the monitor at work: robots in a warehouse, three processes, real DDS.

This process starts the footprint_monitor node and a publisher of the embedded scene, prints each
change of a flag as it arrives, checks that the flags are those that the scene must cause, and
draws the published markers: those at the first contact into demo.png, all of them into demo.gif,
which begins at that contact. One robot brakes when its flag is raised, before it is in contact.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
import math
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point32, PolygonStamped
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.patheffects import withStroke
from matplotlib.textpath import TextPath
from nav_msgs.msg import Odometry
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sat_collision.demo import warehouse
from std_msgs.msg import Bool
from visualization_msgs.msg import MarkerArray

if find_spec('polygon_msgs'):
    from polygon_msgs.msg import Point2D, Polygon2D, Polygon2DCollection as ObstacleMessage
    _SETS = {'type': 'polygon_collection'}
else:
    ObstacleMessage = PolygonStamped
    _SETS = {'set_end': 'empty_polygon'}

# ROS domains; those below are for the tests, which may run at the same time.
DOMAINS = range(71, 102)
_PERIOD = 0.05
_STATIC_STEPS = 20
# The animation: seconds of the scene from frame to frame, and how many times faster it runs.
_FRAME_PERIOD = 0.24
_SPEEDUP = 2.0
_START_TIMEOUT = 90.0
# The robot that brakes: m/s and m/s^2; how many s before contact its flag is raised, and how many
# s it waits once the flag is lowered.
_SPEED, _ACCELERATION = 1.2, 3.0
_BRAKES_AHEAD, _WAITS = 1.5, 1.5
_ROBOTS = (*warehouse.FOOTPRINTS, warehouse.BRAKES)
# Long enough that a process held up by a busy machine does not count as silent.
_TIMEOUT = 5.0
_MONITOR = '/footprint_monitor'
_BASE, _ODOMETRY = f'{warehouse.BY_ODOMETRY}_base', f'{warehouse.BY_ODOMETRY}_odometry'
_PARAMETERS: dict[str, object] = {
    'footprints': list(_ROBOTS),
    'obstacles': ['warehouse', 'people'],
    'frame_id': warehouse.FRAME,
    'watchdog': _TIMEOUT,
    'transform_timeout': _TIMEOUT,
    'release_delay': 1.0,
    f'{warehouse.BY_ODOMETRY}.points': warehouse.FOOTPRINTS[
        warehouse.BY_ODOMETRY].ravel().tolist(),
    f'{warehouse.BY_ODOMETRY}.frame_id': _BASE,
    f'{warehouse.BY_ODOMETRY}.odometry': _ODOMETRY,
    f'{warehouse.BRAKES}.min_time_to_collision': _BRAKES_AHEAD,
    **{f'{name}.timeout': _TIMEOUT for name in (*_ROBOTS, 'warehouse', 'people')},
    **{f'{name}.{key}': value for name in ('warehouse', 'people') for key, value in _SETS.items()},
}
# Texts are drawn larger than in the markers, because a picture cannot be zoomed.
_ENLARGED = 1.3
_WORDS = {'clear': ('clear', '#1a9933'), 'imminent': ('COLLISION AHEAD', '#c06000'),
          'collision': ('COLLISION', '#d11919'), 'unknown': ('unknown', '#555555')}


class _Publisher(Node):
    """
    Publishes the footprints and the person at each step, and static obstacles every 20 steps.

    One robot publishes its odometry instead of its footprint, and the person in the frame of its
    laser, so the monitor must transform both. Another one drives only where its flag allows it.
    """

    def __init__(self) -> None:
        super().__init__('warehouse')
        published = [name for name in _ROBOTS if name != warehouse.BY_ODOMETRY]
        self._topics = {
            **{name: self.create_publisher(PolygonStamped, name, 100) for name in published},
            **{name: self.create_publisher(ObstacleMessage, name, 100)
               for name in ('warehouse', 'people')}}
        self._topics[_ODOMETRY] = self.create_publisher(Odometry, _ODOMETRY, 100)
        self._elapsed = self._goes_on_at = self._speed = self._distance = 0.0
        # Depth 1: only the newest flag counts, and one is received per step.
        self.create_subscription(Bool, f'{_MONITOR}/{warehouse.BRAKES}/collision',
                                 self._receive_flag, 1)

    def play(self) -> None:
        while any(topic.get_subscription_count() == 0 for topic in self._topics.values()):
            time.sleep(_PERIOD)
        # Scene time advances by steps: a busy machine slows the demo, but skips no contact.
        for step in range(round(warehouse.DURATION / _PERIOD)):
            self._elapsed = elapsed = step * _PERIOD
            stamp = self.get_clock().now().to_msg()
            if step % _STATIC_STEPS == 0:
                self._publish_set('warehouse', warehouse.STATIC, stamp)
            robot = warehouse.BY_ODOMETRY
            self._publish_odometry(robot, elapsed, stamp)
            person = warehouse.seen_by(robot, warehouse.person(elapsed), elapsed)
            self._publish_set('people', [person], stamp, _BASE)
            for name in warehouse.FOOTPRINTS:
                if name != robot:
                    self._publish(name, warehouse.footprint(name, elapsed), stamp)
            self._drive()
            self._publish(warehouse.BRAKES, warehouse.courier(self._distance), stamp)
            time.sleep(_PERIOD)
            rclpy.spin_once(self, timeout_sec=0.0)

    def _receive_flag(self, flag: Bool) -> None:
        """Stop the robot that brakes while its flag is raised, and _WAITS seconds longer."""
        if flag.data:
            self._goes_on_at = self._elapsed + _WAITS

    def _drive(self) -> None:
        """Advance the robot that brakes by a step."""
        may_drive = (self._elapsed >= self._goes_on_at
                     and self._distance < warehouse.COURIER_DISTANCE)
        change = _ACCELERATION * _PERIOD
        self._speed = (min(self._speed + change, _SPEED) if may_drive
                       else max(self._speed - change, 0.0))
        self._distance += self._speed * _PERIOD

    def _publish_odometry(self, name: str, elapsed: float, stamp: Time) -> None:
        x, y, heading = warehouse.pose(name, elapsed)
        message = Odometry(child_frame_id=_BASE)
        message.header.stamp = stamp
        message.header.frame_id = warehouse.FRAME
        pose = message.pose.pose
        pose.position.x, pose.position.y = x, y
        pose.orientation.z, pose.orientation.w = math.sin(heading / 2), math.cos(heading / 2)
        self._topics[_ODOMETRY].publish(message)

    def _publish_set(self, topic: str, outlines: Sequence[warehouse.Outline], stamp: Time,
                     frame_id: str = warehouse.FRAME) -> None:
        """Publish obstacles in one message; or one by one, and an empty polygon that ends them."""
        if ObstacleMessage is not PolygonStamped:
            message = ObstacleMessage()
            message.header.stamp = stamp
            message.header.frame_id = frame_id
            message.polygons = [Polygon2D(points=[Point2D(x=x, y=y) for x, y in outline.tolist()])
                                for outline in outlines]
            self._topics[topic].publish(message)
            return
        for outline in (*outlines, warehouse.NOTHING):
            self._publish(topic, outline, stamp, frame_id)

    def _publish(self, topic: str, outline: warehouse.Outline, stamp: Time,
                 frame_id: str = warehouse.FRAME) -> None:
        message = PolygonStamped()
        message.header.stamp = stamp
        message.header.frame_id = frame_id
        message.polygon.points = [Point32(x=x, y=y) for x, y in outline.tolist()]
        self._topics[topic].publish(message)


class _Frame(NamedTuple):
    """What the node published at one time (s): the state of each footprint, and the markers."""

    time: float
    states: dict[str, str]
    markers: MarkerArray


class _Viewer(Node):
    """Records and prints what the node publishes."""

    def __init__(self) -> None:
        super().__init__('viewer')
        self.flags: dict[str, list[bool]] = {name: [] for name in _ROBOTS}
        # The obstacles in contact or ahead, one after the other.
        self.met: dict[str, list[str]] = {name: [] for name in _ROBOTS}
        self._states = dict.fromkeys(_ROBOTS, 'unknown')
        self.frames: list[_Frame] = []
        self.is_shown = False
        # The number of the signal that ends the demo, 0 for none.
        self.signal = 0
        # When the first robot was seen to be clear: the scene has begun.
        self._start: float | None = None
        for name in self.flags:
            self.create_subscription(Bool, f'{_MONITOR}/{name}/collision',
                                     partial(self._record_flag, name), 10)
        self.create_subscription(DiagnosticArray, f'{_MONITOR}/state', self._record_states, 10)
        self.create_subscription(MarkerArray, f'{_MONITOR}/markers', self._record_markers, 10)

    @property
    def elapsed(self) -> float:
        """Seconds since the scene has begun, 0 before."""
        return time.monotonic() - self._start if self._start else 0.0

    def _record_flag(self, name: str, flag: Bool) -> None:
        flags = self.flags[name]
        raised = flag.data
        if not flags or flags[-1] != raised:
            if not raised and not self._start:
                self._start = time.monotonic()
            flags.append(raised)
            _print(f'{self.elapsed:6.2f} s  {name:8} collision: {raised}')

    def _record_states(self, states: DiagnosticArray) -> None:
        for name, status in zip(self.flags, states.status):
            values = {pair.key: pair.value for pair in status.values}
            state = self._states[name] = values['state']
            obstacles = values['obstacles in contact']
            if state == 'imminent' and values['first contact with']:
                obstacles = f'{values["first contact with"]} ahead'
            met = self.met[name]
            if obstacles and (not met or met[-1] != obstacles):
                met.append(obstacles)
                _print(f'{"":8}  {name:8} {status.message}')

    def _record_markers(self, markers: MarkerArray) -> None:
        self.is_shown = True
        # Before the scene begins and after it ends all states are unknown.
        if 'clear' in self._states.values():
            self.frames.append(_Frame(self.elapsed, dict(self._states), markers))

    def show_progress(self) -> None:
        share = min(self.elapsed / warehouse.DURATION, 1.0)
        flags = '  '.join(f'{name} {"COLLISION" if flags[-1] else "clear"}'
                          for name, flags in self.flags.items() if flags)
        if sys.stdout.isatty():
            print(f'\r\033[K[{"#" * round(30 * share):30}] {flags}', end='', flush=True)


def _print(line: str) -> None:
    print(f'\r\033[K{line}' if sys.stdout.isatty() else line, flush=True)


def _spin(viewer: _Viewer, condition: Callable[[], bool], timeout: float) -> bool:
    """
    Spin until a condition holds; return whether it came to hold within the timeout (s).

    A signal ends the demo here, not within rclpy, which may print or replace the error.
    """
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        rclpy.spin_once(viewer, timeout_sec=0.1)
        if viewer.signal:
            sys.exit(128 + viewer.signal)
        viewer.show_progress()
    return True


def _watch(viewer: _Viewer) -> bool:
    """Run node and publisher to the end; return whether they came up and ended well."""
    parameters = [argument for name, value in _PARAMETERS.items()
                  for argument in ('-p', f'{name}:={value}'.replace("'", ''))]
    monitor = subprocess.Popen([sys.executable, '-m', 'sat_collision.node', '--ros-args',
                                *parameters])
    publisher = None
    try:
        # Markers are shown only once the kernels for distances are compiled, too.
        if not _spin(viewer, lambda: all(viewer.flags.values()) and viewer.is_shown,
                     _START_TIMEOUT):
            print(f'the monitor published nothing within {_START_TIMEOUT:g} s')
            return False
        publisher = subprocess.Popen([sys.executable, '-m', 'sat_collision.demo', '--publish'])
        return (_spin(viewer, lambda: publisher.poll() is not None, 2 * warehouse.DURATION)
                and publisher.returncode == 0
                and _spin(viewer, lambda: all(flags[-1] for flags in viewer.flags.values()),
                          2 * _TIMEOUT)
                and monitor.poll() is None)
    finally:
        for process in filter(None, (publisher, monitor)):
            process.terminate()
            process.wait()


def _is_right(viewer: _Viewer) -> bool:
    """Print and return whether the flags and contacts received are those that the scene causes."""
    is_right = True
    expected = {name: [f'{source}/{number}' for source, number in contacts]
                for name, contacts in warehouse.CONTACTS.items()}
    expected[warehouse.BRAKES] = ['people/0 ahead']
    for name, met in expected.items():
        # Flags are raised while unknown, for each contact or contact ahead, and at the end.
        flags = [True, False] * (len(met) + 1) + [True]
        is_right &= viewer.flags[name] == flags and viewer.met[name] == met
        _print(f'{name:8} met {", ".join(viewer.met[name]) or "nothing"}, '
               f'expected {", ".join(met)}; flags {viewer.flags[name]}, expected {flags}')
    print('the flags are right' if is_right else 'THE FLAGS ARE WRONG')
    return is_right


def _draw(frames: Sequence[_Frame], picture: str, movie: str) -> bool:
    """Write picture and animation; return whether there was a contact to draw."""
    first = next((frame for frame in frames if any(
        marker.ns.startswith('contacts/') for marker in frame.markers.markers)), None)
    if first is None:
        return False
    figure = Figure(figsize=(9.0, 5.0))
    _draw_frame(first, figure)
    figure.savefig(picture, dpi=120)
    print(f'wrote {picture}', flush=True)
    shown: list[_Frame] = []
    for frame in frames:
        if not shown or frame.time - shown[-1].time >= _FRAME_PERIOD:
            shown.append(frame)
    writer = PillowWriter(fps=round(_SPEEDUP * len(shown) / shown[-1].time))
    # Begin with a contact, for viewers that show only the first frame.
    shown.sort(key=lambda frame: frame.time < first.time)
    with writer.saving(figure, movie, dpi=92):
        for frame in shown:
            figure.clear()
            _draw_frame(frame, figure)
            writer.grab_frame()
    print(f'wrote {movie}', flush=True)
    return True


def _draw_frame(frame: _Frame, figure: Figure) -> None:
    """Draw the markers, and above them the time and the states."""
    axes = figure.add_axes((0.06, 0.1, 0.925, 0.84))
    min_x, min_y, max_x, max_y = warehouse.BOUNDS
    axes.set(xlim=(min_x, max_x), ylim=(min_y, max_y))
    _draw_markers(frame.markers, axes)
    axes.set_title(f'{frame.time:4.1f} s', loc='left', family='monospace')
    for number, (name, state) in enumerate(frame.states.items()):
        word, colour = _WORDS[state]
        axes.text(0.11 + 0.21 * number, 1.02, f'{name}: {word}', color=colour,
                  transform=axes.transAxes)


def _draw_markers(markers: MarkerArray, axes: Axes) -> None:
    """Draw markers as RViz would from above, into axes whose limits are set."""
    for marker in markers.markers:
        colour = np.array([marker.color.r, marker.color.g, marker.color.b])
        # Blended with the white background.
        colour = 1.0 - marker.color.a * (1.0 - colour)
        height = 2.0 + marker.pose.position.z
        points = np.array([(point.x, point.y) for point in marker.points]).reshape(-1, 2)
        if marker.type == marker.TRIANGLE_LIST:
            # Antialiased edges would leave light lines between triangles.
            axes.add_collection(PolyCollection(
                list(points.reshape(-1, 3, 2)), facecolor=colour, linewidth=0.0,
                antialiased=False, zorder=height))
        elif marker.type == marker.LINE_LIST:
            axes.add_collection(LineCollection(
                list(points.reshape(-1, 2, 2)), colors=[colour],
                linewidths=60.0 * marker.scale.x, zorder=height))
        elif marker.type == marker.SPHERE_LIST:
            x, y = points.T
            axes.scatter(x, y, color=[colour], s=1500.0 * marker.scale.x**2, zorder=height)
        elif marker.type == marker.TEXT_VIEW_FACING:
            # Centred, as in RViz, but moved into the picture.
            size = _ENLARGED * marker.scale.z
            text = TextPath((0.0, 0.0), marker.text, size=size)
            (left, low), (right, high) = text.get_extents().get_points()
            place = marker.pose.position
            least, most = axes.get_xlim()
            begin = (min(max(place.x - (left + right) / 2, least - left), most - right),
                     place.y - (low + high) / 2)
            axes.add_patch(PathPatch(TextPath(begin, marker.text, size=size),
                                     facecolor=colour, linewidth=0.0, zorder=height + 1.0,
                                     path_effects=[withStroke(linewidth=3.0,
                                                              foreground='white')]))
    axes.set_aspect('equal')
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')


def show(args: Sequence[str] | None = None) -> int:
    """Run the demo; return the exit status."""
    parser = argparse.ArgumentParser('sat_collision_demo',
                                     description='See the monitor at work in a warehouse.')
    parser.add_argument('--publish', action='store_true', help='only publish the scene')
    parser.add_argument('--picture', default='demo.png', help='where to draw the first contact')
    parser.add_argument('--movie', default='demo.gif', help='where to draw the whole scene')
    options = parser.parse_args(args)
    if options.publish:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        _Publisher().play()
        rclpy.shutdown()
        return 0
    for path in (options.picture, options.movie):
        if not os.access(Path(path).parent, os.W_OK):
            parser.error(f'cannot write {path}')
    # Keep the demo apart from other nodes on the network.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = str(DOMAINS[os.getpid() % len(DOMAINS)])
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    viewer = _Viewer()

    def note(number: int, frame: object) -> None:
        viewer.signal = number

    signals = signal.SIGINT, signal.SIGTERM
    for number in signals:
        signal.signal(number, note)
    is_right = _watch(viewer) and _is_right(viewer)
    for number in signals:
        signal.signal(number, signal.SIG_DFL)
    rclpy.shutdown()
    is_drawn = _draw(viewer.frames, options.picture, options.movie)
    return 0 if is_right and is_drawn else 1
