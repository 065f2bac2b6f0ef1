# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The rules of knowledge: streams, listings and what is sent again and again, without geometry."""

import re

import pytest
from sat_collision.scene.knowledge import Listings, Message, Refreshed
from sat_collision.scene.obstacle_store import ObstacleStore
from sat_collision.scene.settings import NEVER, ObstacleSettings, POLYGON, POLYGON_INSTANCE
from sat_collision.scene.streams import BEGUN, CONTINUES, Endpoint, JOINED, LOST, Stream

NEWS = {'': CONTINUES, '^': BEGUN, '~': JOINED, '!': LOST}
TIMEOUT, TOLERANCE = 1000, 100


class Letters(dict):
    """Contacts without geometry: the body of each obstacle is a letter."""

    def place_obstacle(self, obstacle, letter):
        obstacle.row = 0
        self[obstacle] = letter

    def remove_obstacle(self, obstacle):
        obstacle.row = None

    def hide_obstacles(self, group, rows):
        """Do nothing: a group that is cleared has none."""


class Heard:
    """What is held and known of one publisher."""

    def __init__(self, set_end, has_ids=False, **changes):
        settings = ObstacleSettings('lidar', '/lidar', set_end=set_end, **{
            'type': POLYGON_INSTANCE if has_ids else POLYGON, 'timeout': TIMEOUT / 1e9,
            'max_count': 100, **changes})
        self.letters = Letters()
        self.store = ObstacleStore('lidar', self.letters)
        self.store.max_count = settings.max_count
        self.knowledge = (Refreshed if set_end == 'none' else Listings)(
            self.store, settings, TOLERANCE)
        self.has_ids = has_ids
        self.now = 1

    def feed(self, messages):
        """
        Receive messages; return what is held, and whether all is known.

        A word is an obstacle's letter, a capital if it is refused, or a dot for an empty polygon,
        and its stamp; after an @ when it arrives, which is otherwise at its stamp, or at once if
        that has passed. One of NEWS may stand before it, or a question mark if it is unreadable.
        A number alone lets time pass. With ids a letter is one, and z the id 0.
        """
        knowledge = self.knowledge
        for word in messages.split():
            news, letter, *times = re.fullmatch(
                r'([\^~!?]?)([a-zA-Z.]?)(\d+)@?(\d*)', word).groups()
            stamp = int(times[0])
            now = self.now = int(times[1] or max(self.now, stamp))
            if knowledge.deadline < now:
                knowledge.pass_time(now)
            if news == '?':
                knowledge.refuse('noise', now, is_read=False)
            elif letter:
                message = Message(
                    NEWS[news], stamp or now, min(stamp or now, now), bool(stamp),
                    letter if letter.islower() else None, 'map',
                    'bad' if letter.isupper() else None,
                    'zabcdefgh'.index(letter.lower()) if self.has_ids and letter != '.' else None)
                (knowledge.end if letter == '.' else knowledge.receive)(message, now)
        return self.held, not knowledge.problem(self.now)

    @property
    def held(self):
        return ''.join(sorted(self.letters[one] for one in self.store if one.row is not None))


