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

"""The section on time: what skew and the spacing of frames cost, beside the coordinates."""

from ages import AGE, SPEED
from words import listed, metres, table


def time(figures):
    rows = figures['ages']
    head = ('scene', 'a frame every', 'fastest', 'a frame before', 'between two frames',
            'float32')
    lines = [[row['scene'], f'{1e3 * row["spacing"]:.0f} ms', _speed(row['speed']),
              _range(row['before']), _range(row['between']), metres(row['coordinates'])]
             for row in rows]
    measured = f"""{_found(rows)}

{table(head, lines)}

Error of the separation from the nearest obstacle, median and greatest, if the footprint is not
that of the obstacles' stamp: the one *a frame before*, or made of the frames before and after, so
*between two frames* that are twice as far apart as those recorded. *Fastest* is a vertex of the
footprint; *float32* is the most that rounding the coordinates of both bodies can do.""" if rows \
        else 'The recordings were not there to be measured.'
    return f"""## What time costs

A decision is exact for the places received; how old they are is another matter. A place that is
older than the other by an age is wrong by speed times age: at {SPEED:g} m/s, {1e3 * AGE:.0f} ms
are {metres(SPEED * AGE)}. So the node says of each contact and of what is nearest how far apart in
time the two are, and [replay](../replay.md) decides by recorded motion. {measured}"""


def _speed(value):
    return f'{value:.2g} m/s' if value else '–'


def _range(values):
    return ' to '.join(metres(value) for value in values) if any(values) else '–'


def _found(rows):
    rows = [row for row in rows if row['speed']]
    times = [row['before'][1] / row['coordinates'] for row in rows]
    better = [row['between'][0] < row['before'][0] for row in rows]
    most = listed(f'{one:,.0f}' for one in times)
    text = (f'In the recordings a footprint that is one frame old makes separations wrong by up '
            f'to {most} times what rounding to float32 can do')
    if all(one > 1 for one in times):
        text += ': it is the largest error there is on a moving robot'
    text += ('; straight lines between frames leave less of it' if all(better) else
             f'; straight lines between frames leave less of it in {sum(better)} of {len(rows)}')
    return f'{text}. The laser scanner is in the frame of its robot, whose footprint stands.'
