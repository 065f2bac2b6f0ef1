# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The promises of docs/knowing.md in every state, and that each rule is needed for them."""

from knowing import explore, problem_of
from knowing_messages import MODES
import pytest
from sat_collision.messages.ingest import Ingest
from sat_collision.messages.rejections import Rejection
from sat_collision.messages.waiting import WaitingItems
from sat_collision.monitor import Monitor
from sat_collision.scene import knowledge, prediction, velocity, view
from sat_collision.scene.knowledge import Knowledge, Listings, Refreshed
from sat_collision.scene.obstacle_store import KeyedGroup, SetGroup, TOO_MANY
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import EMPTY_POLYGON, NEVER
from sat_collision.scene.sources import Source
from sat_collision.scene.streams import BEGUN, CONTINUES, JOINED, LOST, Stream


@pytest.mark.parametrize('mode', MODES)
def test_all_promises_hold_in_every_state(mode):
    _, problem = explore(mode, depth=1, runs=50)
    assert problem is None


@pytest.mark.long
@pytest.mark.parametrize('mode', MODES)
def test_all_promises_hold_in_many_more_states(mode):
    _, problem = explore(mode, depth=2, runs=400, seed=2)
    assert problem is None


def end_sets_on_pauses(patch):
    def pass_time(self, now, original=Listings.pass_time):
        original(self, now)
        if self._open.begun + 10**9 <= now:
            self._close(now)
    patch.setattr(Listings, 'pass_time', pass_time)
    patch.setattr(Source, 'deadline', 0)


def ignore_losses(patch):
    def receive(self, number, now, original=Stream.receive):
        news = original(self, number, now)
        return CONTINUES if news is LOST else news
    patch.setattr(Stream, 'receive', receive)


def take_any_message_for_the_first(patch):
    def receive(self, number, now, original=Stream.receive):
        news = original(self, number, now)
        return BEGUN if news is JOINED else news
    patch.setattr(Stream, 'receive', receive)


def replace_by_any_listing(patch):
    def close(self, now, original=Listings._close):
        self._open.is_sound = True
        original(self, now)
    patch.setattr(Listings, '_close', close)


def let_sets_be_as_old_as_their_marks(patch):
    def end(self, message, now, original=Listings.end):
        self._open.time = message.time
        original(self, message, now)
    patch.setattr(Listings, 'end', end)


def separate_marked_sets_by_stamps(patch):
    def follow(self, message, now, original=Listings._continue):
        original(self, message, now)
        if self._end == EMPTY_POLYGON and self._open.stamp not in (-NEVER, message.stamp):
            self._open.group.clear()
            self._open = self._new_listing(is_sound=True)
    patch.setattr(Listings, '_continue', follow)


def let_older_stamps_end_sets(patch):
    def separate(self, message, now):
        if self._open.stamp not in (-NEVER, message.stamp) and not self._open.is_empty:
            self._close(now)
    patch.setattr(Listings, '_separate', separate)


def compare_stamps_of_maps(patch):
    def replaces(self, message):
        return not message.refusal and not (self._whole and message.stamp < self._whole.stamp)
    patch.setattr(Listings, '_replaces', replaces)


def forget_refusals_at_the_next_message(patch):
    def receive(self, message, now, original=Listings.receive):
        refusal = original(self, message, now)
        self.is_known |= self._whole is not None
        return refusal
    patch.setattr(Listings, 'receive', receive)


def ignore_refusals(patch):
    for kind in (Knowledge, Listings):
        patch.setattr(kind, 'refuse', lambda *_, **__: None)


def ignore_losses_of_maps(patch):
    def continues(self, message, now, original=Listings._continue):
        is_known = self.is_known
        original(self, message, now)
        self.is_known = is_known
    patch.setattr(Listings, '_continue', continues)


