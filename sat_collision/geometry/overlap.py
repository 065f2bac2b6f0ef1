# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where bodies meet, for drawing only: it is rounded."""

from collections.abc import Iterator
from itertools import product
import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.polygon import Polygon
from sat_collision.geometry.sets.polygon_set import PolygonSet

# (n, 2): corners of a convex polygon, counter-clockwise, ends of a segment, or a point.
Ring: TypeAlias = NDArray[np.float64]

# Bodies with more pairs of parts are marked where they are deepest in each other.
_MAX_PAIRS = 2_000
# Bound of rounding errors, relative to the largest coordinate.
_SLACK = 1e-9


def contact_marks(footprint: Polygon, obstacle: Polygon) -> list[Ring]:
    """
    Return marks of where two bodies meet: convex pieces of the region that they share.

    Where that has no area, its segments or points; where they are apart within the margin, or have
    too many parts, the segment from one to the other.
    """
    slack = _SLACK * (1.0 + max(map(abs, (*footprint.bounds, *obstacle.bounds))))
    parts = footprint.parts, obstacle.parts
    has_many = len(parts[0]) * len(parts[1]) > _MAX_PAIRS
    pieces = [piece for own, other in (() if has_many else product(*parts))
              if _meet(own.bounds, other.bounds, slack)
              and len(piece := clip(own.vertices, other.vertices, slack))]
    solid = [piece for piece in pieces if _area(piece) > slack * _size(piece)]
    if solid:
        return solid
    if pieces:
        return [_flat(piece, slack) for piece in pieces]
    nearest = PolygonSet([obstacle]).nearest(footprint)
    return [np.array(nearest[2:])] if nearest else []


def clip(ring: Ring, other: Ring, slack: float = 0.0) -> Ring:
    """Return what two convex rings share, to a slack in m, by Sutherland and Hodgman (1974)."""
    # The fewer lines, the faster.
    if len(ring) < len(other):
        ring, other = other, ring
    for start, along in _half_planes(other):
        sides = ((ring[:, 1] - start[1]) * along[0] - (ring[:, 0] - start[0]) * along[1]
                 ) / math.hypot(*along)
        inside = sides >= -slack
        if inside.all():
            continue
        if not inside.any():
            return ring[:0]
        difference = sides - np.roll(sides, -1)
        share = np.divide(sides, difference, out=np.zeros_like(sides), where=difference != 0.0)
        crossings = ring + np.clip(share, 0.0, 1.0)[:, None] * (np.roll(ring, -1, 0) - ring)
        kept = np.column_stack([inside, inside != np.roll(inside, -1)])
        ring = np.stack([ring, crossings], 1)[kept]
    return ring


def _half_planes(ring: Ring) -> Iterator[tuple[Ring, Ring]]:
    """Yield a point and a direction of each line to the left of which a ring lies."""
    if len(ring) == 1:
        # Those of a square of size zero.
        for along in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)):
            yield ring[0], np.array(along)
        return
    yield from zip(ring, np.roll(ring, -1, 0) - ring)
    if len(ring) == 2:
        x, y = ring[1] - ring[0]
        yield ring[0], np.array([y, -x])
        yield ring[1], np.array([-y, x])


def _meet(one: tuple[float, ...], other: tuple[float, ...], slack: float) -> bool:
    return (one[0] <= other[2] + slack and other[0] <= one[2] + slack
            and one[1] <= other[3] + slack and other[1] <= one[3] + slack)


def _area(ring: Ring) -> float:
    x, y = (ring - ring[0]).T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


def _size(ring: Ring) -> float:
    return float(np.ptp(ring, axis=0).sum())


def _flat(ring: Ring, slack: float) -> Ring:
    """Return the ends of a ring without area, one point if they are the same."""
    for _ in range(2):
        order = np.argsort(np.hypot(*(ring - ring[0]).T))
        ring = ring[order[::-1]]
    return ring[:1] if _size(ring) <= 4.0 * slack else ring[[0, -1]]
