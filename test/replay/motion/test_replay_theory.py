# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The theory of docs/motion.md on random recordings, against an oracle in exact fractions.

Bodies move along one line, and the footprint is so tall that it meets obstacles on all lanes: it
touches one where they are at most 1 m apart along the line. Lanes are far from each other, and
each obstacle has a number of vertices of its own: links are known without a look at distances.
Places are in eighths of a metre, so that those of messages are integers.

Most recordings are short: what goes wrong shows in few messages, and so more can be tried.
"""

from fractions import Fraction
import struct

from builders import SECOND, serialised
import numpy as np
import pytest
from recordings import check, INSTANCE, MARKS, POLYGON, SOURCE, STAMPS, START
from sat_collision.replay.model.result import Options
from storages import channel, mcap_of, MESSAGE, record, schema

FORMS = MARKS, STAMPS, 'ids', None
TIMEOUT, TOLERANCE = SECOND // 2, SECOND // 10
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
    """A random recording, and what docs/motion.md says of it."""

    def __init__(self, seed, form, still=False, most=None):
        self.form = form
        rng = self._rng = np.random.default_rng(seed)
        self.still = still
        # From a tenth to three times the timeout.
        own = self._times(rng.choice([0.05, 0.1, 0.4]))
        others = self._times(rng.choice([0.05, 0.1, 0.3, 0.45, 0.6, 1.5]))
        self.count = int(rng.integers(1, 4))
        # Counted from when bodies with ids can be known.
        most = most or rng.choice([4, 8, 16, 64], p=[0.4, 0.3, 0.25, 0.05])
        sent = sorted(time for time in own + others * self.count
                      if time > others[0] + TIMEOUT + TOLERANCE)
        self.end = min(sent[most], 5 * SECOND)
        own, times = ([time for time in found if time < self.end] for found in (own, others))
        # Where two have one stamp, the way leads to the first, and goes on from the last.
        self.footprint = self._samples(self._some_twice(own), 0)
        self.pieces = [[] for _ in range(self.count)]
        self.undetermined = []
        self.own = [Piece(time, x, after, next_x) for (time, x), (after, next_x)
                    in zip(self.footprint, self.footprint[1:]) if 0 < after - time <= TIMEOUT]
        self.messages = [('/footprint', time, 0, x) for time, x in self.footprint]
        places = [dict(self._samples(range(2 * len(times)), k)) for k in range(1, self.count + 1)]
        # Messages not sent together may be so far apart that others come between them.
        self.apart = int(rng.choice([1000, 2 * 10**7]))
        if form == 'ids':
            self._with_ids(times, places)
        elif form is None:
            self._unmarked(times, places)
        else:
            self._in_sets(times, places)

    def _times(self, period):
        """Return times around a period, with a gap now and then."""
        rng, step = self._rng, int(period * SECOND)
        gaps = rng.integers(step // 2, 3 * step // 2, 100)
        gaps += (rng.random(100) < 0.04) * rng.integers(0, SECOND, 100)
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

    def _with_ids(self, times, places):
        sent = []
        for k, by_number in enumerate(places):
            seen = {}
            for n, time in enumerate(self._some_twice(times)):
                if self._rng.random() < 0.8:
                    # Not sent together: each has a stamp of its own.
                    seen.setdefault(time + self.apart * k, []).append(by_number[n])
            sent.append([*seen.items()])
            self.messages += [('/tracks', time, k, x) for time, xs in sent[k] for x in xs]
        for pieces, seen in zip(self.pieces, sent):
            for (time, xs), (after, next_xs) in zip(seen, [*seen[1:], (10**18, ())]):
                if after - time > TIMEOUT:
                    pieces += [held(time, x, self._gone(time)) for x in xs]
                    continue
                # The first of one stamp to the first of the next, and the second to the second.
                pieces += [Piece(time, x, after, next_x) for x, next_x in zip(xs, next_xs)]
                pieces += [held(time, x, after) for x in xs[len(next_xs):]]
        self._add_gaps()

    def _unmarked(self, times, places):
        for n, time in enumerate(times):
            for k, by_number in enumerate(places):
                if self._rng.random() < 0.8:
                    x = by_number[n // 4]
                    stamp = time + self.apart * k
                    self.messages.append(('/obstacles', stamp, k, x))
                    self.pieces[k].append(held(stamp, x, None))
        for pieces in self.pieces:
            for piece in pieces:
                piece.end = self._gone(piece.begin)

    def _stamps(self):
        return sorted(stamp for topic, stamp, *_ in self.messages if topic != '/footprint')

    def _gone(self, time):
        """Return when an obstacle seen at a time is gone: when messages show it, or none comes."""
        later = [stamp for stamp in self._stamps() if stamp >= time]
        for one, other in zip(later, [*later[1:], 10**18]):
            if other > time + TIMEOUT:
                return min(other, one + TIMEOUT)

    def _add_gaps(self):
        stamps = self._stamps()
        self.undetermined += [(one, other) for one, other in zip(stamps, stamps[1:])
                              if other - one > TIMEOUT]

    def _in_sets(self, times, places):
        # With marks each polygon has a stamp of its own.
        apart = 1000 if self.form == MARKS else 0
        sets = [{k: (time + apart * k, by_number[n]) for k, by_number in enumerate(places)
                 if self._rng.random() < 0.8} for n, time in enumerate(times)]
        ends = []
        for time, one in zip(times, sets):
            self.messages += [('/obstacles', stamp, k, x) for k, (stamp, x) in one.items()]
            ends.append(max([time, *(stamp for stamp, _ in one.values())]))
            if self.form == MARKS:
                self.messages.append(('/obstacles', ends[-1], None, None))
        if self.form == STAMPS:
            # An empty set cannot be seen where nothing marks it.
            found = [(time, one, end) for time, one, end in zip(times, sets, ends) if one]
            times, sets, ends = [*zip(*found)] if found else ([], [], [])
        begins = [min((stamp for stamp, _ in one.values()), default=time)
                  for time, one in zip(times, sets)]
        for n, one in enumerate(sets):
            is_last = n + 1 == len(sets)
            after = {} if is_last else sets[n + 1]
            # Where only another one ends a set, nothing shows in time that the next one is whole
            # if it is the last, or a gap follows.
            is_replaced = not is_last and (self.form == MARKS or n + 2 < len(sets) and (
                times[n + 2] - times[n + 1] <= TIMEOUT))
            end = ends[n + 1] - 1 if is_replaced else self.end
            lost = []
            for k, (stamp, x) in one.items():
                if k in after and after[k][0] - stamp <= TIMEOUT:
                    self.pieces[k].append(Piece(stamp, x, *after[k]))
                else:
                    lost.append(k)
                    self.pieces[k].append(held(stamp, x, min(end, stamp + TIMEOUT)))
            if not is_last and (lost and len(after) > len(one) - len(lost)
                                or begins[n + 1] - ends[n] > TIMEOUT):
                self.undetermined.append((begins[n], ends[n + 1]))

    def messages_of_bag(self, delays=(0, 0)):
        """Return (topic, when it is received, bytes) of all; topics have delays, in ns."""
        messages = [(time + delays[topic != '/footprint'], place, topic, time, k, x)
                    for place, (topic, time, k, x) in enumerate(self.messages)]
        return [(topic, received, serialised(
            [] if k is None else outline(x, 0, 0, 2001) if topic == '/footprint' else (
                outline(x, k, 1000 * k, 1)),
            START + time, instance=k + 1 if topic == '/tracks' else None))
            for received, _, topic, time, k, x in sorted(messages)]

    def written(self, path, delays=(0, 0)):
        """Write it as an MCAP file."""
        kind = INSTANCE if self.form == 'ids' else POLYGON
        parts = [schema(1), schema(2, kind), channel(1, b'/footprint'),
                 channel(2, b'/tracks' if self.form == 'ids' else b'/obstacles', 2)]
        parts += [record(MESSAGE, struct.pack(
            '<HIQQ', 1 if topic == '/footprint' else 2, 0, START + received, START + received)
            + data) for topic, received, data in self.messages_of_bag(delays)]
        path = path.with_suffix('.mcap')
        path.write_bytes(mcap_of(*parts))
        return path

    def result(self, path, delays=(0, 0), **options):
        """Return what is found in it, with some options."""
        name = 'tracks' if self.form == 'ids' else SOURCE
        parameters = {'footprint.timeout': 0.5, f'{name}.timeout': 0.5, 'future_tolerance': 0.1}
        set_end = self.form if self.form in (MARKS, STAMPS) else None
        if set_end:
            parameters[f'{name}.set_end'] = set_end
        return check(self.written(path, delays), Options(parameters=parameters, **options),
                     set_end=None)

    def distances(self, times):
        """Yield how far bodies are from the footprint at times, None where that is unknown."""
        own, others = self.own, [piece for pieces in self.pieces for piece in pieces]
        for time in times:
            x = next((one.at(time) for one in own if one.begin <= time <= one.end), None)
            yield None if x is None else [abs(one.at(time) - x) for one in others
                                          if one.begin <= time <= one.end]


def outline(x, k, y, height):
    """Return a rectangle 1 m wide with k more vertices on its lower side."""
    x = float(x) / METRE
    return [(x, y), *((x + (n + 1) / 8, y) for n in range(k)), (x + 1.0, y),
            (x + 1.0, y + height), (x, y + height)]


def is_in(intervals, time):
    return any(first - START <= time <= last - START for first, last in intervals)


def times_of(intervals):
    return [(one.first, one.last) for one in intervals]


def compare(seed, form, path):
    """Compare a recording with the oracle; return for how many moments each state was seen."""
    recorded = Recorded(seed, form)
    if len(recorded.footprint) < 2 or len(recorded.messages) == len(recorded.footprint):
        return np.zeros(3, int)
    result = recorded.result(path)
    assert result.problems == [] and not any(one.rejected for one in result.sources)
    footprint, = result.footprints
    # I2: each time is in one state.
    assert footprint.clear + footprint.collision + footprint.unknown + footprint.undetermined == (
        result.end - result.start)
    # I3: intervals of one state do not overlap, and not those of unknown and undetermined.
    for intervals in (sorted(times_of([*result.unknown, *result.undetermined])),
                      *(sorted(times_of(one for one in result.contacts if one.obstacle == name))
                        for name in {one.obstacle for one in result.contacts})):
        assert all(last <= first for (_, last), (first, _) in zip(intervals, intervals[1:]))
    contacts, unknown = times_of(result.contacts), times_of(result.unknown)
    undetermined = times_of(result.undetermined)
    seen = np.zeros(3, int)
    rng = np.random.default_rng(seed)
    begin, end = result.start - START, result.end - START
    # Also just before and after messages, which is where most changes.
    stamps = [time for _, time, *_ in recorded.messages if begin + 100 < time < end - 100]
    times = [*rng.integers(begin, end, 15).tolist(),
             *(rng.choice(stamps, 15) + rng.choice([-100, 100], 15)).tolist()]
    for time, distances in zip(times, recorded.distances(times)):
        touches = bool(distances) and min(distances) <= METRE
        if not distances or abs(min(distances) - METRE) > NEAR:
            assert is_in(contacts, time) == touches, (seed, form, time, 'contact')
        if is_in(unknown, time) or form is None:
            continue
        expected = distances is None or any(
            first <= time <= last for first, last in recorded.undetermined)
        assert is_in(undetermined, time) == expected, (seed, form, time, 'undetermined')
        seen += [touches, expected, not touches and not expected]
    return seen


@pytest.mark.parametrize('form', FORMS)
def test_recordings_agree_with_the_oracle(tmp_path, form):
    """Contacts, undetermined and clear times of random recordings (I2, I3); see `make motion`."""
    seen = sum(compare(seed, form, tmp_path / 'recording') for seed in range(250))
    assert form is None or (seen > 50).all()


@pytest.mark.parametrize('form', FORMS)
def test_delays_change_no_contact(tmp_path, form):
    """Topics are received late, each by a time of its own (I5)."""
    for seed in range(20):
        recorded = Recorded(seed, form)
        found = [times_of(recorded.result(tmp_path / f'{seed}{late}', (late, 3 * late)).contacts)
                 for late in (0, SECOND // 10)]
        assert found[0] == found[1]


@pytest.mark.parametrize('form', FORMS)
def test_samples_on_the_motion_change_nothing(tmp_path, form):
    """Halfway between each two samples of the footprint there is another one (I4)."""
    for seed in range(20):
        recorded = Recorded(seed, form)
        found = [recorded.result(tmp_path / f'{seed}a')]
        recorded.messages += [
            ('/footprint', (one.begin + one.end) // 2, 0, one.at(Fraction(one.begin + one.end, 2)))
            for one in recorded.own if (one.begin + one.end) % 2 == 0]
        found.append(recorded.result(tmp_path / f'{seed}b'))
        for one, other in zip(*(times_of(result.contacts) for result in found), strict=True):
            assert one == pytest.approx(other, abs=1000)


@pytest.mark.parametrize('form', FORMS)
def test_part_has_the_contacts_of_the_whole(tmp_path, form):
    """A second is left out at the beginning and some at the end (I6)."""
    compared = 0
    for seed in range(12):
        recorded = Recorded(seed, form, most=64)
        whole = recorded.result(tmp_path / f'{seed}whole')
        part = recorded.result(tmp_path / f'{seed}part', start=1.0, duration=2.0)
        undecided = times_of([*part.unknown, *part.undetermined, *whole.undetermined])
        rng = np.random.default_rng(seed)
        times = rng.integers(part.start - START, part.end - START, 50).tolist()
        for time, distances in zip(times, recorded.distances(times)):
            if not is_in(undecided, time) and (
                    not distances or abs(min(distances) - METRE) > NEAR):
                compared += 1
                assert is_in(times_of(part.contacts), time) == (
                    is_in(times_of(whole.contacts), time)), (seed, form, time)
    assert compared > 20


@pytest.mark.parametrize('form', [MARKS, 'ids', None])
def test_motion_has_each_contact_of_the_monitor(tmp_path, form):
    """
    Of obstacles that stand still, at the stamps of the footprint (I1).

    With new stamps the monitor knows only when a set begins that the one before it is whole.
    """
    compared = 0
    for seed in range(50):
        recorded = Recorded(seed, form, still=True)
        live = recorded.result(tmp_path / f'{seed}live', as_live=True)
        motion = recorded.result(tmp_path / f'{seed}motion')
        stamps = {time for time, _ in recorded.footprint}
        for contact in live.contacts:
            if (time := contact.first - START) in stamps:
                compared += 1
                assert is_in(times_of(motion.contacts), time), (seed, form, time)
    assert compared > 10
