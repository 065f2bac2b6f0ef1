# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The promises of docs/knowing.md in every state, and that each rule is needed for them."""

from functools import wraps

from knowing import explore, problem_of
from knowing_events import MODES
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


# Bodies that are sent until they are known, and one that moves then.
KNOWN = 'send:gone' + 4 * ' · send:F · all:0 · tick:3' + ' · send:F · all:0'
MOVING = 2 * 'send:F · all:0 · tick:3 · ' + 'tick:3 · send:F · send:M · tick · send:M · send:F'
# What breaks each rule, by name: a form, events found by the enumeration that break a promise
# then, and what is set to which other value.
BROKEN = {}


def instead_of(kind, name, mode, events, *others):
    """Let a function, which is given the one that it replaces, break a rule."""
    def register(replacement, original=getattr(kind, name)):
        @wraps(original)
        def broken(*arguments, **more):
            return replacement(original, *arguments, **more)
        BROKEN[replacement.__name__] = mode, events, [(kind, name, broken), *others]
    return register


@instead_of(Listings, 'pass_time', 'marked, own stamps', 'list:F · get:0 · tick:3',
            (Source, 'deadline', 0))
def end_sets_on_pauses(pass_time, self, now):
    pass_time(self, now)
    if self._open.begun + 10**9 <= now:
        self._close(now)


@instead_of(Stream, 'receive', 'marked',
            'list:TF · send · send · all:0 · list:R · send · lose:0 · get:0')
def ignore_losses(receive, self, number, now):
    news = receive(self, number, now)
    return CONTINUES if news is LOST else news


@instead_of(Stream, 'receive', 'marked, waiting', 'list:U · get:0 · send · clock:ahead · get:0')
def take_any_message_for_the_first(receive, self, number, now):
    news = receive(self, number, now)
    return BEGUN if news is JOINED else news


@instead_of(Listings, '_close', 'each message', 'list:R · get:0')
def replace_by_any_listing(close, self, now):
    self._open.is_sound = True
    close(self, now)


@instead_of(Listings, 'end', 'marked',
            'list:F · get:0 · tick:3 · tick:3 · send · get:0 · tick:3')
def let_sets_be_as_old_as_their_marks(end, self, message, now):
    self._open.time = message.time
    end(self, message, now)


@instead_of(Listings, '_continue', 'marked, own stamps',
            'list:F · send · list:TF · all:0 · send · get:0')
def separate_marked_sets_by_stamps(follow, self, message, now):
    follow(self, message, now)
    if self._end == EMPTY_POLYGON and self._open.stamp not in (-NEVER, message.stamp):
        self._held.pop().group.clear()
        self._open = self._new_listing(is_sound=True)


@instead_of(Listings, '_separate', 'new stamp',
            'list:TF · send · list:TF · timeout · send · all:0 · list:TF · lose:0 · send'
            ' · list:FFFFT · timeout · get:0 · get:0')
def let_older_stamps_end_sets(_, self, message, now):
    if self._open.stamp not in (-NEVER, message.stamp) and not self._open.is_empty:
        self._close(now)


@instead_of(Listings, '_replaces', 'collections, no numbers',
            'list:T · clock:little · list:F · all:0')
def let_sets_of_one_replace_newer_ones(_, self, message):
    return not message.refusal


@instead_of(Listings, '_replaces', 'maps of one',
            'stamps:zero · list:T · stamps: · stamps:zero · stamps: · list:F · tick')
def compare_stamps_of_maps(_, self, message):
    return not message.refusal and not (self._whole and message.stamp < self._whole.stamp)


@instead_of(Listings, 'receive', 'each message', 'list:F · list:R · all:0')
def forget_refusals_at_the_next_message(receive, self, message, now):
    refusal = receive(self, message, now)
    self.is_known |= self._whole is not None
    return refusal


@instead_of(Listings, '_continue', 'marked maps',
            'list:F · get:0 · send · list:FFFFT · send · get:0 · lose:0 · get:0')
def ignore_losses_of_maps(follow, self, message, now):
    is_known = self.is_known
    follow(self, message, now)
    self.is_known = is_known


