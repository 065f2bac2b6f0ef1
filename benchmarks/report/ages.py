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

"""What the age of a place costs, in recordings, against what its coordinates cost."""

import numpy as np
from sat_collision import Polygon, separation
from scenes import NAMES, RECORDINGS, stamped

AGE = 0.02
SPEED = 10.0


def measure():
    """Return a row of figures for each recording; none where there are none."""
    return [{'scene': name, **_of(stamped(path))} for start, name in NAMES.items()
            for path in sorted(RECORDINGS.glob(f'{start}*_sqlite3'))]


def _of(frames):
    """
    Return what is wrong with separations, in m, if the footprint is not that of the same stamp.

    Once it is the one of a frame before, once the one half way between the frames before and
    after, each vertex on a straight line.
    """
    before, between, speeds, gaps = [], [], [], []
    for (t0, p0, _), (t1, p1, obstacles), (t2, p2, _) in zip(frames, frames[1:], frames[2:]):
        if not obstacles or not len(p0) == len(p1) == len(p2):
            continue
        bodies = [Polygon(body) for body in obstacles]
        share = (t1 - t0) / (t2 - t0)
        true, old, made = (min(separation(Polygon(p[:, :2]), body) for body in bodies)
                           for p in (p1, p0, p0 + share * (p2 - p0)))
        before.append(abs(old - true))
        between.append(abs(made - true))
        gaps.append(t1 - t0)
        speeds.append(float(np.hypot(*(p1 - p0)[:, :2].T).max()) / (t1 - t0))
    largest = max(float(np.abs(body[:, :2]).max()) for _, footprint, obstacles in frames
                  for body in (footprint, *obstacles))
    return {'frames': len(before), 'spacing': float(np.median(gaps)), 'speed': max(speeds),
            'before': [float(np.median(before)), max(before)],
            'between': [float(np.median(between)), max(between)],
            # Half a step in each coordinate of a vertex of either body.
            'coordinates': float(np.sqrt(2.0) * np.spacing(np.float32(largest)))}
