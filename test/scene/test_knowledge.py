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

"""The rules of knowledge: streams, sets, keys and maps, without any bodies or geometry."""

import re

import pytest
from sat_collision.scene.knowledge import Keys, Maps, Sets
from sat_collision.scene.settings import NEVER
from sat_collision.scene.streams import BEGUN, CONTINUES, Endpoint, JOINED, LOST, Stream

NEWS = {'': CONTINUES, '^': BEGUN, '~': JOINED, '!': LOST}


class Letters(dict):
    """
    A group whose obstacles are letters, each with its time and the listing that had it.

    It is its own store: `new_set` returns another group.
    """

    def __init__(self):
        self.listing = 0

    def new_set(self):
        return Letters()

    def new_keyed(self):
        return self

    @property
    def oldest(self):
        return min((time for time, _ in self.values()), default=NEVER)

    def forget_before(self, time):
        self._keep(lambda known: known[0] >= time)

    def end_listing(self, replaces):
        if replaces:
            self._keep(lambda known: known[1] >= self.listing)
        self.listing += 1

    def _keep(self, stays):
        kept = {letter: known for letter, known in self.items() if stays(known)}
        self.clear()
        self.update(kept)


def feed(listing, messages):
    """
    Let a listing receive messages, each at the time of its stamp; return (held, is_known).

    A word is an obstacle's letter, or a dot for an empty polygon, and its stamp; with one of
    NEWS before it, or a question mark if it is unreadable. A number alone lets time pass.
    """
    for word in messages.split():
        news, letter, stamp = re.fullmatch(r'([\^~!?]?)([a-z.]?)(\d+)', word).groups()
        now = int(stamp)
        listing.pass_time(now)
        if news == '?':
            listing.spoil('noise', now)
        elif letter == '.':
            listing.end(NEWS[news], max(now, 1), now, now)
        elif letter:
            group = listing.receive(NEWS[news], max(now, 1), now, now)
            group[letter] = now, group.listing
    held = sorted(letter for group in listing.groups for letter in group)
    return ''.join(held), listing.is_known


def new_sets(**attributes):
    sets = Sets(Letters())
    sets.window, sets.timeout, sets.max_count = 20, 1000, 100
    for name, value in attributes.items():
        setattr(sets, name, value)
    return sets


@pytest.mark.parametrize('messages, held, is_known', [
    # The beginning: number 1, or the end of a set before without a gap.
    ('^a0 b0 .0', 'ab', True),
    ('~a0 b0 .0', 'ab', False),
    ('~a0 b0 .0 c100 .100', 'c', True),
    ('~b0 c100 d200', 'cd', True),
    ('a0 .0', 'a', False),
    # The end: a later set, an empty polygon with its stamp, never a pause.
    ('^a0 b0', 'ab', False),
    ('^a0 b0 900', 'ab', False),
    ('^a0 b0 c100', 'abc', True),
    ('^.0', '', True),
    ('^a0 .0 .100', '', True),
    # Only a whole set replaces the last whole set and everything after it.
    ('^a0 .0 b100', 'ab', True),
    ('^a0 .0 b100 .100', 'b', True),
    ('^a0 .0 b100 !c100 .100', 'abc', True),
    ('^a0 .0 b100 !c200 .200', 'abc', True),
    ('^a0 .0 b100 !c200 .200 d300', 'abcd', True),
    ('^a0 .0 b100 !c200 .200 d300 .300', 'd', True),
    ('^a0 .0 b100 !.100 c200 .200', 'c', True),
    ('^a0 .0 b100 c200 !d200 e300 f400', 'ef', True),
    # A message that cannot be read may be of the set before it or after it.
    ('^a0 .0 b100 ?100 .100', 'ab', False),
    ('^a0 .0 ?100 b100 .100', 'ab', False),
    ('^a0 .0 ?100 b100 .100 c200 .200', 'c', True),
    # Stamps within the window of a set's first stamp belong to it, in any order.
    ('^a20 b40 c20 .30', 'abc', True),
    ('^a100 b120 c141', 'abc', True),
    # A set that begins within the window of the last stamp shows that the window cuts sets in two.
    ('^a100 b120 c121', 'abc', False),
    ('^a100 b120 c121 d300', 'abcd', False),
    ('^a100 b120 c121 d300 e500', 'de', True),
    ('^.0 a100 !b115 c121 d300', 'abcd', False),
    # A message after the end with the set's stamp still belongs to it.
    ('^a0 .0 b0', 'ab', True),
    ('^a0 .0 b0 c100 .100', 'c', True)])
def test_sets(messages, held, is_known):
    """Rules 1 to 4: where a set begins and ends, and what is held."""
    assert feed(new_sets(), messages) == (held, is_known)


