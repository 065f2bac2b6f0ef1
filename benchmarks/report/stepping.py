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
What stepping a prediction costs: contacts that it misses, and how late it finds the others.

A rectangle of 0.8 m by 0.5 m drives at 1 to 10 m/s and turns by up to 1 rad/s for 3 s, between
segments of 0.1 to 1 m.
"""

import numpy as np
from sat_collision import Polygon, PolygonSet
import stages

STEPS = 0.01, 0.1, 0.2, 0.3, 0.5
HORIZON = 3.0
OBSTACLES = 200
REPEATS = 5
_FOOTPRINT = np.array([(-0.4, -0.25), (0.4, -0.25), (0.4, 0.25), (-0.4, 0.25)])


def measure(rng, count):
    """
    Return for the continuous time (step 0) and for steps what they miss and take, in s and ns.

    What any of them finds counts as a contact, but for what the rectangle touches at the start.
    How late it is found is measured from the earliest. Times are those of a scene's first
    contact, asked from Python, an obstacle.
    """
    scenes = [(_segments(rng), (rng.uniform(1.0, 10.0), 0.0, rng.uniform(-1.0, 1.0)))
              for _ in range(count)]
    found = {0.0: np.concatenate([[_first(PolygonSet([one]), twist) for one in segments]
                                  for segments, twist in scenes])}
    sets = [(PolygonSet(segments), twist) for segments, twist in scenes]
    tasks = {0.0: lambda: [_first(*scene) for scene in sets]}
    for step in STEPS:
        found[step] = np.concatenate([_first_steps(*scene, step) for scene in sets])
        tasks[step] = lambda step=step: [
            next((time for time, rows in _steps(*scene, step) if len(rows)), np.inf)
            for scene in sets]
    seconds = stages.medians(tasks, REPEATS)
    earliest = np.min([*found.values()], axis=0)
    contacts = (earliest > 0.0) & (earliest < np.inf)
    rows = []
    for step, times in found.items():
        seen = contacts & (times < np.inf)
        late = times[seen] - earliest[seen]
        rows.append({'step': step, 'contacts': int(contacts.sum()),
                     'missed': int((contacts & ~seen).sum()),
                     'mean': float(late.mean()), 'worst': float(late.max()),
                     'ns': round(seconds[step] / count / OBSTACLES * 1e9, 1)})
    return rows


def _segments(rng):
    middles = rng.uniform((0.0, -10.0), (25.0, 10.0), (OBSTACLES, 2))
    angles = rng.uniform(0.0, np.pi, OBSTACLES)
    halves = rng.uniform(0.05, 0.5, OBSTACLES) * (np.cos(angles), np.sin(angles))
    return np.stack([middles - halves.T, middles + halves.T], axis=1)


def _first(obstacles, twist):
    """Return when the rectangle first meets any of some obstacles, infinity if it does not."""
    found = obstacles.first_contact(_FOOTPRINT, twist, HORIZON)
    return np.inf if found is None else found[1]


def _first_steps(obstacles, twist, step):
    """Return the first step at which the rectangle meets each obstacle, infinity if none."""
    found = np.full(len(obstacles), np.inf)
    for time, rows in _steps(obstacles, twist, step):
        found[rows] = np.minimum(found[rows], time)
    return found


def _steps(obstacles, twist, step):
    """Yield the time of each step, and which obstacles the rectangle meets there."""
    speed, _, turn = twist
    for time in step * np.arange(round(HORIZON / step) + 1):
        turned = np.exp(1j * turn * time)
        points = turned * (_FOOTPRINT @ (1.0, 1.0j)) + speed * (turned - 1.0) / (1.0j * turn)
        yield time, obstacles.intersecting_rows(
            Polygon(np.column_stack([points.real, points.imag])))
