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

"""Obstacles and their names."""

from typing import NamedTuple

from sat_collision.scene.contacts import Placeable
from sat_collision.scene.deadlines import NEVER


class Obstacle(NamedTuple):
    """
    The name of an obstacle.

    Attributes
    ----------
    source : str
        Name of the source.
    key : int
        Its place in the source's sets, or its id. Obstacles known by their shape alone (stamp 0,
        accumulate) have neither and are numbered -1, -2, ...

    """

    source: str
    key: int

    def __str__(self):
        return f'{self.source}/{self.key}'


class Body(Placeable):
    """An obstacle of a source; or, if `refused` says why, the place of one that was refused."""

    __slots__ = ('source', 'key', 'name', 'time', 'frame_id', 'refused', 'watched')

    def __init__(self, source, key, number, time):
        super().__init__()
        self.source = source
        self.key = key
        self.name = Obstacle(source.settings.name, number)
        self.time = time
        self.frame_id = ''
        self.refused = None
        self.watched = NEVER

    @property
    def deadline(self):
        """Time in ns after which the body is forgotten."""
        return self.time + self.source.timeout

    def expire(self):
        """Forget the body, now that its deadline is past."""
        self.source.forget(self)