@pytest.mark.parametrize('count, messages, held, is_known', [
    (1, '^a0', 'a', True), (1, '^a0 b100', 'b', True), (1, '~a0', 'a', False),
    (1, '~a0 b100', 'b', True), (1, '^a0 !b100', 'ab', True), (2, '^a0 b0', 'ab', True),
    (2, '^a0 b0 .0', 'ab', True), (2, '^a0 b0 c100', 'abc', True),
    # An empty polygon ends the same set; a third obstacle may belong to it, too.
    (2, '^a0 b15 .15', 'ab', True), (2, '^a0 b15 .0', 'ab', True), (2, '^a0 b15 .18', 'ab', True),
    (2, '^a0 b15 .18 c25', 'abc', True), (2, '^a0 b0 c0', 'abc', True),
    (2, '^a0 b15 c18', 'abc', False), (2, '^a0 b15 c18 d100 e115', 'abcde', False),
    (2, '^a0 b15 c18 d100 e200', 'de', True),
    # If a set had more than max_count, reaching it does not end the next one.
    (2, '^a0 b0 c0 d100 e100', 'abcde', True), (2, '^a0 b0 c0 d100 e100 .100', 'de', True),
    (2, '^a0 b0 c0 d100 e100 .100 f200 g200', 'fg', True)])
def test_sets_end_with_max_count(count, messages, held, is_known):
    """Rule 3: a set is whole with max_count obstacles."""
    assert feed(new_sets(max_count=count), messages) == (held, is_known)


def test_last_whole_set_is_known_for_its_timeout():
    """Rule 5: it is kept until the source is unknown, even if no later set is whole."""
    sets = new_sets()
    assert feed(sets, '^a0 b10 .10 !c100 !d200 1000') == ('abcd', True)
    assert sets.deadline == 1000
    assert feed(sets, '1001') == ('bcd', False)
    assert feed(sets, '1201') == ('', False)


def test_set_that_took_longer_than_the_timeout_is_not_known():
    """Rule 5: its first obstacle has timed out when it is whole."""
    sets = new_sets(window=2000)
    assert feed(sets, '^a0 b1001 .1001') == ('b', False)


@pytest.mark.parametrize('messages, words', [
    ('', 'has not sent anything yet'),
    ('~a0', 'has not sent a whole set yet'),
    ('^a0 .0 1001', 'has been silent for longer than its timeout'),
    ('^a0 .0 !b1001', 'has not sent a whole set since messages were lost'),
    ('^a0 .0 ?100 b1001', 'has not sent a whole set since noise'),
    ('^a100 b120 c121', 'sends sets that set_window cuts in two'),
    ('~a0 b600 1700 c1700 d2800', 'end each set with an empty polygon, or set timeout to more'),
    ('^a0 .0 b300 1001', 'has not sent a whole set for longer than its timeout'),
    ('^a0 .0 b700', '')])
def test_reasons_of_sets(messages, words):
    """Rule 5: they say what is missing, and what to set if the period is too long."""
    sets = new_sets()
    feed(sets, messages)
    problem = sets.problem(int(re.findall(r'\d+', '0' + messages)[-1]))
    assert words in problem and bool(words) == bool(problem)


def test_reason_gives_period_and_timeout():
    """Rule 5: sets without an end every 1.1 s, and a timeout of 2 s."""
    sets = new_sets(timeout=2 * 10**9)
    for stamp in (0, 1100, 2200):
        sets.receive(CONTINUES, stamp * 10**6, stamp * 10**6, stamp * 10**6)
    sets.pass_time(3300 * 10**6)
    assert 'every 1.1 s' in sets.problem(3300 * 10**6)
    assert 'more than 2.4 s' in sets.problem(3300 * 10**6)


def new_keys():
    keys = Keys(Letters())
    keys.timeout = 1000
    return keys


@pytest.mark.parametrize('messages, held, is_known', [
    # Known once stamps span a whole timeout.
    ('^a0 999', 'a', False),
    ('^a0 b999', 'ab', False),
    ('^a0 b1000', 'ab', True),
    ('^a0 1000', 'a', False),
    ('~a0 b1000', 'ab', True),
    ('^.0 .1000', '', True),
    # A gap, silence or an unreadable message starts over.
    ('^a0 !b500 b1000', 'ab', False),
    ('^a0 !b500 b1000 b1500', 'b', True),
    ('^a0 b1000 !b1100', 'b', False),
    ('^a0 b1000 ?1100 b2000', 'b', False),
    ('^a0 b1000 ?1100 b1900 b2100', 'b', True),
    ('^a0 b1000 2001', '', False),
    ('^a0 b1000 c2001', 'c', False),
    ('^a0 b1000 c2001 c3001', 'c', True),
    # Forgotten when a later message shows that the publisher lives, not by time alone.
    ('^a0 b900 1500', 'ab', False),
    ('^a0 b400 b1000', 'ab', True),
    ('^a0 b400 b1000 1900', 'ab', True),
    ('^a0 b400 b1001', 'b', True),
    ('^a0 b400 .1001', 'b', True),
    ('^a0 b400 b1000 2000', 'ab', True),
    ('^a0 b400 b1000 2001', '', False)])
