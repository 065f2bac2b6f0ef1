# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Faults that hide a contact from the monitor, in real processes over DDS.

The robot truly touches an obstacle, and a fault keeps the monitor from knowing everything. Counted
are the seconds in which README's rule would let the robot drive: the latest flag is false and
younger than 0.3 s. Then fault and contact end, and the flag must fall in time.

``make faults`` repeats each fault and writes a table of docs/reliability.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import contextlib
from functools import partial
import math
import os
from pathlib import Path
import random
import signal
import sys
import tempfile
import time
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'support'), str(ROOT / 'docs')]

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from discovery import discover_promptly  # noqa: E402
from geometry_msgs.msg import PolygonInstanceStamped  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from page_parts import replace_part  # noqa: E402
import publishers  # noqa: E402
from publishers import BEST_EFFORT, LATCHED, Publisher, SECOND, World  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.parameter_client import AsyncParameterClient  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from witness import TOO_OLD, Witness  # noqa: E402

try:
    from polygon_msgs.msg import Polygon2DCollection
except ImportError:
    Polygon2DCollection = None

# How much later the flag may fall on a busy machine, in s.
SLACK = 30.0
# How long the flag must stay down, in s.
_STAYS = 1.5

# The node with a stand-in for tf2_msgs, which pip lacks; raw bytes need no real type.
_WITH_TF = """
import sys, types
from geometry_msgs.msg import PolygonStamped
sys.modules['tf2_msgs'] = types.ModuleType('tf2_msgs')
sys.modules['tf2_msgs.msg'] = types.ModuleType('tf2_msgs.msg')
sys.modules['tf2_msgs.msg'].TFMessage = PolygonStamped
from sat_collision.node.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


class Outcome(NamedTuple):
    """The result of a situation, in seconds."""

    drivable: float  # time in which the robot might drive, from 0.3 s after contact began
    recovered: float  # from the end of fault and contact until the flag falls; inf if never


class Stage(Witness):
    """
    A monitor process, publishers, and a subscriber of the flag.

    Parameters are those of the monitor; `length` multiplies how often or how long a fault is
    done.
    """

    def __init__(self, parameters: dict[str, Any], domain: int, length: float = 1.0) -> None:
        self.length = length
        self.world = World()
        self.random = random.Random(1)
        self._parameters = parameters
        super().__init__(domain, 1000)
        # What the last state says.
        self.message = ''
        self.node.create_subscription(
            DiagnosticArray, '/footprint_monitor/state', self._receive_state, 1000)
        self.publishers: list[Publisher] = []
        self.contact()

    def start_monitor(self) -> None:
        """Start the monitor's process."""
        program = ['-c', _WITH_TF] if 'frame_id' in self._parameters else [
            '-m', 'sat_collision.node']
        arguments = [word for name, value in self._parameters.items()
                     for word in ('-p', f'{name}:={value}')]
        self.monitor = self.run([sys.executable, *program, '--ros-args', *arguments])

    def publish(self, script: Callable[..., None], topic: str = '/obstacles',
                node: str = 'perception', **options: Any) -> Publisher:
        """Start a process that publishes; see `Publisher`."""
        self.publishers.append(Publisher(self.world, self.domain, script, topic, node, **options))
        return self.publishers[-1]

    def respawn(self, script: Callable[..., None], **options: Any) -> None:
        """Start a process in place of one that has ended, and wait for its first message."""
        publisher = self.publish(script, **options)
        self.until(lambda: publisher.sent)

    def await_publishers(self, topic: str, count: int) -> None:
        """Wait until all processes should have found some publishers."""
        self.until(lambda: self.node.count_publishers(topic) == count)
        self.wait(0.5)

    def contact(self, after: float = 0.0) -> None:
        """Let the robot touch the obstacle; it counts now or some time later."""
        self._begun = time.time() + after
        self._ended = math.inf
        self.world.touching.value = 1

    def leave(self) -> None:
        """End the contact."""
        if self.world.touching.value:
            self._ended = time.time()
        self.world.touching.value = 0

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)

    def await_clear(self) -> None:
        """Wait for the flag to fall."""
        since = time.time()
        self.until(lambda: self._falls(since) < math.inf)

    def outcome(self, promise: float) -> Outcome:
        """Wait until the flag has fallen and stays down, and return the outcome."""
        since = time.time()
        with contextlib.suppress(TimeoutError):
            self.until(lambda: time.time() - self._falls(since) > _STAYS,
                       promise + SLACK + _STAYS + 1.0)
        return Outcome(drivable(self.flags, self._begun + TOO_OLD, self._ended),
                       self._falls(since) - since)

    def set_enabled(self, enabled: bool) -> None:
        """Enable or disable the source of obstacles."""
        client = AsyncParameterClient(self.node, 'footprint_monitor')
        self.until(client.services_are_ready)
        self.until(client.set_parameters([Parameter('obstacle.enabled', value=enabled)]).done)

    def stop_repeatedly(self, pid: int) -> None:
        """Suspend a process for 60 to 300 ms at random moments."""
        for _ in range(round(20 * self.length)):
            self.wait(self.random.uniform(0.05, 0.35))
            with publishers.suspended(pid):
                self.wait(self.random.uniform(0.06, 0.3))

    @contextlib.contextmanager
    def busy(self, pid: int, niceness: int = 0) -> Iterator[None]:
        """Run four busy processes on the only core that a process may use."""
        busy = [self.run([sys.executable, '-c', 'while True: pass']) for _ in range(4)]
        threads = [int(name) for name in os.listdir(f'/proc/{pid}/task')]
        for one in (*threads, *(process.pid for process in busy)):
            os.sched_setaffinity(one, {0})
        for thread in threads:
            before = os.getpriority(os.PRIO_PROCESS, thread)
            os.setpriority(os.PRIO_PROCESS, thread, before + niceness)
        try:
            yield
        finally:
            for process in busy:
                process.kill()
            for thread in threads:
                with contextlib.suppress(ProcessLookupError):
                    os.sched_setaffinity(thread, range(os.cpu_count() or 1))

    def close(self) -> None:
        """Stop all threads and processes."""
        super().close()
        for publisher in self.publishers:
            publisher.kill()

    def _receive_state(self, states: DiagnosticArray) -> None:
        self.message = states.status[0].message

    def _falls(self, since: float) -> float:
        """Return when the flag fell for the last time, infinity if it is raised or old."""
        flags = [(when, raised) for when, raised in list(self.flags) if when > since]
        if not flags or flags[-1][1] or time.time() - flags[-1][0] > TOO_OLD:
            return math.inf
        raised = [k for k, (_, raised) in enumerate(flags) if raised]
        return flags[raised[-1] + 1 if raised else 0][0]


