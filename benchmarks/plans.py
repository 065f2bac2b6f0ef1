# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A plan of 200 poses over 50 m among obstacles, beside what looks at places 5 cm apart.

The plan is free, so that all of it is looked at. The rivals miss what is between their places: the
polygons of the footprint against shapely's STRtree, and its outline on a grid of 5 cm.
"""

from functools import partial

from _shared import medians
import numpy as np
from sat_collision import first_contact_along, Polygon, PolygonSet
import shapely

SIZES = 1_000, 100_000
_BODY = np.array([(-0.5, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.5, 0.3)])
_POSES, _LENGTH, _STEP = 200, 50.0, 0.05
# The half diagonal of an obstacle, a square on a corner; one is in four square metres.
_RADIUS = 0.5
_AREA = 4.0


def measure():
    """Return for each number of obstacles the median µs of each way to check the plan."""
    rng = np.random.default_rng(1)
    return [_measure(rng, size) for size in SIZES]


def _measure(rng, size):
    side = (_AREA * size) ** 0.5
    poses = _plan(side)
    centres = rng.uniform(0.0, side, (size, 2))
    square = _RADIUS * np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
    body = Polygon(_BODY)
    while True:
        bodies = PolygonSet.from_array(centres[:, None] + square)
        found = first_contact_along(body, poses, bodies, margin=2.0 * _STEP)
        if found is None:
            break
        centres[found.row] = rng.uniform(0.0, side, 2)
    if size > min(SIZES):
        bodies.index()
    tree = shapely.STRtree(shapely.polygons(centres[:, None] + square))
    tasks = {'us': partial(first_contact_along, body, poses, bodies),
             'one_by_one_us': partial(_one_by_one, tree, poses),
             'at_once_us': partial(_at_once, tree, poses),
             'grid_us': partial(_on_grid, _grid(centres, side), poses)}
    assert not any(task() for task in tasks.values())
    return {'obstacles': size, **{name: 1e6 * seconds
                                  for name, seconds in medians(tasks, 25).items()}}


def _plan(side):
    """Return poses along a winding way through the middle of a square."""
    step = _LENGTH / (_POSES - 1)
    yaw = 0.8 * np.sin(np.arange(_POSES) * step / 4.0)
    x, y = (np.cumsum(step * part(yaw)) for part in (np.cos, np.sin))
    return np.column_stack([x - x.mean() + side / 2.0, y - y.mean() + side / 2.0, yaw])


def _places(poses, points):
    """Return points of the body at places up to 5 cm apart."""
    parts = int(np.ceil(_LENGTH / (_POSES - 1) / _STEP))
    shares = np.arange(parts * (len(poses) - 1) + 1) / parts
    x, y, yaw = (np.interp(shares, np.arange(len(poses)), part) for part in poses.T)
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    px, py = points.T
    return np.stack([c * px - s * py + x[:, None], s * px + c * py + y[:, None]], axis=2)


def _one_by_one(tree, poses):
    return any(len(tree.query(shapely.Polygon(outline), predicate='intersects'))
               for outline in _places(poses, _BODY))


def _at_once(tree, poses):
    return tree.query(shapely.polygons(_places(poses, _BODY)), predicate='intersects').size > 0


def _grid(centres, side):
    """Return which cells of a grid have their middle in an obstacle."""
    grid = np.zeros((int(side / _STEP) + 1,) * 2, bool)
    reach = np.arange(-int(_RADIUS / _STEP) - 1, int(_RADIUS / _STEP) + 2)
    near = np.stack(np.meshgrid(reach, reach), axis=2).reshape(-1, 2)
    for some in np.array_split(centres, -(-len(centres) // 1000)):
        cells = np.floor(some / _STEP).astype(int)[:, None] + near
        off = np.abs((cells + 0.5) * _STEP - some[:, None]).sum(axis=2)
        x, y = cells[(off <= _RADIUS) & (cells >= 0).all(axis=2)
                     & (cells < len(grid)).all(axis=2)].T
        grid[x, y] = True
    return grid


def _on_grid(grid, poses):
    sides = np.roll(_BODY, -1, axis=0) - _BODY
    outline = np.vstack([
        corner + side * np.linspace(0.0, 1.0, round(np.hypot(*side) / _STEP), False)[:, None]
        for corner, side in zip(_BODY, sides)])
    x, y = (_places(poses, outline) / _STEP).astype(int).reshape(-1, 2).T
    return bool(grid[x, y].any())
