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

"""The sections on what exactness costs in scenes, and on what a scene needs beside it."""

import math

from words import counted, duration, metres, share, spread, table


def cost(figures):
    rows = figures['cost']['scenes']
    lines = [[row['scene'], f'{row["frames"]:,}', f'{row["pairs"]:,}', f'{row["contacts"]:,}',
              share(row['boxes'], row['pairs']), counted_share(row), _time(row),
              duration(row['ns'])] for row in rows]
    recorded = [row for row in rows if row['scene'] in _recorded(figures)]
    drawn = [row for row in rows if row not in recorded]
    head = ('scene', 'frames', 'pairs', 'in contact', 'boxes or discs decide', 'exact stage',
            'of the time', 'a pair')
    return f"""## What exactness costs in scenes

{_recordings_say(recorded)} Where bodies are built to touch, a robot at rest in its dock or flush
with racks in line, it decides
{spread([row["exact"] / row["pairs"] for row in drawn], share)} of the pairs. *Of the time* is the
share that calls take which end in the exact stage, all of such a call counted; no time is given
for fewer than 100 calls.

{table(head, lines)}"""


def _recordings_say(rows):
    if not rows:
        return 'The recordings were not there to be measured.'
    exact = sum(row['exact'] for row in rows)
    pairs = sum(row['pairs'] for row in rows)
    return (f'In the recordings, of a road, of a vehicle among boxes and of a laser scanner, the '
            f'exact stage decides {counted(exact, pairs)} pairs.')


def counted_share(row):
    part = f' ({share(row["exact"], row["pairs"])})' if row['exact'] else ''
    return f'{row["exact"]:,}{part}'


def _time(row):
    return '–' if row['exact_time'] is None else share(row['exact_time'])


def _recorded(figures):
    return [row['scene'] for row in figures['cost']['recorded']]


def left_out(figures):
    rows, index = figures['cost']['recorded'], figures['cost']['index']
    scan = (f'the fullest scene here has {index["obstacles"]} obstacles: comparing all boxes with '
            f'one footprint, contacts decided, takes {index["scan"]:.1f} µs; asking shapely\'s '
            f'STRtree takes {index["query"]:.1f} µs where it is built, and {index["build"]:.1f} '
            f'µs with building it for obstacles that have moved')
    items = [f'**An index** over the obstacles: {scan}.']
    if rows:
        points = sum(row['points'] for row in rows)
        items = [f'**z**: {counted(sum(row["with_z"] for row in rows), points)} points of the '
                 f'recordings have one that is not 0.', _rotation(rows), *items, _among(rows)]
    return '## What a scene needs, and what was left out\n\n' + '\n'.join(
        f'- {item}' for item in items)


def _rotation(rows):
    turn = max(row['turn'] for row in rows)
    bulge = max(row['bulge'] for row in rows)
    return (f'**Rotation between frames**: from one recorded frame to the next the footprint '
            f'turns by up to {math.degrees(turn):.0f}°, so its vertices leave the straight lines '
            f'between their places by up to {metres(bulge)}. The node decides '
            f'about the places received; replay takes the straight lines.')


def _among(rows):
    pairs = sum(row['pairs'] for row in rows)
    among = sum(row['among_obstacles'] for row in rows)
    touching = sum(row['touching'] for row in rows)
    return (f'**Obstacle against obstacle**: that would be {among:,} pairs in the recordings, '
            f'where footprint against obstacle is {pairs:,}: {among / pairs:.1f} times as many, '
            f'to find {touching:,} contacts that no robot takes part in.')
