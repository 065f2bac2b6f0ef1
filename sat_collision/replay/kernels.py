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
What replay computes with: compiled kernels, or plain Python where that is done before them.

That is chosen before anything of the geometry is imported, for then it is too late.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
import contextlib
from pathlib import Path
import sys
import time

from sat_collision.replay.recording import Recording
from sat_collision.replay.unpacking import Limits

_TYPES = ('geometry_msgs/msg/PolygonStamped', 'geometry_msgs/msg/PolygonInstanceStamped')
# So many messages take plain Python some 2 s, and compiling takes more than 10 s. That pays off
# later; but no small check should have to wait for it.
_FEW = 3_000


def choose(bags: Iterable[str], limits: Limits) -> bool:
    """
    Choose plain Python for few messages if nothing is compiled yet; tell if there is to compile.

    It holds for the processes that this one starts, too.
    """
    mark = _mark()
    if mark is None or mark.exists():
        return False
    left = _FEW
    for bag in bags:
        with Recording(bag, limits) as recording:
            left -= sum(recording.counts[topic] for topic, kind in recording.topics.items()
                        if kind in _TYPES)
        if left <= 0:
            return True
    from sat_collision.geometry.kernel_cache import use_plain_python
    use_plain_python()
    return False


def prepare(say: Callable[[str], object]) -> None:
    """Compile or load all kernels, of the node and of replay, and say so."""
    from sat_collision.geometry import warm_up
    from sat_collision.geometry.preparation import Preparation
    from sat_collision.replay.rehearsal import rehearse
    begun = time.monotonic()
    preparation = Preparation(say, say)
    say('preparing the kernels of replay and of the functions on two bodies')
    warm_up.prepare_pairs()
    preparation.complete()
    rehearse()
    say(f'all kernels ready after {time.monotonic() - begun:.1f} s')
    if mark := _mark():
        with contextlib.suppress(OSError):  # as problems of kernels say
            mark.touch()


def main() -> int:
    """Prepare all kernels, for a first start that compiles nothing; return the exit status."""
    prepare(lambda words: print(words, flush=True))
    mark = _mark()
    if mark is None:
        print('nothing is compiled here, so there is nothing to keep')
    elif mark.exists():
        print(f'kept in {mark.parent}, for this Python and this kind of processor')
    else:
        print('prepare_kernels: nothing could be kept', file=sys.stderr)
        return 1
    return 0


def _mark() -> Path | None:
    """Return the file that is there if all is compiled; None if nothing can be."""
    try:
        from sat_collision.geometry.kernel_cache import prepared_mark
        return prepared_mark()
    except Exception:  # a numba that does not work may raise anything; kernels say so
        return None


if __name__ == '__main__':
    sys.exit(main())