def judge(situation: Situation, domain: int, length: float = 1.0) -> Outcome:
    """Run a situation in its own processes."""
    stage = Stage({**_MARKS, **situation.parameters}, domain, length)
    try:
        stage.start_monitor()
        stage.until(lambda: stage.flags)
        if situation.footprint:
            stage.publish(publishers.robot, '/footprint', 'robot')
        situation.act(stage)
        stage.until(lambda: situation.says in stage.message)
        stage.leave()
        return stage.outcome(situation.promise)
    finally:
        stage.close()


def drivable(flags: Sequence[tuple[float, bool]], begun: float, ended: float) -> float:
    """Return how long a robot might drive within a time span, by flags and their times."""
    nexts = [when for when, _ in flags[1:]] + [math.inf]
    return sum(max(min(after, when + TOO_OLD, ended) - max(when, begun), 0.0)
               for (when, raised), after in zip(list(flags), nexts) if not raised)


class Situation(NamedTuple):
    """A fault, and what must follow from it."""

    act: Callable[[Stage], None]  # causes contact and fault
    # Seconds after the fault until the source must be known: three periods, or the timeout.
    promise: float = 0.3
    parameters: dict[str, Any] = {}  # of the monitor; sets end with an empty polygon
    footprint: bool = True  # whether a footprint is published all the time
    is_short: bool = False  # whether `make test` runs it, too
    says: str = ''  # a part of what the state says in the end of the fault


def _lasting(seconds: float, script: Callable[..., None], topic: str = '/obstacles',
             **options: Any) -> Callable[[Stage], None]:
    """Run one publisher for some seconds."""
    def act(stage: Stage) -> None:
        stage.publish(script, topic, **options)
        stage.wait(seconds)
    return act


def _monitor_stopped(stage: Stage, **form: Any) -> None:
    stage.publish(publishers.sets, **form)
    stage.wait(1.0)
    stage.stop_repeatedly(stage.monitor.pid)


