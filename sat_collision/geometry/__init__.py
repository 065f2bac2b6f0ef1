# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Exact predicates and queries on polygons, segments and points; needs only NumPy.

A folder stands on those before it:

compiled  kernels, with numba or as plain Python
numeric   arithmetic with error bounds, exact predicates
body      one body, packed into an array
pair      two bodies: whether they meet, distance, depth and contact
motion    two moving bodies: when they meet
sets      a body beside many

and on them all, beside these:

query        the public functions on bodies
path         where a body on a path of poses first meets an obstacle
overlap      the region that bodies share, for drawing only
preparation  compile or load kernels before they are needed
"""
