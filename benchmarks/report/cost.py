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

"""What exactness costs in scenes."""

import numpy as np
from sat_collision import intersects_pairs, Polygon, PolygonSet
from scenes import scenes
import stages

REPEATS = 15


def measure():
    """Return for each scene how many pairs the exact stage decides, and its share of the time."""
    return [{'scene': name, **_exact_stage(frames)} for name, frames in scenes().items()]


def _exact_stage(frames):
    made = {id(body): Polygon(body) for footprint, obstacles in frames
            for body in (footprint, *obstacles)}
    pairs = [(made[id(footprint)], made[id(obstacle)])
             for footprint, obstacles in frames for obstacle in obstacles]
    a, b = [p for p, _ in pairs], [q for _, q in pairs]
    axes, exact = stages.tried(a, b)
    row = {'frames': len(frames), 'pairs': len(pairs),
           'contacts': int(intersects_pairs(PolygonSet(a), PolygonSet(b)).sum()),
           'boxes': int((axes == stages.BOX_AXES).sum()), 'exact': int(exact.sum())}
    whole = stages.seconds(a, b, REPEATS)
    unsure = np.flatnonzero(exact)
    there = stages.seconds([a[i] for i in unsure], [b[i] for i in unsure], REPEATS)
    row['ns'] = whole and round(whole / len(pairs) * 1e9, 1)
    row['exact_time'] = 0.0 if not len(unsure) else there and round(there / whole, 4)
    return row
