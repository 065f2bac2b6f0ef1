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

"""A check of a recording that is none, which needs all kernels that a check may need."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
import struct

from sat_collision.replay.options import Options
from sat_collision.replay.run import check_recording
from sat_collision.replay.storage import Message

_TYPE = 'geometry_msgs/msg/PolygonStamped'
_SECOND = 10**9
_NOTCHED = ((0, 0), (4, 0), (4, 4), (2, 1))
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))


class _Rehearsed:
    """What is asked of a recording: a robot with a notch, and two obstacles that pass it."""

    path = Path('rehearsal')
    start, end = _SECOND, 2 * _SECOND
    latched: frozenset[str] = frozenset()

    def __init__(self) -> None:
        self.problems: list[str] = []
        self.topics = {'/footprint': _TYPE, '/obstacles': _TYPE}
        self.counts: Counter[str] = Counter()

    def messages(self, *_: object) -> Iterator[Message]:
        for tick in range(21):
            time = _SECOND + tick * _SECOND // 20
            yield '/footprint', time, _message(time, _NOTCHED, 0.01 * tick)
            for ring, x in ((_SQUARE, 0.3 * tick - 3.0), (_NOTCHED, 9.0 - 0.4 * tick)):
                yield '/obstacles', time, _message(time, ring, x)
            yield '/obstacles', time, _message(time, (), 0.0)


def rehearse() -> None:
    """Answer both questions once, exactly and with a margin."""
    for as_live in (False, True):
        for margin in (0.0, 0.1):
            result = check_recording(_Rehearsed(), Options(
                parameters={'margin': margin}, as_live=as_live))
            assert result.contacts and not result.problems, result


def _message(time: int, ring: tuple[tuple[float, float], ...], x: float) -> bytes:
    """Return a PolygonStamped in CDR."""
    seconds, nanoseconds = divmod(time, _SECOND)
    points = array('f', [value for a, b in ring for value in (a + x, b, 0.0)])
    encapsulation = b'\0\1\0\0' if struct.pack('=H', 1) == b'\1\0' else b'\0\0\0\0'
    return encapsulation + struct.pack('=iII4sI', seconds, nanoseconds, 4, b'map\0',
                                       len(ring)) + points.tobytes()
