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

"""Obstacle sources of a running node: ids, maps, silence and limits."""

from harness import box, SECOND, to_ns, values
import pytest

ROBOT = box(0, 0)
APART = box(5, 5)
TOUCHING = box(1, 1)
LASTING = {'footprint__timeout': 0.0, 'obstacle__timeout': 60.0}
HOUR = 3600 * SECOND


@pytest.mark.parametrize('age', [1, -3600])
def test_footprint_from_the_past_or_the_future_is_refused(start, age):
    """It was overtaken by the one before, or the clock that stamped it is an hour ahead."""
    monitor = start(obstacle__timeout=60.0, footprint__timeout=60.0)
    stamp = monitor.now()
    monitor.send('footprint', ROBOT, stamp)
    monitor.send_set('obstacles', TOUCHING)
    monitor.await_state('collision')
    monitor.send('footprint', APART, stamp - age * SECOND)
    monitor.until(lambda: monitor.monitor._monitor.rejected.total())
    count = len(monitor.states())
    monitor.until(lambda: len(monitor.states()) > count + 3)
    assert 'clear' not in monitor.states()
    assert monitor.state() == ('collision' if age > 0 else 'unknown')


def test_footprint_ahead_of_the_clock_shuts_out_nothing(start):
    """One stamped 0.9 s ahead is taken as of now: the next one counts."""
    monitor = start(**LASTING)
    monitor.send_set('obstacles', TOUCHING)
    monitor.send('footprint', APART, monitor.now() + 9 * SECOND // 10)
    monitor.await_state('clear')
    sent = monitor.now()
    monitor.send('footprint', ROBOT, sent)
    monitor.await_state('collision')
    assert monitor.now() < sent + 9 * SECOND // 10 or not monitor.monitor._monitor.rejected


def send_ids(monitor, **places):
    """Send instances by their ids, which have a letter before them."""
    for name, points in places.items():
        monitor.send('obstacles', points, instance=int(name[1:]))


def until_with_ids(monitor, state, **places):
    """Send instances again and again until the footprint is in a state."""
    monitor.until(lambda: send_ids(monitor, **places) or monitor.spin(0.05)
                  or monitor.state() == state, state)


IDS = {'obstacle__type': 'polygon_instance', 'obstacle__timeout': 1.0, 'footprint__timeout': 0.0}


def test_instances_are_known_by_their_id(start):
    """Known after one timeout without a gap; then id 7 comes into contact and goes."""
    monitor = start(**IDS)
    monitor.send('footprint', ROBOT)
    begun = monitor.now()
    until_with_ids(monitor, 'clear', i3=APART, i7=APART)
    assert monitor.now() - begun > SECOND
    until_with_ids(monitor, 'collision', i3=APART, i7=TOUCHING)
    assert monitor.contacts() == ['obstacle/7']
    until_with_ids(monitor, 'clear', i3=APART, i7=APART)


def test_instance_with_an_older_stamp_changes_nothing(start):
    """It was overtaken on its way."""
    monitor = start(**IDS)
    monitor.send('footprint', ROBOT)
    until_with_ids(monitor, 'collision', i7=TOUCHING)
    monitor.send('obstacles', APART, monitor.now() - SECOND // 2, instance=7)
    count = len(monitor.states())
    monitor.until(lambda: len(monitor.states()) > count + 3)
    assert monitor.state() == 'collision'


def test_instance_that_is_not_refreshed_is_forgotten(start):
    """The source goes on with another one, while the one in contact ages."""
    monitor = start(**IDS)
    monitor.send('footprint', ROBOT)
    until_with_ids(monitor, 'collision', i1=TOUCHING)
    sent = monitor._last_stamps['obstacles']
    until_with_ids(monitor, 'clear', i2=APART)
    assert to_ns(monitor.listen('~/state')[-1].header.stamp) - sent > SECOND


def test_instance_is_not_forgotten_by_time_alone(start):
    """The tracker dies: its source is unknown before what it sent is forgotten."""
    monitor = start(**IDS)
    monitor.send('footprint', ROBOT)
    until_with_ids(monitor, 'clear', i1=APART, i2=APART)
    send_ids(monitor, i1=TOUCHING)
    monitor.await_state('collision')
    monitor.spin(0.5)
    send_ids(monitor, i2=APART)
    monitor.until(lambda: 'silent' in monitor.reason())
    assert 'clear' not in monitor.states()[monitor.states().index('collision'):]


def test_refused_instance_is_not_healed_by_another(start):
    """Id 7 is a bow tie: unknown until it is good again, whatever comes of id 3."""
    monitor = start(**IDS)
    monitor.send('footprint', ROBOT)
    until_with_ids(monitor, 'clear', i3=APART, i7=APART)
    until_with_ids(monitor, 'unknown', i7=[(5, 5), (6, 6), (6, 5), (5, 6)])
    begun = len(monitor.states())
    for _ in range(10):
        send_ids(monitor, i3=APART)
        monitor.spin(0.05)
    assert {*monitor.states()[begun:]} == {'unknown'}
    until_with_ids(monitor, 'clear', i3=APART, i7=APART)


def test_accumulating_source_keeps_every_polygon_until_its_timeout(start):
    """A second obstacle, sent on its own, does not replace the first; its age does."""
    monitor = start(obstacle__accumulate=True, obstacle__timeout=1.0, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_until('collision', 'obstacles', TOUCHING)
    sent = monitor._last_stamps['obstacles']
    monitor.send_until('clear', 'obstacles', APART)
    assert to_ns(monitor.listen('~/state')[-1].header.stamp) - sent > SECOND


def test_several_sources(start):
    """A map with stamp 0 and moving obstacles: contacts say which source they are of."""
    monitor = start(obstacles=['map', 'people'], map__timeout=0.0, people__timeout=60.0,
                    footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_set('map', APART, stamp=0)
    monitor.until(lambda: 'people' in monitor.reason() and '/map' not in monitor.reason())
    monitor.send_set('people', APART)
    monitor.await_state('clear')
    monitor.send_set('map', TOUCHING, stamp=0)
    monitor.send_set('people', [(0.2, 0.2), (9.0, 0.3)])
    monitor.until(lambda: len(monitor.contacts()) == 2, 'contact with both')
    assert [name.split('/')[0] for name in monitor.contacts()] == ['map', 'people']


def test_source_that_falls_silent_makes_footprints_unknown(start):
    """First clear, then the obstacles' publisher dies, then it lives again."""
    monitor = start(obstacle__timeout=0.5, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', APART)
    status = monitor.await_state('unknown')
    assert 'silent' in values(status)['reason'] and '/obstacles' in values(status)['reason']
    monitor.until(monitor.flag)
    monitor.send_set_until('clear', 'obstacles', APART)


def test_footprint_that_falls_silent_is_unknown(start):
    """The robot's localisation dies, while it was clear."""
    monitor = start(obstacle__timeout=60.0, footprint__timeout=0.5)
    monitor.send_set('obstacles', APART)
    monitor.send_until('clear', 'footprint', ROBOT)
    monitor.await_state('unknown')
    monitor.send_until('clear', 'footprint', ROBOT)


def test_footprint_with_an_old_stamp_is_unknown(start):
    """It counts when it was taken, not when it came."""
    monitor = start(obstacle__timeout=60.0, footprint__timeout=0.5)
    monitor.send_set('obstacles', APART)
    monitor.send('footprint', ROBOT, monitor.now() - 5 * SECOND)
    monitor.until(lambda: monitor.state() and values(monitor.status())['age'])
    assert monitor.state() == 'unknown'


def test_publisher_that_sees_nothing_sends_empty_sets(start):
    """It keeps its source alive and its footprints clear."""
    monitor = start(use_sim_time=True, obstacle__timeout=0.5, footprint__timeout=0.0)
    monitor.set_clock(HOUR)
    monitor.send('footprint', ROBOT, HOUR)
    monitor.send_set('obstacles', stamp=HOUR)
    monitor.await_state('clear')
    for k in range(1, 6):
        stamp = HOUR + k * SECOND * 2 // 5
        monitor.set_clock(stamp)
        monitor.send_set('obstacles', stamp=stamp)
        monitor.until(lambda: monitor.received['obstacle'] == 1 + k)
    count = len(monitor.states())
    monitor.until(lambda: len(monitor.states()) > count + 2)
    states = monitor.states()
    assert {*states[states.index('clear'):]} == {'clear'}


def test_map_is_known_when_it_ends_or_settles(start):
    """With a timeout of 0.0: unknown while it comes, then whole after a pause; then replaced."""
    monitor = start(obstacle__timeout=0.0, obstacle__settle_time=0.3, footprint__timeout=0.0)
    states = monitor.listen('~/state')
    monitor.send('footprint', ROBOT)
    for x in range(5):
        monitor.send('obstacles', box(5 + x, 5), 0)
    monitor.await_state('clear')
    assert any('sends its map' in array.status[0].message for array in states)
    monitor.send('obstacles', TOUCHING, 0)
    monitor.await_state('collision')
    monitor.send('obstacles', [], 0)
    monitor.send_set('obstacles', APART, stamp=0)
    monitor.await_state('clear')
    assert len(monitor.monitor._scene.obstacles) == 1


def test_more_obstacles_than_max_count_are_unknown_not_truncated(start):
    """Three obstacles where two are allowed, the third in contact or not: nobody knows."""
    monitor = start(obstacle__max_count=2, **LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', box(5, 5))
    monitor.await_state('clear')
    monitor.send_set('obstacles', box(5, 5), box(7, 5), box(9, 5))
    monitor.await_state('unknown')
    assert 'too many' in monitor.reason()
    monitor.send_set_until('clear', 'obstacles', box(5, 5))


def test_disabled_source_and_footprint(start):
    """A source switched off in flight no longer collides; alone, nothing is known any more."""
    monitor = start(obstacles=['map', 'people'], map__timeout=60.0, people__timeout=60.0,
                    footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_set('map', TOUCHING)
    monitor.send_set('people', APART)
    monitor.await_state('collision')
    assert monitor.set_parameters(map__enabled=False) == [None]
    monitor.await_state('clear')
    assert monitor.set_parameters(people__enabled=False) == [None]
    monitor.await_state('unknown')
    monitor.until(monitor.flag)
