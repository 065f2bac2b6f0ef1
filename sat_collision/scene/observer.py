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

"""Who wants to know what a scene takes, and what it drops."""

from __future__ import annotations

from typing import Protocol

from sat_collision.scene.footprints import Footprint
from sat_collision.scene.obstacles import Obstacle


class Observer(Protocol):
    """Is told of each body when it is placed in a scene, and when it is there no longer."""

    def place_footprint(self, footprint: Footprint) -> None:
        """Take note of a footprint that was taken."""

    def remove_footprint(self, footprint: Footprint) -> None:
        """Take note that a footprint is nowhere from now on."""

    def begin_set(self, source: str, stamp: int) -> None:
        """Take note that a set of a source begins: what follows belongs to it; stamp in ns."""

    def place_obstacle(self, obstacle: Obstacle) -> None:
        """Take note of an obstacle, of the set that comes in or known by id or shape."""

    def remove_obstacle(self, obstacle: Obstacle) -> None:
        """Take note that an obstacle is gone, though no later set took its place."""
