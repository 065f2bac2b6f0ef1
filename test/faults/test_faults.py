# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Faults of real processes over DDS: how soon each is detected, what it hides, and its end.

Some begin while all is clear. In the others the robot truly touches an obstacle, and a fault keeps
the monitor from knowing everything. Counted are the seconds in which README's rule would let the
robot drive: the latest flag is false and younger than 0.3 s. Then fault and contact end, and the
flag must fall in time.

``make faults`` repeats each, and writes the tables of docs/reliability.md. Clocks are stepped if
libfaketime is installed.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
import contextlib
from functools import partial
import math
import os
from pathlib import Path
import signal
import statistics
import tempfile
from typing import Any, NamedTuple

from discovery import discover_promptly
from geometry_msgs.msg import PolygonInstanceStamped
from nav_msgs.msg import Odometry
from page_parts import replace_part
import publishers
from publishers import BEST_EFFORT, LATCHED, Publisher, SECOND
import pytest
from rig import FAKETIME, Outcome, Rig, SLACK, TOO_OLD
from rosgraph_msgs.msg import Clock

try:
    from polygon_msgs.msg import Polygon2DCollection
except ImportError:
    Polygon2DCollection = None

# Well above the rule's 0.3 s and a timeout of 0.5 s, since the machine may be busy.
_SLOWEST = 10.0


class Situation(NamedTuple):
    """A fault, and what must follow from it."""

    act: Callable[[Rig], None]  # causes contact and fault
    # Seconds after the fault until the source must be known: three periods, or the timeout.
    promise: float = 0.3
    parameters: dict[str, Any] = {}  # of the monitor; sets end with an empty polygon
    footprint: bool = True  # whether a footprint is published all the time
    steps_clock: bool = False  # whether the monitor has a clock of its own
    is_short: bool = False  # whether `make test` runs it, too
    says: str = ''  # a part of what the state says in the end of the fault


def judge(situation: Situation, domain: int, length: float = 1.0) -> Outcome:
    """Run a situation in its own processes."""
    rig = Rig({**_MARKS, **situation.parameters}, domain, length)
    try:
        if situation.steps_clock:
            rig.set_clock(0.0)
        rig.start_monitor()
        if situation.footprint:
            rig.publish(publishers.robot, '/footprint', 'robot')
        situation.act(rig)
        rig.until(lambda: situation.says in rig.message)
        rig.leave()
        return rig.outcome(situation.promise)
    finally:
        rig.close()


def _lasting(seconds: float, script: Callable[..., None], topic: str = '/obstacles',
             **options: Any) -> Callable[[Rig], None]:
    """Run one publisher for some seconds."""
    def act(rig: Rig) -> None:
        rig.publish(script, topic, **options)
        rig.wait(seconds)
    return act


def _monitor_stopped(rig: Rig, **form: Any) -> None:
    rig.publish(publishers.sets, **form)
    rig.wait(1.0)
    rig.stop_repeatedly(rig.monitor.pid)


def _publisher_stopped(rig: Rig, **form: Any) -> None:
    publisher = rig.publish(publishers.sets, spread=0.05, **form)
    rig.wait(1.0)
    rig.stop_repeatedly(publisher.process.pid)


def _killed_in_a_set(rig: Rig, **form: Any) -> None:
    rig.publish(publishers.sets, cut=signal.SIGKILL, **form).process.join()
    rig.wait(2.5)
    rig.respawn(publishers.sets, **form)


def _stopped_in_a_set(rig: Rig, **form: Any) -> None:
    publisher = rig.publish(publishers.sets, cut=signal.SIGSTOP, **form)
    rig.wait(4.0)
    os.kill(publisher.process.pid, signal.SIGCONT)


def _busy_publisher(rig: Rig) -> None:
    publisher = rig.publish(publishers.sets, count=600, period=1.0)
    rig.until(lambda: publisher.sent)
    with rig.busy(publisher.process.pid, niceness=10):
        rig.wait(8.0 * rig.length)


def _busy_monitor(rig: Rig) -> None:
    rig.publish(publishers.sets, count=1000, period=0.5)
    with rig.busy(rig.monitor.pid):
        rig.wait(8.0 * rig.length)


def _beside(topic: str, right: dict[str, Any], wrong: dict[str, Any],
            other: dict[str, Any] | None = None) -> Callable[[Rig], None]:
    """Run two publishers, one of which sends the contact; one of them ends."""
    def act(rig: Rig) -> None:
        if other:
            rig.publish(**other)
        one = rig.publish(topic=topic, node='one', **right)
        two = rig.publish(topic=topic, node='two', **wrong)
        rig.await_publishers(topic, 2)
        rig.contact()
        rig.wait(3.0)
        (one if right.get('qos') is BEST_EFFORT else two).end()
    return act


def _second_leaves(rig: Rig) -> None:
    """Let a second publisher send an empty set and leave, repeatedly."""
    first = rig.publish(publishers.sets, period=2.0)
    rig.until(lambda: first.sent > 200)
    for _ in range(6):
        rig.publish(publishers.once, node='other', points=(), has_stamp=True).process.join()
        rig.wait(0.7)