@pytest.mark.parametrize('messages, held, is_known', [
    # A set begins with number 1 or after a mark, and ends with a mark: never with a stamp or
    # a pause.
    ('^a1 b1 .1', 'ab', True),
    ('~a1 b1 .1', 'ab', False),
    ('a1 .1', 'a', False),
    ('~a1 b1 .1 c2 .2', 'c', True),
    ('^a1 b1', 'ab', False),
    ('^a1 b1 900', 'ab', False),
    ('^a1 b1 c500', 'abc', False),
    ('^.1', '', True),
    ('^a1 .1 .2', '', True),
    # Order says what belongs together, whatever the stamps: each of its own,
    ('^a1 b31 c61 .61 d101 e131', 'abcde', True),
    ('^a1 b31 c61 .61 d101 e131 .131', 'de', True),
    # the same as in the set before, within and before the set before,
    ('^a1 b1 .1 c1 d1', 'abcd', True),
    ('^a1 b1 .1 c1 d1 .1', 'cd', True),
    ('^a50 b60 .60 c40 d70 .70', 'cd', True),
    # and marks of any stamp.
    ('^a500 .1 b600 .0@600 c700 .900@700 d800', 'cd', True),
    # Only a whole set replaces the last whole set and all after it. A loss is of the set it is in.
    ('^a1 .1 b2', 'ab', True),
    ('^a1 .1 b2 .2', 'b', True),
    ('^a1 .1 b2 !c3 .3', 'abc', True),
    ('^a1 .1 b2 !c3 .3 d4', 'abcd', True),
    ('^a1 .1 b2 !c3 .3 d4 .4', 'd', True),
    ('^a1 .1 b2 !.2 c3', 'abc', True),
    ('^a1 .1 b2 !.2 c3 .3', 'c', True),
    # After a refused message all is unknown until a later set is whole.
    ('^a1 .1 b2 C2', 'ab', False),
    ('^a1 .1 b2 C2 .2', 'ab', False),
    ('^a1 .1 b2 C2 .2 d3', 'abd', False),
    ('^a1 .1 b2 C2 .2 d3 .3', 'd', True),
    ('^a1 .1 ?2 b2 .2', 'ab', False),
    ('^a1 .1 ?2 b2 .2 c3 .3', 'c', True),
    # A set is as old as its oldest obstacle, an empty one as its mark.
    ('^a1 b500 .500 1001', 'ab', True),
    ('^a1 b500 .500 1002', 'b', False),
    ('^a500 .1@500 1500', 'a', True),
    ('^.1@500 1001', '', True),
    ('^.1@500 1002', '', False),
    ('^a1 b1001 .1001', 'ab', True),
    ('^a1 b1002 .1002', 'b', False),
    # What is newer counts until it and the last whole set are older than the timeout.
    ('^a500 .500 !b1@600 1500', 'ab', True),
    ('^a500 .500 !b1@600 C700 1500', 'ab', False),
    ('^a500 .500 !b1@600 c700 1501', 'c', False),
    ('^a1 .1 !b500 1002', 'b', False)])
def test_sets_that_end_with_an_empty_polygon(messages, held, is_known):
    """Rules 2 to 4: where a set begins and ends, what is held and what is known."""
    assert Heard('empty_polygon').feed(messages) == (held, is_known)


@pytest.mark.parametrize('messages, held, is_known', [
    ('^a1 b1', 'ab', False),
    ('^a1 b1 c2', 'abc', True),
    ('^a1 b1 c2 d3', 'cd', True),
    ('~a1 b2', 'ab', False),
    ('~a1 b2 c3', 'bc', True),
    # A loss between two stamps is of both sets, one within a set of that alone.
    ('^a1 b2 !c3', 'abc', True),
    ('^a1 b2 !c3 d4', 'abcd', True),
    ('^a1 b2 !c3 d4 e5', 'de', True),
    ('^a1 b2 !c2 d3', 'abcd', True),
    ('^a1 b2 !c2 d3 e4', 'de', True),
    # An older stamp makes both not whole.
    ('^a10 b20 c15', 'abc', True),
    ('^a10 b20 c15 d30', 'abcd', True),
    ('^a10 b20 c15 d30 e40', 'de', True),
    # An empty polygon is a set of none, unless a set of its stamp has begun.
    ('^a1 .2', '', True),
    ('^a1 .2 b3', 'b', True),
    ('^a1 .2 b3 c4', 'bc', True),
    ('^a1 .2 b2 c3', 'bc', True),
    ('^a1 .5 b3 c6 1004', 'bc', True),
    ('^a1 .2 b3 1003', 'b', False),
    ('^a1 .1', 'a', False),
    ('^a1 .1 b2', 'ab', True),
    # What cannot be read may be of the set before or the next; a stamp tells which.
    ('^a1 b2 ?3 c3', 'abc', False),
    ('^a1 b2 ?3 c3 d4', 'abcd', False),
    ('^a1 b2 ?3 c3 d4 e5', 'de', True),
    ('^a1 b2 C3', 'b', False),
    ('^a1 b2 C3 d4', 'bd', False),
    ('^a1 b2 C3 d4 e5', 'de', True)])
def test_sets_that_end_with_a_new_stamp(messages, held, is_known):
    """Rule 6."""
    assert Heard('new_stamp').feed(messages) == (held, is_known)