def count_old_and_new_maps_together(patch):
    def add(self, body, *arguments, original=SetGroup.add, **more):
        if sum(len(group) for group in self._store.groups) < self._store.max_count:
            return original(self, body, *arguments, **more)
        return TOO_MANY
    patch.setattr(SetGroup, 'add', add)


def keep_what_others_have_proved(patch):
    def update(self, endpoints, now):
        self.stream.update(endpoints)
        self.find_faults(now)
    patch.setattr(Source, 'update_publishers', update)


def ignore_older_namesakes(patch):
    def receive(self, number, now, original=Stream.receive):
        publisher = self._publisher
        news = original(self, number, now)
        if news is LOST:
            self._publisher = publisher
        return news
    patch.setattr(Stream, 'receive', receive)


def take_mixed_messages_for_those_of_one(patch):
    def receive(self, name, messages, now, arrived=None):
        stream = self.scene.sources[name].stream
        number = None if stream.is_interrupted else stream.last + 1
        return self.receive_batch(name, messages, now, number, arrived)
    patch.setattr(Monitor, 'receive_mixed', receive)


def know_bodies_at_once(patch):
    def follow(self, message, now, original=Refreshed._continue):
        original(self, message, now)
        self.is_known = True
    patch.setattr(Refreshed, '_continue', follow)


