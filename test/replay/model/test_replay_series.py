# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Samples of a result over time."""

from sat_collision.replay.model.result import Series


def test_long_series_keeps_the_least_of_neighbours():
    """Of 10,000 samples, each four become one; None counts only where there is nothing else."""
    values = [None if k % 3 == 0 or k > 9000 else 7919 * k % 1000 / 10 for k in range(10_000)]
    series = Series([])
    for k, value in enumerate(values):
        series.add(k, value)
    assert series.samples == [
        (k, min((value for value in values[k:k + 4] if value is not None), default=None))
        for k in range(0, 10_000, 4)]