def _publisher_stopped(stage: Stage, **form: Any) -> None:
    publisher = stage.publish(publishers.sets, spread=0.05, **form)
    stage.wait(1.0)
    stage.stop_repeatedly(publisher.process.pid)


def _killed_in_a_set(stage: Stage, **form: Any) -> None:
    stage.publish(publishers.sets, cut=signal.SIGKILL, **form).process.join()
    stage.wait(2.5)
    stage.respawn(publishers.sets, **form)


def _stopped_in_a_set(stage: Stage, **form: Any) -> None:
    publisher = stage.publish(publishers.sets, cut=signal.SIGSTOP, **form)
    stage.wait(4.0)
    os.kill(publisher.process.pid, signal.SIGCONT)


def _busy_publisher(stage: Stage) -> None:
    publisher = stage.publish(publishers.sets, count=600, period=1.0)
    stage.until(lambda: publisher.sent)
    with stage.busy(publisher.process.pid, niceness=10):
        stage.wait(8.0 * stage.length)


def _busy_monitor(stage: Stage) -> None:
    stage.publish(publishers.sets, count=1000, period=0.5)
    with stage.busy(stage.monitor.pid):
        stage.wait(8.0 * stage.length)


def _beside(topic: str, right: dict[str, Any], wrong: dict[str, Any],
            other: dict[str, Any] | None = None) -> Callable[[Stage], None]:
    """Run two publishers, one of which sends the contact; one of them ends."""
    def act(stage: Stage) -> None:
        if other:
            stage.publish(**other)
        one = stage.publish(topic=topic, node='one', **right)
        two = stage.publish(topic=topic, node='two', **wrong)
        stage.await_publishers(topic, 2)
        stage.contact()
        stage.wait(3.0)
        (one if right.get('qos') is BEST_EFFORT else two).end()
    return act


def _second_leaves(stage: Stage) -> None:
    """Let a second publisher send an empty set and leave, repeatedly."""
    first = stage.publish(publishers.sets, period=2.0)
    stage.until(lambda: first.sent > 200)
    for _ in range(6):
        stage.publish(publishers.once, node='other', points=(), has_stamp=True).process.join()
        stage.wait(0.7)


def _tracker_killed_beside(stage: Stage) -> None:
    """Kill the one of two trackers that sees the contact."""
    one = stage.publish(publishers.tracks, node='one', obstacles={0: (0.1, 0.0)}, **_IDS)
    stage.publish(publishers.tracks, node='two', obstacles={1: (0.1, 0.0)}, **_IDS)
    stage.await_publishers('/obstacles', 2)
    one.kill()
    stage.wait(5.0)


def _tracker_killed(stage: Stage) -> None:
    # The contact is sent after 0.0, 1.6 and 3.2 s.
    stage.publish(publishers.tracks, obstacles={0: (1.6, 0.0), 1: (0.1, 0.0)}, killed=4.6,
                  **_IDS).process.join()
    stage.wait(2.5)
    stage.respawn(publishers.tracks, obstacles={0: (0.1, 0.0), 1: (0.1, 0.0)}, **_IDS)


def _ahead(topic: str, **options: Any) -> Callable[[Stage], None]:
    def act(stage: Stage) -> None:
        stage.leave()
        robot = stage.publish(publishers.robot_ahead, topic, 'robot', **options)
        stage.publish(publishers.sets)
        stage.await_clear()
        sent = robot.sent
        stage.contact()
        # The message stamped ahead may still be queued, followed by these.
        stage.until(lambda: robot.sent > sent + 4)
        stage.contact()
        stage.wait(1.5)
    return act


def _transform_ahead(stage: Stage) -> None:
    stage.leave()
    stage.publish(publishers.sets)
    robot = stage.publish(publishers.transform_ahead, '/tf', 'robot')
    stage.until(lambda: robot.sent > 2)


def _lost_among_deadlines(stage: Stage) -> None:
    """Kill a publisher with a lease while many others miss deadlines."""
    stage.leave()
    stage.publish(publishers.late_for_deadlines, 'late0', 'late', qos=publishers.IN_TIME,
                  count=_LATE)
    publisher = stage.publish(publishers.sets, qos=publishers.ALIVE, count=10)
    stage.await_clear()
    stage.wait(2.0)
    publisher.kill()
    stage.contact(after=publishers.LEASE + 0.2 - TOO_OLD)
    stage.wait(4.0)
    stage.respawn(publishers.sets, qos=publishers.ALIVE, count=10)