@instead_of(SetGroup, 'add', 'marked maps', 'list:FFT · send · send · send · all:0')
def count_old_and_new_maps_together(add, self, body, *arguments, **more):
    if sum(len(group) for group in self._store.groups) < self._store.max_count:
        return add(self, body, *arguments, **more)
    return TOO_MANY


@instead_of(Source, 'update_publishers', 'marked maps',
            'list:F · send · all:0 · second:start · end · news')
def keep_what_others_have_proved(_, self, endpoints, now):
    self.stream.update(endpoints)
    self.find_faults(now)


@instead_of(Stream, 'receive', 'marked',
            'second:namesake · end · news · second:F · all:1 · start:a · matched:2 · list:F'
            ' · get:2 · send · get:2 · second:F · get:1')
def ignore_older_namesakes(receive, self, number, now):
    publisher = self._publisher
    news = receive(self, number, now)
    if news is LOST:
        self._publisher = publisher
    return news


@instead_of(Monitor, 'receive_mixed', 'collections, waiting',
            'list:FT · second:namesake · list:F · all:0 · list: · clock:ahead · second:F · mix:1')
def take_mixed_messages_for_those_of_one(_, self, name, messages, now, arrived=None):
    stream = self.scene.sources[name].stream
    number = None if stream.is_interrupted else stream.last + 1
    return self.receive_batch(name, messages, now, number, arrived)


@instead_of(Refreshed, '_continue', 'unmarked', 'send:F · get:0')
def know_bodies_at_once(follow, self, message, now):
    follow(self, message, now)
    self.is_known = True


@instead_of(Refreshed, 'pass_time', 'unmarked',
            f'{KNOWN} · send:T · all:0 · tick:3 · send:F · get:0 · tick:3 · tick',
            (Source, 'deadline', 0))
