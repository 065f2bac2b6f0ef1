# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Kernels: compiled with numba if it is installed, otherwise run as plain Python, alike to the bit.

jit             how a kernel is declared, and what numba makes of it
kernel_cache    compile each kernel once, and keep it on disk
compilation     what is said while compiling, and what is wrong with the files kept
floating_point  checks that floating point is what the proofs of docs/exactness.md assume
"""
