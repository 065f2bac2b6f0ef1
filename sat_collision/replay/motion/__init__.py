# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Recorded motion: where everything was between two messages, and which contacts that made.

bodies        sets of outlines, and the links (linear motion) from one set to the next
trajectories  the links of a footprint from one sample to the next
tracker       which body is which from one message to the next
contacts      where and when a footprint touches obstacles in between
kernels       operations on many rings (outlines as received): bounds, nearest neighbours, motions
nearness      which bodies are near to a footprint
prediction    predicted time to collision of a footprint
motion        all of this applied to a recording
drawing       where all of this was at chosen moments
"""