def forget_bodies_by_time(pass_time, self, now):
    pass_time(self, now)
    for group in self.groups:
        group.forget_before(now - 3 * self.timeout // 4)


@instead_of(Refreshed, 'receive', 'ids', f'{KNOWN} · send:0T · tick · send:0F · all:0')
def take_0_for_an_id(receive, self, message, now):
    if message.instance == 0:
        message = message._replace(instance=7)
    return receive(self, message, now)


@instead_of(KeyedGroup, 'add', 'ids',
            'send:F · all:0 · tick:3 · tick:3 · all:0 · tick:3 · tick:3 · all:0 · send:T · get:0'
            ' · send:M · get:0')
def let_any_stamp_of_an_id_replace(add, self, instance, *arguments):
    for one in self._held.get(instance, ()):
        one.stamp = -1
    return add(self, instance, *arguments)


@instead_of(KeyedGroup, 'add', 'ids', f'{KNOWN} · send:M · stamps:back · send:T · all:0')
def drop_older_stamps_of_an_id(add, self, instance, body, frame_id, stamp, *more):
    if all(stamp > one.stamp for one in self._held.get(instance, ())):
        return add(self, instance, body, frame_id, stamp, *more)


@instead_of(Knowledge, 'configure', 'unmarked',
            'timeout · send:F · get:0 · tick:3 · send:F · get:0 · tick · tick · stamps:ahead'
            ' · send:F · get:0 · timeout')
def keep_what_another_timeout_has_proved(configure, self, settings, tolerance, now):
    heard, self._heard = getattr(self, '_heard', -NEVER), -NEVER
    configure(self, settings, tolerance, now)
    self._heard = heard


@instead_of(Ingest, 'apply', 'maps as collections', 'list: · list:R · all:0 · tick:3')
def leave_out_what_waits(apply, self, settings, data, number, now, may_wait=True):
    refused = apply(self, settings, data, number, now, may_wait)
    return refused if isinstance(refused, Rejection) else None


@instead_of(view, 'predict', 'ids', f'{MOVING} · all:0')
def delay_times(predict, *arguments):
    found = predict(*arguments)
    return found and found._replace(seconds=found.seconds + 0.1)


@instead_of(prediction, '_course', 'ids', f'{MOVING} · tick · all:0')
def ignore_the_age_of_obstacles(course, obstacle, motion, ahead):
    return course(obstacle, motion, 0.0)


def do_nothing(*_, **__):
    """Return None, which is false."""


BROKEN |= {
    'ignore_refusals': ('collections', 'list:FR · get:0', [
        (Knowledge, 'refuse', do_nothing), (Listings, 'refuse', do_nothing)]),
    'know_maps_while_another_is_open': (
        'marked maps', 'list: · list:FFT · all:0 · tick:3', [(knowledge, '_LONGEST_OPEN', NEVER)]),
    'never_request_history': (
        'maps of one', 'list:T · list:T · second:start · news · all:0 · list: · get:0',
        [(Scene, 'wants_history', do_nothing)]),
    'know_maps_while_they_come_again': (
        'marked maps',
        'list:F · send · all:0 · list: · list:R · lose:0 · get:0 · renew · get:0 · get:0',
        [(Stream, 'is_again', False)]),
    'leave_maps_where_they_were': (
        'maps in a frame', 'transform · list:F · send · all:0 · transform',
        [(Ingest, 'follow_maps', do_nothing)]),
    'know_maps_while_a_part_waits': (
        'maps as collections', 'list:F · list: · all:0 · list:FFFFT · list:FR · lose:0 · get:0',
        [(Source, 'wait', do_nothing)]),
    'keep_what_waits_when_disabled': (
        'maps as collections', 'list:F · all:0 · switch · switch · transform',
        [(WaitingItems, 'renew', do_nothing)]),
    'allow_two_publishers': (
        'maps of one', 'list:F · second:start · news · get:0', [(Stream, 'faults', lambda _: [])]),
    'count_every_namesake': ('collections, waiting', 'list:F · get:0 · kill', [
        (Stream, 'publishers', property(lambda self: [*(self._endpoints or {}).values()]))]),
    'go_on_where_a_publisher_came': (
        'marked, own stamps', 'list:U · get:0 · second:namesake · second:T · news · get:1',
        [(Stream, 'interrupt', do_nothing)]),
    'trust_a_silent_publisher': (
        'unmarked', f'{KNOWN} · tick:3 · tick:3 · tick:3', [(Refreshed, 'pass_time', do_nothing)]),
    'keep_what_another_clock_has_proved': (
        'marked', 'list:F · send · all:0 · clock:back', [(Source, 'set_back', do_nothing)]),
    'wait_for_what_has_a_place': (
        'marked, waiting',
        'list:F · send · all:0 · tick · transform · tick · list:F · send · get:0 · clock:little'
        ' · clock:little · list:TF · all:0', [(Source, 'receive_early', do_nothing)]),
    'keep_velocities_for_ever': (
        'ids', f'{KNOWN} · send:F · send:M · tick · send:M · send:F · all:0 · tick:3',
        [(prediction, 'VELOCITY_LASTS', NEVER)]),
    'treat_moving_obstacles_as_apart': (
        'ids', f'{MOVING} · all:0', [(prediction, '_is_apart', lambda *_: True)]),
    'fit_velocities_over_any_gap': (
        'ids',
        'send:F · all:0 · tick:3 · send:F · all:0 · tick:3 · tick:3 · send:M · tick · stamps:zero'
        ' · send:M · all:0', [(velocity, '_LONGEST', NEVER)]),
    'treat_unknown_motion_as_known': (
        'ids',
        'send:gone · send:F · all:0 · tick:3 · tick:3 · send:F · all:0 · tick:3 · tick:3 · send:M'
        ' · all:0', [(prediction.Prediction, 'is_known', True)])}


@pytest.mark.parametrize('mode, events, changes', BROKEN.values(), ids=BROKEN)
def test_breaking_a_rule_breaks_a_promise(mode, events, changes, monkeypatch):
    assert problem_of(mode, events.split(' · ')) == ''
    for change in changes:
        monkeypatch.setattr(*change)
    assert problem_of(mode, events.split(' · ')) != ''
