# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Random scenes in random moving frames have the same states as in the fixed frame."""

from builders import serialised
from moving_scenes import FIXED, MovingScene, OUTLINE, WINDOW, WINDOWS
import oracle
import pytest
from sat_collision.messages.transform_listener import TRANSFORM_TOPICS
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, TF

START = 1_700_000_000 * 10**9
POINTS = tuple(number for corner in OUTLINE for number in (corner.real, corner.imag))
SETTINGS = Settings(
    frame_id=FIXED, transform_timeout=1.0,
    footprints=(FootprintSettings('robot', '/footprint', timeout=0.0),
                FootprintSettings('cart', TF, timeout=0.0, frame_id='base', rate=1000.0,
                                  points=POINTS)),
    obstacles=(ObstacleSettings('seen', '/obstacles', type='polygon_instance', timeout=60.0,
                                assume_no_loss=True),))
NAMES = {'/footprint': 'robot', '/obstacles': 'seen'}


class Playback:
    """A monitor that receives events."""

    def __init__(self, events):
        self.monitor = Monitor(SETTINGS, transforms=True)
        self.rejections = self.monitor.advance(START - 70 * 10**9)
        # The source is known from the start, by messages over its timeout and future_tolerance.
        for ago in (61.1, 30.0, 0.0):
            time = START - round(ago * 1e9)
            self.monitor.receive('seen', serialised((), time, FIXED, 0), time)
        self._events = list(reversed(events))

    def until(self, time):
        """Receive all events up to a time, and check the contacts after each."""
        while self._events and self._events[-1].time <= time:
            at, topic, data = self._events.pop()
            now = START + round(at * 1e9)
            if topic in TRANSFORM_TOPICS:
                self.rejections += self.monitor.receive_transforms(topic, data, now)
            else:
                self.monitor.receive(NAMES[topic], data, now)
            self.check_contacts()
        self.rejections += self.monitor.advance(START + round(time * 1e9))
        self.check_contacts()

    @property
    def bodies(self):
        """The vertices of footprints by name and of obstacles by id."""
        scene = self.monitor.scene
        return {**{name: polygon.vertices for name, polygon in scene.footprints},
                **{obstacle.key: polygon.vertices for obstacle, polygon in scene.obstacles}}

    def contacts(self, name):
        return {obstacle.key for obstacle in self.monitor.scene.state(name).contacts}

    def check_contacts(self):
        """
        Compare the contacts of each footprint with exact ones of the stored vertices.

        An obstacle that is queued behind one that waits counts beside the last one of its id.
        """
        obstacles = [*self.monitor.scene.obstacles]
        for name, polygon in self.monitor.scene.footprints:
            meet = obstacles and oracle.intersects_pairs(
                [(polygon.vertices, other.vertices) for _, other in obstacles])[0]
            assert self.contacts(name) == {
                obstacle.key for (obstacle, _), meets in zip(obstacles, meet) if meets}


def near(vertices, truth):
    """Tell whether each corner has a vertex near it, up to single precision."""
    points = [complex(x, y) for x, y in vertices.tolist()]
    return len(points) == len(truth) and all(
        min(abs(point - corner) for point in points) < 2e-4 for corner in truth)


@pytest.mark.parametrize('seed', [
    *range(6), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(6, 25))])
def test_states_are_those_of_the_fixed_frame(seed):
    """
    With any frames, rates of /tf, delays and orders of arrival.

    Once transforms and bodies have arrived, all bodies are where they truly were; contacts are
    exact for the stored vertices at all times.
    """
    scene = MovingScene(seed, START)
    moving, fixed = Playback(scene.moving), Playback(scene.fixed)
    touched, statuses = 0, set()
    for window in range(WINDOWS):
        end = (window + 1) * WINDOW
        moving.until(end)
        fixed.until(end)
        assert moving.monitor.waiting.counts() == {}
        truth = {**scene.truth[window], 'cart': scene.outline(end)}
        for playback in (moving, fixed):
            assert playback.bodies.keys() == truth.keys()
            assert all(near(playback.bodies[name], ring) for name, ring in truth.items())
        for name in ('robot', 'cart'):
            assert moving.contacts(name) == fixed.contacts(name)
            assert (moving.monitor.scene.status(name) is fixed.monitor.scene.status(name))
            touched += len(moving.contacts(name))
            statuses.add(moving.monitor.scene.status(name).value)
    assert touched and statuses == {'clear', 'collision'}
    assert not moving.rejections and not fixed.rejections
    assert not moving.monitor.rejected