def _tracker_killed_beside(rig: Rig) -> None:
    """Kill the one of two trackers that sees the contact."""
    one = rig.publish(publishers.tracks, node='one', obstacles={0: (0.1, 0.0)}, **_IDS)
    rig.publish(publishers.tracks, node='two', obstacles={1: (0.1, 0.0)}, **_IDS)
    rig.await_publishers('/obstacles', 2)
    one.kill()
    rig.wait(5.0)


def _tracker_killed(rig: Rig) -> None:
    # The contact is sent after 0.0, 1.6 and 3.2 s.
    rig.publish(publishers.tracks, obstacles={0: (1.6, 0.0), 1: (0.1, 0.0)}, killed=4.6,
                **_IDS).process.join()
    rig.wait(2.5)
    rig.respawn(publishers.tracks, obstacles={0: (0.1, 0.0), 1: (0.1, 0.0)}, **_IDS)


def _ahead(topic: str, **options: Any) -> Callable[[Rig], None]:
    def act(rig: Rig) -> None:
        rig.leave()
        robot = rig.publish(publishers.robot_ahead, topic, 'robot', **options)
        rig.publish(publishers.sets)
        rig.await_clear()
        sent = robot.sent
        rig.contact()
        # The message stamped ahead may still be queued, followed by these.
        rig.until(lambda: robot.sent > sent + 4)
        rig.contact()
        rig.wait(1.5)
    return act


def _transform_ahead(rig: Rig) -> None:
    rig.leave()
    rig.publish(publishers.sets)
    robot = rig.publish(publishers.transform_ahead, '/tf', 'robot')
    rig.until(lambda: robot.sent > 2)


def _lost_among_deadlines(rig: Rig) -> None:
    """Kill a publisher with a lease while many others miss deadlines."""
    rig.leave()
    rig.publish(publishers.late_for_deadlines, 'late0', 'late', qos=publishers.IN_TIME,
                count=_LATE)
    publisher = rig.publish(publishers.sets, qos=publishers.ALIVE, count=10)
    rig.await_clear()
    rig.wait(2.0)
    publisher.kill()
    rig.contact(after=publishers.LEASE + 0.2 - TOO_OLD)
    rig.wait(4.0)
    rig.respawn(publishers.sets, qos=publishers.ALIVE, count=10)


def _respawned(script: Callable[..., None], end: Callable[[Publisher], None] = Publisher.end,
               **options: Any) -> Callable[[Rig], None]:
    """End a publisher and start it again, without contact."""
    def act(rig: Rig) -> None:
        rig.leave()
        publisher = rig.publish(script, **options)
        rig.await_clear()
        end(publisher)
        rig.respawn(script, **options)
    return act


def _one_shot_beside(rig: Rig) -> None:
    rig.leave()
    rig.publish(**_UNSTAMPED)
    rig.await_clear()
    rig.publish(publishers.once, node='other', points=publishers.APART,
                has_stamp=False).process.join()


def _map_moves(rig: Rig) -> None:
    """Correct the transform of a map, so that an obstacle of it touches."""
    rig.leave()
    rig.publish(publishers.corrected_transform, '/tf_static', 'corrector', qos=LATCHED)
    # Kept by its publisher: sent only once, it might be missed.
    rig.publish(publishers.latched, qos=LATCHED, first=publishers.TOUCHING, count=1,
                frame_id='map2')
    rig.await_clear()
    rig.contact()
    rig.wait(3.0)


def _map_grows(rig: Rig) -> None:
    rig.leave()
    rig.publish(publishers.map_sent_again, y=6.0)
    rig.wait(2.0)


def _undecodable(rig: Rig) -> None:
    rig.leave()
    rig.publish(publishers.undecodable)
    rig.await_clear()
    # The last whole set is known for its timeout.
    rig.contact(after=1.0)
    rig.wait(3.0)


def _clock_stepped(rig: Rig) -> None:
    rig.leave()
    rig.publish(publishers.clock, '/clock', 'clock', kind=Clock)
    rig.publish(publishers.latched, qos=LATCHED)
    rig.await_clear()
    rig.world.offset.value -= SECOND // 20
    rig.wait(0.2)


def _enabled_again(rig: Rig) -> None:
    rig.leave()
    rig.publish(publishers.latched, qos=LATCHED)
    rig.await_clear()
    for enabled in (False, True):
        rig.set_enabled(enabled)
        rig.wait(0.3)


def _fault(cause: Callable[[Rig], contextlib.AbstractContextManager[Any]],
           robot: dict[str, Any] = {'script': publishers.robot},
           obstacles: dict[str, Any] = {'script': publishers.sets, 'count': 20, 'period': 0.02},
           **more: Any) -> Situation:
    """Cause a fault where all is known and clear."""
    def act(rig: Rig) -> None:
        rig.leave()
        # No more messages than five sets are kept for a monitor that does not receive them.
        rig.publish(topic='/footprint', node='robot', qos={'depth': 100}, **robot)
        rig.publish(qos={'depth': 100}, **obstacles)
        rig.await_clear()
        with cause(rig):
            rig.detect()
    return Situation(act, 0.5, _FAST, footprint=False, **more)


