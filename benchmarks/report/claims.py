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

"""The paper's claims: which step of the published method gives the wrong answers, and examples."""

from methods import Pairs, run
import numpy as np
import samples
from sat_collision import closest_points, separation
from sat_collision.geometry import sat_methods

DRAWN_SIDES = 8
PUBLISHED = 'published_a', 'published_b'
# The last axis of each step.
STEPS = {'published_a': {'centre line': 1, 'edge normals at B and C': 5,
                         'lines to the nearest points': 9},
         'published_b': {'centre line, four vertices': 1, 'normals of the crossed edges': 3}}


def measure(rng, count=4000):
    """Return by number of vertices at which step the answers of near pairs fall, right or not."""
    rows = []
    for n in samples.SIDES:
        pairs, meet = samples.sample(rng, n, 'near', count if n < 256 else count // 4)
        prepared = Pairs(pairs)
        for method in PUBLISHED:
            answers, axes = run(method, prepared)
            row = {'n': n, 'method': method, 'apart': int((~meet).sum()),
                   'meet': int(meet.sum()), 'steps': []}
            first = 1
            for step, last in STEPS[method].items():
                here = ~answers & (axes >= first) & (axes <= last)
                row['steps'].append({'step': step, 'clears': int((here & ~meet).sum()),
                                     'false_clears': int((here & meet).sum())})
                first = last + 1
            rows.append(row)
    return rows


def examples(rng, count=4000):
    """Return the near pair furthest apart of those A calls colliding, and B's deepest miss."""
    pairs, meet = samples.sample(rng, DRAWN_SIDES, 'near', count)
    prepared = Pairs(pairs)
    found = {}
    for method, wrong in (('published_a', ~meet), ('published_b', meet)):
        answers, _ = run(method, prepared)
        rows = np.flatnonzero((answers != meet) & wrong)
        values = [separation(*pairs[i]) for i in rows]
        a, b = pairs[rows[np.argmax(np.abs(values))]]
        found[method] = {
            'a': a.tolist(), 'b': b.tolist(), 'separation': float(separation(a, b)),
            'closest_points': [point.tolist() for point in closest_points(a, b)],
            'centres': [list(map(float, sat_methods.centre_of_gravity(body))) for body in (a, b)]}
    return found
