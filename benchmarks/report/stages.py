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
Timing, and which stage of the improved method decides a pair and what each stage costs.

The one place of the report that looks into the method: boxes first, then the search in plain
doubles, then exact orientations where the search was not sure. Bodies that are not convex are
decided part by part, as `intersection.bodies_meet` does.
"""

import functools
import gc
import time

import numpy as np
from sat_collision.geometry.intersection import bodies_meet
from sat_collision.geometry.jit import kernel
from sat_collision.geometry.layout import convex_part, Packed
from sat_collision.geometry.separating_axis import (
    boxes_apart, find_separating_axis, SEPARATE, UNCERTAIN)

# Testing bounding boxes counts as trying two axes.
BOX_AXES = 2
# Fewer pairs than this are not timed.
FEWEST_TIMED = 100
# A task that takes longer than this is not repeated, in seconds.
LONG = 0.25


def times(tasks, repeats):
    """
    Run functions without arguments as often as said, in turns; return the seconds of each run.

    Each must have run before, so that nothing compiles now; what takes `LONG` runs once.
    """
    taken = {name: [] for name in tasks}
    gc.collect()
    gc.disable()
    try:
        for _ in range(repeats):
            for name, task in tasks.items():
                if not taken[name] or taken[name][0] < LONG:
                    start = time.perf_counter()
                    task()
                    taken[name].append(time.perf_counter() - start)
    finally:
        gc.enable()
    return taken


def medians(tasks, repeats):
    """Do as `times`, and return the median seconds by name."""
    return {name: float(np.median(taken)) for name, taken in times(tasks, repeats).items()}


def tried(a, b):
    """
    Return for pairs of two lists of `Polygon` how many axes each takes, and what went further.

    These are axes tried in plain doubles, the boxes counted as two, and whether exact orientations
    had to decide.
    """
    axes, exact = np.empty(len(a), np.int64), np.empty(len(a), np.bool_)
    _count(*_packed(a), *_packed(b), axes, exact)
    return axes, exact


def seconds(a, b, repeats=7):
    """Return the median seconds of deciding pairs in one compiled call; None of few pairs."""
    if len(a) < FEWEST_TIMED:
        return None
    task = functools.partial(_decide, *_packed(a), *_packed(b), np.empty(len(a), np.bool_))
    task()
    return medians({'whole': task}, repeats)['whole']


def _packed(polygons):
    bodies = [np.asarray(polygon.packed[0]) for polygon in polygons]
    starts = np.cumsum([0] + [len(body) for body in bodies[:-1]])
    return np.concatenate(bodies), starts, np.array([polygon.packed[1] for polygon in polygons])


@kernel
def _count(a, a_starts, a_counts, b, b_starts, b_counts, axes, exact):
    for row in range(len(axes)):
        axes[row], exact[row] = _axes_and_doubt(Packed(a, a_starts[row], a_counts[row]),
                                                Packed(b, b_starts[row], b_counts[row]))


@kernel
def _decide(a, a_starts, a_counts, b, b_starts, b_counts, answers):
    for row in range(len(answers)):
        answers[row] = bodies_meet(Packed(a, a_starts[row], a_counts[row]),
                                   Packed(b, b_starts[row], b_counts[row]))


@kernel
def _axes_and_doubt(p, q):
    """Return how many axes two bodies take, and whether the search was not sure."""
    axes = BOX_AXES
    if boxes_apart(p, q):
        return axes, False
    for i in range(max(1, -p.n)):
        a = convex_part(p, i)
        for j in range(max(1, -q.n)):
            b = convex_part(q, j)
            if p.n < 0 or q.n < 0:
                axes += BOX_AXES
            if not boxes_apart(a, b):
                verdict, _, _, queries = find_separating_axis(a, b)
                axes += queries
                if verdict != SEPARATE:
                    return axes, verdict == UNCERTAIN
    return axes, False
