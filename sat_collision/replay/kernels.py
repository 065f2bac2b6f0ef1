# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The choice of compiled kernels, or of plain Python if compiling would take longer.

It must be made before any kernel of geometry is imported.
"""

from __future__ import annotations

from argparse import ArgumentParser
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
import contextlib
from functools import partial
from itertools import product
from pathlib import Path
import signal
import struct
import sys
import time
from typing import cast, TYPE_CHECKING

from sat_collision.extras import missing
from sat_collision.geometry.compiled.compilation import (
    is_plain_python_chosen, kernel_problem, use_plain_python)
from sat_collision.replay.bag.storage import Limits, Row

if TYPE_CHECKING:
    from sat_collision.replay.bag.recording import Recording

_POLYGON = 'geometry_msgs/msg/PolygonStamped'
# Compiling takes about 25 s. Plain Python takes about 5 s for so many boxes, and 40 s for
# non-convex polygons of 40 vertices.
_FEW = 20_000
# Bytes of a box in a Polygon2DCollection: the number of its corners, and these as float64.
_BOX = 4 + 4 * 2 * 8


def choose(bags: Iterable[str], limits: Limits) -> bool:
    """
    Return whether to compile; choose plain Python if compiling is slower, for few polygons.

    The choice also holds for the processes that this one starts.
    """
    mark = _mark()
    if mark is None or mark.exists():
        return False
    from sat_collision.replay.bag.recording import Recording
    left = _FEW
    for bag in bags:
        # Its check says what is wrong with a recording.
        with contextlib.suppress(Exception), Recording(bag, limits) as recording:
            left -= _polygons(recording, left)
        if left <= 0:
            return True
    use_plain_python()
    return False


def _polygons(recording: Recording, most: int) -> int:
    """Return about how many polygons a recording has; they are not counted beyond `most`."""
    kinds = {topic: kind for topic, kind in recording.topics.items() if '/Polygon' in kind}
    collections = [topic for topic, kind in kinds.items() if kind.endswith('Collection')]
    count = sum(recording.counts[topic] for topic in kinds)
    for _, _, messages in recording.rows(collections) if collections else ():
        if count >= most:
            break
        count += sum(map(len, messages)) // _BOX
    return count


def prepare(say: Callable[[str], object]) -> None:
    """Compile or load all kernels, of the node and of replay, and report it."""
    from sat_collision.geometry.preparation import prepare_pairs, Preparation
    begun = time.monotonic()
    preparation = Preparation(say, say)
    say('preparing the kernels of replay and of the functions on two bodies')
    prepare_pairs()
    preparation.complete()
    _warm_up()
    say(f'all kernels ready after {time.monotonic() - begun:.1f} s')
    if not kernel_problem() and (mark := _mark()):
        with contextlib.suppress(OSError):  # kernels report a cache that cannot be written
            mark.touch()


def main() -> int:
    """
    Compile all kernels ahead of the first start; return the exit status.

    This is the command prepare_kernels. Where libraries that replay_check needs are missing, the
    kernels of the node and the library are compiled.
    """
    ArgumentParser('prepare_kernels', description='Compile all kernels ahead.').parse_args()
    # An exception would end in callbacks of compilers, and there is nothing to put away.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    say = partial(print, flush=True)
    try:
        import sat_collision.replay.check  # noqa: F401
    except ModuleNotFoundError as error:
        if str(error.name).startswith('sat_collision'):
            raise
        from sat_collision.geometry.preparation import prepare_pairs, Preparation
        say(f'preparing the library only, without replay_check: {missing(error)}')
        preparation = Preparation(say, say)
        prepare_pairs()
        preparation.complete()
        return 0
    from sat_collision.geometry.compiled.jit import COMPILED
    if not COMPILED:
        print('nothing to do: in plain Python, without numba, there are no kernels to compile')
        return 0
    prepare(say)
    mark = _mark()
    if mark is None:
        print('nothing is kept here: numba itself keeps kernels')
    elif mark.exists():
        print(f'kept in {mark.parent} and folders beside it, for this Python and this kind of '
              'processor')
    else:
        print('prepare_kernels: nothing could be kept', file=sys.stderr)
        return 1
    return 0


def _mark() -> Path | None:
    """Return the file that exists if all kernels are compiled; None if none can be."""
    if is_plain_python_chosen():
        return None
    try:
        from sat_collision.geometry.compiled.kernel_cache import prepared_mark
        return prepared_mark(Path(__file__).parent / 'motion')
    except Exception:  # a broken numba may raise anything; kernels report it
        return None


_SECOND = 10**9
_NOTCHED = ((0, 0), (4, 0), (4, 4), (2, 1))
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))


class _WarmUp:
    """
    A stand-in for a Recording: a non-convex robot, and two obstacles that pass it.

    It has more messages than recorded motion processes together, because a source that is new
    takes its first ones one by one.
    """

    path = Path('warm-up')
    start, end = _SECOND, 6 * _SECOND
    latched: frozenset[str] = frozenset()
    problems: tuple[str, ...] = ()
    topics = {'/footprint': _POLYGON, '/obstacles': _POLYGON}
    counts = shared = Counter[str]()

    def rows(self, *_: object) -> Iterator[Row]:
        for tick in range(101):
            time = _SECOND + tick * _SECOND // 20
            yield '/footprint', [time], [_message(time, _NOTCHED, 0.01 * tick)]
            for ring, x in ((_SQUARE, 0.3 * tick - 3.0), (_NOTCHED, 9.0 - 0.4 * tick)):
                yield '/obstacles', [time], [_message(time, ring, x)]
            yield '/obstacles', [time], [_message(time, (), 0.0)]


def _warm_up() -> None:
    """Check recorded motion and the live monitor by sets and without, with a margin and not."""
    from sat_collision.replay.model.result import Options
    from sat_collision.replay.check import check_recording
    from sat_collision.scene.settings import DEFAULT_SOURCE, EMPTY_POLYGON, NONE
    for as_live, margin, set_end in product((False, True), (0.0, 0.1), (EMPTY_POLYGON, NONE)):
        parameters = {'margin': margin, f'{DEFAULT_SOURCE}.set_end': set_end}
        result = check_recording(cast('Recording', _WarmUp()), Options(
            parameters=parameters, as_live=as_live))
        assert result.contacts and not result.problems, result


def _message(time: int, ring: tuple[tuple[float, float], ...], x: float) -> bytes:
    """Return a PolygonStamped in CDR."""
    seconds, nanoseconds = divmod(time, _SECOND)
    points = array('f', [value for a, b in ring for value in (a + x, b, 0.0)])
    encapsulation = 0, sys.byteorder == 'little', 0, 0
    return struct.pack('=4BiII4sI', *encapsulation, seconds, nanoseconds, 4, b'map\0',
                       len(ring)) + points.tobytes()


if __name__ == '__main__':
    sys.exit(main())