def forget_bodies_by_time(patch):
    def pass_time(self, now, original=Refreshed.pass_time):
        original(self, now)
        for group in self.groups:
            group.forget_before(now - 3 * self.timeout // 4)
    patch.setattr(Refreshed, 'pass_time', pass_time)
    patch.setattr(Source, 'deadline', 0)


def take_0_for_an_id(patch):
    def receive(self, message, now, original=Refreshed.receive):
        if message.instance == 0:
            message = message._replace(instance=7)
        return original(self, message, now)
    patch.setattr(Refreshed, 'receive', receive)


def let_any_stamp_of_an_id_replace(patch):
    def add(self, instance, *arguments, original=KeyedGroup.add):
        for one in self._held.get(instance, ()):
            one.stamp = -1
        return original(self, instance, *arguments)
    patch.setattr(KeyedGroup, 'add', add)


def drop_older_stamps_of_an_id(patch):
    def add(self, instance, body, frame_id, stamp, *more, original=KeyedGroup.add):
        if all(stamp > one.stamp for one in self._held.get(instance, ())):
            return original(self, instance, body, frame_id, stamp, *more)
    patch.setattr(KeyedGroup, 'add', add)


def keep_what_another_timeout_has_proved(patch):
    def configure(self, settings, tolerance, now, original=Knowledge.configure):
        heard, self._heard = getattr(self, '_heard', -NEVER), -NEVER
        original(self, settings, tolerance, now)
        self._heard = heard
    patch.setattr(Knowledge, 'configure', configure)


def leave_out_what_waits(patch):
    def apply(self, settings, data, number, now, may_wait=True, original=Ingest.apply):
        refused = original(self, settings, data, number, now, may_wait)
        return refused if isinstance(refused, Rejection) else None
    patch.setattr(Ingest, 'apply', apply)


def delay_times(patch):
    def predict(*arguments, original=prediction.predict):
        found = original(*arguments)
        return found and found._replace(seconds=found.seconds + 0.1)
    patch.setattr(view, 'predict', predict)


def ignore_the_age_of_obstacles(patch):
    def course(obstacle, motion, ahead, original=prediction._course):
        return original(obstacle, motion, 0.0)
    patch.setattr(prediction, '_course', course)


# Rules that are broken by one other value: of what, its name and the value.
VALUES = {
    'let_sets_of_one_replace_newer_ones': (
        Listings, '_replaces', lambda self, message: not message.refusal),
    'know_maps_while_another_is_open': (knowledge, '_LONGEST_OPEN', NEVER),
    'never_request_history': (Scene, 'wants_history', lambda *_: False),
    'know_maps_while_they_come_again': (Stream, 'is_again', False),
    'leave_maps_where_they_were': (Ingest, 'follow_maps', lambda self, now: None),
    'know_maps_while_a_part_waits': (Source, 'wait', lambda self, first: None),
    'keep_what_waits_when_disabled': (WaitingItems, 'renew', lambda self, name: None),
    'allow_two_publishers': (Stream, 'faults', lambda self: []),
    'count_every_namesake': (
        Stream, 'publishers', property(lambda self: [*(self._endpoints or {}).values()])),
    'go_on_where_a_publisher_came': (Stream, 'interrupt', lambda self: None),
    'trust_a_silent_publisher': (Refreshed, 'pass_time', lambda self, now: None),
    'keep_what_another_clock_has_proved': (Source, 'set_back', lambda self, now: None),
    'wait_for_what_has_a_place': (Source, 'receive_early', lambda *_: None),
    'keep_velocities_for_ever': (prediction, 'VELOCITY_LASTS', NEVER),
    'treat_moving_obstacles_as_apart': (prediction, '_is_apart', lambda *_: True),
    'fit_velocities_over_any_gap': (velocity, '_LONGEST', NEVER),
    'treat_unknown_motion_as_known': (prediction.Prediction, 'is_known', True),
}
# Bodies that are sent until they are known, and one that moves then.
KNOWN = 'send:gone' + 4 * ' · send:F · all:0 · tick:3' + ' · send:F · all:0'
MOVING = 2 * 'send:F · all:0 · tick:3 · ' + 'tick:3 · send:F · send:M · tick · send:M · send:F'
# For each broken rule a form, and events found by the enumeration that break a promise.
WITNESSES = (
    (end_sets_on_pauses, 'marked, own stamps', 'list:F · get:0 · tick:3'),
    (ignore_losses, 'marked', 'list:TF · send · send · all:0 · list:R · send · lose:0 · get:0'),
    (take_any_message_for_the_first, 'marked, waiting',
     'list:U · get:0 · send · clock:ahead · get:0'),
    (replace_by_any_listing, 'each message', 'list:R · get:0'),
    (let_sets_be_as_old_as_their_marks, 'marked',
     'list:F · get:0 · tick:3 · tick:3 · send · get:0 · tick:3'),
    (separate_marked_sets_by_stamps, 'marked, own stamps',
     'list:F · send · list:TF · all:0 · send · get:0'),
    (let_older_stamps_end_sets, 'new stamp',
     'list:TF · send · list:TF · timeout · send · all:0 · list:TF · lose:0 · send · list:FFFFT'
     ' · timeout · get:0 · get:0'),
    ('let_sets_of_one_replace_newer_ones', 'collections, no numbers',
     'list:T · clock:little · list:F · all:0'),
    (compare_stamps_of_maps, 'maps of one',
     'stamps:zero · list:T · stamps: · stamps:zero · stamps: · list:F · tick'),
    (forget_refusals_at_the_next_message, 'each message', 'list:F · list:R · all:0'),
    (ignore_refusals, 'collections', 'list:FR · get:0'),
    (ignore_losses_of_maps, 'marked maps',
     'list:F · get:0 · send · list:FFFFT · send · get:0 · lose:0 · get:0'),
    ('know_maps_while_another_is_open', 'marked maps', 'list: · list:FFT · all:0 · tick:3'),
    (count_old_and_new_maps_together, 'marked maps', 'list:FFT · send · send · send · all:0'),
    ('never_request_history', 'maps of one',
     'list:T · list:T · second:start · news · all:0 · list: · get:0'),
    ('know_maps_while_they_come_again', 'marked maps',
     'list:F · send · all:0 · list: · list:R · lose:0 · get:0 · renew · get:0 · get:0'),
    ('leave_maps_where_they_were', 'maps in a frame',
     'transform · list:F · send · all:0 · transform'),
    ('know_maps_while_a_part_waits', 'maps as collections',
     'list:F · list: · all:0 · list:FFFFT · list:FR · lose:0 · get:0'),
    ('allow_two_publishers', 'maps of one', 'list:F · second:start · news · get:0'),
    (keep_what_others_have_proved, 'marked maps',
     'list:F · send · all:0 · second:start · end · news'),
    ('count_every_namesake', 'collections, waiting', 'list:F · get:0 · kill'),
    (ignore_older_namesakes, 'marked',
     'second:namesake · end · news · second:F · all:1 · start:a · matched:2 · list:F · get:2'
     ' · send · get:2 · second:F · get:1'),
    (take_mixed_messages_for_those_of_one, 'collections, waiting',
     'list:FT · second:namesake · list:F · all:0 · list: · clock:ahead · second:F · mix:1'),
    ('go_on_where_a_publisher_came', 'marked, own stamps',
     'list:U · get:0 · second:namesake · second:T · news · get:1'),
    (know_bodies_at_once, 'unmarked', 'send:F · get:0'),
    (forget_bodies_by_time, 'unmarked',
     f'{KNOWN} · send:T · all:0 · tick:3 · send:F · get:0 · tick:3 · tick'),
    ('trust_a_silent_publisher', 'unmarked', f'{KNOWN} · tick:3 · tick:3 · tick:3'),
    (take_0_for_an_id, 'ids', f'{KNOWN} · send:0T · tick · send:0F · all:0'),
    (let_any_stamp_of_an_id_replace, 'ids',
     'send:F · all:0 · tick:3 · tick:3 · all:0 · tick:3 · tick:3 · all:0 · send:T · get:0'
     ' · send:M · get:0'),
    (drop_older_stamps_of_an_id, 'ids', f'{KNOWN} · send:M · stamps:back · send:T · all:0'),
    (keep_what_another_timeout_has_proved, 'unmarked',
     'timeout · send:F · get:0 · tick:3 · send:F · get:0 · tick · tick · stamps:ahead · send:F'
     ' · get:0 · timeout'),
    ('keep_what_another_clock_has_proved', 'marked', 'list:F · send · all:0 · clock:back'),
    ('keep_what_waits_when_disabled', 'maps as collections',
     'list:F · all:0 · switch · switch · transform'),
    (leave_out_what_waits, 'maps as collections', 'list: · list:R · all:0 · tick:3'),
    ('wait_for_what_has_a_place', 'marked, waiting',
     'list:F · send · all:0 · tick · transform · tick · list:F · send · get:0 · clock:little'
     ' · clock:little · list:TF · all:0'),
    (delay_times, 'ids', f'{MOVING} · all:0'),
    ('keep_velocities_for_ever', 'ids',
     f'{KNOWN} · send:F · send:M · tick · send:M · send:F · all:0 · tick:3'),
    (ignore_the_age_of_obstacles, 'ids', f'{MOVING} · tick · all:0'),
    ('treat_moving_obstacles_as_apart', 'ids', f'{MOVING} · all:0'),
    ('fit_velocities_over_any_gap', 'ids',
     'send:F · all:0 · tick:3 · send:F · all:0 · tick:3 · tick:3 · send:M · tick · stamps:zero'
     ' · send:M · all:0'),
    ('treat_unknown_motion_as_known', 'ids',
     'send:gone · send:F · all:0 · tick:3 · tick:3 · send:F · all:0 · tick:3 · tick:3 · send:M'
     ' · all:0'),
)


@pytest.mark.parametrize('broken, mode, events', WITNESSES, ids=lambda one: getattr(
    one, '__name__', one if one in VALUES else ''))
def test_breaking_a_rule_breaks_a_promise(broken, mode, events, monkeypatch):
    assert problem_of(mode, events.split(' · ')) == ''
    if broken in VALUES:
        monkeypatch.setattr(*VALUES[broken])
    else:
        broken(monkeypatch)
    assert problem_of(mode, events.split(' · ')) != ''
