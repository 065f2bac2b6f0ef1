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

"""Texts in a picture: none covers another, and none is cut off."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

_SIDES = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1))
_ALIGNED = {-1: ('right', 'top'), 0: ('center', 'center'), 1: ('left', 'bottom')}
_SMALLEST = 6.0
_GAP = 3.0


class Labels:
    """
    Places texts in axes whose limits are final.

    Parameters
    ----------
    axes : matplotlib.axes.Axes

    """

    def __init__(self, axes: Axes) -> None:
        self._axes = axes
        self._taken: list[Bbox] = []
        self._spared: list[Bbox] = []

    def avoid(self, bounds: Bbox) -> None:
        """Let no text be placed over a part of the axes, given in pixels."""
        self._taken.append(bounds)

    def spare(self, bounds: Bbox) -> None:
        """Let a text be placed over a part of the axes only where there is no better place."""
        self._spared.append(bounds)

    def place(self, text: str, bounds: Bbox, colour: str,
              sides: Sequence[tuple[int, int]] = _SIDES) -> bool:
        """
        Write a text beside a body or a band, where it fits.

        Parameters
        ----------
        text : str
        bounds : Bbox
            Of the body or band, in pixels.
        colour : str
        sides : sequence of tuple, optional
            Where to try: -1 is left or below, 1 right or above; (0, 0) is inside, in white.

        Returns
        -------
        bool
            Whether it fits somewhere.

        """
        inverse = self._axes.transData.inverted()
        for taken, (x, y) in product(([*self._taken, *self._spared], [*self._taken]), sides):
            place = ((bounds.x0 + bounds.x1 + x * (bounds.width + 2 * _GAP)) / 2,
                     (bounds.y0 + bounds.y1 + y * (bounds.height + 2 * _GAP)) / 2)
            is_inside = x == y == 0
            spot_x, spot_y = inverse.transform(place)
            found = self._axes.text(
                spot_x, spot_y, text, fontsize=8, zorder=5,
                color='white' if is_inside else colour, ha=_ALIGNED[x][0], va=_ALIGNED[y][1])
            covered = found.get_window_extent()
            others = [other for other in taken if not (is_inside and other is bounds)]
            room = bounds if is_inside else self._axes.bbox
            if _holds(room, covered) and not any(covered.overlaps(one) for one in others):
                self._taken.append(covered)
                return True
            found.remove()
        return False


def fit(text: Text, width: float) -> None:
    """Make a text smaller, then shorter, until it is no wider than some pixels."""
    while text.get_window_extent().width > width:
        size = float(text.get_fontsize())
        words = text.get_text()
        if size > _SMALLEST:
            text.set_fontsize(size - 0.5)
        elif len(words) > 3:
            half = (len(words) - 2) // 2
            text.set_text(f'{words[:half]}…{words[-half:]}')
        else:
            break


def _holds(bounds: Bbox, other: Bbox) -> bool:
    return bool(bounds.x0 <= other.x0 and other.x1 <= bounds.x1
                and bounds.y0 <= other.y0 and other.y1 <= bounds.y1)
