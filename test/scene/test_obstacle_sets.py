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

"""Sets: which polygon of a PolygonStamped topic is which obstacle, and how long it stays."""

import pytest
from sat_collision.geometry.layout import FINGERPRINT
from sat_collision.geometry.polygon import Polygon
from sat_collision.scene.obstacle_sets import ObstacleSets
from sat_collision.scene.settings import ObstacleSettings
from stage import Stage


@pytest.fixture
def sets():
    """Return sets of three places, with a window of 10 and a timeout of 100."""
    sets = ObstacleSets()
    sets.window, sets.timeout, sets.most = 10, 100, 3
    return sets


def test_places_left_over_are_told_when_the_next_set_begins(sets):
    """Sets of three, one, none and none."""
    sets.join(1000)
    assert [sets.next_place() for _ in range(3)] == [0, 1, 2]
    assert list(sets.join(1020)) == []
    assert sets.next_place() == 0
    assert list(sets.join(1040)) == [1, 2]
    assert list(sets.join(1060)) == [0]
    assert sets.start == 1060


def test_late_stamps_join_and_those_of_another_clock_do_not(sets):
    """A stamp is late if it is before the set by less than the timeout."""
    sets.join(1000)
    for stamp in (1010, 990, 901):
        sets.join(stamp)
        assert sets.start == 1000
    sets.join(900)
    assert sets.start == 900


def test_place_beyond_the_last_is_shared(sets):
    """What comes to it is not known again."""
    sets.join(1000)
    assert [sets.next_place(fingerprint) for fingerprint in (0.1, 0.2, 0.3, 0.4, 0.5)] == [
        0, 1, 2, 3, 3]
    assert [sets.place_of_equal(fingerprint) for fingerprint in (0.1, 0.3, 0.4, 0.5)] == [
        0, 2, None, None]


def test_equal_fingerprints_share_a_place_within_a_set_only(sets):
    """And not after all was forgotten."""
    sets.join(1000)
    sets.next_place()
    sets.next_place(0.5)
    assert sets.place_of_equal(0.5) == 1
    sets.join(1020)
    assert sets.place_of_equal(0.5) is None
    assert sets.next_place(0.5) == 0
    sets.clear()
    assert sets.start is None and sets.place_of_equal(0.5) is None
    assert list(sets.join(1020)) == []


def test_messages_with_a_copied_stamp_are_different_obstacles():
    """A publisher copies the stamp of its scan into every polygon that it found there."""
    stage = Stage()
    stage.burst(10, 20, 30)
    assert stage.held == {0: 10, 1: 20, 2: 30}


def test_messages_stamped_each_within_the_window_are_different_obstacles():
    """A publisher stamps each message of a burst when it sends it, in no particular order."""
    stage = Stage()
    for x, stamp in ((10, 0.0), (20, 0.007), (30, -0.004), (40, 0.02)):
        stage.see(x, stamp)
    assert stage.held == {0: 10, 1: 20, 2: 30, 3: 40}


def test_window_counts_from_the_first_stamp_of_the_set():
    """Messages that follow each other closely do not chain up to an endless set."""
    stage = Stage()
    for x, time in ((10, 0.0), (20, 0.015), (30, 0.03)):
        stage.wait_until(time)
        stage.see(x)
    assert stage.held == {0: 30, 1: 20}


def test_next_set_replaces_in_order_while_it_comes_in():
    """The k-th of the next set replaces the k-th of the last, the others stay meanwhile."""
    stage = Stage()
    stage.burst(10, 20, 30)
    stage.wait_until(0.1)
    stage.see(11)
    assert stage.held == {0: 11, 1: 20, 2: 30}
    stage.see(21)
    stage.see(31)
    assert stage.held == {0: 11, 1: 21, 2: 31}


def test_lone_publisher_replaces_itself():
    """One obstacle a message at 10 Hz is one obstacle that moves, never a trace."""
    stage = Stage()
    for tenth in range(5):
        stage.wait_until(tenth / 10)
        stage.see(10 + tenth)
        assert stage.held == {0: 10 + tenth}


def test_shrinking_set_leaves_a_ghost_for_one_period():
    """What is gone from the scan stays for the time of one set: a ghost, not a lost obstacle."""
    stage = Stage()
    stage.burst(10, 20, 30)
    stage.wait_until(0.1)
    stage.see(11)
    assert stage.held == {0: 11, 1: 20, 2: 30}
    stage.wait_until(0.2)
    stage.see(12)
    assert stage.held == {0: 12}


def test_growing_set_takes_places_of_its_own():
    """An obstacle that comes into view is the last of its set."""
    stage = Stage()
    stage.burst(10)
    stage.wait_until(0.1)
    stage.burst(11, 21)
    stage.wait_until(0.2)
    stage.burst(12, 22)
    assert stage.held == {0: 12, 1: 22}


def test_late_message_joins_the_set_that_is_coming_in():
    """A message overtaken by the next set, as by another route, costs a ghost at most."""
    stage = Stage()
    stage.burst(10, 20, stamp=0.0)
    stage.wait_until(0.1)
    stage.see(11, stamp=0.1)
    stage.see(30, stamp=0.0)
    stage.see(21, stamp=0.1)
    assert stage.held == {0: 11, 1: 30, 2: 21}


@pytest.mark.parametrize('stamp', [58.0, 0.1])
def test_clock_set_back_by_the_timeout_or_more_begins_a_set(stamp):
    """A publisher's clock ran ahead and is corrected: its obstacles go on replacing each other."""
    stage = Stage()
    stage.burst(10, 20, stamp=60.0)
    stage.wait_until(0.1)
    stage.burst(11, stamp=stamp)
    assert stage.held == {0: 11, 1: 20}
    stage.wait_until(0.2)
    stage.burst(12, stamp=stamp + 0.1)
    assert stage.held == {0: 12}


