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

"""Repeated timings, the tasks taking turns."""

import gc
import time

import numpy as np

# A task that takes longer than this is not repeated, in seconds.
LONG = 0.25


def times(tasks, repeats):
    """
    Run each task as often as said, in turns, and return how long each run took.

    Parameters
    ----------
    tasks : dict
        Functions without arguments by name; each has run before, so that nothing compiles now.
    repeats : int

    Returns
    -------
    dict
        Seconds of each run by name; of one run where that was `LONG`.

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
