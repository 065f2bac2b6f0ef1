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

"""Separations over time, in a list that does not grow with the recording."""

from __future__ import annotations

from collections.abc import Iterable
from heapq import merge
from typing import TypeAlias

Sample: TypeAlias = tuple[int, 'float | None']

_MOST_SAMPLES = 4096


class Series:
    """
    Separations (time in ns, metres or None) in a list that never grows beyond a fixed length.

    Where it would, neighbours are merged to their least.

    Parameters
    ----------
    samples : list
        An empty one, to be filled.

    """

    def __init__(self, samples: list[Sample]) -> None:
        self.samples = samples
        self._merged = 1
        self._pending = 0

    def add(self, time: int, value: float | None) -> None:
        """Add a sample."""
        samples = self.samples
        if self._pending:
            last, least = samples[-1]
            samples[-1] = last, _least(least, value)
        else:
            if len(samples) == _MOST_SAMPLES:
                samples[:] = [(time_a, _least(a, b)) for (time_a, a), (_, b)
                              in zip(samples[::2], samples[1::2])]
                self._merged *= 2
            samples.append((time, value))
        self._pending = (self._pending + 1) % self._merged


def least_of(series: Iterable[list[Sample]]) -> Iterable[Sample]:
    """Yield the least of what several series, each in the order of time, have said last."""
    latest: dict[int, float | None] = {}
    before: Sample | None = None
    for time, number, value in merge(*(
            [(time, number, value) for time, value in samples]
            for number, samples in enumerate(series)), key=lambda sample: sample[0]):
        latest[number] = value
        if before is not None and time > before[0]:
            yield before
        found = None
        for one in latest.values():
            found = _least(found, one)
        before = time, found
    if before is not None:
        yield before


def _least(a: float | None, b: float | None) -> float | None:
    return min((value for value in (a, b) if value is not None), default=None)
