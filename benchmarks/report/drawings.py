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

"""The plots of examples, families and rounding."""

import lookup
from matplotlib import pyplot
from methods import LABELS, STYLES
import numpy as np
from plots import PER_CENT, style

U = 2.0 ** -53
U_FLOAT32 = 2.0 ** -24


def write_all(figures, directory):
    """Write the PNG files of this module to a directory."""
    for plot in (_examples, _families, _growth, _float32):
        figure = plot(figures)
        figure.savefig(directory / f'{plot.__name__[1:]}.png')
        pyplot.close(figure)


def _examples(figures):
    figure, panels = pyplot.subplots(1, 2, figsize=(10.5, 5.2))
    for panel, method in zip(panels, ('published_a', 'published_b')):
        example = figures['examples'][method]
        a, b = (np.array(example[side]) for side in 'ab')
        centres = np.array(example['centres'])
        for body, name, at in zip((a, b), 'PQ', centres):
            panel.fill(*body.T, facecolor='#d9d9d9', edgecolor='#333333', alpha=0.8)
            panel.annotate(name, at, (6, 6), textcoords='offset points', fontsize=12)
        panel.plot(*centres.T, 'o--', color='#0072B2', markersize=4, label='centre line')
        (_draw_a if method == 'published_a' else _draw_b)(panel, example, a, b, centres)
        panel.set_aspect('equal', adjustable='datalim')
        panel.set_xlabel('x, m')
        panel.set_ylabel('y, m')
        panel.legend(frameon=False, fontsize=8, loc='upper center', bbox_to_anchor=(0.5, -0.13),
                     ncols=2)
    figure.tight_layout()
    return figure


def _draw_a(panel, example, a, b, centres):
    """Draw the edges whose normals are tried, and a line that separates nonetheless."""
    along = centres[1] - centres[0]
    for body, sign, name in ((a, 1, 'B'), (b, -1, 'C')):
        i = int(np.argmax(sign * body @ along))
        tried = body[[i - 1, i, (i + 1) % len(body)]]
        panel.plot(*tried.T, color=STYLES['published_a'][1], linewidth=3,
                   label='edges whose normals A tries' if sign > 0 else None)
        panel.plot(*body[i], 'o', color=STYLES['published_a'][1])
        panel.annotate(name, body[i], (5, -12), textcoords='offset points', fontsize=10)
    p, q = np.array(example['closest_points'])
    normal = (q - p) / np.hypot(*(q - p))
    middle, line = (p + q) / 2, np.array([-normal[1], normal[0]])
    panel.plot(*np.array([middle - 1.2 * line, middle + 1.2 * line]).T, color='#009E73',
               linewidth=1.5, label='a line between P and Q')
    panel.set_title(f'published A: "collision"; they are {example["separation"] * 1e3:.0f} mm '
                    f'apart')


def _draw_b(panel, example, a, b, centres):
    """Draw the four vertices and how far they and the others reach on the centre line."""
    along = centres[1] - centres[0]
    length = np.hypot(*along)
    along = along / length
    across = np.array([-along[1], along[0]])
    reaches = []
    for body, centre, sign in ((a, centres[0], 1), (b, centres[1], -1)):
        edge = body[list(_crossed(body, centre, sign * along))]
        panel.plot(*edge.T, 'o-', color=STYLES['published_b'][1], linewidth=3,
                   label='the crossed edges: the four vertices' if sign > 0 else None)
        reaches.append(((edge @ along * sign).max() * sign, (body @ along * sign).max() * sign))
    base = centres[0] @ across
    for reach, name, colour in ((0, 'reach of the four', STYLES['published_b'][1]),
                                (1, 'reach of all vertices', '#009E73')):
        for k in range(2):
            foot = reaches[k][reach] * along + base * across
            panel.plot(*np.array([foot - 0.6 * across, foot + 0.6 * across]).T, color=colour,
                       linestyle=('-', ':')[k], linewidth=1.3,
                       label=f'{name}, {"PQ"[k]}')
    panel.set_title(f'published B: "clear"; they overlap by {-example["separation"] * 1e3:.0f} mm')


def _crossed(body, centre, along):
    """Return the vertices of the edge that the ray from the centre crosses."""
    sides = (body - centre) @ np.array([-along[1], along[0]])
    for i in range(len(body)):
        if sides[i - 1] <= 0 <= sides[i]:
            return i - 1, i
    return 0, 0


