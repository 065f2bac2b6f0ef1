# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Ascending arrays of numbers: sorting them, and finding a number in one."""

from sat_collision.geometry.compiled.jit import inlined, inner


@inner
def sort(keys, values, count):
    """Sort so many keys, and move values along with them, which may be the same array (Shell)."""
    gap = count // 2
    while gap > 0:
        for i in range(gap, count):
            key = keys[i]
            value = values[i]
            k = i
            while k >= gap and keys[k - gap] > key:
                keys[k] = keys[k - gap]
                values[k] = values[k - gap]
                k -= gap
            keys[k] = key
            values[k] = value
        # Not halved: that might compare odd indices only with each other until the last pass.
        gap = (5 * gap - 1) // 11 if gap > 2 else gap // 2


@inlined
def contains(numbers, number):
    """Return whether a number is in an ascending array, by bisection."""
    begin, end = 0, len(numbers)
    while begin < end:
        middle = (begin + end) // 2
        if numbers[middle] < number:
            begin = middle + 1
        else:
            end = middle
    return begin < len(numbers) and numbers[begin] == number
