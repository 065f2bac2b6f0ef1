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

from typing import TYPE_CHECKING

from matplotlib.transforms import Bbox
import numpy as np
from sat_collision.replay.drawing.labels import Labels
from sat_collision.replay.drawing.words import colours, CONTACT, INK, OBSTACLE, Touching
from sat_collision.replay.film import Film, Floats, Span
from sat_collision.replay.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_scene(result: Result, film: Film, number: int, axes: Axes) -> None:
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

    """
    of_footprint = colours(result)
    names = {body: contact.obstacle
             for contact, body in Touching(film, result.contacts).at(film.moments[number])}
    labels = Labels(axes)
    named = []
    for body, span in film.at(number):
        colour = of_footprint[body.name] if body.is_footprint else OBSTACLE
        _draw_body(axes, span, colour, CONTACT if body in names else colour)
        box = Bbox.null()
        box.update_from_data_xy(axes.transData.transform(span.ring))
        box = box.padded(1.0)
        if (body.is_footprint or body in names) and box.overlaps(axes.bbox):
            labels.avoid(box)
            named.append((body.name if body.is_footprint else names[body], box,
                          colour if body.is_footprint else INK))
    for name, box, colour in named:
        labels.place(name, box, colour)


def look_at_pair(axes: Axes, gap: float, *rings: Floats) -> None:
    """Show the smaller body of a pair, some metres apart, and what is around it."""
    low, high = min(((ring.min(axis=0), ring.max(axis=0)) for ring in rings),
                    key=lambda corners: float((corners[1] - corners[0]).max()))
    reach = max(max(gap, 0.0) + 2.5 * float((high - low).max()), 1.0)
    _look_at(axes, (low + high) / 2, np.array([reach, reach]))


def look_at_all(axes: Axes, film: Film) -> None:
    """Show wherever a footprint comes, and some of what is around it."""
    rings = [span.ring for body in film.bodies if body.is_footprint for span in body.spans]
    points = np.concatenate(rings or [np.zeros((1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    reach = (high - low) / 2
    _look_at(axes, (low + high) / 2, reach + max(0.08 * float(reach.max()), 1.0))


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
