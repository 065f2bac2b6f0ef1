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

"""The drawing of a wrong answer of either published reading."""

from matplotlib import pyplot
from methods import METHODS
import numpy as np

_A, _B = (METHODS[method].colour for method in ('published_a', 'published_b'))


def write_all(figures, directory):
    """Write the PNG file of this module to a directory."""
    figure = _examples(figures)
    figure.savefig(directory / 'examples.png')
    pyplot.close(figure)


def _examples(figures):
    figure, (left, middle, right) = pyplot.subplots(1, 3, figsize=(12.5, 4.9))
    one, other = (figures['examples'][method] for method in ('published_a', 'published_b'))
    _draw(left, one, _draw_a)
    _draw(middle, other, _draw_b)
    _draw(right, other, _draw_b)
    left.set_title(f'reading A says "collision": {one["separation"] * 1e3:.0f} mm apart')
    middle.set_title(f'reading B says "clear": {-other["separation"] * 1e3:.0f} mm overlap')
    right.set_title('the overlap, magnified')
    for panel in (left, middle):
        panel.legend(frameon=False, fontsize=8, loc='upper center', bbox_to_anchor=(0.5, -0.13),
                     ncols=1 if panel is left else 2)
    x, y = np.mean(other['closest_points'], axis=0)
    half = -3 * other['separation']
    right.set(xlim=(x - half, x + half), ylim=(y - half, y + half), adjustable='box')
    middle.plot(*_frame(x, y, half), color='#666666', linewidth=0.8)
    figure.tight_layout()
    return figure


def _draw(panel, example, draw):
    a, b = (np.array(example[side]) for side in 'ab')
    centres = np.array(example['centres'])
    for body, name, at in zip((a, b), 'PQ', centres):
        panel.fill(*body.T, facecolor='#bbbbbb', edgecolor='#333333', alpha=0.6)
        panel.annotate(name, at, (0, 5), textcoords='offset points', fontsize=11,
                       annotation_clip=True)
    panel.plot(*centres.T, 'o--', color='#0072B2', markersize=4, label='centre line')
    draw(panel, example, a, b, centres)
    panel.set_aspect('equal', adjustable='datalim')
    panel.set_xlabel('x, m')
    panel.set_ylabel('y, m')


def _frame(x, y, half):
    return ([x - half, x + half, x + half, x - half, x - half],
            [y - half, y - half, y + half, y + half, y - half])


def _draw_a(panel, example, a, b, centres):
    """Draw the edges whose normals are tried, and a line that separates nonetheless."""
    along = centres[1] - centres[0]
    for body, sign, name, place in ((a, 1, 'B', (-4, 7)), (b, -1, 'C', (6, -14))):
        i = int(np.argmax(sign * body @ along))
        tried = body[[i - 1, i, (i + 1) % len(body)]]
        panel.plot(*tried.T, color=_A, linewidth=3,
                   label='edges whose normals A tries' if sign > 0 else None)
        panel.plot(*body[i], 'o', color=_A)
        panel.annotate(name, body[i], place, textcoords='offset points', fontsize=10)
    p, q = np.array(example['closest_points'])
    normal = (q - p) / np.hypot(*(q - p))
    middle, line = (p + q) / 2, np.array([-normal[1], normal[0]])
    panel.plot(*np.array([middle - 1.2 * line, middle + 1.2 * line]).T, color='#009E73',
               linewidth=1.5, label='a line between P and Q')


def _draw_b(panel, example, a, b, centres):
    """Draw the four vertices and how far they and the others reach on the centre line."""
    along = centres[1] - centres[0]
    length = np.hypot(*along)
    along = along / length
    across = np.array([-along[1], along[0]])
    reaches = []
    for body, centre, sign in ((a, centres[0], 1), (b, centres[1], -1)):
        edge = body[list(_crossed(body, centre, sign * along))]
        panel.plot(*edge.T, 'o-', color=_B, linewidth=3,
                   label='the crossed edges: the four vertices' if sign > 0 else None)
        reaches.append(((edge @ along * sign).max() * sign, (body @ along * sign).max() * sign))
    base = centres[0] @ across
    for reach, name, colour in ((0, 'reach of the four', _B),
                                (1, 'reach of all vertices', '#009E73')):
        for k in range(2):
            foot = reaches[k][reach] * along + base * across
            panel.plot(*np.array([foot - 0.6 * across, foot + 0.6 * across]).T, color=colour,
                       linestyle=('-', ':')[k], linewidth=1.3,
                       label=f'{name}, {"PQ"[k]}')


def _crossed(body, centre, along):
    """Return the vertices of the edge that the ray from the centre crosses."""
    sides = (body - centre) @ np.array([-along[1], along[0]])
    for i in range(len(body)):
        if sides[i - 1] <= 0 <= sides[i]:
            return i - 1, i
    return 0, 0
