# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Changes of bodies that must not change any answer."""

import metamorphic
import numpy as np
import pytest
from sat_collision import intersects_pairs
from sat_collision.geometry.compiled.jit import COMPILED

COUNT = 2000 if COMPILED else 300


@pytest.mark.parametrize('n', [5, 19])
@pytest.mark.parametrize('name', metamorphic.CHANGES)
def test_exact_changes_change_no_answer(name, n):
    assert metamorphic.changed_answers(name, np.random.default_rng(5), COUNT, n) == 0


@pytest.mark.parametrize('n', [5, 19])
def test_body_intersects_if_one_of_its_halves_does(n):
    """The halves share the diagonal along which the body is cut."""
    rng = np.random.default_rng(6)
    assert sum(metamorphic.lost_by_a_cut(rng, COUNT // 5, n) for _ in range(5)) == 0


def test_both_answers_occur():
    answers = intersects_pairs(*metamorphic.sets_of(
        *metamorphic.pairs_of(np.random.default_rng(7), COUNT, 5)))
    assert 0.3 < answers.mean() < 0.95