@pytest.mark.parametrize('messages, held, is_known', [
    ('~a1', 'a', True),
    ('~a1 b2', 'b', True),
    ('~a1 b1', 'b', True),
    ('~a1 !b5', 'b', True),
    ('~a1 .2', '', True),
    ('~a1 1001', 'a', True),
    ('~a1 1002', '', False),
    ('~a1 B2', 'a', False),
    ('~a1 ?2', 'a', False),
    ('~a1 B2 c3', 'c', True),
    # One with an older stamp counts beside the last one, until a newer one comes.
    ('~a10 b5', 'ab', True),
    ('~a10 b5 c7', 'abc', True),
    ('~a10 b5 c7 d11', 'd', True),
    ('~.10 a5 b7', 'ab', True),
    ('~.10 a5 b7 .11', '', True)])
def test_messages_that_are_sets_of_one(messages, held, is_known):
    """Rule 1, as `each_message` makes it true of polygons."""
    assert Heard('each_message').feed(messages) == (held, is_known)


@pytest.mark.parametrize('set_end, messages, held, is_known', [
    ('empty_polygon', '^a1 b1 1000', 'ab', False),
    ('empty_polygon', '^a1 b1 .1 9000000000000', 'ab', True),
    ('empty_polygon', '~a1 b1 .1', 'ab', False),
    ('empty_polygon', '~a1 .1 b2 .2', 'b', True),
    # The next one replaces all of it, whatever the stamps.
    ('empty_polygon', '^a500 b500 .500 c1 .1', 'c', True),
    ('empty_polygon', '^a500 .500 b500 .500', 'b', True),
    ('each_message', '~a500 b1', 'b', True),
    ('each_message', '~a500 !b1', 'b', True),
    # Something of an update was lost or refused: the old one must not stay in force.
    ('empty_polygon', '^a1 .1 b2', 'ab', True),
    ('empty_polygon', '^a1 .1 b2 !c2', 'abc', False),
    ('empty_polygon', '^a1 .1 b2 !.2', 'ab', False),
    ('empty_polygon', '^a1 .1 b2 !.2 c3 .3', 'c', True),
    ('empty_polygon', '^a1 .1 B2', 'a', False),
    ('empty_polygon', '^a1 .1 ?2 .2', 'a', False),
    # An update may take 1 s.
    ('empty_polygon', '^a1 .1 b2 1000000002', 'ab', True),
    ('empty_polygon', '^a1 .1 b2 1000000003', 'ab', False),
    ('empty_polygon', '^a1 .1 b2 1000000003 .1000000004', 'b', True)])
def test_maps(set_end, messages, held, is_known):
    """Rules 10 and 11: a map does not age, and is replaced as a whole."""
    assert Heard(set_end, timeout=0.0).feed(messages) == (held, is_known)


@pytest.mark.parametrize('messages, held, is_known', [
    # Known from the first stamp on that is a timeout and the tolerance after the first arrival.
    ('^a1 b501 c1101', 'bc', False),
    ('^a1 b501 c1102', 'bc', True),
    ('~a1 b501 c1102', 'bc', True),
    ('^a1@500 b801 c1600', 'bc', False),
    ('^a1@500 b801 c1601', 'bc', True),
    ('^a1 b501 1502', '', False),
    # Each counts until its publisher, still alive, has not sent it again, not by time alone.
    ('^a1 a501 c1001', 'aac', False),
    ('^a1 b501 c1040', 'bc', False),
    ('^a1 b501 .1040', 'b', False),
    ('^a1 b501 1500', 'ab', False),
    # An empty polygon is life, and nothing else; without a stamp not even that.
    ('^.1 .501 .1102', '', True),
    ('^a1 .1 b501 .501 c1102', 'bc', True),
    ('^a1 .0@600 b1102', 'b', False),
    # Silence, and a step from one stamp to the next, of more than the timeout.
    ('^a1 b501 c1102 2102', 'bc', True),
    ('^a1 b501 c1102 2103', '', False),
    ('^a1 b1001 c1102', 'bc', True),
    ('^a1 b1002@1000 c1102', 'bc', False),
    ('^a1 b1002@1000 c1900 d2100', 'cd', False),
    ('^a1 b1002@1000 c1900 d2101', 'cd', True),
    # A loss, a refused message, one that cannot be read.
    ('^a1 b501 c1102 !d1200', 'bcd', False),
    ('^a1 b501 c1102 !.0', 'bc', False),
    ('^a1 b501 c1102 !d1200 e1800 f2300', 'ef', False),
    ('^a1 b501 c1102 !d1200 e1800 f2301', 'ef', True),
    ('^a1 b501 c1102 D1200', 'bc', False),
    ('^a1 b501 c1102 ?1200 d1800 e2300', 'de', False),
    ('^a1 b501 c1102 D1200 d1800 e2301', 'de', True),
    # Stamps that stand and go back by no more than the timeout.
    ('^a501 b501 c1 d501', 'abcd', False),
    ('^a1 b501 c1102 d900', 'bcd', True),
    ('^a1 b501 c1102 d900 2102', 'bcd', True)])