def test_keys(messages, held, is_known):
    """Rule 7: when a listing by id or shape is known, and when an obstacle is forgotten."""
    assert feed(new_keys(), messages) == (held, is_known)


def test_messages_past_the_timeout_do_not_count():
    """Rule 7: their stamps are a timeout apart, but they arrive too late."""
    keys = new_keys()
    for stamp in (0, 1000):
        keys.receive(CONTINUES, stamp, stamp, 5000)
    assert not keys.is_known
    assert 'silent' in keys.problem(5000)


def test_late_message_does_not_undo_a_silence():
    """Rule 7: by its stamp there was no silence, but obstacles were already forgotten."""
    keys = new_keys()
    assert feed(keys, '^.0 a1000 b1500 2501') == ('', False)
    for stamp, is_known in ((2000, False), (2999, False), (3000, True)):
        keys.receive(CONTINUES, stamp, stamp, 3000)
        assert keys.is_known == is_known


def test_older_stamps_change_nothing():
    """Rule 7: messages arrive in the wrong order."""
    keys = new_keys()
    for stamp in (500, 0, 1499):
        keys.receive(CONTINUES, stamp, stamp, 1499)
    assert not keys.is_known
    keys.receive(CONTINUES, 1500, 1500, 1500)
    keys.receive(CONTINUES, 100, 100, 1500)
    assert keys.is_known and keys.deadline == 2500


def test_reasons_of_keys():
    keys = new_keys()
    assert keys.problem(0) == 'has not sent anything yet'
    feed(keys, '^a0')
    assert keys.problem(0).startswith('has not been received for its timeout')
    feed(keys, '!a100')
    assert keys.problem(0).endswith('without a gap since messages were lost')
    feed(keys, '1101')
    assert keys.problem(1101).startswith('has been silent')


def new_maps():
    maps = Maps(Letters())
    maps.settle_time = 100
    return maps


@pytest.mark.parametrize('messages, held, is_known', [
    # A map begins with number 1 or after an empty polygon, and ends with an empty polygon.
    ('^a0 b1 .2', 'ab', True),
    ('~a0 b1 .2', 'ab', False),
    ('~a0 .1 b2 .3', 'b', True),
    ('^.0', '', True),
    # The first map of a stream is also known when no message has come for settle_time.
    ('^a0 b50 150', 'ab', False),
    ('^a0 b50 151', 'ab', True),
    ('~a0 b50 5000', 'ab', False),
    # Settling drops nothing: a second map replaces the first when an empty polygon ends it.
    ('^a0 101 b200 5000', 'ab', True),
    ('^a0 101 b200 .201', 'ab', True),
    ('^a0 .1 b2 5000', 'ab', True),
    ('^a0 .1 b2 .3', 'b', True),
    ('^a0 .1 b2 a3 .4', 'ab', True),
    # After a gap or an unreadable message, a later map must end with an empty polygon.
    ('^a0 !b1 5000', 'ab', False),
    ('^a0 !b1 .2', 'ab', False),
    ('^a0 !b1 .2 c3 .4', 'c', True),
    ('^a0 .1 !b2', 'ab', False),
    ('^a0 .1 ?2 5000', 'a', False),
    ('^a0 .1 ?2 .3 b4 .5', 'b', True)])
def test_maps(messages, held, is_known):
    """Rule 8: a map is known once all of a listing has certainly arrived."""
    assert feed(new_maps(), messages) == (held, is_known)


def test_queued_messages_delay_settling():
    """Rule 8: a map settles when no new messages come, not while they are queued."""
    maps = new_maps()
    feed(maps, '^a0')
    maps.wait(90)
    assert feed(maps, '190') == ('a', False)
    assert maps.deadline == 190
    assert feed(maps, '191') == ('a', True)


def test_history_is_requested_after_a_loss():
    """Rule 8: a publisher can send its map again; the reason names a depth that is too small."""
    maps = new_maps()
    assert not maps.wants_history
    feed(maps, '^a0 !b1')
    assert maps.wants_history
    feed(maps, '^a2')
    assert not maps.wants_history
    maps = new_maps()
    feed(maps, '~b5')
    assert 'the depth of its publisher must hold the whole map' in maps.problem(5)


A, B, A_AGAIN = Endpoint('a', '/a'), Endpoint('b', '/b'), Endpoint('c', '/a')


