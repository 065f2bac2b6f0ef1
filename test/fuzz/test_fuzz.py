# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The short form of ``make fuzz``."""

from fuzz import fuzz, FUZZERS
import pytest


@pytest.mark.parametrize('name', FUZZERS)
def test_fuzz(name):
    fuzz(name, 2000, seed=7)


@pytest.mark.parametrize('numbers, seed', [
    pytest.param(range(200), 7, id='200'),
    pytest.param(range(1000), 7, id='1000', marks=pytest.mark.long),
    pytest.param([525], 904164853, id='zeroed checksum of a chunk')])
def test_damaged_files(numbers, seed):
    pytest.importorskip('mcap')
    import fuzz_files
    fuzz_files.fuzz(numbers, seed)