def test_polygons_that_are_sent_again_and_again(messages, held, is_known):
    """Rule 5: right without any declaration."""
    assert Heard('none').feed(messages) == (held, is_known)


def test_late_message_does_not_undo_a_silence():
    """By its stamp there was none, but obstacles were already forgotten."""
    heard = Heard('none')
    assert heard.feed('^a1 b501 c1102 d1602 2603') == ('', False)
    assert heard.feed('e2102@2603 f3000 g3703') == ('fg', False)
    assert heard.feed('h3704')[1]


@pytest.mark.parametrize('messages, held, is_known', [
    ('^a1 b501 a1102', 'ab', True),
    ('^a1 b501 a1002 a1102', 'ab', True),
    # Where its newest stamp says; the same or an older one counts beside it, until a newer comes.
    ('^a10 a11', 'a', False),
    ('^a10 a10', 'aa', False),
    ('^a10 a5 a8', 'aaa', False),
    ('^a10 a5 a8 a10', 'aaaa', False),
    ('^a10 a5 a8 a11', 'a', False),
    # Forgotten when a message stamped more than the timeout after all of them comes.
    ('^a10 a5 b510 b1010', 'aab', False),
    ('^a10 a5 b510 b1011', 'b', False),
    ('^a10 b510 .1011', 'b', False),
    ('^a10 b510 1500', 'ab', False),
    # Id 0 is none: such messages are obstacles of their own.
    ('^z10 z10 z11', 'zzz', False),
    ('^z10 a510 b1050', 'ab', False),
    ('^z1 a501 Z600 b1102', 'ab', False),
    # A refused id stays so until a newer good message, or until it is forgotten.
    ('^a1 b501 A600 b1102', 'b', False),
    ('^a1 b501 A600 a600 b1102', 'ab', False),
    ('^a1 b501 A600 a601 b1102', 'ab', True),
    ('^a1 b501 A600 b1102 b1600', 'b', False),
    ('^a1 b501 A600 b1102 b1601', 'b', True),
    ('^a1 b501 !A600 b1102', 'b', False)])
def test_ids(messages, held, is_known):
    """Rules 8 and 9."""
    assert Heard('none', has_ids=True).feed(messages) == (held, is_known)


@pytest.mark.parametrize('set_end, has_ids, messages, held, is_known', [
    ('empty_polygon', False, '^a1 b1 .1 c2 d2', 'abcd', True),
    ('empty_polygon', False, '^a1 b1 .1 c2 d2 e2', 'abcd', False),
    ('empty_polygon', False, '^a1 b1 c1 .1', 'ab', False),
    ('empty_polygon', False, '^a1 b1 c1 .1 d2 .2', 'd', True),
    ('new_stamp', False, '^a1 b1 c2 d2 e3', 'cde', True),
    ('none', False, '^a1 b501 c502', 'ab', False),
    ('none', True, '^a1 b501 c502', 'ab', False),
    ('none', True, '^a1 z501 b502', 'az', False),
    ('none', True, '^a1 z501 a1', 'az', False),
    # A place beside the newest one takes room until that is gone.
    ('none', True, '^a1 a1 b501', 'aa', False),
    ('none', True, '^a1 a1 a2 b501 a1102', 'ab', True)])
def test_room_for_two(set_end, has_ids, messages, held, is_known):
    """Rule 17: max_count bounds one listing; without any, what is held in all."""
    heard = Heard(set_end, has_ids, max_count=2)
    assert heard.feed(messages) == (held, is_known)
    assert is_known or 'max_count, 2' in heard.knowledge.problem(heard.now)


USELESS = 'has sent nothing of use for longer than its timeout of 1e-06 s: '


