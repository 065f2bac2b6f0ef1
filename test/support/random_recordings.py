# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random recordings, and an oracle that says what docs/motion.md does of them, in exact fractions.

Bodies move along one line, and the footprint is so tall that it meets obstacles on all lanes: it
touches one where they are at most 1 m apart along the line. Lanes are far from each other, and
each obstacle has a number of vertices of its own: links are known without a look at distances.
Places are in eighths of a metre, so that those of messages are integers.

Most recordings are short: what goes wrong shows in few messages, and so more can be tried.
"""

from collections import Counter
from fractions import Fraction
import math
from operator import ne
import struct

from builders import collection, SECOND, serialised
import numpy as np
from recordings import (
    check, COLLECTION, INSTANCE, losses, LOST, LOST_TOPIC, MARKS, POLYGON, STAMPS, START)
from sat_collision.replay.model.result import Options
from storages import channel, mcap_of, MESSAGE, record, schema

FORMS = MARKS, STAMPS, 'collection', 'ids', None, 'map'
# What is special about each recording, by its number modulo 8; see `Recorded`.
KINDS = ({'is_slow': True}, {'faults': True}, {'is_late': True},
         {'faults': True, 'is_set_back': True}, {'is_set_back': True},
         {'faults': True, 'is_slow': True}, {'is_late': True}, {'faults': True})
FOOTPRINTS = 'footprint', 'second'
# Two messages further apart are not linked, in ns.
LONGEST = 10 * SECOND
# In place of the number of a body, of a polygon that is refused.
REFUSED = -1
TOLERANCE = SECOND // 10
METRE = 8
# The rounding of times to ns and the tolerance of the sweep, at speeds of up to 80 m/s.
NEAR = METRE * Fraction(1, 10**5)


class Piece:
    """A motion on a straight line, from one place and time to another."""

    def __init__(self, begin, x, end, next_x):
        self.begin, self.x, self.end, self.next_x = begin, x, end, next_x

    def at(self, time):
        """Return the place at a time in the piece."""
        if self.x == self.next_x:
            return self.x
        return self.x + Fraction((self.next_x - self.x) * (time - self.begin),
                                 self.end - self.begin)


def held(begin, x, until):
    """Return a body that stands still."""
    return Piece(begin, x, until, x)


class Recorded:
    """
    A random recording, and what docs/motion.md says of it.

    Beside another one it is a source only, which that may `add`.
    """

    def __init__(self, seed, form, still=False, most=None, faults=False, is_late=False,
                 is_set_back=False, is_slow=False, beside=None):
        self.form = form
        self.source = 'others' if beside else 'walls'
        self.sources = {self.source: self}
        # Whether messages are received late, each by a time of its own, so in another order.
        self.is_late = is_late
        # Whether the stamps are the clock, which is set back by more than 10 s in the end, but not
        # with maps: these stay.
        self.clock = 'header' if is_set_back else 'receive'
        self.is_set_back = is_set_back and form != 'map'
        rng = self._rng = np.random.default_rng(seed)
        self.still = still
        # All takes so many times as long, and timeouts are above LONGEST.
        self.scale = 40 if is_slow else 1
        # The timeout of the source and of footprints, in ns: in some recordings not the same.
        self.timeout = self.own_timeout = self.scale * SECOND // 2
        if is_late and seed % 3:
            self.own_timeout = SECOND // 5
        # Some footprints never time out, but stand.
        self.stands = is_slow and seed % 3 > 0
        self.longest = min(self.timeout, LONGEST)
        # From a tenth to three times the timeout.
        footprints = () if beside else FOOTPRINTS[:rng.integers(1, 3)]
        own = [self._times(rng.choice([0.05, 0.1, 0.4])) for _ in footprints]
        others = self._times(rng.choice([0.05, 0.1, 0.3, 0.45, 0.6, 1.5]))
        self.count = int(rng.integers(1, 4))
        # Counted from when bodies with ids can be known.
        most = most or rng.choice([4, 8, 16, 64], p=[0.4, 0.3, 0.25, 0.05])
        sent = sorted(time for time in sum(own, others * self.count)
                      if time > others[0] + self.timeout + TOLERANCE)
        self.end = beside.end if beside else min(sent[most], 5 * SECOND * self.scale)
        *own, times = ([time for time in found if time < self.end] for found in (*own, others))
        # Where two have one stamp, the way leads to the first, and goes on from the last.
        self.samples = {name: self._samples(self._some_twice(found), 0)
                        for name, found in zip(footprints, own)}
        self.pieces = [[] for _ in range(self.count)]
        self.undetermined = []
        # What may be refused or lost: the rate of it.
        self._rate = 0.05 * faults
        # Where obstacles are not compared: from the set before one that is not whole to the next.
        self.broken = []
        # Where it depends on the order of messages whether it is known that a set is not whole.
        self.unclear = []
        # By footprint its pieces, and when it is held in one place, though it may be elsewhere.
        self.own, self.unsure = {}, {}
        self.messages = []
        for name, found in self.samples.items():
            refused = [int(rng.integers(self.end)) for _ in found if rng.random() < self._rate]
            self.own[name], self.unsure[name] = self._way(found, refused)
            self.messages += [(name, time, 0, x) for time, x in found]
            self.messages += [(name, time, REFUSED, None) for time in refused]
        places = [dict(self._samples(range(2 * len(times)), k)) for k in range(1, self.count + 1)]
        # Messages not sent together may be so far apart that others come between them.
        self.apart = int(rng.choice([1000, 2 * 10**7]))
        if form == 'ids':
            self._with_ids(times, places)
        elif form is None:
            self._unmarked(times, places)
        else:
            (self._in_maps if form == 'map' else self._in_sets)(times, places)

    def add(self, other):
        """Have another source, too."""
        self.sources[other.source] = other
        for name in ('messages', 'pieces', 'undetermined', 'broken', 'unclear'):
            getattr(self, name).extend(getattr(other, name))

    def _times(self, period):
        """Return times around a period, with a gap now and then."""
        rng, step = self._rng, int(period * SECOND) * self.scale
        gaps = rng.integers(step // 2, 3 * step // 2, 100)
        gaps += (rng.random(100) < 0.04) * rng.integers(0, SECOND * self.scale, 100)
        return (np.cumsum(gaps) - rng.integers(gaps[0])).tolist()

    def _some_twice(self, times):
        return sorted([*times, *(time for time in times if self._rng.random() < 0.05)])

    def _samples(self, times, k):
        """Return (time, x) of a body that moves by random steps, or stands still."""
        rng = self._rng
        steps = rng.integers(-8, 9, len(times)) * (rng.random(len(times)) < 0.5)
        if self.still and k:
            steps[:] = 0
        start = rng.integers(-24, 25)
        # Around the start, so that bodies meet.
        return [*zip(times, (start + steps).tolist())]

    def _way(self, samples, refused):
        """Return the pieces of a footprint, and when it is held but may not be there."""
        pieces, unsure = [], []
        has_moved = any(at < samples[0][0] for at in refused)
        longest = LONGEST if self.stands else min(self.own_timeout, LONGEST)
        for (time, x), (after, next_x) in zip(samples, [*samples[1:], (2 * self.end, None)]):
            is_refused = any(time < at < after for at in refused)
            is_last = next_x is None
            if 0 < after - time <= longest and not is_last and not is_refused:
                pieces.append(Piece(time, x, after, next_x))
            elif self.stands and time < after:
                until = min((at for at in refused if time < at), default=after)
                pieces.append(held(time, x, min(until, after)))
                if has_moved or is_refused or x != next_x and not is_last:
                    unsure.append((time, after))
            has_moved |= is_refused or x != next_x
        return pieces, unsure

    def _with_ids(self, times, places):
        sent = []
        for k, by_number in enumerate(places):
            seen = {}
            for n, time in enumerate(self._some_twice(times)):
                if self._rng.random() < 0.8:
                    # Not sent together: each has a stamp of its own.
                    seen.setdefault(time + self.apart * k, []).append(by_number[n])
            sent.append([*seen.items()])
            self.messages += [(self.source, time, k, x) for time, xs in sent[k] for x in xs]
        self._disturb()
        for pieces, seen in zip(self.pieces, sent):
            for (time, xs), (after, next_xs) in zip(seen, [*seen[1:], (10**18, ())]):
                if after - time > self.longest:
                    pieces += [held(time, x, min(self._gone(time), after)) for x in xs]
                    if after < self._gone(time) and any(map(ne, xs, next_xs)):
                        self.undetermined.append((time, after))
                    continue
                # The first of one stamp to the first of the next, and the second to the second.
                pieces += [Piece(time, x, after, next_x) for x, next_x in zip(xs, next_xs)]
                pieces += [held(time, x, after) for x in xs[len(next_xs):]]
        self._add_gaps()

    def _disturb(self):
        """Let polygons be refused and messages be lost, which changes no link."""
        rng = self._rng
        # In place of a refused polygon's x is the number of its body.
        self.messages += [(self.source, int(rng.integers(self.end)), REFUSED, int(rng.integers(2)))
                          for _ in range(rng.poisson(20 * self._rate))]
        if rng.random() < 4 * self._rate:
            self._lose([])

    def _in_maps(self, times, places):
        """Send sets with marks that never time out; only a whole one replaces those before."""
        sets = [[(self.source, time + 1000 * k, k, by_number[n // 4])
                 for k, by_number in enumerate(places) if self._rng.random() < 0.8]
                for n, time in enumerate(times)]
        ends = [max([time, *(stamp for _, stamp, *_ in one)]) for time, one in zip(times, sets)]
        stamps = [stamp for _, stamp, *_ in self.messages]
        broken = self._send(sets, times, ends)
        for n, one in enumerate(sets):
            end = next((ends[m] for m in range(n + 1, len(sets)) if m not in broken), self.end)
            for _, stamp, k, x in one:
                self.pieces[k].append(held(
                    self._counted(stamp, stamps), x, self._counted(end, stamps)))

    def _counted(self, time, stamps):
        """Return when a map counts: if stamps are the clock, at that of a footprint before."""
        if self.clock == 'receive':
            return time
        return max((stamp for stamp in stamps if stamp <= time), default=time)

    def _unmarked(self, times, places):
        for n, time in enumerate(times):
            for k, by_number in enumerate(places):
                if self._rng.random() < 0.8:
                    x = by_number[n // 4]
                    stamp = time + self.apart * k
                    self.messages.append((self.source, stamp, k, x))
                    self.pieces[k].append(held(stamp, x, None))
        for pieces in self.pieces:
            for piece in pieces:
                piece.end = self._gone(piece.begin)
        self._disturb()

    def _stamps(self):
        return sorted(stamp for topic, stamp, k, _ in self.messages
                      if topic == self.source and (k != REFUSED or self.form == 'ids'))

    def _gone(self, time):
        """Return when an obstacle seen at a time is gone: when messages show it, or none comes."""
        later = [stamp for stamp in self._stamps() if stamp >= time]
        for one, other in zip(later, [*later[1:], 10**18]):
            if other > time + self.timeout:
                return min(other, one + self.timeout)

    def _add_gaps(self):
        stamps = self._stamps()
        self.undetermined += [(one, other) for one, other in zip(stamps, stamps[1:])
                              if other - one > self.timeout]

    def _in_sets(self, times, places):
        # With marks each polygon has a stamp of its own, sometimes in another order.
        apart = 0 if self.form != MARKS else self.apart if self.is_late else 1000
        order = range(self.count)
        if self.is_late:
            order = self._rng.permutation(self.count).tolist()
        sets = [{k: (time + apart * order[k], by_number[n]) for k, by_number in enumerate(places)
                 if self._rng.random() < 0.8} for n, time in enumerate(times)]
        if self.form == STAMPS:
            # An empty set cannot be seen where nothing marks it.
            found = [(time, one) for time, one in zip(times, sets) if one]
            times, sets = [*zip(*found)] if found else ([], [])
        begins = [min((stamp for stamp, _ in one.values()), default=time)
                  for time, one in zip(times, sets)]
        ends = [max([time, *(stamp for stamp, _ in one.values())])
                for time, one in zip(times, sets)]
        sent = [[(self.source, stamp, k, x) for k, (stamp, x) in one.items()] for one in sets]
        self._note_broken(begins, ends, self._send(sent, begins, ends))
        # A set counts at its latest stamp; of one that is refused nothing does.
        order = sorted((n for n, one in enumerate(sets) if sent[n] or not one),
                       key=ends.__getitem__)
        times, begins, ends, sets = ([found[n] for n in order]
                                     for found in (times, begins, ends, sets))
        for n, one in enumerate(sets):
            is_last = n + 1 == len(sets)
            after = {} if is_last else sets[n + 1]
            # Where only another one ends a set, nothing shows in time that the next one is whole
            # if it is the last, or a gap follows.
            is_replaced = not is_last and (self.form != STAMPS or n + 2 < len(sets) and (
                times[n + 2] - times[n + 1] <= self.longest))
            end = ends[n + 1] - 1 if is_replaced else (
                self.end if is_last else times[n + 1] + self.longest)
            lost = []
            for k, (stamp, x) in one.items():
                if k in after and 0 < after[k][0] - stamp <= (
                        self.timeout if after[k][1] == x else self.longest) and (
                            after[k][1] == x or ends[n + 1] - ends[n] <= self.longest):
                    self.pieces[k].append(Piece(stamp, x, *after[k]))
                else:
                    lost.append(k)
                    self.pieces[k].append(held(stamp, x, min(end, stamp + self.timeout)))
            if not is_last and (lost and len(after) > len(one) - len(lost)
                                or begins[n + 1] - ends[n] > self.timeout):
                self.undetermined.append((begins[n], ends[n + 1]))

    def _send(self, sets, begins, ends):
        """Send sets, and return of which of them something is refused or lost; or all: cleared."""
        rng = self._rng
        broken = {n for n in range(len(sets)) if rng.random() < self._rate}
        sent = []
        for n, one in enumerate(sets):
            found = [*one]
            is_refused = n in broken and rng.random() < 0.5
            if is_refused:
                found.clear()
                one.clear()
            found[:0] = [(self.source, begins[n], REFUSED, None)] * (n in broken)
            if self.form == 'collection':
                found = found if is_refused else [(self.source, begins[n], None, found)]
            elif self.form != STAMPS:
                found.append((self.source, ends[n], None, None))
            sent.append(found)
        self.messages += sum(sent, [])
        if self.form != 'collection' and rng.random() < 4 * self._rate:
            broken |= self._lose(sent)
        return broken

    def _note_broken(self, begins, ends, broken):
        """Note what is not known where sets are not whole."""
        n = 0
        while n < len(begins):
            before = n
            while n in broken:
                n += 1
            if n > before:
                begin = begins[before - 1] if before else -math.inf
                end = ends[n] if n < len(ends) else self.end
                # Nothing shows in time of a set that only another one ends.
                if self._is_open(before, begins, ends):
                    self.unclear.append((begin, begins[before]))
                    begin = begins[before]
                if self._is_open(n - 1, begins, ends):
                    self.unclear.append((begins[n - 1], end))
                    end = begins[n - 1]
                self.broken.append((begin, end))
            n += 1
        self.undetermined += self.broken

    def _is_open(self, n, begins, ends):
        """Return whether no other set follows one soon, which only that would end."""
        return self.form == STAMPS and (
            n + 1 == len(begins) or begins[n + 1] - ends[n] > self.longest)

    def _lose(self, sent):
        """Let the recorder say at two times whether something was lost; return of which sets."""
        if not self.samples:
            # An event for another source would change since when this one has lost.
            return set()
        events = [-math.inf, *sorted(self._rng.integers(0, self.end, 2).tolist())]
        lost = self._rng.integers(0, 2, 2).tolist()
        self.messages += [(LOST_TOPIC[1:], time, None, {self.source: (count, 0)})
                          for time, count in zip(events[1:], lost)]
        # It may have been up to 1 s before the event before.
        times = [(before - SECOND, time)
                 for before, time, count in zip(events, events[1:], lost) if count]
        broken, previous = set(), -math.inf
        for n, messages in enumerate(sent):
            for k, (_, time, *_) in enumerate(messages):
                if any(begin < time and previous < end for begin, end in times):
                    # Between two stamps it may have been of either.
                    broken |= {n, n - 1} if self.form == STAMPS and not k else {n}
                previous = time
        return broken - {-1}

    def messages_of_bag(self, delays=(0, 0)):
        """Return (topic, when it is received, bytes) of all; topics have delays, in ns."""
        rng, late, messages = np.random.default_rng(len(self.messages)), {}, []
        last, after = Counter(), 2 * self.end
        for place, (topic, time, k, x) in enumerate(self.messages):
            received = time + delays[topic not in FOOTPRINTS]
            if self.is_late:
                # Those of one stamp stay in order, and all where marks end sets.
                received += late.setdefault((topic, time), int(rng.integers(SECOND // 3)))
                if topic in self.sources and self.sources[topic].form in (MARKS, 'map'):
                    last[topic] = received = max(last[topic], received)
            messages.append((received, place, topic, time, k, x))
        if self.is_set_back:
            messages += [(after, place, topic, time - 20 * SECOND, k, x)
                         for _, place, topic, time, k, x in messages if topic in FOOTPRINTS]
        return [(topic, received, self._bytes_of(topic, time, k, x))
                for received, _, topic, time, k, x in sorted(messages)]

    def _bytes_of(self, topic, time, k, x):
        """Return the bytes of a message: a polygon, a mark, or a collection."""
        stamp = START + time
        if topic == LOST_TOPIC[1:]:
            return losses(0, **x)[2]
        if topic in FOOTPRINTS:
            return serialised(outline(x, k, 0, 2001), stamp)
        form = self.sources[topic].form
        if form == 'collection' and k == REFUSED:
            return collection([], stamp)[:-1]
        if form == 'collection':
            return collection([outline(x, k, 1000 * k, 1) for *_, k, x in x], stamp)
        number = x if k == REFUSED else k
        return serialised([] if k is None else outline(x, k, 1000 * k, 1), stamp,
                          instance=number + 1 if form == 'ids' else None)

    def written(self, path, delays=(0, 0)):
        """Write it as an MCAP file."""
        kinds = dict.fromkeys(self.samples, POLYGON) | {LOST_TOPIC[1:]: LOST} | {
            name: {'ids': INSTANCE, 'collection': COLLECTION}.get(source.form, POLYGON)
            for name, source in self.sources.items()}
        keys = {name: key for key, name in enumerate(kinds, 1)}
        parts = [part for name, key in keys.items() for part in (
            schema(key, kinds[name]), channel(key, f'/{name}'.encode(), key))]
        parts += [record(MESSAGE, struct.pack(
            '<HIQQ', keys[topic], 0, START + received, START + received) + data)
            for topic, received, data in self.messages_of_bag(delays)]
        path = path.with_suffix('.mcap')
        path.write_bytes(mcap_of(*parts))
        return path

    def result(self, path, delays=(0, 0), **options):
        """Return what is found in it, with some options."""
        parameters = {'footprints': [*self.samples], 'obstacles': [*self.sources],
                      **{f'{one}.timeout': 0.0 if self.stands else self.own_timeout / SECOND
                         for one in self.samples},
                      'future_tolerance': 0.1}
        for name, source in self.sources.items():
            parameters[f'{name}.timeout'] = source.timeout / SECOND
            if source.form == 'map':
                parameters |= {f'{name}.timeout': 0.0, f'{name}.set_end': MARKS}
            elif source.form in (MARKS, STAMPS):
                parameters[f'{name}.set_end'] = source.form
        return check(self.written(path, delays), Options(
            parameters=parameters, clock=self.clock, **options), set_end=None)

    def distances(self, name, times):
        """Yield how far bodies are from a footprint at times, None where that is unknown."""
        own, others = self.own[name], [piece for pieces in self.pieces for piece in pieces]
        for time in times:
            x = next((one.at(time) for one in own if one.begin <= time <= one.end), None)
            yield None if x is None else [abs(one.at(time) - x) for one in others
                                          if one.begin <= time <= one.end]


def outline(x, k, y, height):
    """Return a rectangle 1 m wide with k more vertices on its lower side, or one to refuse."""
    if k == REFUSED:
        return [(math.nan, 0)]
    x = float(x) / METRE
    return [(x, y), *((x + (n + 1) / 8, y) for n in range(k)), (x + 1.0, y),
            (x + 1.0, y + height), (x, y + height)]


def is_in(intervals, time):
    return any(first - START <= time <= last - START for first, last in intervals)


def times_of(intervals):
    return [(one.first, one.last) for one in intervals]


def compare(seed, form, path):
    """Compare a recording with the oracle; return for how many moments each state was seen."""
    kind = KINDS[seed % len(KINDS)]
    recorded = Recorded(seed, form, **kind)
    # Every third one has another source.
    turn = seed // len(KINDS)
    other = FORMS[turn // 3 % len(FORMS)]
    if turn % 3 == 0 and not (recorded.clock == 'header' and 'map' in (form, other)):
        recorded.add(Recorded(seed + 10**9, other, **kind, beside=recorded))
    # In which no time passes, or a topic has no message.
    if min(len(dict(one)) for one in recorded.samples.values()) < 2 or (
            recorded.sources.keys() - {topic for topic, *_ in recorded.messages}):
        return np.zeros(3, int)
    result = recorded.result(path)
    refused = Counter(topic for topic, _, k, x in recorded.messages
                      for *_, k, _ in (x if isinstance(x, list) else [(k, x)]) if k == REFUSED)
    assert any('go back' in one for one in result.problems) == recorded.is_set_back
    assert refused == Counter({one.topic[1:]: sum(one.rejected.values())
                               for one in result.sources})
    return sum(compared(recorded, result, footprint, np.random.default_rng(seed))
               for footprint in result.footprints)


def compared(recorded, result, footprint, rng):
    """Compare what is found of a footprint with the oracle, as `compare` does."""
    forms, name = [source.form for source in recorded.sources.values()], footprint.name
    # I2: each time is in one state.
    assert footprint.clear + footprint.collision + footprint.unknown + footprint.undetermined == (
        result.end - result.start)
    # I3: intervals of one state do not overlap, and not those of unknown and undetermined.
    contacts, unknown, undetermined = (
        [one for one in found if one.footprint == name]
        for found in (result.contacts, result.unknown, result.undetermined))
    for intervals in (sorted(times_of([*unknown, *undetermined])),
                      *(sorted(times_of(one for one in contacts if one.obstacle == obstacle))
                        for obstacle in {one.obstacle for one in contacts})):
        assert all(last <= first for (_, last), (first, _) in zip(intervals, intervals[1:]))
    contacts, unknown, undetermined = map(times_of, (contacts, unknown, undetermined))
    seen = np.zeros(3, int)
    begin, end = result.start - START, result.end - START
    if begin == end:
        return seen
    # Also just before and after messages, which is where most changes.
    stamps = [time for _, time, *_ in recorded.messages if begin + 100 < time < end - 100]
    times = [*rng.integers(begin, end, 15).tolist(),
             *((rng.choice(stamps, 15) + rng.choice([-100, 100], 15)).tolist() if stamps else ())]
    for time, distances in zip(times, recorded.distances(name, times)):
        touches = bool(distances) and min(distances) <= METRE
        if any(first <= time <= last for first, last in recorded.broken):
            assert is_in(unknown, time) or is_in(undetermined, time) or is_in(contacts, time)
            continue
        if not distances or abs(min(distances) - METRE) > NEAR:
            assert is_in(contacts, time) == touches, (forms, name, time, 'contact')
        if is_in(unknown, time) or None in forms or any(
                first <= time <= last for first, last in recorded.unclear):
            continue
        expected = distances is None or any(
            first <= time <= last for first, last in (*recorded.undetermined,
                                                      *recorded.unsure[name]))
        assert is_in(undetermined, time) == expected, (forms, name, time, 'undetermined')
        seen += [touches, expected, not touches and not expected]
    return seen
