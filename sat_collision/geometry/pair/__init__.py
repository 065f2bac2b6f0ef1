# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Two bodies: whether they meet, and how far apart, how deep and where.

separating_axis  the improved separating axis method on convex bodies (paper sections 3.1 and 3.2)
intersection     exact answers: that search, and exact signs where it leaves a pair open
convex_distance  distance or depth of two convex bodies (GJK), to twice the precision of a double
distance         signed distance of any two bodies
way_out          the shortest move that takes one body out of another, over all directions
contact          normal, depth and points of contact
"""
