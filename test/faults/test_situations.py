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

"""The second half of ``make faults`` in short: what a monitor cannot know is not clear."""

import pytest
from situations import judge, SITUATIONS, SLACK


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=() if situation.is_short else pytest.mark.long)
    for name, situation in SITUATIONS.items()])
def test_situation(domain, name):
    """No flag lets the robot drive while in contact, and the flag falls once all is over."""
    outcome = judge(SITUATIONS[name], domain)
    # A flag is on its way for some ms, and for longer on a busy machine.
    assert outcome.drivable < 0.2
    assert outcome.recovered < SITUATIONS[name].promise + SLACK
