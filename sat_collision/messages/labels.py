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

"""Where texts go: beside what they describe, over no body and over no other text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.messages.shared_region import clip, Ring

# Least x and y, greatest x and y.
Box: TypeAlias = tuple[float, float, float, float]

# Of a character, in parts of the height of the text.
_WIDTH = 0.6
_DISTANCES = (0.3, 1.5, 3.0)
_PADDING = 0.2


class Labels:
    """
    Finds places for texts, one after the other.

    Parameters
    ----------
    bodies : iterable of ((n, 2) ndarray, Box)
        Convex rings that no text shall cover, each with the box around it.
    height : float
        Of all texts, metres.

    """

    def __init__(self, bodies: Iterable[tuple[Ring, Box]], height: float) -> None:
        bodies = list(bodies)
        self._rings = [ring for ring, _ in bodies]
        self._boxes: NDArray[np.float64] = np.array([box for _, box in bodies]).reshape(-1, 4)
        self._height = height

    def place(self, text: str, box: Box) -> tuple[float, float]:
        """Return where the middle of a text about what is in a box (m) goes, and keep it free."""
        half = 0.5 * _WIDTH * self._height * len(text), 0.5 * self._height
        padding = _PADDING * self._height
        w, h = half[0] + padding, half[1] + padding
        least: tuple[int, Ring] | None = None
        for x, y in _candidates(box, *half, self._height):
            ring = np.array([(x - w, y - h), (x + w, y - h), (x + w, y + h), (x - w, y + h)])
            covered = self._count_covered(ring)
            if least is None or covered < least[0]:
                least = covered, ring
            if not covered:
                break
        assert least is not None
        ring = least[1]
        self.keep_free(ring)
        x, y = ring.mean(0).tolist()
        return x, y

    def keep_free(self, ring: Ring) -> None:
        """Let what else is drawn be covered by no text."""
        self._rings.append(ring)
        self._boxes = np.vstack([self._boxes, (*ring.min(0), *ring.max(0))])

    def _count_covered(self, ring: Ring) -> int:
        """Return how many bodies and texts a text would cover."""
        near = ((self._boxes[:, :2] < ring[2]) & (self._boxes[:, 2:] > ring[0])).all(1)
        return sum(len(clip(ring, self._rings[i])) > 0 for i in np.flatnonzero(near))


def _candidates(box: Box, half_width: float, half_height: float,
                height: float) -> Iterator[tuple[float, float]]:
    """Yield the places around a box, the best first: above, below, at the sides, at corners."""
    min_x, min_y, max_x, max_y = box
    for distance in _DISTANCES:
        gap = distance * height
        xs = 0.5 * (min_x + max_x), max_x + gap + half_width, min_x - gap - half_width
        ys = 0.5 * (min_y + max_y), max_y + gap + half_height, min_y - gap - half_height
        for i, j in ((0, 1), (0, 2), (1, 0), (2, 0), (1, 1), (2, 1), (1, 2), (2, 2)):
            yield xs[i], ys[j]
