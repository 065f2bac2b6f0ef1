# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Arithmetic on coordinates, with its error bounds.

double_double  numbers of twice the precision of a double (docs/exactness.md, lemma 15)
predicates     exact orientation of three points, by stages (Shewchuk 1997)
ascending      sorting, and finding a number
vectors        lengths, units, boxes, and the scaling that keeps them from overflow
"""
