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

"""The bodies of a film at a moment, drawn in axes."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from matplotlib.transforms import Bbox
import numpy as np
from sat_collision.replay.drawing.labels import Labels
from sat_collision.replay.drawing.words import colours, CONTACT, INK, OBSTACLE, touching
from sat_collision.replay.film import Film, FilmedBody, Floats, Span
from sat_collision.replay.result import Least, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_scene(result: Result, film: Film, number: int, axes: Axes,
               named: Collection[str] = ()) -> None:
    """
    Draw bodies, with their outlines broken where it is not known that they are there.

    Parameters
    ----------
    result : Result
    film : Film
        Of the result.
    number : int
        Of the moment.
    axes : matplotlib.axes.Axes
        Its limits are final.
    named : collection of str, optional
        Obstacles to name beside footprints and what is in contact.

    """
    of_footprint = colours(result)
    in_contact = touching(result, film, film.moments[number])
    labels = Labels(axes)
    texts = []
    for body, span in film.at(number):
        colour = of_footprint[span.name] if body.is_footprint else OBSTACLE
        face = CONTACT if body in in_contact else colour
        _draw_body(axes, span, colour if body.is_footprint else face, face)
        box = Bbox.null()
        box.update_from_data_xy(axes.transData.transform(span.ring))
        if not box.overlaps(axes.bbox):
            continue
        if body.is_footprint or body in in_contact or span.name in named:
            labels.avoid(box)
            texts.append((span.name, box, colour if body.is_footprint else INK))
        else:
            labels.spare(box)
    for name, box, colour in texts:
        labels.place(name, box, colour)


def look_at_least(axes: Axes, least: Least, footprint: FilmedBody | None) -> None:
    """Show where a footprint is nearest to an obstacle, and what is around it."""
    size = float(np.max(np.ptp(footprint.spans[0].ring, axis=0))) if footprint else 0.0
    reach = max(least.separation + 1.5 * size, 1.5 * size, 1.0)
    _look_at(axes, np.array([least.x, least.y]), np.array([reach, reach]))


def look_at_all(axes: Axes, film: Film) -> None:
    """Show wherever a footprint comes, and some of what is around it."""
    rings = [span.ring for body in film.bodies if body.is_footprint for span in body.spans]
    points = np.concatenate(rings or [np.zeros((1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    reach = (high - low) / 2
    _look_at(axes, (low + high) / 2, reach + max(0.08 * float(np.max(reach)), 1.0))


def _look_at(axes: Axes, middle: Floats, reach: Floats) -> None:
    """Show what is this far from a point, and more where the axes have another shape."""
    scale = max(reach[0] / axes.bbox.width, reach[1] / axes.bbox.height)
    axes.set_xlim(middle[0] - scale * axes.bbox.width, middle[0] + scale * axes.bbox.width)
    axes.set_ylim(middle[1] - scale * axes.bbox.height, middle[1] + scale * axes.bbox.height)


def _draw_body(axes: Axes, span: Span, edge: str, face: str) -> None:
    ring = np.concatenate([span.ring, span.ring[:1]])
    if span.known and len(span.ring) > 2:
        axes.fill(*span.ring.T, color=face, alpha=0.35, linewidth=0)
    axes.plot(*ring.T, color=edge, linewidth=1.4, linestyle='-' if span.known else ':',
              marker='o' if len(span.ring) == 1 else None, markersize=4)
