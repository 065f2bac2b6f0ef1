# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compile or load kernels before they are needed, so that no message has to wait for them.

Compiling takes seconds if nothing is kept from an earlier process, see `kernel_cache`. On such a
first start three processes share the work, and load from disk what another has compiled:

- this one compiles the kernels for packing;
- ``python -m sat_collision.geometry.preparation contacts distances`` compiles those for contacts,
  then those for distances, which share much code with them;
- once contacts can be decided, a third one compiles those for motion.

The other processes end when they are done, or with this one: it ends them at its exit, and where
it is killed they see the end of their standard input.
"""

import atexit
from collections.abc import Callable
import gc
import os
import subprocess
import sys
import threading
import time

import numpy as np
from sat_collision.geometry.body.convex_parts import convex_parts
from sat_collision.geometry.body.layout import packed_size
from sat_collision.geometry.body.packing import pack_convex, TRIPLE, workspace
from sat_collision.geometry.body.polygon import Polygon, UNMOVED
from sat_collision.geometry.compiled.compilation import kernel_problem, say_nothing
from sat_collision.geometry.compiled.jit import COMPILED, HAS_OWN_CACHE, indexable, KERNEL
from sat_collision.geometry.motion.sweep import time_of_contact
from sat_collision.geometry.pair.contact import contact, contact_of_arrays
from sat_collision.geometry.path import first_contact_along, first_row_met_on
from sat_collision.geometry.query import (
    closest_points, intersects, intersects_pairs, separations)
from sat_collision.geometry.sets.packed_set import PackedSet
from sat_collision.geometry.sets.polygon_set import PolygonSet
from sat_collision.geometry.sets.run import find_polygons

_TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
_NON_CONVEX = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0)]

_others: list[subprocess.Popen[bytes]] = []


def begin() -> None:
    """Start another process, if this is a first start; call it early, before long imports."""
    if not (_others or is_prepared() or kernel_problem()):
        _others.append(_process('contacts', 'distances'))


class Preparation:
    """
    Compiles or loads the kernels of node and replay; `say` gets its progress, `warn` problems.

    Once it is constructed the kernels for contacts are ready. Those for distances are too, unless
    this is the first start after an installation, which compiles.
    """

    def __init__(self, say: Callable[[str], object], warn: Callable[[str], object]) -> None:
        self._say = say
        self._begun = time.monotonic()
        say_nothing()
        begin()
        say(f'preparing kernels ({KERNEL})' + (
            '; the first start after an installation compiles them' if _others else ''))
        # Garbage collection would take a tenth of the time, and there is little garbage.
        gc.disable()
        prepare_packing()
        for other in _others:
            if other.stdout:
                other.stdout.readline()
        prepare_contacts()
        if _others:
            _others.append(_process('motion'))
        else:
            prepare_distances()
            prepare_motion()
        gc.enable()
        say(f'kernels ({KERNEL}) ready after {self._seconds()}'
            + ('; distances are measured later' if _others else ''))
        if problem := kernel_problem():
            warn(problem)

    def is_complete(self) -> bool:
        """Return whether the kernels for distances are ready; call it again until they are."""
        if _others and all(other.poll() is not None for other in _others):
            self.complete()
        return not _others

    def complete(self) -> None:
        """Wait until the kernels for distances are ready."""
        if _others:
            for other in _others:
                other.communicate()
            _others.clear()
            prepare_distances()
            prepare_motion()
            self._say(f'distances are measured after {self._seconds()}')

    def _seconds(self) -> str:
        return f'{time.monotonic() - self._begun:.1f} s'


def is_prepared() -> bool:
    """Return whether an earlier process has left the kernels compiled; True if none is kept."""
    if not (COMPILED and HAS_OWN_CACHE):
        return True
    # This imports numba, which may be missing or broken.
    from sat_collision.geometry.compiled.kernel_cache import is_kept
    return is_kept(contact_of_arrays) and is_kept(first_row_met_on)


def prepare_packing() -> None:
    packed = workspace(len(_TRIANGLE))
    points = _TRIANGLE.tobytes(), 0, len(_TRIANGLE), TRIPLE
    pack_convex(*points, packed, len(_TRIANGLE), UNMOVED)
    Polygon(_TRIANGLE)
    Polygon.from_float32(*points[:3])
    message = np.array((0, len(_TRIANGLE)), np.uint32).tobytes() + points[0]
    ends = indexable(np.array((len(message),)))
    bodies = PackedSet()
    bodies.new_row()
    bodies.place_run((2 * message, ends, 1, 4, UNMOVED, len(_TRIANGLE), packed),
                     indexable(np.zeros(1, np.int64)), 0, 1, PackedSet(), 0.0)
    find_polygons(message, 0, indexable(np.empty(0, np.int64)))


def prepare_contacts() -> None:
    """Prepare the kernels that cut bodies into parts, and find the rows of a set that meet one."""
    # Without a Polygon, because packing may still be compiling.
    convex_parts(indexable(np.array(_NON_CONVEX).ravel()))
    point = _origin()
    bodies = PackedSet([point])
    bodies.intersecting_rows(point)
    bodies.hide(indexable(np.zeros(1, np.int64)))


def prepare_distances() -> None:
    """Prepare the kernels that find the nearest body of a set, those in a margin, and contacts."""
    point = _origin()
    bodies = PackedSet([point])
    bodies.nearest(point)
    bodies.place(bodies.new_row(), point.packed, PolygonSet([point]), 1.0)
    # Last, because `is_prepared` checks for it.
    contact(point, point)


def prepare_motion() -> None:
    # The bodies begin apart: otherwise no motion is computed.
    bodies = PackedSet([_origin()])
    bodies.first_contact(Polygon(_TRIANGLE + 1), (1, 0, 1), 1.0)
    # Last, because `is_prepared` checks for it.
    first_contact_along(_TRIANGLE + 1, [(0, 0, 0), (1, 0, 1)], bodies)


def prepare_pairs() -> None:
    """Prepare the kernels that only the functions on two bodies, or two sets, need."""
    body = Polygon(_TRIANGLE)
    bodies = PolygonSet([body])
    intersects(body, body)
    intersects_pairs(bodies, bodies)
    separations(bodies, bodies)
    closest_points(body, body)
    body.centroid
    time_of_contact(_TRIANGLE, _TRIANGLE + 2, _TRIANGLE + 4, _TRIANGLE)


def _origin() -> Polygon:
    """Return a point packed by hand, because packing may still be compiling."""
    return Polygon._of_packed(np.zeros(packed_size(1)), 1)


def _process(*tasks: str) -> subprocess.Popen[bytes]:
    # With the modules of this process: `-m` would look in the current folder first.
    program = (f'import sys; sys.path[:] = {sys.path}; import runpy; '
               f'runpy.run_module({__spec__.name!r}, run_name="__main__", alter_sys=True)')
    return subprocess.Popen([sys.executable, '-c', program, *tasks], stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)


@atexit.register
def _end_others() -> None:
    """Leave no process behind that would still write kernels."""
    for other in _others:
        other.kill()
        other.wait()


def _end_with_input() -> None:
    # Not with sys.stdin, whose lock would be held when the interpreter ends.
    os.read(0, 1)
    os._exit(0)


if __name__ == '__main__':
    threading.Thread(target=_end_with_input, daemon=True).start()
    gc.disable()
    for task in sys.argv[1:]:
        globals()[f'prepare_{task}']()
        print(task, flush=True)
