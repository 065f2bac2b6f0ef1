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

"""Deadlines: who missed one, and what the watching costs."""

import random
import weakref

from sat_collision.scene.deadlines import Deadlines, NEVER


class Thing:
    """Something with a deadline."""

    def __init__(self, deadline):
        self.deadline = deadline
        self.watched = NEVER


def test_a_deadline_is_missed_once_it_lies_in_the_past():
    """At the deadline itself there is still time; afterwards it is told once."""
    deadlines = Deadlines()
    thing = Thing(5)
    deadlines.watch(thing)
    assert list(deadlines.missed(5)) == []
    assert list(deadlines.missed(6)) == [thing]
    assert list(deadlines.missed(7)) == []


def test_a_deadline_may_move_both_ways():
    """Put off, it need not be told; brought forward, it must be."""
    deadlines = Deadlines()
    late, early = Thing(5), Thing(5)
    deadlines.watch(late)
    deadlines.watch(early)
    late.deadline = 9
    early.deadline = 2
    deadlines.watch(early)
    assert list(deadlines.missed(4)) == [early]
    assert list(deadlines.missed(9)) == []
    assert list(deadlines.missed(10)) == [late]


def test_random_deadlines_are_missed_exactly_when_due():
    """Things come, go and change their deadlines; each is told at the first look after its own."""
    rng = random.Random(1)
    deadlines = Deadlines()
    watched = set()
    for now in range(0, 3000, 3):
        for _ in range(5):
            thing = Thing(now + rng.randrange(60))
            deadlines.watch(thing)
            watched.add(thing)
        for thing in rng.sample(sorted(watched, key=id), len(watched) // 8):
            if rng.random() < 0.5:
                thing.watched = NEVER
                watched.remove(thing)
            else:
                thing.deadline = now + rng.randrange(60)
                deadlines.watch(thing)
        missed = set(deadlines.missed(now))
        assert missed == {thing for thing in watched if thing.deadline < now}
        watched -= missed


def test_things_no_longer_watched_take_no_memory():
    """Obstacles come and go, ten at a time, all of them long before their timeout."""
    deadlines = Deadlines()
    alive = weakref.WeakSet()
    things = []
    for deadline in range(100_000):
        things.append(Thing(deadline))
        alive.add(things[-1])
        deadlines.watch(things[-1])
        if len(things) > 10:
            things.pop(0).watched = NEVER
    assert len(alive) < 200