def test_earlier_stamp_begins_a_set_where_nothing_times_out():
    """With timeout 0 a lower stamp means another clock: joining would pile up ghosts for ever."""
    stage = Stage(ObstacleSettings('lidar', '/polygons', timeout=0.0))
    stage.burst(10, 20, stamp=0.0)
    stage.burst(11, stamp=-0.1)
    stage.burst(12, stamp=-0.2)
    assert stage.held == {0: 12}


def test_same_polygon_again_in_one_set_refreshes_it():
    """A polygon that arrives twice, as from two relays, is one obstacle."""
    stage = Stage()
    stage.burst(10, 20, 10, 20, 30)
    assert stage.held == {0: 10, 1: 20, 2: 30}


def test_different_polygons_with_one_fingerprint_are_different_obstacles():
    """Two hooks of different strength; in the next set they have changed places."""
    hooks = [Polygon([(0, 0), (3, 0), (3, y), (1, y), (1, 3), (0, 3)]) for y in (1, 2)]
    for hook in hooks:
        hook.packed[0][FINGERPRINT] = 7.0
    stage = Stage()
    for time, order in ((0.0, hooks), (0.1, hooks[::-1])):
        stage.wait_until(time)
        for hook in order:
            stage.scene.obstacle('lidar', hook.packed, 'map', stage.now, stage.now)
        assert [(name.key, polygon.vertices.tolist())
                for name, polygon in stage.scene.obstacles] == [
            (key, hook.vertices.tolist()) for key, hook in enumerate(order)]


def test_refreshed_obstacle_lives_from_the_later_stamp():
    """The later one of two equal messages counts, in whatever order they arrive."""
    stage = Stage(ObstacleSettings('lidar', '/polygons', timeout=2.0, set_window=1.5))
    stage.wait_until(1.5)
    stage.see(10, stamp=0.0)
    stage.see(10, stamp=1.5)
    stage.see(10, stamp=0.5)
    stage.wait_until(3.5)
    assert stage.held == {0: 10}
    stage.wait_until(3.6)
    assert stage.held == {}


def test_obstacle_that_stands_still_is_refreshed_by_the_next_set():
    """The same polygon in the same place of every set never expires."""
    stage = Stage()
    for second in range(5):
        stage.wait_until(float(second))
        stage.burst(10, 20)
    assert stage.held == {0: 10, 1: 20}


def test_sources_do_not_share_sets():
    """Two sensors with one rhythm each hold their own obstacles."""
    stage = Stage(ObstacleSettings('lidar', '/polygons'), ObstacleSettings('radar', '/radar'))
    stage.see(10)
    stage.see(20, name='radar')
    assert [tuple(name) for name, _ in stage.scene.obstacles] == [('lidar', 0), ('radar', 0)]


def test_heartbeat_begins_a_set_and_places_nothing():
    """Two empty scans in a row: nothing is there any more, and the source is trusted."""
    stage = Stage()
    stage.robot()
    stage.burst(0.5, 20)
    stage.wait_until(0.1)
    stage.heartbeat()
    assert stage.held == {0: 0.5, 1: 20}
    stage.wait_until(0.2)
    stage.heartbeat()
    assert stage.held == {}
    assert stage.status() == 'clear'


def test_heartbeat_within_a_set_leaves_it_alone():
    """A publisher ends every burst with an empty polygon."""
    stage = Stage()
    for tenth in range(3):
        stage.wait_until(tenth / 10)
        stage.burst(10, 20)
        stage.heartbeat()
    assert stage.held == {0: 10, 1: 20}


def test_message_past_its_timeout_changes_nothing():
    """A message from a clogged network must not push out obstacles that are known better."""
    stage = Stage()
    stage.wait_until(5.0)
    stage.burst(10, 20)
    assert stage.see(30, stamp=2.9) == 'too old'
    stage.burst(11, 21)
    assert stage.held == {0: 10, 1: 20, 2: 11, 3: 21}
    assert stage.heartbeat(stamp=2.9) == 'too old'


def test_stamp_0_is_a_set_that_never_ends():
    """A map comes polygon by polygon without stamps; repeating one refreshes it."""
    stage = Stage()
    stage.burst(10, 20, stamp='none')
    stage.wait_until(1.5)
    stage.burst(30, 20, stamp='none')
    assert stage.held == {-1: 10, -2: 20, -3: 30}
    stage.wait_until(2.5)
    assert stage.held == {-2: 20, -3: 30}


def test_stamp_0_and_stamped_obstacles_of_one_topic_do_not_replace_each_other():
    """Static and seen obstacles share a topic."""
    stage = Stage()
    stage.burst(50, stamp='none')
    stage.burst(10, 20)
    stage.wait_until(0.1)
    stage.burst(11)
    stage.wait_until(0.2)
    stage.burst(12)
    assert stage.held == {-1: 50, 0: 12}


def test_accumulate_keeps_every_polygon_until_its_timeout():
    """A publisher sends one obstacle at a time, each with its own stamp."""
    stage = Stage(ObstacleSettings('lidar', '/polygons', accumulate=True))
    for second, x in enumerate((10, 20, 30)):
        stage.wait_until(float(second))
        stage.see(x)
    assert stage.held == {-1: 10, -2: 20, -3: 30}
    stage.wait_until(2.1)
    assert stage.held == {-2: 20, -3: 30}


def test_accumulate_refreshes_a_polygon_that_is_repeated():
    """The same polygon again is no second obstacle, and lives on."""
    stage = Stage(ObstacleSettings('lidar', '/polygons', accumulate=True))
    stage.see(10)
    stage.wait_until(1.5)
    stage.see(10)
    stage.wait_until(3.0)
    assert stage.held == {-1: 10}
