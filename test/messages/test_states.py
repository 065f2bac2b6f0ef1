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

"""States in words, and how coarse the coordinates are that they rest on."""

import pytest
from sat_collision.geometry.polygon import Polygon
from sat_collision.messages.states import coordinate_step, in_words
from sat_collision.scene.footprints import State, Status
from sat_collision.scene.obstacles import ObstacleId
from stage import square


def collision(count, *reasons):
    """Return the state of a footprint in contact with so many obstacles."""
    return State(Status.COLLISION, tuple(ObstacleId('lidar', key) for key in range(count)),
                 reasons, 0.1)


@pytest.mark.parametrize('state, margin, words', [
    (State(Status.CLEAR, (), (), 0.1), 0.0, 'clear'),
    (State(Status.UNKNOWN, (), ('it is silent', 'it is stale'), None), 0.0,
     'unknown: it is silent; it is stale'),
    (collision(1), 0.0, 'in contact with lidar/0'),
    (collision(3), 0.0, 'in contact with lidar/0, lidar/1, lidar/2'),
    (collision(12), 0.0, 'in contact with lidar/0, lidar/1, lidar/2 and 9 more'),
    (collision(1, 'radar is silent'), 0.0, 'in contact with lidar/0'),
    (collision(2), 0.25, 'within 0.25 m of lidar/0, lidar/1'),
    (collision(0, 'clear for less than release_delay, 0.5 s'), 0.0,
     'collision: clear for less than release_delay, 0.5 s')])
def test_state_in_words(state, margin, words):
    """At most three obstacles by name, and the reasons where there is no contact."""
    assert in_words(state, margin) == words


def test_coordinate_step():
    """The float32 step 10 km from the origin, by the coordinate furthest out; 0 for no body."""
    assert 0.0009 < coordinate_step(square(10000)) < 0.001
    assert coordinate_step(square(-10000)) == coordinate_step(square(9999))
    assert coordinate_step(Polygon([(1, -10000)])) == coordinate_step(Polygon([(10000, 1)]))
    assert coordinate_step(square(0)) == 2.0**-23
    assert coordinate_step(None) == 0.0
