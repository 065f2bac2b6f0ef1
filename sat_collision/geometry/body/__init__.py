# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
One body: checked, cleaned and packed into an array that kernels read.

layout        where in the array everything is, for bodies and for sets of them
packing       make a packed polygon of received points, or say what is wrong with them
convex_parts  cut a simple polygon into convex parts (Meisters 1975, Hertel and Mehlhorn 1983)
polygon       the public `Polygon`, and what packs the points of messages
moving        a body between two poses, each vertex on a straight line
box_index     which of many bodies have bounds near a box: an R-tree, or a scan
"""
