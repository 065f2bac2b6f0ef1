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

"""What is missing among messages, by their publishers' numbers."""

from sat_collision.messages.losses import Losses


def missing(*numbers, publishers=1):
    """Return how many are missing before each of these."""
    losses = Losses()
    losses.most = publishers
    return [losses.missing(number) for number in numbers]


def test_publisher_that_is_heard_from_the_middle_on():
    """What came before the first is nobody's loss."""
    assert missing(7, 8, 9) == [None, 0, 0]


def test_gaps_are_counted():
    """Each once."""
    assert missing(1, 2, 5, 6, 16) == [None, 0, 2, 0, 9]


def test_two_publishers_in_turns():
    """Each has numbers of its own."""
    assert missing(500, 3, 501, 4, 5, 502, 503, 8, 504, publishers=2) == [
        None, None, 0, 0, 0, 0, 0, 2, 0]


def test_publisher_that_begins_again():
    """Even when it comes to where it once stopped."""
    assert missing(*range(1, 20), *range(1, 40)) == [None, *[0] * 18, None, *[0] * 38]


def test_publishers_that_begin_again_and_again_take_no_memory():
    """Only the latest are remembered."""
    losses = Losses()
    for first in range(1000, 0, -1):
        assert losses.missing(2 * first) is None
    assert len(losses._last) == 1
    assert [losses.missing(number) for number in (3, 4, 6)] == [0, 0, 1]
