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

"""What waits is taken in order, at the latest when patience ends; nothing is lost."""

import random

from sat_collision.scene.times import NEVER
from sat_collision.scene.waiting import WAIT, Waiting


class Desk:
    """Takes numbers that are at most `ready`, and notes what it is told."""

    def __init__(self):
        self.ready = 0
        self.taken = []
        self.waiting = Waiting(self.take)

    def take(self, name, item, now, may_wait):
        if item > self.ready and may_wait:
            return WAIT
        self.taken.append((name, item))
        return f'{item} gave up' if item > self.ready else None


def test_each_waits_for_what_came_before_it():
    desk = Desk()
    for item in (3, 1, 2):
        assert desk.waiting.add('a', item, 0, 10, 9) == []
    desk.ready = 2
    assert desk.waiting.take(10) == [] and desk.taken == []
    desk.ready = 3
    assert desk.waiting.take(10) == []
    assert desk.taken == [('a', 3), ('a', 1), ('a', 2)]
    assert 'a' not in desk.waiting


def test_names_do_not_wait_for_each_other():
    desk = Desk()
    desk.waiting.add('a', 5, 0, 10, 9)
    desk.waiting.add('b', 1, 0, 10, 9)
    desk.ready = 1
    desk.waiting.take(1)
    assert desk.taken == [('b', 1)] and 'a' in desk.waiting and 'b' not in desk.waiting
    assert desk.waiting.counts() == {'a': 1}


def test_patience_ends_for_each_at_its_time():
    desk = Desk()
    desk.waiting.add('a', 5, 0, 10, 9)
    desk.waiting.add('a', 6, 4, 10, 9)
    assert desk.waiting.earliest == 10
    assert desk.waiting.take(10) == []
    assert desk.waiting.take(11) == ['5 gave up']
    assert desk.waiting.earliest == 14
    assert desk.waiting.take(15) == ['6 gave up']
    assert desk.waiting.earliest == NEVER


def test_the_first_give_way_where_too_many_wait():
    desk = Desk()
    outcomes = [desk.waiting.add('a', item, 0, 10, 2) for item in (7, 8, 9)]
    assert outcomes == [[], [], ['7 gave up']]
    assert desk.waiting.counts() == {'a': 2}
    assert desk.waiting.add('a', 1, 0, 10, 1) == ['8 gave up', '9 gave up']


def test_what_is_dropped_is_not_taken():
    desk = Desk()
    desk.waiting.add('a', 5, 0, 10, 9)
    desk.waiting.drop()
    assert desk.waiting.take(99) == desk.taken == []
    assert desk.waiting.earliest == NEVER and 'a' not in desk.waiting


def test_nothing_is_lost_overtakes_or_waits_too_long():
    chance = random.Random(1)
    desk = Desk()
    sent = []
    for now in range(3000):
        if chance.random() < 0.5:
            name, item = chance.choice('abc'), chance.randrange(100)
            sent.append((name, item))
            desk.waiting.add(name, item, now, 20, 1000)
        desk.ready = chance.randrange(60, 100)
        desk.waiting.take(now)
        assert desk.waiting.earliest >= now
    desk.waiting.take(NEVER)
    for name in 'abc':
        assert ([item for other, item in desk.taken if other == name]
                == [item for other, item in sent if other == name])
