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

"""The plots of speed, error and axes; the same colour and marker a method everywhere."""

import math

import lookup
from matplotlib import pyplot
from matplotlib.ticker import FuncFormatter
from methods import LABELS, RIVALS, STYLES

# Where the points of near pairs have their n written beside them.
_NUMBERED = ('published_a', 'false_collisions'), ('published_b', 'false_clears')

PER_CENT = FuncFormatter(lambda value, _: f'{value:g} %')


def write_all(figures, directory):
    """Write the PNG files of this module to a directory."""
    pyplot.rcParams.update({'font.size': 9, 'axes.grid': True, 'grid.alpha': 0.25,
                            'axes.spines.top': False, 'axes.spines.right': False,
                            'figure.dpi': 110, 'savefig.bbox': 'tight'})
    for plot in (_speed_error, _time, _claims, _axes):
        figure = plot(figures)
        figure.savefig(directory / f'{plot.__name__[1:]}.png')
        pyplot.close(figure)


def style(method, **changes):
    """Return how a method's line is drawn."""
    label, colour, marker = STYLES[method]
    return {'label': label, 'color': colour, 'marker': marker, 'linewidth': 1.4,
            'markersize': 8 if marker == '*' else 5, 'markeredgecolor': 'white',
            'markeredgewidth': 0.4, 'zorder': 4 if method == 'improved' else 3, **changes}


def _speed_error(figures):
    figure, panels = pyplot.subplots(2, 3, figsize=(10.5, 7.2), sharex=True, sharey=True)
    columns = {'false_collisions': ('clear', 'near', 'hard'),
               'false_clears': ('deep', 'near', 'hard')}
    for line, (what, kinds) in zip(panels, columns.items()):
        for panel, kind in zip(line, kinds):
            for lane, method in enumerate(STYLES):
                _speed_error_line(panel, figures, kind, method, what, -0.4 - 0.25 * lane)
            panel.axhspan(-0.25 * len(STYLES) - 0.3, -0.2, color='#009E73', alpha=0.08)
            panel.set_title(f'{kind} pairs')
            panel.set_xscale('log')
            panel.set_ylim(-0.25 * len(STYLES) - 0.3, 4.1)
            panel.set_yticks([-0.3 - 0.125 * len(STYLES), 0, 1, 2, 3, 4],
                             ['none\nwrong', '0.01 %', '0.1 %', '1 %', '10 %', '100 %'])
    panels[0, 0].set_ylabel('false "collision", share of the pairs apart')
    panels[1, 0].set_ylabel('false "clear", share of the pairs in contact')
    for panel in panels[1]:
        panel.set_xlabel('median time a pair, ns')
    _legend(figure, panels[0, 2])
    figure.tight_layout(rect=(0, 0.09, 1, 1))
    return figure


def _speed_error_line(panel, figures, kind, method, what, lane):
    """Draw rates on a logarithmic scale, per cent times 100, and a rate of 0 in a lane below."""
    shapes = ('rectangles',) if method == 'rectangles' else lookup.shapes(figures)
    rows = [(shape, lookup.row(figures, shape, kind, method)) for shape in shapes]
    points = [(row['ns'][0], lookup.rate(row, what), shape) for shape, row in rows if row]
    if not points:
        return
    times = [time for time, _, _ in points]
    heights = [math.log10(1e4 * rate) if rate else math.nan for _, rate, _ in points]
    panel.plot(times, heights, **style(method))
    panel.plot(times, [lane if not rate else math.nan for _, rate, _ in points],
               **style(method, label=None))
    if kind == 'near' and (method, what) in _NUMBERED:
        for time, height, (_, _, shape) in zip(times, heights, points):
            if height == height:
                panel.annotate(f'{shape}', (time, height), (6, -3), textcoords='offset points',
                               fontsize=7, color=STYLES[method][1])


def _time(figures):
    figure, panels = pyplot.subplots(1, 2, figsize=(10, 4.4), sharey=True)
    for panel, kernel, title in zip(panels, ('compiled', 'plain'), (
            'compiled (numba)', 'plain Python')):
        for method in STYLES:
            _line_by_sides(panel, figures, method,
                           lambda n, m, k=kernel: lookup.time(figures, n, m, k))
        panel.set_yscale('log')
        panel.set_title(title)
    panels[0].set_ylabel('median time a pair, ns')
    _legend(figure, panels[0])
    figure.tight_layout(rect=(0, 0.1, 1, 1))
    return figure


def _claims(figures):
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4.2))
    for method in ('traditional', 'boxed', 'published_a', 'published_b', 'improved', *RIVALS):
        _line_by_sides(left, figures, method,
                       lambda n, m: _ratio(lookup.time(figures, n, m),
                                           lookup.time(figures, n, 'traditional')))
    left.set_yscale('log')
    left.set_ylabel('time a pair / time of traditional')
    steps = figures['steps']
    for method, what, line in (('published_a', 'false_collisions', '-'),
                               ('published_b', 'false_collisions', '-'),
                               ('published_b', 'false_clears', '--')):
        rows = [row for row in steps if row['method'] == method]
        whole = 'apart' if what == 'false_collisions' else 'meet'
        right.plot([row['n'] for row in rows], [100 * row[what] / row[whole] for row in rows],
                   **style(method, linestyle=line,
                           label=f'{LABELS[method]}, {what.replace("_", " ")}'))
    _side_axis(right, [row['n'] for row in steps])
    right.set_ylim(0)
    right.yaxis.set_major_formatter(PER_CENT)
    right.set_ylabel('wrong answers on near pairs')
    right.legend(frameon=False, fontsize=8)
    left.legend(frameon=False, fontsize=8)
    figure.tight_layout()
    return figure


def _axes(figures):
    figure, panels = pyplot.subplots(1, 2, figsize=(10, 4.2), sharey=True)
    for panel, kinds, title in zip(panels, (lookup.MIX, ('hard',)), (
            'clear, near and deep pairs, equal shares', 'hard pairs')):
        for method in ('traditional', 'boxed', 'published_a', 'published_b', 'improved'):
            _line_by_sides(panel, figures, method,
                           lambda n, m, k=kinds: lookup.axes(figures, n, m, k))
        panel.set_yscale('log')
        panel.set_title(title)
    panels[0].set_ylabel('mean number of axes a decision')
    panels[0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    return figure


def _line_by_sides(panel, figures, method, value):
    points = [(n, value(n, method)) for n in lookup.shapes(figures)]
    points = [(n, y) for n, y in points if y is not None]
    if points:
        panel.plot(*zip(*points), **style(method))
    _side_axis(panel, lookup.shapes(figures))


def _side_axis(panel, sides):
    sides = sorted(set(sides))
    panel.set_xscale('log', base=2)
    panel.set_xticks(sides, [str(n) if n != 3 else '3 ' for n in sides])
    panel.minorticks_off()
    panel.set_xlabel('vertices of each body, n')


def _legend(figure, panel):
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc='lower center', ncols=4, frameon=False)


def _ratio(a, b):
    return None if a is None or b is None else a / b
