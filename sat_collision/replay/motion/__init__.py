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
"""
Recorded motion: where everything was between two messages, and what touched meanwhile.

order         messages in the order of their own stamps
bodies        outlines set after set, and between two moments
trajectories  the trajectory of a footprint
tracker       who is who from one message to the next
contacts      where and when a footprint touches obstacles meanwhile
kernels       rings by the thousand: bounds, neighbours, motions
nearness      what of them is near to a footprint
prediction    how soon a footprint would touch something as it moves
walk          all of this over a recording
tape          what is kept to draw it
"""
