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

"""The promises of docs/knowing.md in every state, and that each rule is needed for them."""

from knowing import explore, problem_of
import knowing_world
from knowing_world import MODES
import pytest
from sat_collision.scene import knowledge, prediction, sources, velocity
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.knowledge import Keys, Maps, Sets
from sat_collision.scene.obstacles import KeyedGroup, SetGroup
from sat_collision.scene.settings import NEVER
from sat_collision.scene.streams import CONTINUES, LOST, Stream
from sat_collision.scene.velocity import MotionTracker


@pytest.mark.parametrize('mode', MODES)
def test_clear_and_times_are_right_and_every_fault_heals_in_every_state(mode):
    _, problem = explore(mode, depth=3, runs=500, seed=1)
    assert problem is None


def a_pause_ends_a_set(patch):
    def pass_time(self, now, original=Sets.pass_time):
        original(self, now)
        if self.current is not None and self.current.time + 10**9 <= now:
            self._end(self.current, now)
    deadline = Sets.deadline.fget
    patch.setattr(Sets, 'pass_time', pass_time)
    patch.setattr(Sets, 'deadline', property(lambda self: min(deadline(self), (
        self.current.time + 10**9 - 1 if self.current and not self.current.is_ended else NEVER))))


def a_gap_is_no_loss(patch):
    def receive(self, number, now, original=Stream.receive):
        news = original(self, number, now)
        return CONTINUES if news is LOST else news
    patch.setattr(Stream, 'receive', receive)


def a_set_needs_no_beginning(patch):
    def begin(self, group, start, last, time, is_begun, original=knowledge._Set.__init__):
        original(self, group, start, last, time, True)
    patch.setattr(knowledge._Set, '__init__', begin)


def any_later_set_replaces(patch):
    def follow(self, news, stamp, time, now, original=Sets._follow):
        if self.current is not None and stamp != self.current.last:
            self.current.is_begun = True
            self._end(self.current, now)
        return original(self, news, stamp, time, now)
    patch.setattr(Sets, '_follow', follow)


def two_publishers_are_no_fault(patch):
    patch.setattr(Stream, 'faults', lambda self: [])


def an_old_listing_speaks_for_who_is_left(patch):
    def update(self, endpoints, now):
        self.stream.update(endpoints)
        self._find_faults(now)
    patch.setattr(sources.Source, 'update_publishers', update)


def ids_are_known_at_once(patch):
    def receive(self, *arguments, original=Keys.receive):
        group = original(self, *arguments)
        self.is_known = True
        return group
    patch.setattr(Keys, 'receive', receive)


def ids_are_known_by_our_clock(patch):
    def receive(self, news, stamp, time, now, original=Keys.receive):
        return original(self, news, stamp, now, now)
    patch.setattr(Keys, 'receive', receive)


