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

"""The warehouse scene as an example recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sat_collision.demo import warehouse
from sat_collision.messages.interfaces import Point32, PolygonStamped, serialize
from sat_collision.replay.bag.writer import new_bag

_START = 1_700_000_000 * 10**9
_PERIOD = 0.05
_STATIC_EVERY = 10
_DELAY = 2_000_000
_KIND = 'geometry_msgs/msg/PolygonStamped'
_PARAMETERS = """\
# The warehouse scene: three robots, what does not move, and a person.
/**:
  ros__parameters:
    footprints: [{footprints}]
    obstacles: [warehouse, people]
    frame_id: {frame}
    warehouse.timeout: 3.0
    people.timeout: 1.0
"""


def write_example(path: str | Path) -> None:
    """
    Write the scene as a bag of 16 s, with the parameters to check it in params.yaml beside it.

    Raises
    ------
    OutputError
        If the path exists, or nothing is there that writes bags.

    """
    path = Path(path)
    writer = new_bag(path)
    for name in (*warehouse.FOOTPRINTS, 'warehouse', 'people'):
        writer.add_topic(f'/{name}', _KIND)
    for tick in range(round(warehouse.DURATION / _PERIOD) + 1):
        elapsed = tick * _PERIOD
        stamp = _START + round(elapsed * 1e9)
        outlines = [(name, warehouse.footprint(name, elapsed)) for name in warehouse.FOOTPRINTS]
        sets = [('people', [warehouse.person(elapsed)])]
        if tick % _STATIC_EVERY == 0:
            sets.append(('warehouse', [*warehouse.STATIC]))
        outlines += [(name, outline) for name, obstacles in sets
                     for outline in (*obstacles, warehouse.NOTHING)]
        for name, outline in outlines:
            writer.write(f'/{name}', stamp + _DELAY, _message(outline, stamp))
    writer.close()
    parameters = _PARAMETERS.format(footprints=', '.join(warehouse.FOOTPRINTS),
                                    frame=warehouse.FRAME)
    (path / 'params.yaml').write_text(parameters)


def _message(outline: NDArray[np.float64], stamp: int) -> bytes:
    message = PolygonStamped()
    message.header.frame_id = warehouse.FRAME
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    message.polygon.points = [Point32(x=x, y=y) for x, y in outline.astype(np.float32).tolist()]
    return bytes(serialize(message))
