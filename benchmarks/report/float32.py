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

"""What the float32 of messages does to answers."""

import numpy as np
from sat_collision import intersects, PolygonError
from stability import hair_pairs, OFFSET_SIDES

DISTANCES = 10, 100, 1e3, 5e3, 1e4, 2e4, 1e5, 1e6, 5e6


def measure(rng, count=2000):
    """Return how often rounding bodies to float32, as a message does, changes the exact answer."""
    rows = []
    for distance in DISTANCES:
        pairs, gaps = hair_pairs(rng, OFFSET_SIDES, distance, count, -5, 0)
        changed, refused = [], 0
        for (a, b), gap in zip(pairs, gaps):
            try:
                there = intersects(*(body.astype(np.float32) for body in (a, b)))
            except PolygonError:
                refused += 1
                continue
            if there != intersects(a, b):
                changed.append(abs(float(gap)))
        rows.append({'distance': distance, 'step': _step(distance), 'pairs': len(pairs),
                     'changed': len(changed), 'refused': refused,
                     'widest': max(changed, default=0.0)})
    return rows


def _step(distance):
    return float(np.spacing(np.float32(distance)))