def _respawned(script: Callable[..., None], end: Callable[[Publisher], None] = Publisher.end,
               **options: Any) -> Callable[[Stage], None]:
    """End a publisher and start it again, without contact."""
    def act(stage: Stage) -> None:
        stage.leave()
        publisher = stage.publish(script, **options)
        stage.await_clear()
        end(publisher)
        stage.respawn(script, **options)
    return act


def _one_shot_beside(stage: Stage) -> None:
    stage.leave()
    stage.publish(**_UNSTAMPED)
    stage.await_clear()
    stage.publish(publishers.once, node='other', points=publishers.APART,
                  has_stamp=False).process.join()


def _map_moves(stage: Stage) -> None:
    """Correct the transform of a map, so that an obstacle of it touches."""
    stage.leave()
    stage.publish(publishers.corrected_transform, '/tf_static', 'corrector', qos=LATCHED)
    # Kept by its publisher: sent only once, it might be missed.
    stage.publish(publishers.latched, qos=LATCHED, first=publishers.TOUCHING, count=1,
                  frame_id='map2')
    stage.await_clear()
    stage.contact()
    stage.wait(3.0)


def _map_grows(stage: Stage) -> None:
    stage.leave()
    stage.publish(publishers.map_sent_again, y=6.0)
    stage.wait(2.0)


def _undecodable(stage: Stage) -> None:
    stage.leave()
    stage.publish(publishers.undecodable)
    stage.await_clear()
    # The last whole set is known for its timeout.
    stage.contact(after=1.0)
    stage.wait(3.0)


def _clock_stepped(stage: Stage) -> None:
    stage.leave()
    stage.publish(publishers.clock, '/clock', 'clock', kind=Clock)
    stage.publish(publishers.latched, qos=LATCHED)
    stage.await_clear()
    stage.world.offset.value -= SECOND // 20
    stage.wait(0.2)


def _enabled_again(stage: Stage) -> None:
    stage.leave()
    stage.publish(publishers.latched, qos=LATCHED)
    stage.await_clear()
    for enabled in (False, True):
        stage.set_enabled(enabled)
        stage.wait(0.3)


_LATE = 20
_UNSTAMPED = {'script': publishers.repeated,
              'messages': [(publishers.box(5 + 2 * k, 5), None, 0) for k in range(5)]}
_IDS = {'kind': PolygonInstanceStamped}
_MARKS = {'obstacle.set_end': 'empty_polygon'}
_SHORT = {'obstacle.timeout': 1.0}
_NO_MARKS = {**_SHORT, 'obstacle.set_end': 'none', 'future_tolerance': 0.2}
_BY_ID = {**_NO_MARKS, 'obstacle.type': 'polygon_instance'}
_SLOW = {**_BY_ID, 'obstacle.timeout': 2.0}
_MAP = {'obstacle.timeout': 0.0}
_LATCHED_MAP = {**_MAP, 'qos_overrides./obstacles.subscription.durability': 'transient_local'}
# Of each way in which sets end: parameters, options of the publisher, and seconds until all is
# known: three periods, or the timeout, future_tolerance and two periods.
_FORMS = {
    'empty polygons': ({}, {}, 0.3),
    'new stamps': ({'obstacle.set_end': 'new_stamp'}, {'marks': False}, 0.3),
    'nothing declared': (_NO_MARKS, {'marks': False}, 1.4),
    'ids': (_BY_ID, {'marks': False, **_IDS}, 1.4)}
if Polygon2DCollection:
    _FORMS['sets in one message'] = (
        {'obstacle.type': 'polygon_collection', 'obstacle.set_end': 'none'},
        {'kind': Polygon2DCollection}, 0.3)
_OUTLINE = {'frame_id': 'map', 'footprint.frame_id': 'base',
            'footprint.points': [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]}
