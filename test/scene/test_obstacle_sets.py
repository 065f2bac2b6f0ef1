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
    """Return sets with a window of 10 and a timeout of 100."""
    sets = ObstacleSets()
    sets.window, sets.timeout = 10, 100
    return sets


def take(sets, *stamps):
    """Let messages join their sets, which are begun if they are new; return whether each was."""
    begun = []
    for stamp in stamps:
        begun.append(stamp != 0 and not sets.continues(stamp))
        (sets.begin if begun[-1] else sets.join)(stamp)
    return begun


def test_sets_take_turns_on_two_sides(sets):
    """Each is whole when it is said to be."""
    sides = []
    for number, stamp in enumerate((1000, 1020, 1040), 1):
        assert take(sets, stamp, stamp + 1) == [True, False]
        sides.append(sets.side)
        assert (sets.start, sets.last, sets.number) == (stamp, stamp + 1, number)
        assert not sets.is_whole
    assert sides[0] == sides[2] != sides[1]


@pytest.mark.parametrize('stamps, is_cut', [
    ((1000, 1010, 1019), True), ((1000, 1010, 1020), False), ((1000, 1011), False),
    ((1000, 995, 900), False)])
def test_set_is_cut_off_where_no_pause_goes_before(sets, stamps, is_cut):
    """A pause is as long as the window, counted from the last stamp before it."""
    take(sets, *stamps)
    assert sets.is_cut == is_cut


def test_stamps_that_a_set_includes(sets):
    """A late one joins the set, but does not lie in it."""
    assert not sets.includes(1000)
    take(sets, 1000)
    assert [sets.includes(stamp) for stamp in (989, 990, 1010, 1011)] == [
        False, True, True, False]


def test_late_stamps_join_and_those_of_another_clock_do_not(sets):
    """A stamp is late if it is before the set by less than the timeout."""
    assert take(sets, 1000, 1010, 990, 901) == [True, False, False, False]
    assert (sets.start, sets.last) == (1000, 1010)
    assert take(sets, 900) == [True]


def test_first_set_does_not_count_unless_a_pause_went_before(sets):
    """Its beginning may have been missed; that of the next one has been seen."""
    take(sets, 1000)
    assert not sets.counts
    take(sets, 1020)
    assert sets.counts
    sets.clear()
    sets.settle()
    take(sets, 1000)
    assert sets.counts


def test_set_with_a_loss_does_not_count(sets):
    """Nor does one that begins with the first message after the loss."""
    sets.settle()
    take(sets, 1000, 1001)
    sets.miss()
    take(sets, 1002)
    assert not sets.counts
    take(sets, 1020)
    assert sets.counts
    sets.miss()
    take(sets, 1040)
    assert not sets.counts


def test_messages_without_a_stamp_count_from_pause_to_pause(sets):
    """Those after a pause are seen from their beginning."""
    take(sets, 0, 0)
    assert not sets.counts
    sets.settle()
    assert not sets.counts, 'nothing has come since'
    take(sets, 0, 0)
    assert sets.counts
    assert sets.number == 2


def test_message_before_is_remembered_until_a_pause_or_a_loss(sets):
    """What comes with its stamp joins its set, whatever else is true of it."""
    for forget in (sets.miss, sets.settle, sets.clear):
        take(sets, 1000, 1003)
        assert sets.current == 1003
        forget()
        assert sets.current is None


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
    assert stage.held == {0: (10, 30), 1: 20}
    assert 'set_window cuts in two' in stage.state().reasons[-1]


def test_next_set_only_adds_while_it_comes_in():
    """What the last one held stays until the next is known to be whole."""
    stage = Stage()
    stage.burst(10, 20, 30)
    stage.wait_until(0.1)
    stage.see(11)
    assert stage.held == {0: (10, 11), 1: 20, 2: 30}
    stage.see(21)
    assert stage.held == {0: (10, 11), 1: (20, 21), 2: 30}
    stage.whole()
    assert stage.held == {0: 11, 1: 21}


def test_set_is_whole_after_a_pause():
    """Nothing of it came for set_quiet; what comes still later joins it all the same."""
    stage = Stage()
    stage.robot()
    stage.burst(10, 20)
    stage.wait_until(0.04)
    stage.see(30, stamp=0.0)
    stage.wait_until(0.09)
    assert stage.status() == 'unknown'
    stage.wait_until(0.0901)
    assert stage.status() == 'clear'
    stage.see(0.5, stamp=0.0)
    assert stage.held == {0: 10, 1: 20, 2: 30, 3: 0.5}
    assert stage.status() == 'collision'


def test_set_is_whole_when_the_next_one_begins():
    """At 100 Hz there is no pause of 50 ms."""
    stage = Stage(ObstacleSettings('lidar', '/polygons', set_window=0.0))
    stage.robot()
    for time, status in ((0.0, 'unknown'), (0.01, 'clear'), (0.02, 'clear')):
        stage.wait_until(time)
        stage.burst(10, 20)
        assert stage.status() == status


