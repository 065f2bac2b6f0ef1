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
from sat_collision.scene.obstacle_store import KeyedGroup, SetGroup
from sat_collision.scene.settings import NEVER
from sat_collision.scene.streams import CONTINUES, LOST, Stream
from sat_collision.scene.velocity import MotionTracker


@pytest.mark.parametrize('mode', MODES)
def test_all_promises_hold_in_every_state(mode):
    _, problem = explore(mode, depth=3, runs=500, seed=1)
    assert problem is None


def end_sets_on_pauses(patch):
    def pass_time(self, now, original=Sets.pass_time):
        original(self, now)
        if self.current is not None and self.current.time + 10**9 <= now:
            self._end(self.current, now)
    deadline = Sets.deadline.fget
    patch.setattr(Sets, 'pass_time', pass_time)
    patch.setattr(Sets, 'deadline', property(lambda self: min(deadline(self), (
        self.current.time + 10**9 - 1 if self.current and not self.current.is_ended else NEVER))))


def ignore_gaps(patch):
    def receive(self, number, now, original=Stream.receive):
        news = original(self, number, now)
        return CONTINUES if news is LOST else news
    patch.setattr(Stream, 'receive', receive)


def accept_sets_without_beginning(patch):
    def begin(self, group, start, last, time, is_begun, original=knowledge._Set.__init__):
        original(self, group, start, last, time, True)
    patch.setattr(knowledge._Set, '__init__', begin)


def replace_by_any_later_set(patch):
    def follow(self, news, stamp, time, now, original=Sets._follow):
        if self.current is not None and stamp != self.current.last:
            self.current.is_begun = True
            self._end(self.current, now)
        return original(self, news, stamp, time, now)
    patch.setattr(Sets, '_follow', follow)


def allow_two_publishers(patch):
    patch.setattr(Stream, 'faults', lambda self: [])


def keep_listings_of_other_publishers(patch):
    def update(self, endpoints, now):
        self.stream.update(endpoints)
        self._find_faults(now)
    patch.setattr(sources.Source, 'update_publishers', update)


def know_ids_at_once(patch):
    def receive(self, *arguments, original=Keys.receive):
        group = original(self, *arguments)
        self.is_known = True
        return group
    patch.setattr(Keys, 'receive', receive)


def keep_what_another_timeout_has_proved(patch):
    for listing in (Keys, Sets):
        patch.delattr(listing, 'configure')


def time_ids_by_arrival(patch):
    def receive(self, news, stamp, time, now, original=Keys.receive):
        return original(self, news, stamp, now, now)
    patch.setattr(Keys, 'receive', receive)


