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

"""
Enumerates what can happen around one source, and checks all promises in every state.

First every order of events up to a depth, then random ones of many events: `make knowing`.
"""

import argparse
import random
import sys
import time

from knowing_world import MODES, replayed, World

EVENTS_OF_A_RUN = 40
# Events that make messages are drawn more often than those that end publishers.
_OFTEN = ('get', 'send', 'list', 'key')


def problem_of(mode, events):
    """Return which promise is broken after some events, '' for none."""
    world = replayed(mode, events)
    if world.is_clear and not world.may_be_clear():
        return 'wrong clear'
    if world.is_late():
        return 'late, or given while unknown'
    return '' if world.heals() else 'never known again'


def every_order(mode, depth, events=()):
    """Yield every sequence of events up to a depth."""
    yield events
    if depth:
        for event in replayed(mode, events).options():
            yield from every_order(mode, depth - 1, (*events, event))


def wander(mode, rng, length=EVENTS_OF_A_RUN):
    """Return random events, up to the first wrong clear or late time."""
    world, events = World(mode), []
    while len(events) < length:
        options = world.options()
        event = rng.choice(options + 3 * [one for one in options if one.startswith(_OFTEN)])
        world.do(event)
        events.append(event)
        if world.is_clear and not world.may_be_clear() or world.is_late():
            break
    return events


def shortest(mode, events):
    """Return a shorter sequence of events that still shows the same problem."""
    wanted = problem_of(mode, events)
    k = len(events)
    while k:
        k -= 1
        fewer = [*events[:k], *events[k + 1:]]
        if _can_happen(mode, fewer) and problem_of(mode, fewer) == wanted:
            events = fewer
            k = len(events)
    return events


def _can_happen(mode, events):
    world = World(mode)
    for event in events:
        if event not in world.options():
            return False
        world.do(event)
    return True


def explore(mode, depth, runs, seed):
    """Return the number of states visited, and the first problem with its events, or None."""
    states = 0
    for events in every_order(mode, depth):
        states += 1
        if problem := problem_of(mode, events):
            return states, (problem, list(events))
    rng = random.Random(seed)
    for _ in range(runs):
        events = wander(mode, rng)
        states += len(events)
        if problem := problem_of(mode, events):
            return states, (problem, shortest(mode, events))
    return states, None


def main():
    """Explore all modes; return 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--depth', type=int, default=3)
    parser.add_argument('--runs', type=lambda text: int(float(text)), default=10_000)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    found = []
    for mode in MODES:
        begun = time.monotonic()
        states, problem = explore(mode, options.depth, options.runs, options.seed)
        print(f'{mode}: {states} states in {time.monotonic() - begun:.0f} s, '
              f'{problem or "all promises kept in each"}', flush=True)
        found += [problem] if problem else []
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