@pytest.mark.parametrize('spacing', [0.0, 0.002])
def test_order_within_a_set_means_nothing(spacing):
    """One of eleven lies on the robot all the time: first of its set, then last, then between."""
    stage = Stage()
    stage.robot()
    places = [0.5, *range(10, 110, 10)]
    statuses = set()
    for number in range(12):
        order = places[::-1] if number % 2 else places[number:] + places[:number]
        for k, x in enumerate(order):
            stage.wait_until(number / 10 + k * spacing)
            stage.robot()
            stage.see(x)
            if number:
                statuses.add(stage.status())
    assert statuses == {'collision'}


def test_late_heartbeat_does_not_end_the_set_that_comes_in():
    """The empty polygon that ended the last set was overtaken."""
    stage = Stage()
    stage.robot()
    stage.see(0.5, stamp=0.0)
    stage.wait_until(0.1)
    stage.see(10)
    stage.heartbeat(stamp=0.0)
    assert stage.status() == 'collision'
    stage.heartbeat(stamp=0.1)
    assert stage.status() == 'clear'


def test_set_cut_by_the_window_is_unknown_until_one_is_not():
    """Each of ten obstacles is stamped when it was built, 5 ms apart."""
    stage = Stage()
    stage.robot()
    for number in range(3):
        for k in range(10):
            stage.wait_until(number / 10 + k * 0.005)
            stage.see(10 + 2 * k)
            assert stage.status() == 'unknown'
    assert stage.state().reasons == (
        'obstacle source lidar on /polygons sends sets that set_window cuts in two: set it to '
        'more than a set takes or to 0 with one stamp a set, use ids, or set accumulate',)
    stage.wait_until(0.3)
    stage.burst(10, 20)
    assert stage.status() == 'unknown'
    stage.whole()
    assert stage.status() == 'clear'


def test_lone_publisher_replaces_itself():
    """One obstacle a message at 10 Hz is one obstacle that moves, never a trace."""
    stage = Stage()
    for tenth in range(5):
        stage.wait_until(tenth / 10)
        stage.see(10 + tenth)
        stage.wait_until(tenth / 10 + 0.051)
        assert stage.held == {0: 10 + tenth}


def test_shrinking_set_leaves_no_ghost():
    """What is gone from the scan goes when the scan is whole."""
    stage = Stage()
    stage.burst(10, 20, 30)
    stage.wait_until(0.1)
    stage.see(11)
    assert stage.held == {0: (10, 11), 1: 20, 2: 30}
    stage.wait_until(0.2)
    assert stage.held == {0: 11}


def test_growing_set_takes_places_of_its_own():
    """An obstacle that comes into view is the last of its set."""
    stage = Stage()
    stage.burst(10)
    stage.wait_until(0.1)
    stage.burst(11, 21)
    stage.wait_until(0.2)
    assert stage.held == {0: 11, 1: 21}


def test_late_message_joins_the_set_that_is_coming_in():
    """A message overtaken by the next set, as by another route, costs a ghost at most."""
    stage = Stage()
    stage.burst(10, 20, stamp=0.0)
    stage.wait_until(0.1)
    stage.see(11, stamp=0.1)
    stage.see(30, stamp=0.0)
    stage.see(21, stamp=0.1)
    stage.whole()
    assert stage.held == {0: 11, 1: 30, 2: 21}


@pytest.mark.parametrize('stamp', [58.0, 0.1])
def test_clock_set_back_by_the_timeout_or_more_begins_a_set(stamp):
    """A publisher's clock ran ahead and is corrected: its obstacles go on replacing each other."""
    stage = Stage(future_tolerance=100.0)
    stage.burst(10, 20, stamp=60.0)
    stage.wait_until(0.1)
    stage.burst(11, stamp=stamp)
    assert stage.held == {0: (10, 11), 1: 20}
    stage.wait_until(0.2)
    assert stage.held == {0: 11}
    stage.burst(12, stamp=stamp + 0.1)
    assert stage.held == {0: (11, 12)}


def test_earlier_stamp_begins_a_set_where_nothing_times_out():
    """With timeout 0 a lower stamp means another clock: joining would pile up ghosts for ever."""
    stage = Stage(ObstacleSettings('lidar', '/polygons', timeout=0.0))
    stage.burst(10, 20, stamp=0.0)
    stage.burst(11, stamp=-0.1)
    stage.burst(12, stamp=-0.2)
    assert stage.held == {0: (11, 12)}
    stage.wait_until(0.051)
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
        stage.whole()
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
        stage.whole()
    assert stage.held == {0: 10, 1: 20}


def test_sources_do_not_share_sets():
    """Two sensors with one rhythm each hold their own obstacles."""
    stage = Stage(ObstacleSettings('lidar', '/polygons'), ObstacleSettings('radar', '/radar'))
    stage.see(10)
    stage.see(20, name='radar')
    assert [tuple(name) for name, _ in stage.scene.obstacles] == [('lidar', 0), ('radar', 0)]


def test_heartbeat_is_a_set_of_nothing():
    """An empty scan: nothing is there any more, and the source is trusted."""
    stage = Stage()
    stage.robot()
    stage.burst(0.5, 20)
    stage.wait_until(0.1)
    assert stage.status() == 'collision'
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
    assert stage.held == {-1: 50, 0: (10, 11), 1: 20}
    stage.whole()
    assert stage.held == {-1: 50, 0: 11}


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
