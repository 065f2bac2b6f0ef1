# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""A short run of the search for inputs that break a filter; the long one is `make adversary`."""

import adversary
import contacts
import filter_bounds
import numpy as np
import predictions
import pytest
from sat_collision.geometry.compiled.jit import COMPILED
import separations
import steering

pytestmark = [pytest.mark.long,
              pytest.mark.skipif(not COMPILED, reason='the search needs compiled kernels')]

EVALUATIONS = 100000
# A share of each bound that is too small: the search finds errors beyond it. In brackets the share
# that the lemma proves.
TOO_SMALL = {
    filter_bounds.ORIENTATION: 0.5,  # (1)
    filter_bounds.TURN: 0.2,         # (3/8)
    filter_bounds.RISE: 0.15,        # (1/4)
    filter_bounds.SCAN: 0.5,         # (1)
    filter_bounds.GAP: 0.05,         # (3/20)
    filter_bounds.CLIMB: 0.4,        # (22/25)
    filter_bounds.DISC: 0.002,       # (7/256)
}


@pytest.mark.parametrize('which', TOO_SMALL, ids=filter_bounds.NAMES)
def test_no_error_exceeds_its_bound_but_some_a_smaller_one(which):
    ratio, mistakes = adversary.largest(which, EVALUATIONS)
    assert 0.0 < ratio <= 1.0 and mistakes == 0
    assert adversary.largest(which, EVALUATIONS, share=TOO_SMALL[which])[0] > 1.0


@pytest.mark.parametrize('which', TOO_SMALL, ids=filter_bounds.NAMES)
def test_compiled_error_agrees_with_rationals(which):
    """To a thousandth, for values near zero."""
    rng = np.random.default_rng(3)
    compared = 0
    for x in adversary.starts_of(rng, which, 100):
        steering.climb(adversary.score, which, x, 1.0, 10, rng)
        exact = filter_bounds.exact(which, x)
        if exact > 0.0:
            compared += 1
            assert adversary.score(which, x, 1.0)[0] == pytest.approx(exact, rel=1e-3)
    assert compared >= 10


@pytest.mark.parametrize('n, m', steering.COUNTS)
@pytest.mark.parametrize('which', range(len(steering.NAMES)), ids=steering.NAMES)
def test_pairs_at_the_edge_of_a_filter(which, n, m):
    """All verdicts agree with the exact stage, and all final answers with the oracle."""
    arrived, ratio, proved, wrong = steering.at_the_edge(which, n, m, EVALUATIONS // 2)
    assert wrong == 0 and proved > 0 and ratio <= 1.0
    assert arrived > 0.0 or n + m > 10


@pytest.mark.parametrize('search, which, evaluations, share', [
    (separations, separations.DISTANCE, EVALUATIONS // 2, 0.45),
    (separations, separations.DEPTH, EVALUATIONS // 2, 0.45),
    (separations, separations.WAY, EVALUATIONS // 2, 0.12),
    (separations, separations.AXIS, EVALUATIONS // 2, 0.12),
    (contacts, contacts.NORMAL, EVALUATIONS // 5, 0.4),
    (contacts, contacts.POINTS, EVALUATIONS // 5, 0.09),
    (contacts, contacts.GAP, EVALUATIONS // 5, 0.04),
    (contacts, contacts.WAY_OUT, EVALUATIONS // 5, 0.004),
    (predictions, predictions.LATE, EVALUATIONS // 10, -1.0),
    (predictions, predictions.EARLY, EVALUATIONS // 10, 0.2),
], ids=separations.NAMES + contacts.NAMES + predictions.NAMES)
def test_no_promise_is_broken(search, which, evaluations, share):
    """Nor are the bounds much too large, except for the margin of a prediction."""
    ratio, wrong = adversary.worst(search, which, evaluations * len(search.COUNTS))
    assert wrong == 0 and share < ratio <= 1.0