def forget_ids_by_time(patch):
    def pass_time(self, now, original=Keys.pass_time):
        original(self, now)
        self.group.forget_before(now - 3 * self.timeout // 4)
    deadline = Keys.deadline.fget
    patch.setattr(Keys, 'pass_time', pass_time)
    patch.setattr(Keys, 'deadline', property(lambda self: min(
        deadline(self), self.group.oldest + 3 * self.timeout // 4)))


def ignore_losses_of_ids(patch):
    def receive(self, news, *arguments, original=Keys.receive):
        return original(self, CONTINUES, *arguments)
    patch.setattr(Keys, 'receive', receive)


def ignore_unreadable_messages(patch):
    for listing in (Keys, Maps, Sets):
        patch.setattr(listing, 'spoil', lambda self, cause, now: None)


def forget_refusals_on_a_good_message(patch):
    def take(self, key, body, *arguments, original=KeyedGroup.take):
        if body is not None:
            self.forget_refused()
        return original(self, key, body, *arguments)
    patch.setattr(KeyedGroup, 'take', take)


def accept_older_stamps(patch):
    def take(self, key, body, frame_id, time, refusal, original=KeyedGroup.take):
        if key in self._held:
            self._held[key].time = min(self._held[key].time, time)
        return original(self, key, body, frame_id, time, refusal)
    patch.setattr(KeyedGroup, 'take', take)


def drop_refused_members(patch):
    def take(self, key, body, *arguments, original=SetGroup.take):
        return original(self, key, body, *arguments) if body is not None else arguments[-1]
    patch.setattr(SetGroup, 'take', take)


def ignore_older_namesakes(patch):
    def receive(self, number, now, original=Stream.receive):
        publisher = self._publisher
        news = original(self, number, now)
        if news is LOST:
            self._publisher = publisher
        return news
    patch.setattr(Stream, 'receive', receive)


def count_every_namesake(patch):
    patch.setattr(Stream, 'publishers', property(lambda self: [*(self._endpoints or {}).values()]))


def settle_any_map(patch):
    def receive(self, news, stamp, time, now, original=Maps.receive):
        group = original(self, news, stamp, time, now)
        self._settles = now + self.settle_time
        return group
    patch.setattr(Maps, 'receive', receive)


def end_maps_without_beginning(patch):
    def end(self, news, *arguments, original=Maps.end):
        self.receive(news, *arguments)
        self._is_begun = True
        original(self, CONTINUES, *arguments)
    patch.setattr(Maps, 'end', end)


def drop_maps_when_the_clock_is_set_back(patch):
    def set_back(self, now):
        self._forget_all(now, wants_history=False)
        self._find_faults(now)
    patch.setattr(sources.Source, 'set_back', set_back)


def never_request_history(patch):
    patch.setattr(sources.Source, 'wants_history', False)


def delay_times(patch):
    def predict(*arguments, original=prediction.predict):
        found = original(*arguments)
        return found and found._replace(seconds=found.seconds + 0.01)
    patch.setattr(knowing_world, 'predict', predict)


def predict_while_unknown(patch):
    def evaluate(self, now, monitor_fault, source_faults, *arguments,
                 original=Footprint.evaluate):
        original(self, now, monitor_fault, (), *arguments)
    patch.setattr(Footprint, 'evaluate', evaluate)


def keep_velocities_forever(patch):
    patch.setattr(prediction, 'VELOCITY_LASTS', 10**18)


def ignore_the_age_of_obstacles(patch):
    def course(obstacle, motion, ahead, original=prediction._course):
        return original(obstacle, motion, 0.0)
    patch.setattr(prediction, '_course', course)


def treat_moving_obstacles_as_apart(patch):
    patch.setattr(prediction, '_is_apart', lambda *_: True)


def fit_velocities_over_any_gap(patch):
    patch.setattr(velocity, '_LONGEST', 10**18)


def track_older_stamps(patch):
    def track(self, instance, time, vertices):
        obstacle = self.listing.group.get(instance)
        if obstacle is not None:
            obstacle.motion = obstacle.motion or MotionTracker()
            obstacle.motion.place(time, vertices)
    patch.setattr(sources.Source, 'track', track)


def treat_unknown_motion_as_known(patch):
    patch.setattr(prediction.Prediction, 'is_known', True)


# For each broken rule, events found by the enumeration that break a promise.
WITNESSES = (
    (ignore_older_namesakes, 'ended sets',
     'second:namesake · end · news · second:send · get:1 · get:1 · start:a · news · list:F · '
     'get:2 · send · get:2 · second:send · get:1'),
    (count_every_namesake, 'sets', 'list:F · get:0 · kill'),
    (end_sets_on_pauses, 'sets', 'list:FT · get:0 · tick'),
    (ignore_gaps, 'sets',
     'list:FT · send · get:0 · list:TF · lose:0 · lose:0 · send · get:0'),
    (accept_sets_without_beginning, 'sets',
     'kill · second:namesake · lease · start:b · list:R · list:TF · get:2 · news · '
     'second:end · lose:2 · send · list:FT · news · get:2 · get:2'),
    (replace_by_any_later_set, 'sets',
     'list:FT · get:0 · send · list:U · list:FT · lose:0 · get:0 · get:0'),
    (allow_two_publishers, 'sets',
     'second:start · kill · second:send · start:a · list:F · list:FT · get:2 · news · '
     'get:1 · get:2'),
    (keep_listings_of_other_publishers, 'sets',
     'list:F · get:0 · list:FT · get:0 · end · second:start · news'),
    (know_ids_at_once, 'ids',
     'key:unreadable · key:refused · key:T · key:F · get:0 · get:0 · lose:0 · get:0'),
    (keep_what_another_timeout_has_proved, 'ids',
     'timeout · tick:3 · key:other · get:0 · tick · key:other · get:0 · timeout'),
    (keep_what_another_timeout_has_proved, 'ended sets',
     'end · second:namesake · second:end · timeout · news · start:b · list:FT · send · send '
     '· tick:3 · tick · get:2 · news · tick · get:2 · timeout · get:2'),
    (time_ids_by_arrival, 'ids', 'key:old · get:0 · tick · tick · tick:3 · tick:3'),
    (forget_ids_by_time, 'ids', 'tick:3 · tick:3'),
    (ignore_losses_of_ids, 'ids', 'key:unreadable · key:old · lose:0 · get:0'),
    (ignore_unreadable_messages, 'sets',
     'list:FT · get:0 · send · list:U · list:FT · lose:0 · get:0 · get:0'),
    (forget_refusals_on_a_good_message, 'ids', 'key:refused · key:ahead · get:0 · get:0'),
    (accept_older_stamps, 'ids', 'key:T · key:other · key:old · get:0 · get:0 · get:0'),
    (drop_refused_members, 'ended sets',
     'list:F · get:0 · end · second:namesake · second:end · start:a · list:R · send · '
     'get:2 · news · get:2'),
    (settle_any_map, 'maps', 'list:TF · lose:0 · send · get:0 · tick:3'),
    (end_maps_without_beginning, 'maps',
     'end · second:namesake · second:end · start:b · list:TF · news · send · list:U · send '
     '· list:R · get:2 · get:2 · get:2 · send · lose:2 · get:2'),
    (drop_maps_when_the_clock_is_set_back, 'maps',
     'list:TF · send · list:FT · second:start · news · send · send · list:F · second:end · '
     'send · list:F · send · list:FT · send · news · send · list:F · get:0 · get:0 · send '
     '· list:TF · get:0 · get:0 · clock back · send · get:0 · send · get:0'),
    (never_request_history, 'maps',
     'list:U · second:namesake · list:U · get:0 · get:0 · send · list:R · send · list:F · '
     'lose:0 · send · list:TF · get:0 · send · get:0 · lose:0 · get:0 · get:0 · get:0 · '
     'send · get:0 · list:U · get:0 · send · get:0 · kill · start:b · news · list:F · '
     'get:2'),
    (delay_times, 'ids', 'tick'),
    (predict_while_unknown, 'ids', 'key:refused · get:0'),
    (keep_velocities_forever, 'ids', 'key:old · tick:3 · get:0'),
    (ignore_the_age_of_obstacles, 'ids', 'key:old · key:M · get:0 · get:0 · tick'),
    (treat_moving_obstacles_as_apart, 'ids', 'key:old · key:M · get:0 · get:0 · tick'),
    (fit_velocities_over_any_gap, 'ids',
     'key:F · key:M · key:M · tick:3 · key:M · get:0 · get:0 · get:0 · get:0'),
    (track_older_stamps, 'ids',
     'key:refused · key:old · get:0 · get:0 · key:F · get:0 · tick:3'),
    (treat_unknown_motion_as_known, 'ids', 'key:old · tick:3 · get:0'),
)


@pytest.mark.parametrize('broken, mode, events', WITNESSES, ids=lambda one: getattr(
    one, '__name__', ''))
def test_breaking_a_rule_breaks_a_promise(broken, mode, events, monkeypatch):
    assert problem_of(mode, events.split(' · ')) == ''
    broken(monkeypatch)
    assert problem_of(mode, events.split(' · ')) != ''
