# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The short form of ``make faults``: each fault and situation once."""

from faults import FAULTS, rig
import pytest
from situations import judge, SITUATIONS, SLACK

# Well above the rule's 0.3 s and a timeout of 0.5 s, since the machine may be busy.
_SLOW = 10.0


@pytest.fixture(scope='class')
def made(module_domain):
    """Share a rig, which is closed before situations begin."""
    with rig(module_domain) as made:
        yield made


@pytest.mark.long
class TestFault:
    """Each fault is detected, and no flag says clear meanwhile."""

    @pytest.mark.parametrize('fault', FAULTS)
    def test_fault(self, made, fault):
        outcome = FAULTS[fault](made)
        assert outcome.wrong_clears == 0
        assert outcome.detected < _SLOW


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=() if situation.is_short else pytest.mark.long)
    for name, situation in SITUATIONS.items()])
def test_situation(domain, name):
    """No flag lets the robot drive in contact, and the flag falls in time afterwards."""
    outcome = judge(SITUATIONS[name], domain)
    # A flag takes some ms to arrive, and longer on a busy machine.
    assert outcome.drivable < 0.2
    assert outcome.recovered < SITUATIONS[name].promise + SLACK
