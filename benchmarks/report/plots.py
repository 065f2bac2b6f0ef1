# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The plots and the drawing of wrong answers; the same colour and marker a method everywhere."""

import math

from _shared import wilson
from matplotlib import pyplot
from methods import LABELS, METHODS
import numpy as np
import rivals
from sat_collision.geometry.compiled.jit import indexable
import shapely
from stability import centre_of_bin, FIRST
from tables import distinct, parts, speed_row

U, U_FLOAT32 = 2.0 ** -53, 2.0 ** -24
# Drawn in the first figure; the others are in its table.
DRAWN = ('improved', 'traditional', 'published_a', 'published_b', 'binary', 'gjk', 'filtered',
         'shapely')
CONDITIONED = 'traditional', 'closest', 'gjk', 'published_a', 'published_b', 'improved'
# Bins with fewer pairs are not drawn.
_FEWEST = 20
_A, _B = (METHODS[method].colour for method in ('published_a', 'published_b'))


def write_all(figures, directory):
    """Write the PNG files of this module to a directory."""
    pyplot.rcParams.update({'font.size': 9, 'axes.grid': True, 'grid.alpha': 0.25,
                            'axes.spines.top': False, 'axes.spines.right': False,
                            'figure.dpi': 110, 'savefig.bbox': 'tight'})
    for plot in (_speed_error, _condition, _growth, _examples):
        figure = plot(figures)
        figure.savefig(directory / f'{plot.__name__[1:]}.png')
        pyplot.close(figure)


def style(method, **changes):
    """Return the style of a method's line; that of improved stands out."""
    label, colour, marker = METHODS[method][:3]
    ours = method == 'improved'
    return {'label': label, 'color': colour, 'marker': marker, 'linewidth': 2.6 if ours else 1.2,
            'markersize': 13 if ours else 5, 'markeredgecolor': 'black' if ours else 'white',
            'markeredgewidth': 0.8 if ours else 0.4, 'zorder': 5 if ours else 3, **changes}


def _speed_error(figures):
    """Draw the share of wrong answers above; below, a row a method, the times where it is 0."""
    figure, panels = pyplot.subplots(
        2, 2, figsize=(10.5, 7.2), sharex=True, sharey='row', height_ratios=(1, 0.85))
    for (above, below), kind in zip(panels.T, ('near', 'hard')):
        above.set(title=f'{kind} pairs', yscale='log', ylim=(4e-3, 126))
        for place, method in enumerate(reversed(DRAWN)):
            _speed_error_line(above, below, figures, kind, method, place)
        above.set_yticks([0.01, 0.1, 1, 10, 100], ['0.01 %', '0.1 %', '1 %', '10 %', '100 %'])
        above.minorticks_off()
        below.set(ylim=(-0.6, len(DRAWN) - 0.1), xscale='log', xlabel='median time a pair, ns')
        below.set_yticks(range(len(DRAWN)), [LABELS[method] for method in reversed(DRAWN)])
        below.grid(axis='y', visible=False)
        below.axhspan(*(DRAWN[::-1].index('improved') + end for end in (-0.5, 0.5)),
                      color=METHODS['improved'].colour, alpha=0.15)
    panels[0, 0].set_ylabel('wrong answers')
    panels[1, 0].set_ylabel('no wrong answer')
    for text in panels[1, 0].get_yticklabels():
        text.set_fontweight('bold' if text.get_text() == LABELS['improved'] else 'normal')
        text.set_color(next(m.colour for m in METHODS.values() if m.label == text.get_text()))
    figure.tight_layout()
    return figure


def _speed_error_line(above, below, figures, kind, method, place):
    """Draw shares in per cent, and a share of 0 in its row."""
    rows = [speed_row(figures, n, kind, method) for n in distinct(figures['speed'], 'n')]
    times = np.array([row['ns'] for row in rows])
    ends = 100 * np.array([(part / whole, *wilson(part, whole)) for part, whole in map(
        parts, rows)])
    wrong = ends[:, 0] > 0
    for panel, shown, heights in ((above, wrong, ends[:, 0]),
                                  (below, ~wrong, np.full(len(rows), place))):
        panel.plot(times[:, 0], np.where(shown, heights, math.nan), **style(method))
        panel.errorbar(times[shown, 0], heights[shown], fmt='none', zorder=2, elinewidth=0.8,
                       ecolor=METHODS[method].colour,
                       xerr=np.abs(times[shown, 1:] - times[shown, :1]).T,
                       yerr=np.abs(ends[shown, 1:] - ends[shown, :1]).T if panel is above
                       else None)