def _families(figures):
    rows = figures['families']
    names = list(dict.fromkeys(row['family'] for row in rows))
    methods = [method for method in STYLES if any(row['method'] == method for row in rows)]
    shares = np.full((len(names), len(methods)), np.nan)
    for row in rows:
        shares[names.index(row['family']), methods.index(row['method'])] = (
            lookup.wrong([row]) / row['pairs'])
    figure, panel = pyplot.subplots(figsize=(9, 6.2))
    image = panel.imshow(np.sqrt(shares), cmap='Oranges', vmin=0, vmax=1, aspect='auto')
    for i, j in np.ndindex(shares.shape):
        share = shares[i, j]
        text = '' if np.isnan(share) else '0' if share == 0 else f'{100 * share:.2g} %'
        panel.text(j, i, text, ha='center', va='center', fontsize=8,
                   color='white' if share > 0.4 else 'black')
    panel.set_xticks(range(len(methods)), [LABELS[m] for m in methods], rotation=30, ha='right')
    panel.set_yticks(range(len(names)), [name.replace('_', ' ') for name in names])
    panel.grid(False)
    bar = figure.colorbar(image, ticks=np.sqrt([0, 0.01, 0.1, 0.25, 0.5, 1]))
    bar.ax.set_yticklabels(['0', '1 %', '10 %', '25 %', '50 %', '100 %'])
    bar.set_label('wrong answers')
    return figure


def _growth(figures):
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4.4))
    rows = [row for row in figures['by_offset'] if row['offset'] > 0]
    offsets = np.array(sorted({row['offset'] for row in rows}), float)
    for u, colour, name in ((U, '#000000', '4 u D, float64'),
                            (U_FLOAT32, '#7f7f7f', '6 u D, float32')):
        left.plot(offsets, (4 if u == U else 6) * u * offsets, ':', color=colour, label=name)
    for method in STYLES:
        points = [(row['offset'], row['widest']) for row in rows if row['method'] == method
                  and row['widest'] > 1e-300]
        if points:
            left.plot(*zip(*points), **style(method, linewidth=0.8))
    left.set_xscale('log')
    left.set_yscale('log')
    left.set_xlabel('distance from the origin D, m')
    left.set_ylabel('widest gap or overlap misjudged, m')
    left.legend(frameon=False, fontsize=8)
    for method in dict.fromkeys(row['method'] for row in figures['by_sides']):
        rows = [row for row in figures['by_sides'] if row['method'] == method]
        right.plot([row['n'] for row in rows],
                   [100 * lookup.wrong([row]) / row['pairs'] for row in rows], **style(method))
    right.set_xscale('log', base=2)
    ticks = [row['n'] for row in rows]
    right.set_xticks(ticks, [str(n) for n in ticks])
    right.minorticks_off()
    right.set_ylim(bottom=-1)
    right.yaxis.set_major_formatter(PER_CENT)
    right.set_xlabel('vertices of each body, n')
    right.set_ylabel(f'wrong answers {figures["sides_offset"] / 1000:g} km from the origin')
    right.legend(frameon=False, fontsize=8)
    figure.tight_layout()
    return figure


def _float32(figures):
    rows = figures['float32']
    figure, panel = pyplot.subplots(figsize=(6.4, 4.2))
    distance = np.array([row['distance'] for row in rows])
    fine = np.geomspace(distance[0], distance[-1], 400)
    panel.plot(fine, np.spacing(fine.astype(np.float32)), color='#7f7f7f', linewidth=1,
               label='step of float32')
    changed = [row for row in rows if row['widest'] > 0]
    panel.plot([row['distance'] for row in changed], [row['widest'] for row in changed], 'o',
               color='#D55E00', label='widest gap or overlap whose answer it changed')
    panel.axhline(figures['warning']['resolution'], color='#0072B2', linestyle='--', linewidth=1,
                  label='resolution (default)')
    panel.axvspan(figures['warning']['from'], distance[-1], color='#0072B2', alpha=0.08,
                  label='warning in ~/state')
    panel.set_xscale('log')
    panel.set_yscale('log')
    panel.set_xlabel('distance from the origin, m')
    panel.set_ylabel('step; gap or overlap, m')
    panel.legend(frameon=False, fontsize=8)
    return figure