def play(stream, events, now=0):
    """Give a stream numbers and lists of endpoints; return what it answers to each."""
    return [stream.update(event) if isinstance(event, list) else stream.receive(event, now)
            for event in events]


@pytest.mark.parametrize('events, news', [
    ([1, 2, 3], [BEGUN, CONTINUES, CONTINUES]),
    ([7, 8, 10, 11], [JOINED, CONTINUES, LOST, CONTINUES]),
    ([1, 2, 1, 2], [BEGUN, CONTINUES, BEGUN, CONTINUES]),
    ([5, 6, 4], [JOINED, CONTINUES, JOINED]),
    ([5, 6, 6], [JOINED, CONTINUES, JOINED]),
    ([None, None], [JOINED, CONTINUES]),
    # A change of publishers ends a stream, even if the next number continues it.
    ([[A], 1, 2, [A, B], 3], [True, BEGUN, CONTINUES, True, JOINED]),
    ([[A], 1, [A, B], [A], 2], [True, BEGUN, True, True, JOINED]),
    ([[A], 1, [], [A], 2, 3], [True, BEGUN, True, True, JOINED, CONTINUES]),
    ([[A], 1, [A], 2], [True, BEGUN, False, CONTINUES]),
    # Number 1 may come before its publisher is announced; that announcement then ends nothing.
    ([1, [A], 2], [BEGUN, False, CONTINUES]),
    ([[], 1, [A], 2, [A, B], 3], [False, BEGUN, False, CONTINUES, True, JOINED]),
    ([[A], 1, 1, [], [B], 2], [True, BEGUN, BEGUN, False, False, CONTINUES])])
def test_streams(events, news):
    """Rule 10: which messages are of one publisher, without a gap."""
    assert play(Stream(), events) == news


def test_lost_messages_are_counted():
    """A publisher that restarts has lost none."""
    stream = Stream()
    play(stream, [3, 4, 7, 1, 2, 5])
    assert stream.lost == 4


@pytest.mark.parametrize('endpoints, words', [
    ([], ['has no publisher']), ([A], []), ([A, B], ['has 2 publishers, /a and /b']),
    ([A, A_AGAIN], ['has 2 publishers, /a and /a']),
    ([A, Endpoint('b')], ['has 2 publishers, /a and of a node whose name is not known yet']),
    ([Endpoint('a', '/a', 'which is deaf')], ['has a publisher, /a, which is deaf'])])
def test_number_of_publishers(endpoints, words):
    """No publisher, two, or one that cannot be received is a fault."""
    stream = Stream()
    assert stream.faults() == []
    stream.update(endpoints)
    faults = stream.faults()
    assert len(faults) == len(words)
    assert all(fault.startswith(word) for fault, word in zip(faults, words))


def test_second_publisher_is_found_by_message_numbers():
    """It is a fault for a timeout, even if the graph shows only one."""
    stream = Stream()
    stream.timeout = 1000
    play(stream, [[A], 5, 6, 3])
    assert 'those of two publishers' in stream.faults()[0]
    stream.pass_time(1000)
    assert stream.faults()
    stream.pass_time(1001)
    assert stream.faults() == []


def test_killed_publisher_does_not_count_beside_its_successor():
    """Rule 11: the middleware lists it until its lease ends."""
    stream = Stream()
    play(stream, [[A], 1, 2, [A, A_AGAIN]])
    assert stream.faults(), 'the new one has sent nothing yet'
    assert play(stream, [1]) == [BEGUN]
    assert stream.publishers == [A_AGAIN] and stream.faults() == []
    assert play(stream, [2, [A_AGAIN], 3]) == [CONTINUES, False, CONTINUES]


@pytest.mark.parametrize('number', [3, 4, 50])
def test_namesake_that_still_sends_counts(number):
    """Rule 11: if the older one is received again there are two, whatever its number."""
    stream = Stream()
    play(stream, [[A], *range(1, 11), [A, A_AGAIN], 1, 2, 3, 4])
    assert stream.faults() == []
    play(stream, [number])
    assert stream.faults()


@pytest.mark.parametrize('other', [B, Endpoint('c')])
def test_publisher_of_another_node_counts(other):
    """Rule 11: also while its name is unknown."""
    stream = Stream()
    play(stream, [[A], 1, 2, [A, other], 1, 2])
    assert stream.faults()


def test_restarted_stream_begins_with_number_1():
    """A latched map comes again without being taken for a loss or a second publisher."""
    stream = Stream()
    play(stream, [[A], 1, 2, 5])
    stream.restart()
    assert play(stream, [1, 2]) == [BEGUN, CONTINUES]
    assert stream.faults() == []
    assert play(stream, [[A, B]]) == [True], 'the number 1 was that of a'