def _condition(figures):
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.5, 4.6), sharey=True)
    found = figures['condition']
    for number, (family, bins) in enumerate(found['families'].items()):
        x, shares, _ = _curve(bins, 'apart')
        if np.nan_to_num(shares).any():
            left.plot(x, shares, linewidth=1.0, marker='os^vDPX<>hp8d'[number % 13], markersize=4,
                      label=family.replace('_', ' '))
    for method in CONDITIONED:
        for side, line in (('apart', '-'), ('meet', ':')):
            x, shares, ends = _curve(found['bins'][method], side)
            if side == 'apart' or np.nan_to_num(shares).any():
                never_wrong = '' if found['backward'][method] else ' (as all never wrong)'
                right.plot(x, shares, **style(
                    method, linestyle=line, linewidth=1.4, markersize=4,
                    label=LABELS[method] + never_wrong if side == 'apart' else None))
                right.fill_between(x, *ends.T, color=METHODS[method].colour, alpha=0.12,
                                   linewidth=0)
    right.plot([], [], ':', color='#666666', label='dotted: pairs that overlap')
    for panel, step in ((left, 1), (right, 3)):
        panel.set(xscale='log', ylim=(-3, 109),
                  xlabel='gap or overlap in units of u D:  1/κ = |g| / (u D)')
        panel.axvline(4, color='#666666', linewidth=0.8, linestyle='--')
        panel.annotate('4 u D', (4, 103), (-3, 0), textcoords='offset points', fontsize=8,
                       color='#666666', ha='right')
        panel.set_xticks([10.0 ** k for k in range(-2, 17, step)])
        panel.minorticks_off()
        panel.legend(frameon=False, fontsize=8, loc='upper right')
    left.set(title='traditional by family, pairs apart', xlim=(10 ** FIRST, 1e3),
             ylabel='wrong answers, %')
    right.set_title('all families')
    figure.tight_layout()
    return figure


def _curve(bins, side):
    """Return gaps in units of u D, wrong shares and Wilson's intervals in per cent."""
    at = {'apart': 1, 'meet': 3}[side]
    found = {k: (bin_[at - 1], bin_[at]) for k, *bin_ in bins if k >= 0 and bin_[at] >= _FEWEST}
    gaps, shares, ends = [], [], []
    for k in range(min(found, default=0), max(found, default=-1) + 1):
        wrong, pairs = found.get(k, (math.nan, math.nan))
        gaps.append(centre_of_bin(k))
        shares.append(100 * wrong / pairs)
        ends.append([100 * end for end in wilson(wrong, pairs)])
    return np.array(gaps), np.array(shares), np.array(ends).reshape(-1, 2)


def _growth(figures):
    figure, panel = pyplot.subplots(figsize=(6.4, 4.2))
    rows = [row for row in figures['by_offset'] if row['offset'] > 0]
    offsets = np.array(sorted({row['offset'] for row in rows}), float)
    for bound, colour, name in ((4 * U, '#000000', '4 u D, float64'),
                                (6 * U_FLOAT32, '#7f7f7f', '6 u D, float32')):
        panel.plot(offsets, bound * offsets, ':', color=colour, label=name)
    for method in METHODS:
        points = [(row['offset'], row['widest']) for row in rows if row['method'] == method
                  and row['widest'] > 1e-300]
        if points:
            panel.plot(*zip(*points), **style(method, linewidth=0.8))
    panel.set(xscale='log', yscale='log', xlabel='distance from the origin D, m',
              ylabel='widest gap or overlap misjudged, m')
    panel.legend(frameon=False, fontsize=8, loc='upper left', bbox_to_anchor=(1, 1))
    return figure


