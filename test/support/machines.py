# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Random sequences of events, as many as show everything that they are meant to."""

import hypothesis
from hypothesis.stateful import run_state_machine_as_test

# Examples are drawn from constants of imported modules, too: what one run shows, another may not.
_SEEDS = 5


def run_until_seen(machine, wanted, examples, steps):
    """Run a state machine with other seeds until its `seen` counts all that is wanted of it."""
    machine.seen.clear()
    for seed in range(_SEEDS):
        run_state_machine_as_test(hypothesis.seed(seed)(machine), settings=hypothesis.settings(
            max_examples=examples, stateful_step_count=steps, database=None, deadline=None,
            report_multiple_bugs=False,
            phases=(hypothesis.Phase.generate, hypothesis.Phase.shrink)))
        if all(machine.seen[what] > count for what, count in wanted.items()):
            return
    raise AssertionError(f'wanted {wanted}, seen {machine.seen}')
