# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Enumerates what can happen around one source, and checks all promises in every state.

First every order of events up to a depth, then random ones of many events: `make knowing`.
"""

import argparse
from itertools import chain
import random
import sys
import time

from knowing_events import MODES, MOVING
from knowing_world import replayed, World
from sat_collision.scene.settings import EACH_MESSAGE

EVENTS_OF_A_RUN = 40
# Events that make messages are drawn more often than those that end publishers.
_OFTEN = ('get', 'all', 'send', 'list')
# Half of the runs, and every second order, begin where a source is known.
_LISTED = ('list:F', 'send', 'all:0')
_KNOWN = {
    'unmarked': ('send:gone', 'send:F', 'all:0') + 4 * ('tick:3', 'send:F', 'all:0'),
    'new stamp': ('list:F', 'tick', 'list:F', 'all:0'),
    'each message': ('list:F', 'all:0'),
    'maps in a frame': ('transform', *_LISTED),
}


def beginning(mode):
    """Return events after which the source is known."""
    kind = MODES[mode]
    known = ('unmarked' if kind.is_refreshed else 'each message'
             if kind.set_end == EACH_MESSAGE else mode)
    events = _KNOWN.get(known, _LISTED)
    if kind.frame == MOVING:
        return tuple(chain.from_iterable(
            ('transform', one) if one == 'all:0' else (one,) for one in events))
    return events


def danger_of(world):
    """Return what is wrong in a state, '' for nothing."""
    if world.is_clear and not world.may_be_clear():
        return 'wrong clear'
    return 'late' if world.is_late() else ''


def problem_of(mode, events):
    """Return which promise is broken after some events, '' for none."""
    world = replayed(mode, events)
    if problem := danger_of(world):
        return problem
    return '' if world.heals() else 'never known again'


def every_order(mode, depth, events=()):
    """Yield every sequence of events up to a depth."""
    yield events
    if depth:
        for event in replayed(mode, events).options():
            yield from every_order(mode, depth - 1, (*events, event))


def wander(mode, rng, begin=(), length=EVENTS_OF_A_RUN):
    """Return random events, and the problem that they end with, '' for none."""
    world, events = replayed(mode, begin), [*begin]
    for _ in range(length):
        options = world.options()
        often = [one for one in options if one.startswith(_OFTEN)]
        often += 4 * ['switch'] * (not world.source.settings.enabled)
        event = rng.choice(options + 3 * often)
        world.do(event)
        events.append(event)
        if problem := danger_of(world):
            return events, problem
    return events, '' if world.heals() else 'never known again'


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


def explore(mode, depth, runs, seed=1):
    """Return the number of states visited, and the first problem with its events, or None."""
    states = 0
    begins = (), beginning(mode)
    for begin in begins:
        for events in every_order(mode, depth, begin):
            states += 1
            if problem := problem_of(mode, events):
                return states, (problem, shortest(mode, events))
    rng = random.Random(seed)
    for k in range(runs):
        events, problem = wander(mode, rng, begins[k % 2])
        states += len(events)
        if problem:
            return states, (problem, shortest(mode, events))
    return states, None


def main():
    """Explore all modes; return 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--depth', type=int, default=2)
    parser.add_argument('--runs', type=lambda text: int(float(text)), default=10_000)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--modes', nargs='*', default=MODES, choices=MODES)
    options = parser.parse_args()
    found = []
    for mode in options.modes:
        begun = time.monotonic()
        states, problem = explore(mode, options.depth, options.runs, options.seed)
        print(f'{mode}: {states} states in {time.monotonic() - begun:.0f} s, '
              f'{problem or "all promises kept in each"}', flush=True)
        found += [problem] if problem else []
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