@contextlib.contextmanager
def _touching(rig: Rig) -> Iterator[None]:
    rig.contact()
    yield
    rig.leave()


@contextlib.contextmanager
def _killed(rig: Rig) -> Iterator[None]:
    rig.monitor.kill()
    yield
    rig.start_monitor()


@contextlib.contextmanager
def _stepped(rig: Rig, seconds: float) -> Iterator[None]:
    rig.set_clock(seconds)
    yield
    rig.set_clock(0.0)


@contextlib.contextmanager
def _flooded(rig: Rig) -> Iterator[None]:
    """Touch while another publisher floods the topic, which is then unknown for both reasons."""
    rig.contact()
    flood = rig.publish(publishers.flood, node='flood', qos={'depth': 1000})
    yield
    flood.end()
    rig.leave()


_LATE = 20
_UNSTAMPED = {'script': publishers.repeated,
              'messages': [(publishers.box(5 + 2 * k, 5), None, 0) for k in range(5)]}
_IDS = {'kind': PolygonInstanceStamped}
_MARKS = {'obstacle.set_end': 'empty_polygon'}
_FAST = {'footprint.timeout': 0.5, 'obstacle.timeout': 0.5}
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

FAULTS = {
    'no fault: the robot touches an obstacle': _fault(_touching),
    'the monitor is killed and started again': _fault(_killed),
    'the monitor is stopped and goes on (SIGSTOP, SIGCONT)': _fault(
        lambda rig: publishers.suspended(rig.monitor.pid)),
    'the loop of the monitor hangs': _fault(Rig.hanging),
    **{f'the {what} {verb} silent (timeout 0.5 s)': _fault(
        lambda rig, k=k: publishers.suspended(rig.publishers[k].process.pid))
       for k, (what, verb) in enumerate((('footprint', 'is'), ('obstacles', 'are')))},
    'footprints come damaged': _fault(_touching, robot={
        'script': publishers.undecodable, 'polygons': [publishers.ROBOT]}),
    'obstacles come damaged': _fault(_touching, obstacles={'script': publishers.undecodable}),
    'the robot touches while 10,000 messages/s of no use come': _fault(_flooded),
    **({f'the clock of the monitor is stepped by {step:+g} s, and back': _fault(
        partial(_stepped, seconds=step), steps_clock=True)
        for step in (10.0, -10.0)} if FAKETIME else {}),
}

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


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=() if situation.is_short else pytest.mark.long)
    for name, situation in (FAULTS | SITUATIONS).items()])
def test_fault(domain, name):
    """It is detected, no flag lets the robot drive in contact, and it falls in time afterwards."""
    situation = (FAULTS | SITUATIONS)[name]
    outcome = judge(situation, domain)
    assert outcome.detected < _SLOWEST and outcome.wrong_clears == 0
    # A flag takes some ms to arrive, and longer on a busy machine.
    assert outcome.drivable < 0.2
    assert outcome.recovered < situation.promise + SLACK


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--repeat', type=int, default=10, help='how often a fault is caused')
    parser.add_argument('--length', type=float, default=5.0,
                        help='how long those last that hide a contact, relative to the tests')
    parser.add_argument('--only', default='', help='words in the names of faults to cause')
    parser.add_argument('--write', metavar='FILE', type=Path,
                        help='a page whose tables are to be replaced')
    arguments = parser.parse_args()
    domain = int(os.environ.get('ROS_DOMAIN_ID', 0))
    with tempfile.TemporaryDirectory(prefix='sat_collision_faults_') as folder:
        discover_promptly(folder)
        for part, head, found, row in (
                ('faults', '| fault | detected after | recovered after | wrong clears |', FAULTS,
                 lambda one: _detection([judge(one, domain) for _ in range(arguments.repeat)])),
                ('situations', '| fault | drivable in contact | clear again after |', SITUATIONS,
                 lambda one: _hidden(judge(one, domain, arguments.length)))):
            rows = [head, '|---' * (head.count('|') - 1) + '|']
            for name, situation in found.items():
                if arguments.only in name:
                    rows.append(f'| {name} | {row(situation)} |')
                    print(rows[-1], flush=True)
            if arguments.write:
                replace_part(arguments.write, part, '\n'.join(rows))


def _detection(outcomes: list[Outcome]) -> str:
    cells = [f'{statistics.median(times):.2f} s (at most {max(times):.2f} s)' for times in (
        [one.detected for one in outcomes], [one.recovered for one in outcomes])]
    wrong = sum(one.wrong_clears for one in outcomes)
    return ' | '.join([*cells, f'{wrong} of {len(outcomes)}'])


def _hidden(outcome: Outcome) -> str:
    again = f'{outcome.recovered:.2f} s' if outcome.recovered < math.inf else 'never'
    return f'{outcome.drivable:.2f} s | {again}'


if __name__ == '__main__':
    main()
