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

"""Times, which are in ns."""

NEVER = float('inf')

# Stamps so far from the present are by another clock.
FAR = 3600 * 10**9
BY_ANOTHER_CLOCK = ('more than an hour from the clock of this node: set use_sim_time: true where '
                    'a recording or a simulation publishes /clock')
