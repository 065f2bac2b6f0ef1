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

"""What exactness costs in scenes, and what a scene would need of what was left out."""

import functools

import clock
import numpy as np
from sat_collision import intersects_pairs, Polygon, PolygonSet
from scenes import NAMES, scenes
import shapely
import stages

REPEATS = 15


def measure():
    """Return for each scene the share of the exact stage, and figures of what was left out."""
    found = scenes()
    return {'scenes': [{'scene': name, **_exact_stage(frames)} for name, frames in found.items()],
            'recorded': [{'scene': name, **_left_out(frames)} for name, frames in found.items()
                         if name in NAMES.values()],
            'index': _index(found)}


def _exact_stage(frames):
    made = {id(body): Polygon(body) for footprint, obstacles in frames
            for body in (footprint, *obstacles)}
    pairs = [(made[id(footprint)], made[id(obstacle)])
             for footprint, obstacles in frames for obstacle in obstacles]
    a, b = [p for p, _ in pairs], [q for _, q in pairs]
    axes, exact = stages.tried(a, b)
    row = {'frames': len(frames), 'pairs': len(pairs),
           'contacts': int(intersects_pairs(PolygonSet(a), PolygonSet(b)).sum()),
           'boxes': int((axes == stages.BOX_AXES).sum()), 'exact': int(exact.sum())}
    whole = stages.seconds(a, b, REPEATS)
    unsure = np.flatnonzero(exact)
    there = stages.seconds([a[i] for i in unsure], [b[i] for i in unsure], REPEATS)
    row['ns'] = whole and round(whole / len(pairs) * 1e9, 1)
    row['exact_ns'] = there and round(there / len(unsure) * 1e9, 1)
    row['exact_time'] = 0.0 if not len(unsure) else there and round(there / whole, 4)
    return row


def _left_out(frames):
    """
    Return how much of z, of turning between frames and of obstacle pairs a recording has.

    Between two frames a body that turns by t about its middle leaves the straight lines between
    its vertices' places by up to r (1 - cos(t / 2)), r the distance of the furthest vertex.
    """
    points = np.concatenate([body for footprint, obstacles in frames
                             for body in (footprint, *obstacles)])
    turns, bulges = [], []
    for (before, _), (after, _) in zip(frames, frames[1:]):
        p, q = (body[:, :2] - body[:, :2].mean(axis=0) for body in (before, after))
        if p.shape == q.shape:
            turn = np.arctan2((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum(), (p * q).sum())
            turns.append(abs(turn))
            bulges.append(np.hypot(*p.T).max() * (1 - np.cos(turn / 2)))
    among = [(Polygon(a), Polygon(b)) for _, obstacles in frames
             for k, a in enumerate(obstacles) for b in obstacles[:k]]
    touching = intersects_pairs(*(PolygonSet(pair[k] for pair in among) for k in (0, 1)))
    return {'points': len(points), 'with_z': int((points[:, 2] != 0).sum()),
            'turn': float(max(turns)), 'bulge': float(max(bulges)),
            'pairs': sum(len(obstacles) for _, obstacles in frames),
            'among_obstacles': len(among), 'touching': int(touching.sum())}


def _index(found):
    """Return the times of a scan and of an index over the obstacles of the fullest frame, us."""
    footprint, obstacles = max((frame for frames in found.values() for frame in frames),
                               key=lambda frame: len(frame[1]))
    rows = PolygonSet(Polygon(body) for body in obstacles)
    body, other = Polygon(footprint), shapely.Polygon(footprint)
    shapes = [shapely.Polygon(outline) for outline in obstacles]
    tree = shapely.STRtree(shapes)
    tasks = {'scan': lambda: [rows.intersecting_rows(body) for _ in range(100)],
             'query': lambda: [tree.query(other, predicate='intersects') for _ in range(100)],
             'build': functools.partial(_build, shapes, other)}
    for task in tasks.values():
        task()
    medians = clock.medians(tasks, REPEATS)
    return {'obstacles': len(obstacles),
            **{name: round(seconds / 100 * 1e6, 2) for name, seconds in medians.items()}}


def _build(shapes, other):
    for _ in range(100):
        shapely.STRtree(shapes).query(other, predicate='intersects')
