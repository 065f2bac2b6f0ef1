# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random events in moving frames: messages that wait for transforms, against the model of the scene.

The model receives a body in the fixed frame once its transform has arrived, or a refusal once
transform_timeout has passed or a later set has its place. An obstacle behind one that waits counts
once it has a place. Each message has a frame of its own.
"""

from collections import Counter, deque
from itertools import islice
from typing import NamedTuple

from builders import SECOND, serialised, transforms
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule, RuleBasedStateMachine
from machines import run_until_seen
import pytest
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.scene.frames import UNKNOWN_FRAME
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, TF

pytest.importorskip('shapely')

from scene_model import SceneModel, separation  # noqa: E402
from test_scene_random import BODIES, ring_of  # noqa: E402

MILLISECOND = SECOND // 1000
START = 1000 * SECOND
TRANSFORM_TIMEOUT = 200 * MILLISECOND
FOOTPRINT = FootprintSettings('robot', '/footprint', timeout=1.0)
SOURCES = (ObstacleSettings('sets', '/sets', timeout=0.8, set_end='empty_polygon'),
           ObstacleSettings('tracks', '/tracks', timeout=0.8, type='polygon_instance'))
# Where 'base' is in the fixed frame, always.
BASE = 4.5, -1.5

bodies = st.sampled_from([name for name in BODIES if name.endswith(' 0')])
names = st.sampled_from(('robot', 'sets', 'tracks'))
ages = st.sampled_from((0, 0, 0, 5, 15, 90))
waits = st.sampled_from((1, 5, 30, 60, 201, 201))
# How the pose at the stamp is sent: exactly, as the middle of a pose before and one after, or with
# a parent that changed shortly before.
ways = st.sampled_from(('exact', 'between', 're-parented'))
offsets = st.tuples(*[st.integers(-20, 20).map(lambda k: k / 2)] * 2)


class Message(NamedTuple):
    """A message that waits, or is queued behind one that does; frame is '' for the fixed one."""

    ring: tuple | None
    stamp: int
    instance: int
    number: int
    frame: str
    deadline: int


class FramesMachine(RuleBasedStateMachine):
    """A monitor and the model, with the same events; `seen` counts what happened."""

    seen = Counter()

    @initialize()
    def begin(self):
        self.settings = Settings((FOOTPRINT,), SOURCES, frame_id='odom', future_tolerance=0.05,
                                 transform_timeout=TRANSFORM_TIMEOUT / SECOND)
        self.now = START
        self.monitor = Monitor(self.settings, transforms=True)
        self.model = SceneModel(self.settings)
        self.frames = 0
        self.numbers = Counter()
        self._forget()
        self.monitor.advance(self.now)
        self.monitor.receive_transforms(TF_STATIC, transforms(('odom', 'base', 0, *BASE)),
                                        self.now)
        for milliseconds in (1, 450, 450):
            self.wait(milliseconds)
            self.end('sets')
            self.end('tracks')
        self.send('robot', 'square 0 0', 0, 0)

    def _forget(self):
        self.queues = {'robot': deque(), 'sets': deque(), 'tracks': deque()}
        self.missing = {}
        # What counted before its turn, since something waits.
        self.early = {'sets': set(), 'tracks': set()}

    @rule(milliseconds=waits)
    def wait(self, milliseconds):
        self.now += milliseconds * MILLISECOND
        self.monitor.advance(self.now)
        self._take(expires=True)
        self.model.pass_time(self.now)

    @precondition(lambda self: any(self.queues.values()))
    @rule()
    def wait_too_long(self):
        self.wait(milliseconds=TRANSFORM_TIMEOUT // MILLISECOND + 1)

    @rule()
    def step_back(self):
        """Jump back in time, which drops all waiting messages."""
        self.now -= 3 * SECOND
        self.monitor.advance(self.now)
        self._forget()
        self.model.step_back(self.now)

    @rule(name=names, body=bodies, age=ages, instance=st.integers(0, 3))
    def send(self, name, body, age, instance):
        """Send a body in the fixed frame."""
        self._send(name, BODIES[body], age, instance)

    @rule(name=names, body=bodies, age=ages, instance=st.integers(0, 3), way=ways, offset=offsets,
          is_late=st.booleans())
    def send_in_a_frame(self, name, body, age, instance, way, offset, is_late):
        """Send a body in another frame, whose transform comes earlier or later."""
        self.frames += 1
        frame = f'camera{self.frames}'
        self.missing[frame] = self.now - age * MILLISECOND, way, offset
        if not is_late:
            self.transform(frame)
        self._send(name, BODIES[body], age, instance, frame, offset)
        self.seen['late'] += is_late

    @rule(which=st.integers(0, 20))
    def a_transform_comes(self, which):
        if self.missing:
            self.transform(sorted(self.missing)[which % len(self.missing)])

    @rule()
    def all_transforms_come(self):
        for frame in sorted(self.missing):
            self.transform(frame)

    @rule(name=names)
    def lose(self, name):
        self.numbers[name] += 1

    @rule(name=st.sampled_from(('sets', 'tracks')))
    def end(self, name, age=0):
        """Send an empty polygon, which needs no transform, but waits behind what does."""
        self._send(name, (), age, 0)

    def transform(self, frame):
        stamp, way, (x, y) = self.missing.pop(frame)
        step = 10 * MILLISECOND
        links = {'exact': [('odom', stamp, x, y)],
                 'between': [('odom', stamp - step, x - 1, y + 2),
                             ('odom', stamp + step, x + 1, y - 2)],
                 're-parented': [('odom', stamp - step, x + 3, y),
                                 ('base', stamp, x - BASE[0], y - BASE[1])]}[way]
        # In one message: with the first link alone, a polygon might be refused.
        self.monitor.receive_transforms(TF, transforms(*(
            (parent, frame, at, *place) for parent, at, *place in links)), self.now)
        self._take()
        self.seen[way] += 1

    def _send(self, name, ring, age, instance, frame='', offset=(0.0, 0.0)):
        stamp = self.now - age * MILLISECOND
        instance = instance if name == 'tracks' else None
        moved = [(x - offset[0], y - offset[1]) for x, y in ring]
        self.numbers[name] += 1
        self.monitor.receive(name, serialised(moved, stamp, frame or 'odom', instance), self.now,
                             self.numbers[name])
        self.queues[name].append(Message(ring or None, stamp, instance, self.numbers[name], frame,
                                         self.now + TRANSFORM_TIMEOUT))
        self._take(name)

    def _take(self, name=None, expires=False):
        """Let the model receive what need not wait any more."""
        for one in [name] if name else self.queues:
            queue = self.queues[one]
            replaced = 0
            while queue:
                first, replaced = queue[0], max(replaced, self._replaced(one))
                is_known = self._is_placed(first)
                if not (is_known or replaced or expires and first.deadline < self.now):
                    break
                queue.popleft()
                replaced = max(replaced - 1, 0)
                self.model.receive(
                    one, first.ring if is_known else None, None if is_known else UNKNOWN_FRAME,
                    first.stamp, self.now, first.instance, first.number)
                self.seen['refused'] += not is_known
            if one != 'robot':
                self.early[one] |= self._counting(one)
                if not queue:
                    self.early[one].clear()

    def _is_placed(self, message):
        return message.frame not in self.missing

    def _counting(self, name):
        """Return the obstacles that have a place behind one that waits."""
        return {(name, message.ring) for message in islice(self.queues[name], 1, None)
                if message.ring and self._is_placed(message)}

    def _replaced(self, name):
        """Return how many of the first messages a later set replaces that has its place."""
        queue = [*self.queues[name]]
        ends = [k for k, message in enumerate(queue) if message.ring is None and name == 'sets']
        return max((first + 1 for first, last in zip(ends, ends[1:]) if all(
            map(self._is_placed, queue[first + 1:last]))), default=0)

    @invariant()
    def agree(self):
        scene = self.monitor.scene
        assert self.monitor.waiting.counts() == {
            name: len(queue) for name, queue in self.queues.items() if queue}
        held = Counter((name.source, ring_of(polygon)) for name, polygon in scene.obstacles)
        taken = Counter((source, ring) for source, _, ring in self.model.obstacles(self.now))
        early = self._counting('sets') | self._counting('tracks')
        assert taken <= held and early <= held.keys()
        assert held.keys() <= taken.keys() | self.early['sets'] | self.early['tracks']
        status, _, reasons = self.model.state('robot', self.now)
        found = scene.state('robot').status.value
        is_touched = any(separation(ring_of(polygon), ring) == 0.0
                         for _, polygon in scene.footprints for _, ring in early)
        if is_touched and not any(reason.startswith('footprint') for reason in reasons):
            status = 'collision'
        assert found == status or found == 'collision' and held.keys() > taken.keys() | early
        self.seen['early contact'] += is_touched
        self.seen['clear while some wait'] += status == 'clear' and any(self.queues.values())
        self.seen[status] += 1


@pytest.mark.parametrize('examples', [50, pytest.param(150, marks=pytest.mark.long)])
def test_waiting_messages_are_received_in_order(examples):
    """
    The model receives each message when its transform has arrived.

    Messages wait for any time, transforms come in any order, and frames change parents.
    """
    run_until_seen(FramesMachine, dict.fromkeys((
        'clear', 'collision', 'unknown', 'late', 'exact', 'between', 're-parented', 'refused',
        'early contact', 'clear while some wait'), examples // 15), examples, steps=40)
