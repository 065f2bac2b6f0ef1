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
"""The place of a body as of a message, the input of recorded motion."""

from __future__ import annotations

from typing import NamedTuple

from sat_collision.geometry.polygon import PlaneMap
from sat_collision.messages.cdr import Points


class Placement(NamedTuple):
    """
    A message that was taken.

    Attributes
    ----------
    name : str
        Of the footprint or source of obstacles.
    stamp : int
        Header stamp in ns, the time of reception if it has none.
    is_stamped : bool
        Whether it has a stamp.
    frame_id : str
        The frame after the map is applied.
    points : Points
        As received.
    plane : PlaneMap or None
        What takes the points to that frame, None if they are in it.
    instance : int or None
        The obstacle's id, of a source that gives ids.

    """

    name: str
    stamp: int
    is_stamped: bool
    frame_id: str
    points: Points
    plane: PlaneMap | None
    instance: int | None
