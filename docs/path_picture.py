# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""Draw path.png of docs/recipes.md: a plan whose poses are all free, and which touches a shelf."""

from pathlib import Path

import matplotlib
from matplotlib import pyplot
from matplotlib.patches import Polygon
import numpy as np
from sat_collision import first_contact_along

BODY = np.array([(-0.7, -0.35), (0.7, -0.35), (0.7, 0.35), (-0.7, 0.35)])
SHELVES = [np.array([(x, y), (x + width, y), (x + width, y + depth), (x, y + depth)])
           for x, y, width, depth in ((-0.9, 0.55, 3.4, 1.9), (3.5, 0.55, 1.95, 1.9),
                                      (-0.9, -1.15, 6.35, 0.35))]
# Along an aisle, a turn on the spot, and along another aisle.
POSES = [(0.0, 0.0, 0.0), (0.75, 0.0, 0.0), (1.5, 0.0, 0.0), (2.25, 0.0, 0.0), (3.0, 0.0, 0.0),
         (3.0, 0.0, np.pi / 2), (3.0, 0.75, np.pi / 2), (3.0, 1.5, np.pi / 2)]
_RED, _BLUE, _GREY = '#d62728', '#1f77b4', '#5b7089'


def placed(x, y, yaw):
    """Return the outline at a pose."""
    c, s = np.cos(yaw), np.sin(yaw)
    return BODY @ [(c, s), (-s, c)] + (x, y)


def draw():
    """Return the figure."""
    found = first_contact_along(BODY, POSES, SHELVES)
    before = int(found.pose)
    share = found.pose - before
    contact = (1.0 - share) * np.array(POSES[before]) + share * np.array(POSES[before + 1])
    figure, axes = pyplot.subplots(figsize=(7.4, 4.2), layout='constrained')
    for row, shelf in enumerate(SHELVES):
        axes.add_patch(Polygon(shelf, facecolor=_GREY, alpha=0.6 if row == found.row else 0.3))
    for pose in POSES:
        axes.add_patch(Polygon(placed(*pose), facecolor=_BLUE, edgecolor=_BLUE, alpha=0.13))
        axes.add_patch(Polygon(placed(*pose), fill=False, edgecolor=_BLUE, linewidth=0.8))
    axes.plot(*np.array(POSES)[:, :2].T, 'o-', color=_BLUE, markersize=4, linewidth=1.2)
    axes.add_patch(Polygon(placed(*contact), fill=False, edgecolor=_RED, linewidth=2.2))
    axes.annotate(
        f'first contact: pose {found.pose:.2f},\nafter {found.distance:.2f} m',
        placed(*contact)[2], (3.8, 1.1), color=_RED, va='bottom',
        arrowprops={'arrowstyle': '->', 'color': _RED})
    for place, (x, y, _) in enumerate(POSES):
        axes.text(x + 0.06, y + 0.06, '' if place == 5 else '4, 5' if place == 4 else str(place),
                  color=_BLUE)
    axes.text(1.1, -0.6, f'{len(POSES)} poses, all free', color=_BLUE, ha='center')
    axes.set(aspect='equal', xlim=(-0.9, 5.45), ylim=(-1.15, 2.45), xlabel='x, m', ylabel='y, m')
    return figure


if __name__ == '__main__':
    matplotlib.use('agg')
    draw().savefig(Path(__file__).with_name('path.png'), dpi=110, metadata={'Software': None})