def ids_are_forgotten_by_time(patch):
    def pass_time(self, now, original=Keys.pass_time):
        original(self, now)
        self.group.forget_before(now - 3 * self.timeout // 4)
    deadline = Keys.deadline.fget
    patch.setattr(Keys, 'pass_time', pass_time)
    patch.setattr(Keys, 'deadline', property(lambda self: min(
        deadline(self), self.group.oldest + 3 * self.timeout // 4)))


def a_loss_among_ids_does_not_matter(patch):
    def receive(self, news, *arguments, original=Keys.receive):
        return original(self, CONTINUES, *arguments)
    patch.setattr(Keys, 'receive', receive)


def what_cannot_be_read_does_not_matter(patch):
    for listing in (Keys, Maps, Sets):
        patch.setattr(listing, 'spoil', lambda self, cause, now: None)


def a_good_message_forgives_all_refusals(patch):
    def take(self, key, body, *arguments, original=KeyedGroup.take):
        if body is not None:
            self.forget_refused()
        return original(self, key, body, *arguments)
    patch.setattr(KeyedGroup, 'take', take)


def an_older_stamp_counts(patch):
    def take(self, key, body, frame_id, time, refusal, original=KeyedGroup.take):
        if key in self._held:
            self._held[key].time = min(self._held[key].time, time)
        return original(self, key, body, frame_id, time, refusal)
    patch.setattr(KeyedGroup, 'take', take)


def a_refused_member_is_none(patch):
    def take(self, key, body, *arguments, original=SetGroup.take):
        return original(self, key, body, *arguments) if body is not None else arguments[-1]
    patch.setattr(SetGroup, 'take', take)


def a_namesake_never_counts_again(patch):
    def receive(self, number, now, original=Stream.receive):
        speaker = self._speaker
        news = original(self, number, now)
        if news is LOST:
            self._speaker = speaker
        return news
    patch.setattr(Stream, 'receive', receive)


def every_namesake_counts(patch):
    patch.setattr(Stream, 'publishers', property(lambda self: [*(self._endpoints or {}).values()]))


def any_map_settles(patch):
    def receive(self, news, stamp, time, now, original=Maps.receive):
        group = original(self, news, stamp, time, now)
        self._settles = now + self.settle_time
        return group
    patch.setattr(Maps, 'receive', receive)


def an_empty_polygon_ends_what_had_no_beginning(patch):
    def end(self, news, *arguments, original=Maps.end):
        self.receive(news, *arguments)
        self._is_begun = True
        original(self, CONTINUES, *arguments)
    patch.setattr(Maps, 'end', end)


def a_map_goes_with_a_clock_that_is_set_back(patch):
    def set_back(self, now):
        self._forget_all(now, wants_history=False)
        self._find_faults(now)
    patch.setattr(sources.Source, 'set_back', set_back)


def a_map_is_never_asked_for_again(patch):
    patch.setattr(sources.Source, 'wants_history', False)


def a_time_is_later(patch):
    def predict(*arguments, original=prediction.predict):
        found = original(*arguments)
        return found and found._replace(seconds=found.seconds + 0.01)
    patch.setattr(knowing_world, 'predict', predict)


def a_time_is_given_while_unknown(patch):
    def evaluate(self, now, monitor_fault, source_faults, *arguments,
                 original=Footprint.evaluate):
        original(self, now, monitor_fault, (), *arguments)
    patch.setattr(Footprint, 'evaluate', evaluate)


def what_moved_moves_on_for_ever(patch):
    patch.setattr(prediction, 'VELOCITY_LASTS', 10**18)


def what_moved_is_where_it_was(patch):
    def course(obstacle, motion, ahead, original=prediction._course):
        return original(obstacle, motion, 0.0)
    patch.setattr(prediction, '_course', course)


def what_moves_is_never_in_reach(patch):
    patch.setattr(prediction, '_is_apart', lambda *_: True)


def a_velocity_is_that_of_any_two_messages(patch):
    patch.setattr(velocity, '_LONGEST', 10**18)


def an_older_stamp_changes_a_velocity(patch):
    def track(self, instance, time, vertices):
        obstacle = self.listing.group.get(instance)
        if obstacle is not None:
            obstacle.motion = obstacle.motion or MotionTracker()
            obstacle.motion.place(time, vertices)
    patch.setattr(sources.Source, 'track', track)


def what_moves_unknown_stands(patch):
    patch.setattr(prediction.Prediction, 'is_known', True)


# For each rule that is broken, events that the enumeration has found to break a promise by it.
WITNESSES = (
    (a_namesake_never_counts_again, 'ended sets',
     'second:namesake · end · news · second:send · get:1 · get:1 · start:a · news · list:F · '
     'get:2 · send · get:2 · second:send · get:1'),
    (every_namesake_counts, 'sets', 'list:F · get:0 · kill'),
    (a_pause_ends_a_set, 'sets', 'list:FT · get:0 · tick'),
    (a_gap_is_no_loss, 'sets',
     'list:FT · send · get:0 · list:TF · lose:0 · lose:0 · send · get:0'),
    (a_set_needs_no_beginning, 'sets',
     'kill · second:namesake · lease · start:b · list:R · list:TF · get:2 · news · '
     'second:end · lose:2 · send · list:FT · news · get:2 · get:2'),
    (any_later_set_replaces, 'sets',
     'list:FT · get:0 · send · list:U · list:FT · lose:0 · get:0 · get:0'),
    (two_publishers_are_no_fault, 'sets',
     'second:start · kill · second:send · start:a · list:F · list:FT · get:2 · news · '
     'get:1 · get:2'),
    (an_old_listing_speaks_for_who_is_left, 'sets',
     'list:F · get:0 · list:FT · get:0 · end · second:start · news'),
    (ids_are_known_at_once, 'ids',
     'key:unreadable · key:refused · key:T · key:F · get:0 · get:0 · lose:0 · get:0'),
    (ids_are_known_by_our_clock, 'ids', 'key:old · get:0 · tick · tick · tick:3 · tick:3'),
    (ids_are_forgotten_by_time, 'ids', 'tick:3 · tick:3'),
    (a_loss_among_ids_does_not_matter, 'ids', 'key:unreadable · key:old · lose:0 · get:0'),
    (what_cannot_be_read_does_not_matter, 'sets',
     'list:FT · get:0 · send · list:U · list:FT · lose:0 · get:0 · get:0'),
    (a_good_message_forgives_all_refusals, 'ids', 'key:refused · key:ahead · get:0 · get:0'),
    (an_older_stamp_counts, 'ids', 'key:T · key:other · key:old · get:0 · get:0 · get:0'),
    (a_refused_member_is_none, 'ended sets',
     'list:F · get:0 · end · second:namesake · second:end · start:a · list:R · send · '
     'get:2 · news · get:2'),
    (any_map_settles, 'maps', 'list:TF · lose:0 · send · get:0 · tick:3'),
    (an_empty_polygon_ends_what_had_no_beginning, 'maps',
     'end · second:namesake · second:end · start:b · list:TF · news · send · list:U · send '
     '· list:R · get:2 · get:2 · get:2 · send · lose:2 · get:2'),
    (a_map_goes_with_a_clock_that_is_set_back, 'maps',
     'list:TF · send · list:FT · second:start · news · send · send · list:F · second:end · '
     'send · list:F · send · list:FT · send · news · send · list:F · get:0 · get:0 · send '
     '· list:TF · get:0 · get:0 · clock back · send · get:0 · send · get:0'),
    (a_map_is_never_asked_for_again, 'maps',
     'list:U · second:namesake · list:U · get:0 · get:0 · send · list:R · send · list:F · '
     'lose:0 · send · list:TF · get:0 · send · get:0 · lose:0 · get:0 · get:0 · get:0 · '
     'send · get:0 · list:U · get:0 · send · get:0 · kill · start:b · news · list:F · '
     'get:2'),
    (a_time_is_later, 'ids', 'tick'),
    (a_time_is_given_while_unknown, 'ids', 'key:refused · get:0'),
    (what_moved_moves_on_for_ever, 'ids', 'key:old · tick:3 · get:0'),
    (what_moved_is_where_it_was, 'ids', 'key:old · key:M · get:0 · get:0 · tick'),
    (what_moves_is_never_in_reach, 'ids', 'key:old · key:M · get:0 · get:0 · tick'),
    (a_velocity_is_that_of_any_two_messages, 'ids',
     'key:F · key:M · key:M · tick:3 · key:M · get:0 · get:0 · get:0 · get:0'),
    (an_older_stamp_changes_a_velocity, 'ids',
     'key:refused · key:old · get:0 · get:0 · key:F · get:0 · tick:3'),
    (what_moves_unknown_stands, 'ids', 'key:old · tick:3 · get:0'),
)


@pytest.mark.parametrize('broken, mode, events', WITNESSES, ids=lambda one: getattr(
    one, '__name__', ''))
def test_a_rule_that_is_broken_is_noticed(broken, mode, events, monkeypatch):
    assert problem_of(mode, events.split(' · ')) == ''
    broken(monkeypatch)
    assert problem_of(mode, events.split(' · ')) != ''
