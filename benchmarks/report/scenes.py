# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What exactness costs in scenes, and how wrong predictions in steps are.

A scene is a list of frames, each a footprint and the obstacles it is compared with, as vertices:
of recordings, a docking, and racks in line. All coordinates are float32, as messages carry them.
In the scenes of predictions a rectangle of 0.8 m by 0.5 m drives at 1 to 10 m/s and turns by up to
1 rad/s for 3 s, between segments of 0.1 to 1 m.
"""

import functools

from _shared import medians
import numpy as np
from published import load
from sat_collision import intersects_pairs, Polygon, PolygonSet
from sat_collision.geometry.body.layout import body_of, convex_part, rows_of
from sat_collision.geometry.compiled.jit import kernel
from sat_collision.geometry.pair.separating_axis import (
    boxes_apart, find_separating_axis, SEPARATE, UNCERTAIN)

# What decides a pair: boxes or discs, axes in plain doubles, or the exact stage.
BOXES, AXES, EXACT = range(3)
# The names of the recordings in test/data on the page.
NAMES = {'autoware_ego_trajectory_boxes': 'a vehicle among boxes (Autoware)',
         'commonroad_USA_Lanker-1_1_ego1247': 'vehicles on a road (CommonROAD, NGSIM)',
         'tysik_front_scan_polygons': 'clusters of a laser scanner'}
REPEATS = 15
_DOCK = np.array([(0, -1), (0.5, -1), (0.5, 1), (0, 1), (0, 0.4), (0.3, 0.4), (0.3, -0.4),
                  (0, -0.4)])
_FOOTPRINT = np.array([(0, -0.3), (0, 0.3), (-0.8, 0.3), (-0.8, -0.3)])
STEPS = 0.01, 0.1, 0.2, 0.3, 0.5
HORIZON = 3.0
OBSTACLES = 200
_STEP_REPEATS = 5
_RECTANGLE = np.array([(-0.4, -0.25), (0.4, -0.25), (0.4, 0.25), (-0.4, 0.25)])


def scenes():
    """Return the frames of each scene by name."""
    found = {title: [frame[1:] for frame in stamped(name)] for name, title in NAMES.items()}
    for name, scene in (('docking', docking), ('racks in line', racks)):
        found[name] = scene(0.0)
        found[f'{name}, turned by 30°'] = scene(np.pi / 6)
    return found


def stamped(name):
    """Return (stamp in s since the first, footprint, obstacles) of each frame of a recording."""
    sets = load('recordings')[name]['sets']
    frames = []
    for stamp, *outlines in sets:
        footprint, *obstacles = (
            np.reshape(outline, (-1, 2)).astype(np.float32).astype(float) for outline in outlines)
        frames.append(((stamp - sets[0][0]) / 1e9, footprint, obstacles))
    return frames


def docking(angle):
    """
    Return a robot that drives straight into a dock at 0.1 m/s, 20 frames a second.

    The dock is a U, its sides 0.1 m off; a wall and boxes stand about. The robot stays as long as
    it drove, its front against the ground of the dock.
    """
    place = functools.partial(_placed, angle, (12.0, 7.0))
    about = [_box(x, y, 0.6, 0.6) for x in (-2.0, -1.0, 0.2) for y in (-3.0, -1.8, 1.8, 3.0)]
    wall = _box(0.8, 0.0, 0.2, 8.0)
    obstacles = [place(body) for body in (_DOCK, wall, *about)]
    drive = np.arange(-1.5, 0.0, 0.005)
    return [(place(_FOOTPRINT + (0.3 + x, 0.0)), obstacles)
            for x in (*drive, *np.zeros(len(drive)))]


def racks(angle):
    """
    Return a robot that drives along an aisle, its sides in line with the racks', and turns in.

    Racks of 1.2 by 2.4 m stand edge to edge in two rows of 50 with gaps of one rack, as wide as
    the robot; it drives 48 m flush with the racks' faces, and into each gap between two of them.
    """
    place = functools.partial(_placed, angle, (20.0, 10.0))
    gaps = range(4, 50, 5)
    obstacles = [place(_box(1.2 * k + 0.6, y, 1.2, 2.4)) for y in (-3.0, 3.0) for k in range(50)
                 if k not in gaps]
    along = [place(_box(x, -1.2, 1.2, 1.2)) for x in np.arange(6.0, 54.0, 0.05)]
    into = [place(_box(1.2 * k + 0.6, y, 1.2, 1.2)) for k in gaps
            for y in np.arange(-1.2, -3.0, -0.05)]
    return [(body, obstacles) for body in (*along, *into)]


def _placed(angle, origin, body):
    """Return a body turned, moved and rounded to float32."""
    turn = np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
    return (body @ turn + origin).astype(np.float32).astype(float)


def _box(x, y, length, width):
    return (x, y) + np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (length / 2, width / 2)


def cost():
    """Return for each scene how many pairs the exact stage decides, and its share of the time."""
    rows = []
    for name, frames in scenes().items():
        pairs = [(Polygon(footprint), Polygon(obstacle))
                 for footprint, obstacles in frames for obstacle in obstacles]
        sets = [PolygonSet(side) for side in zip(*pairs)]
        found = stages(*sets)
        tasks = {'whole': functools.partial(intersects_pairs, *sets)}
        if exact := [pair for pair, stage in zip(pairs, found) if stage == EXACT]:
            tasks['exact'] = functools.partial(intersects_pairs, *map(PolygonSet, zip(*exact)))
        contacts = int(tasks['whole']().sum())
        seconds = {'exact': 0.0, **medians(tasks, REPEATS)}
        rows.append({'scene': name, 'pairs': len(pairs), 'contacts': contacts,
                     'boxes': int((found == BOXES).sum()), 'exact': len(exact),
                     'ns': round(seconds['whole'] / len(pairs) * 1e9, 1),
                     'exact_time': round(seconds['exact'] / seconds['whole'], 4)})
    return rows


def stages(a, b):
    """Return what decides each row of two `PolygonSet`: BOXES, AXES or EXACT."""
    array, other, used = a._paired(b)
    found = np.empty(used, np.int8)
    _write_stages(array, other, found)
    return found


@kernel
def _write_stages(array, other, found):
    rows, others = rows_of(array), rows_of(other)
    for row in range(len(found)):
        found[row] = _stage(body_of(rows, row), body_of(others, row))


@kernel
def _stage(p, q):
    if boxes_apart(p, q):
        return BOXES
    stage = BOXES if p.n > 0 and q.n > 0 else AXES
    for i in range(max(1, -p.n)):
        a = convex_part(p, i)
        for j in range(max(1, -q.n)):
            b = convex_part(q, j)
            if not boxes_apart(a, b):
                verdict, _, _, queries = find_separating_axis(a, b)
                stage = AXES if queries else stage
                if verdict != SEPARATE:
                    return EXACT if verdict == UNCERTAIN else stage
    return stage


def stepping(rng, count):
    """
    Return for the continuous time (step 0) and for steps what they miss and take, in s and ns.

    A contact is one that any of them finds, except with what the rectangle touches at the start;
    it is late by the time since the earliest found. The ns are those of finding a scene's first
    contact, divided by the number of obstacles.
    """
    scenes = [(_segments(rng), (rng.uniform(1.0, 10.0), 0.0, rng.uniform(-1.0, 1.0)))
              for _ in range(count)]
    found = {0.0: np.concatenate([[_first(PolygonSet([one]), twist) for one in segments]
                                  for segments, twist in scenes])}
    sets = [(PolygonSet(segments), twist) for segments, twist in scenes]
    tasks = {0.0: lambda: [_first(*scene) for scene in sets]}
    for step in STEPS:
        found[step] = np.concatenate([_first_steps(*scene, step) for scene in sets])
        tasks[step] = lambda step=step: [
            next((time for time, rows in _steps(*scene, step) if len(rows)), np.inf)
            for scene in sets]
    seconds_of = medians(tasks, _STEP_REPEATS)
    earliest = np.min([*found.values()], axis=0)
    contacts = (earliest > 0.0) & (earliest < np.inf)
    rows = []
    for step, times in found.items():
        seen = contacts & (times < np.inf)
        late = times[seen] - earliest[seen]
        rows.append({'step': step, 'contacts': int(contacts.sum()),
                     'missed': int((contacts & ~seen).sum()),
                     'mean': float(late.mean()), 'worst': float(late.max()),
                     'ns': round(seconds_of[step] / count / OBSTACLES * 1e9, 1)})
    return rows


def _segments(rng):
    middles = rng.uniform((0.0, -10.0), (25.0, 10.0), (OBSTACLES, 2))
    angles = rng.uniform(0.0, np.pi, OBSTACLES)
    halves = rng.uniform(0.05, 0.5, OBSTACLES) * (np.cos(angles), np.sin(angles))
    return np.stack([middles - halves.T, middles + halves.T], axis=1)


def _first(obstacles, twist):
    """Return when the rectangle first meets any of some obstacles, infinity if it does not."""
    found = obstacles.first_contact(_RECTANGLE, twist, HORIZON)
    return np.inf if found is None else found[1]


def _first_steps(obstacles, twist, step):
    """Return the first step at which the rectangle meets each obstacle, infinity if none."""
    found = np.full(len(obstacles), np.inf)
    for time, rows in _steps(obstacles, twist, step):
        found[rows] = np.minimum(found[rows], time)
    return found


def _steps(obstacles, twist, step):
    """Yield the time of each step, and which obstacles the rectangle meets there."""
    speed, _, turn = twist
    for time in step * np.arange(round(HORIZON / step) + 1):
        turned = np.exp(1j * turn * time)
        points = turned * (_RECTANGLE @ (1.0, 1.0j)) + speed * (turned - 1.0) / (1.0j * turn)
        yield time, obstacles.intersecting_rows(
            Polygon(np.column_stack([points.real, points.imag])))