_DEADLINES = {
    'obstacles': ['obstacle', *(f'late{k}' for k in range(_LATE))],
    **{f'qos_overrides./late{k}.subscription.deadline': 50_000_000 for k in range(_LATE)},
    **{f'late{k}.timeout': 60.0 for k in range(_LATE)}, 'obstacle.timeout': 60.0,
    **{f'late{k}.set_end': 'empty_polygon' for k in range(_LATE)},
    'obstacle.topic': 'obstacles',
    'qos_overrides./obstacles.subscription.liveliness': 'automatic',
    'qos_overrides./obstacles.subscription.liveliness_lease_duration':
        round(publishers.LEASE * SECOND)}
_REFUSED = {
    'a self-crossing ring': {'points': [(0.5, 0.5), (1.5, 1.5), (1.5, 0.5), (0.5, 1.5)]},
    '2,000 vertices': {'points': [
        (math.cos(k * math.pi / 1000), math.sin(k * math.pi / 1000)) for k in range(2000)]},
    'a message that is cut off': {'length': -5},
    'a frame that nobody sends': {'frame_id': 'nowhere'}}

SITUATIONS = {
    **{f'{what}: {form}': Situation(
        partial(act, **options), promise, parameters,
        is_short=act is _killed_in_a_set and form == 'empty polygons')
       for what, act in (
           ('the monitor is stopped for 60 to 300 ms again and again', _monitor_stopped),
           ('the publisher is stopped for 60 to 300 ms again and again', _publisher_stopped),
           ('the publisher is killed in the middle of a set, and respawned', _killed_in_a_set),
           ('the publisher is stopped in the middle of a set, and goes on', _stopped_in_a_set))
       for form, (parameters, options, promise) in _FORMS.items()},
    **{f'each polygon is stamped when it is sent, 30 ms apart: {what}': Situation(
        _lasting(4.0, publishers.own_stamps, marks=marks), promise, parameters,
        is_short=what == 'nothing declared')
       for what, marks, parameters, promise in (
           ('empty polygons', True, {}, 0.4), ('nothing declared', False, _NO_MARKS, 1.5),
           ('empty polygons that are not declared', True, _NO_MARKS, 1.5))},
    **{f'the first of a set has a stamp {what}: {form}': Situation(
        _lasting(4.0, publishers.slow_clock, behind=behind), promise, parameters)
       for what, behind in (('of the set before', 0.0), ('older than the set before', 0.15))
       for form, parameters, promise in (
           ('empty polygons', {}, 0.3), ('nothing declared', _NO_MARKS, 1.4))},
    'a map is sent again by a clock that was set back': Situation(
        _lasting(4.0, publishers.map_sent_again, set_back=100.0), 1.0, _MAP),
    'the static transform of the frame of a map is corrected': Situation(
        _map_moves, 1.0, {**_LATCHED_MAP, 'frame_id': 'map'}),
    'a map of more than half of max_count is sent again': Situation(
        _map_grows, 1.0, {**_MAP, 'obstacle.max_count': 8}),
    **{f'two messages of one id with one stamp, the id {instance}': Situation(
        _lasting(4.0, publishers.repeated, messages=[
            (points, 0.0, instance) for points in (None, publishers.APART)], **_IDS), 1.4, _BY_ID)
       for instance in (0, 7)},
    'no message can be decoded any more': Situation(
        _undecodable, 1.0, _SHORT,
        says='has sent nothing of use for longer than its timeout of 1 s: a message was refused: '
             'undecodable'),
    'the last of a set comes 90 ms after the others': Situation(
        _lasting(4.0, publishers.sets, period=0.2, late=0.09), promise=0.6),
    '600 obstacles at 1 Hz, the publisher shares its core with four busy processes': Situation(
        _busy_publisher, promise=3.0),
    '1,000 obstacles at 2 Hz, the monitor shares its core with four busy processes': Situation(
        _busy_monitor, promise=1.5),
    **{f'{what}, then a good obstacle far away: {form}': Situation(
        _lasting(3.0, publishers.refused, **kind, **options), 1.4, parameters)
       for form, parameters, kind in (('ids', _BY_ID, _IDS), ('nothing declared', _NO_MARKS, {}))
       for what, options in _REFUSED.items()},
    'the obstacles of a best-effort publisher are not received, those of another are': Situation(
        _beside('/obstacles', {'script': publishers.sets, 'count': 1, 'qos': BEST_EFFORT},
                {'script': publishers.sets, 'sees': False})),
    'the footprints of a best-effort publisher are not received, those of another are': Situation(
        _beside('/footprint', {'script': publishers.robot, 'qos': BEST_EFFORT},
                {'script': publishers.robot, 'x': 50.0}, {'script': publishers.sets}),
        footprint=False),
    'two robots on one topic': Situation(
        _beside('/footprint', {'script': publishers.robot},
                {'script': publishers.robot, 'x': 50.0}, {'script': publishers.sets}),
        footprint=False),
    'two ids 0.8 s apart, at the start and after silence': Situation(
        _lasting(9.0, publishers.tracks, obstacles={1: (1.0, 0.0), 0: (1.0, 0.8)}, awake=3.0,
                 **_IDS), 4.2, _SLOW),
    'two publishers use the same id': Situation(
        _beside('/obstacles', {'script': publishers.tracks, 'obstacles': {0: (0.1, 0.0)}, **_IDS},
                {'script': publishers.repeated, 'messages': [(publishers.APART, 0.0, 0)], **_IDS}),
        1.4, _BY_ID),
    'one of two publishers of ids is killed': Situation(_tracker_killed_beside, 22.0, _BY_ID),
    'an id with an older stamp after a newer one': Situation(
        _lasting(3.0, publishers.repeated, messages=[
            (None, 0.0, 0), (publishers.APART, 0.5, 0)], **_IDS), 1.4, _BY_ID),
    'a tracker is killed 1.4 s after it sent the contact': Situation(_tracker_killed, 2.4, _SLOW),
    'a footprint stamped 0.9 s ahead': Situation(
        _ahead('/footprint'), footprint=False),
    'odometry stamped 0.9 s ahead': Situation(
        _ahead('/odom', kind=Odometry, by_odometry=True),
        parameters={**_OUTLINE, 'footprint.odometry': '/odom'}, footprint=False),
    'a transform stamped an hour ahead': Situation(
        _transform_ahead, 0.5, _OUTLINE, footprint=False),
    'a second publisher says once that nothing is seen, and leaves': Situation(
        _second_leaves, 6.0, {'obstacle.timeout': 5.0}),
    'liveliness is lost while 20 topics miss deadlines': Situation(
        _lost_among_deadlines, parameters=_DEADLINES),
    # The middleware may report the node name of a respawned process only after some seconds, at
    # the latest when the lease of the killed one ends.
    'the publisher is killed and respawned': Situation(
        _respawned(publishers.sets, Publisher.kill), 21.0),
    'a publisher without stamps restarts': Situation(
        _respawned(**_UNSTAMPED), 1.4, _NO_MARKS),
    'one message without a stamp comes from another, beside those of a publisher': Situation(
        _one_shot_beside, 1.4, _NO_MARKS),
    'the server of a latched map restarts': Situation(
        _respawned(publishers.latched, qos=LATCHED), 1.0, _LATCHED_MAP),
    'the server of a latched map is killed and respawned': Situation(
        _respawned(publishers.latched, Publisher.kill, qos=LATCHED), 21.0, _LATCHED_MAP),
    'the clock steps back by 50 ms, with a latched map': Situation(
        _clock_stepped, 1.0, {**_LATCHED_MAP, 'use_sim_time': True}),
    'a latched source is disabled and enabled': Situation(_enabled_again, 1.0, _LATCHED_MAP),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--length', type=float, default=5.0,
                        help='how often or how long a fault is done, relative to the tests')
    parser.add_argument('--only', default='', help='words in the names of situations to run')
    parser.add_argument('--write', metavar='FILE', type=Path,
                        help='a page whose table is to be replaced')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix='sat_collision_faults_') as folder:
        discover_promptly(folder)
        rows = table(arguments.only, arguments.length)
    if arguments.write:
        replace_part(arguments.write, 'situations', '\n'.join(rows))


def table(words: str, length: float) -> list[str]:
    """Run all situations whose names contain some words; return the rows of a table."""
    rows = ['| fault | drivable in contact | clear again after |', '|---|---|---|']
    for name, situation in SITUATIONS.items():
        if words in name:
            outcome = judge(situation, int(os.environ.get('ROS_DOMAIN_ID', 0)), length)
            again = (f'{outcome.recovered:.2f} s' if outcome.recovered < math.inf else 'never')
            rows.append(f'| {name} | {outcome.drivable:.2f} s | {again} |')
            print(rows[-1], flush=True)
    return rows


if __name__ == '__main__':
    main()
