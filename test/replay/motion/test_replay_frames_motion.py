# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recorded motion in moving frames is the same as in the fixed frame."""

import math

from builders import box, serialised, transforms
import numpy as np
import pytest
from recordings import check, declared, INSTANCE, MARKS, nanoseconds, SOURCE, write
from sat_collision.replay.model.result import Options

KINDS = {'sets': declared(MARKS), 'ids': {f'{SOURCE}.type': 'polygon_instance'}}
FRAMES = ('odom', 'laser'), ('laser', 'odom'), ('laser', 'laser')
BODIES_EVERY, TRANSFORMS_EVERY, LAST = 1 / 16, 1 / 8, 8.0
TURNING = 0.4
# Their places at a time: without rotation each number is a float32 in either frame, and no contact
# begins or ends at the stamp of a message.
OBSTACLES = (lambda time: box(6 + 1 / 64, 0.25, 0.25, 0.25), lambda time: box(12.0 - time, 0.5),
             lambda time: box(4 + 3 / 64, 3.0 - time, 0.5, 0.25))


def written(points, time, frame_id, turning, number=None):
    """Write a body with points in the fixed frame as a message in another frame."""
    if frame_id == 'laser':
        angle = turning * time
        c, s = math.cos(angle), math.sin(angle)
        points = np.array(points) - (1.5 * time, 0.5)
        points = points if not angle else points @ [(c, -s), (s, c)]
    return serialised(points, nanoseconds(time), frame_id, number)


def recorded(path, kind, delay, turning, frames):
    """Replay footprint and obstacles in one frame each; transforms come late."""
    messages = []
    for k in range(round(LAST / TRANSFORMS_EVERY) + 1):
        time = k * TRANSFORMS_EVERY
        messages.append(('/tf', time + delay, transforms(
            ('odom', 'laser', nanoseconds(time), 1.5 * time, 0.5, turning * time))))
    for k in range(round(LAST / BODIES_EVERY)):
        time = k * BODIES_EVERY
        messages.append(('/footprint', time + 0.01,
                         written(box(1.5 * time, 0.0), time, frames[0], turning)))
        messages += [('/obstacles', time + 0.02 + 0.001 * i,
                      written(place(time), time, frames[1], turning, i if kind == 'ids' else None))
                     for i, place in enumerate(OBSTACLES, 1)]
        if kind == 'sets':
            messages.append(('/obstacles', time + 0.03, []))
    types = {'/tf': 'tf2_msgs/msg/TFMessage'}
    if kind == 'ids':
        types['/obstacles'] = INSTANCE
    result = check(write(path, messages, types=types), Options(
        parameters={'frame_id': 'odom', **KINDS[kind]}, footprints=['footprint:=/footprint'],
        obstacles=[f'{SOURCE}:=/obstacles']))
    assert result.problems == [] and not any(source.rejected for source in result.sources)
    return result


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('delay', (0.0, 0.06))
@pytest.mark.parametrize('turning', (0.0, TURNING))
def test_motion_is_that_of_the_fixed_frame(tmp_path, kind, delay, turning):
    """
    Each body is placed at its own stamp, though others arrive while it waits.

    Without rotation the numbers are identical.
    """
    near = 1e-5 if turning else 0.0
    fixed = recorded(tmp_path / 'fixed', kind, delay, turning, ('odom', 'odom'))
    assert [contact.obstacle for contact in fixed.contacts] == [
        f'{SOURCE}/{k + (kind == "ids")}' for k in (2, 0, 1)]
    for frames in FRAMES:
        moving = recorded(tmp_path / '-'.join(frames), kind, delay, turning, frames)
        compare(moving, fixed, near)


def compare(moving, fixed, near):
    """Compare contacts and separations; near is a tolerance in m and in s."""
    assert len(moving.contacts) == len(fixed.contacts)
    for one, other in zip(moving.contacts, fixed.contacts):
        assert (one.obstacle, one.found) == (other.obstacle, other.found)
        assert [one.first, one.last, *filter(None, one.between)] == pytest.approx(
            [other.first, other.last, *filter(None, other.between)], rel=0.0, abs=near * 1e9)
        assert one.depth == pytest.approx(other.depth, abs=near)
    known = dict(fixed.footprints[0].separation)
    both = [(value, known[time]) for time, value in moving.footprints[0].separation
            if value is not None and known.get(time) is not None]
    assert len(both) > 0.9 * len(known)
    assert [one for one, _ in both] == pytest.approx([other for _, other in both], abs=near)