@pytest.mark.parametrize('set_end, messages, words', [
    ('empty_polygon', '', 'has not sent anything yet'),
    ('none', '', 'has not sent anything yet'),
    ('empty_polygon', '?1', 'has sent nothing of use yet: a message was refused: noise'),
    ('empty_polygon', '~a1', 'has not sent a whole set since it was received from its middle on'),
    ('empty_polygon', '^a1', 'has not ended a set yet: send an empty polygon after the last '
     'obstacle of each set, or leave set_end out'),
    ('empty_polygon', '^a1 .1 b600 c1200', 'has not ended a set for 1e-06 s: send an'),
    ('empty_polygon', '^a1 !b2 .2 c3 .3 d900 1004', 'has not ended a set for 1e-06 s: send an'),
    ('empty_polygon', '^a1 .1 1002', 'has been silent for longer than its timeout of 1e-06 s: '
     'where it sees nothing let it send an empty polygon'),
    ('empty_polygon', '^a1 .1 ?900 ?1002', USELESS + 'a message was refused: noise'),
    ('empty_polygon', '^a1 .1 b2@1100', USELESS + 'its stamps are older than that'),
    ('empty_polygon', '^a1 .1 !b1002', 'has not sent a whole set since messages were lost'),
    ('empty_polygon', '^a1 .1 ?100 b900', 'has not sent a whole set since a message was refused'),
    ('empty_polygon', '^a1 b1101 .1101', 'sends sets whose oldest obstacle, lidar/0, is 1.1e-06 s '
     'old when they end, more than its timeout'),
    ('empty_polygon', '^a700 b300@701 .1400',
     'sends sets whose oldest obstacle, lidar/1, is 1.1e-06 s old'),
    ('empty_polygon', '^a1 b500 .600 c1000 1100', 'has sent no other whole set within its timeout '
     'of 1e-06 s from the oldest message of the last one'),
    ('new_stamp', '^a1 b1', 'has not sent a whole set yet'),
    ('new_stamp', '^a1 b2000 c4000 c5001', 'sends a set every 1.5e-06 s: raise timeout above'),
    ('none', '^a1', 'has not been received for its timeout of 1e-06 s and future_tolerance, 1e-07 '
     's, without a gap'),
    ('none', '^a1 !b2', 'without a gap since messages were lost'),
    ('none', '^a1 b1002@1001', 'has stamps that are further apart than its timeout'),
    ('none', '^a1 b501 1502', 'has been silent for longer than its timeout of 1e-06 s')])
def test_reasons(set_end, messages, words):
    """Rule 16: they say what is missing, and what to do."""
    heard = Heard(set_end)
    assert heard.feed(messages)[1] is False
    assert words in heard.knowledge.problem(heard.now)


def test_reasons_of_maps():
    """Rule 11: the depth of a publisher is named."""
    heard = Heard('empty_polygon', timeout=0.0)
    heard.feed('~a1 b1')
    assert 'raise the depth of its publisher to one message more' in heard.knowledge.problem(1)
    assert heard.feed('.1 b1')[1] is False and not heard.knowledge.wants_history
    heard.feed('!c1')
    assert heard.knowledge.wants_history
    assert heard.feed('.1 d1 .1')[1] and not heard.knowledge.wants_history


@pytest.mark.parametrize('set_end, whole, message', [
    ('empty_polygon', '^w1000 .1000', '!a1 .1'), ('each_message', '^w1000', 'a{}')])
def test_listings_that_are_never_whole_are_bounded(set_end, whole, message):
    """Rule 17: beyond the bound all is unknown; the last whole one stays."""
    heard = Heard(set_end, timeout=0.0 if set_end == 'empty_polygon' else 1.0)
    heard.feed(whole)
    for k in range(100):
        heard.feed(message.format(999 - k))
    assert len(heard.held) <= 22 and 'w' in heard.held and heard.knowledge.problem(heard.now)


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
    ([[A], 1, 1, [], [B], 2], [True, BEGUN, BEGUN, False, False, CONTINUES]),
    ([1, [A], 1, 1, [A, A_AGAIN], 2], [BEGUN, False, BEGUN, BEGUN, False, CONTINUES]),
    ([1, [A], [A, B], 2], [BEGUN, False, True, JOINED]),
    # Two at once may both have sent.
    ([1, [A, B], 2], [BEGUN, True, JOINED])])
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


