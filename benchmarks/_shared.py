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

"""Shared by benchmarks: module paths, timing, and a description of the machine."""

import gc
from importlib import metadata
import os
from pathlib import Path
import platform
import sys
import time

import numpy as np
from sat_collision import KERNEL

ROOT = Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / place) for place in (
    'benchmarks', 'benchmarks/report', 'docs', 'test/support')]
# Plots need no screen.
os.environ.setdefault('MPLBACKEND', 'Agg')
# A task that takes longer than this is not repeated, in seconds.
_LONG = 0.25


def times(tasks, repeats):
    """
    Run functions without arguments `repeats` times, in turns; return the seconds of each run.

    Each must have run before, so that nothing is compiled now; functions that take long run once.
    """
    taken = {name: [] for name in tasks}
    gc.collect()
    gc.disable()
    try:
        for _ in range(repeats):
            for name, task in tasks.items():
                if not taken[name] or taken[name][0] < _LONG:
                    start = time.perf_counter()
                    task()
                    taken[name].append(time.perf_counter() - start)
    finally:
        gc.enable()
    return taken


def medians(tasks, repeats):
    """Run functions as `times` does, and return the median seconds by name."""
    return {name: float(np.median(taken)) for name, taken in times(tasks, repeats).items()}


def describe(*packages):
    """Return processor, system and versions, of the named distributions too; no host name."""
    return {
        'processor': _processor(), 'cores': os.cpu_count(),
        'system': f'{platform.system()} {platform.machine()}',
        'python': platform.python_version(), 'kernel': KERNEL,
        **{package: metadata.version(package) for package in packages}}


def _processor():
    """Return the processor's name with its family, model and stepping, which a name may hide."""
    try:
        lines = Path('/proc/cpuinfo').read_text().splitlines()
    except OSError:
        return platform.processor()
    facts = dict(line.replace('\t', '').split(':', 1) for line in reversed(lines) if ':' in line)
    name = facts.get('model name', platform.machine()).strip()
    numbers = [f'{key}{facts[of]}' for key, of in (
        ('family', 'cpu family'), ('model', 'model'), ('stepping', 'stepping')) if of in facts]
    return ', '.join([name, ' '.join(numbers)] if numbers else [name])