def _examples(figures):
    """Draw a pair that A calls colliding, one that B calls clear, and what A and B evaluate."""
    figure, panels = pyplot.subplots(1, 3, figsize=(12.0, 5.6), width_ratios=(1, 1.15, 1.15))
    one, other = (figures['examples'][method] for method in ('published_a', 'published_b'))
    gap, overlap = 1e3 * one['separation'], -1e3 * other['separation']
    for panel, example, draw, title in zip(
            panels, (one, other, other), (_draw_a, _draw_b, _draw_b), (
            f'False collision: A says "collision",\nyet P and Q are {gap:.0f} mm apart',
            f'Missed collision: B says "clear",\nyet P and Q overlap by {overlap:.0f} mm',
            'The framed part, magnified:\nthe overlap is red')):
        _draw_bodies(panel, example)
        draw(panel, example)
        panel.set_title(title, fontsize=13)
    common = shapely.intersection(*(shapely.Polygon(other[side]) for side in 'ab'))
    for panel in panels[1:]:
        panel.fill(*common.exterior.xy, color='#c00000', alpha=0.6)
    x, y = np.mean(other['closest_points'], axis=0)
    half = 3e-3 * overlap
    panels[2].set(xlim=(x - half, x + half), ylim=(y - half, y + half), adjustable='box')
    panels[1].add_patch(pyplot.Rectangle((x - half, y - half), 2 * half, 2 * half, fill=False,
                                         color='#666666'))
    figure.tight_layout(rect=(0, 0.2, 1, 1))
    for panel, x in zip(panels[:2], (0.02, 0.4)):
        figure.legend(*panel.get_legend_handles_labels(), loc='upper left', fontsize=12,
                      bbox_to_anchor=(x, 0.21), frameon=False)
    return figure


def _draw_bodies(panel, example):
    for name, centre in zip('PQ', example['centres']):
        body = np.array(example['ab'[name == 'Q']])
        panel.fill(*body.T, facecolor='#bbbbbb', edgecolor='#333333', alpha=0.6)
        panel.annotate(name, centre, (0, 6), textcoords='offset points', fontsize=15,
                       annotation_clip=True)
    panel.plot(*np.transpose(example['centres']), 'o--', color='#0072B2', markersize=5,
               label='line through the centres')
    panel.set_aspect('equal', adjustable='datalim')
    panel.set_xlabel('x [m]', fontsize=12)
    panel.set_ylabel('y [m]', fontsize=12)


def _draw_a(panel, example):
    """Draw the edges whose normals are tried, and a separating line that is missed."""
    a, b = (np.array(example[side]) for side in 'ab')
    along = np.subtract(*example['centres'][::-1])
    for body, sign, name, place in ((a, 1, 'B', (-4, 7)), (b, -1, 'C', (6, -15))):
        i = int(np.argmax(sign * body @ along))
        tried = body[[i - 1, i, (i + 1) % len(body)]]
        panel.plot(*tried.T, color=_A, linewidth=4,
                   label='edges at B and C, the only ones that A tries' if sign > 0 else None)
        panel.plot(*body[i], 'o', color=_A, markersize=8)
        panel.annotate(name, body[i], place, textcoords='offset points', fontsize=15)
    p, q = np.array(example['closest_points'])
    normal = (q - p) / np.hypot(*(q - p))
    middle, line = (p + q) / 2, np.array([-normal[1], normal[0]])
    panel.plot(*np.array([middle - 1.2 * line, middle + 1.2 * line]).T, color='#009E73',
               linewidth=2.5, label='a line between P and Q, which A never tries')


def _draw_b(panel, example):
    """Draw the four vertices, and the projections of them and the others on the centre line."""
    bodies, centres = (example['a'], example['b']), np.array(example['centres'])
    along = centres[1] - centres[0]
    along = along / np.hypot(*along)
    across = np.array([-along[1], along[0]])
    for body, centre, name, sign in zip(map(np.array, bodies), centres, 'PQ', (1, -1)):
        i = rivals.crossed_edge(indexable(body), centre, *(sign * along).tolist())
        edge = body[[i - 1, i]]
        panel.plot(*edge.T, 'o-', color=_B, linewidth=4, markersize=8,
                   label='edges that it crosses: four vertices' if name == 'P' else None)
        for vertices, what, colour in ((edge, 'those vertices, all that B sees', _B),
                                       (body, 'all vertices', '#009E73')):
            foot = sign * (vertices @ along * sign).max() * along + centres[0] @ across * across
            panel.plot(*np.array([foot - 0.6 * across, foot + 0.6 * across]).T, color=colour,
                       linestyle='-' if name == 'P' else ':', linewidth=2,
                       label=f'how far {name} reaches by {what}')