@pytest.mark.parametrize('timeout, lasts', [(1000, 1000), (NEVER, 10**9)])
def test_second_publisher_is_found_by_message_numbers(timeout, lasts):
    """It is a fault for a timeout, of a map for 1 s, even if the graph shows only one."""
    stream = Stream()
    stream.timeout = timeout
    play(stream, [[A], 5, 6, 3])
    assert 'those of two publishers' in stream.faults()[0]
    stream.pass_time(lasts)
    assert stream.faults()
    stream.pass_time(lasts + 1)
    assert stream.faults() == []
    play(stream, [3, [B]])
    assert stream.faults() == [], 'its end is reported'


def test_killed_publisher_does_not_count_beside_its_successor():
    """Rule 11: the middleware lists it until its lease ends."""
    stream = Stream()
    play(stream, [[A], *range(1, 11), [A, A_AGAIN]])
    assert stream.faults(), 'the new one has sent nothing yet'
    assert play(stream, [1]) == [BEGUN]
    assert stream.publishers == [A_AGAIN] and stream.faults() == []
    assert play(stream, [2, 5]) == [CONTINUES, LOST]
    assert stream.faults() == [], 'number 5 of the killed one was received before'
    assert play(stream, [[A_AGAIN], 6]) == [False, CONTINUES]


UNNAMED = Endpoint('c')


@pytest.mark.parametrize('events, news', [
    ([1, 2, [A, UNNAMED], 1, [A, A_AGAIN], 2],
     [BEGUN, CONTINUES, True, BEGUN, False, CONTINUES]),
    ([1, 2, 1, [A, A_AGAIN], 2], [BEGUN, CONTINUES, BEGUN, False, CONTINUES]),
    ([1, 2, 1, [A, A_AGAIN], 1], [BEGUN, CONTINUES, BEGUN, False, BEGUN]),
    ([1, [A, B], 2, [A], [A, A_AGAIN], 1], [BEGUN, True, JOINED, True, True, BEGUN])],
    ids=['named late', 'heard before it is listed', 'received again', 'after another'])
def test_successor_of_a_killed_publisher_counts_alone(events, news):
    """Rule 11: however late its node is reported, and whoever was there before."""
    stream = Stream()
    assert play(stream, [[A], *events]) == [True, *news]
    assert stream.publishers == [A_AGAIN] and stream.faults() == []


@pytest.mark.parametrize('is_interrupted', [False, True])
@pytest.mark.parametrize('number', [3, 4, 50])
def test_namesake_that_still_sends_counts(number, is_interrupted):
    """Rule 11: if the older one is received again there are two, whatever its number."""
    stream = Stream()
    play(stream, [[A], *range(1, 11), [A, A_AGAIN], 1, 2, 3, 4])
    assert stream.faults() == []
    if is_interrupted:
        stream.interrupt()
    play(stream, [number])
    stream.pass_time(2 * 10**9)
    assert stream.faults(), 'not only while numbers show it'


@pytest.mark.parametrize('one, other', [
    (A, B), (A, Endpoint('c')), (Endpoint('a'), Endpoint('c'))])
def test_publisher_of_another_node_counts(one, other):
    """Rule 11: also while its name is unknown, or both are."""
    stream = Stream()
    play(stream, [[one], 1, 2, [one, other], 1, 2])
    assert stream.faults()


def test_restarted_stream_begins_with_number_1():
    """What was received before comes again, without being taken for a loss."""
    stream = Stream()
    play(stream, [[A], 1, 2, 5])
    stream.restart(0)
    assert play(stream, [1, 2]) == [BEGUN, CONTINUES]
    assert stream.faults() == ['is being received again from the start']
    assert play(stream, [3, 4, 5]) == [CONTINUES] * 3
    assert stream.faults() == []
    assert play(stream, [[A, B]]) == [True], 'the number 1 was that of a'


def test_map_requested_twice_is_awaited_as_the_second_time_says():
    """The first request was soon after another publisher had gone, so it had a time limit."""
    stream = Stream()
    play(stream, [[A], 1, 2, 3, [A, B], [A]])
    stream.restart(0)
    play(stream, [1, 2, 3])
    stream.restart(10**9)
    play(stream, [1, 2])
    stream.pass_time(3 * 10**9)
    assert stream.faults() == ['is being received again from the start']
