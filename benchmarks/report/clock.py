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

"""Medians of repeated timings, the tasks taking turns."""

import gc
import time

import numpy as np


def medians(tasks, repeats):
    """
    Run each task as often as said, in turns, and return its median and quartiles in seconds.

    Parameters
    ----------
    tasks : dict
        Functions without arguments by name; each has run before, so that nothing compiles now.
    repeats : int

    Returns
    -------
    dict
        (median, first quartile, third quartile) by name.

    """
    times = {name: [] for name in tasks}
    gc.collect()
    gc.disable()
    try:
        for _ in range(repeats):
            for name, task in tasks.items():
                start = time.perf_counter()
                task()
                times[name].append(time.perf_counter() - start)
    finally:
        gc.enable()
    return {name: tuple(np.quantile(values, [0.5, 0.25, 0.75]).tolist())
            for name, values in times.items()}
