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

"""Recordings of bodies in frames that move, by the /tf and /tf_static that are in them."""

import math

from builders import SECOND, serialised, transforms
import pytest
from recordings import box, nanoseconds, SOURCE, write
from sat_collision.replay.model.result import HEADER, Options, Verdict
from sat_collision.replay.run import check

TYPES = dict.fromkeys(('/tf', '/tf_static'), 'tf2_msgs/msg/TFMessage')
PARAMETERS = {'frame_id': 'odom', f'{SOURCE}.accumulate': True, f'{SOURCE}.timeout': 0.3}
POST = [(0, 0), (0.25, 0), (0.25, 0.25), (0, 0.25)]


def static(time=0.0):
    return '/tf_static', time, transforms(('base', 'laser', 0, 1.0, 0.0, math.pi))


def drive(delay=0.04, end=6.0):
    """
    Return a robot that drives by 1 m/s along x past a post at (3, 0), seen by its laser.

    The robot's outline is a box from its origin on; its laser looks back. Transforms come at 20 Hz
    and late by a delay.
    """
    messages = [(0.0, static())]
    for k in range(round(end * 20)):
        time = k / 20
        messages.append((time + delay, (
            '/tf', time + delay, transforms(('odom', 'base', nanoseconds(time), time, 0.0)))))
    for k in range(round(end * 10)):
        time = k / 10 + 0.03
        stamp = nanoseconds(time)
        messages.append((time, ('/footprint', time, serialised(box(0), stamp, 'base'))))
        seen = [(1 + time - x, -y) for x, y in ((3 + x, y) for x, y in POST)]
        messages.append((time + 0.001, ('/obstacles', time + 0.001,
                                        serialised(seen, stamp, 'laser'))))
    return [message for _, message in sorted(messages, key=lambda pair: pair[0])]


def run(path, messages, **options):
    return check(write(path, messages, types=TYPES), Options(
        parameters=PARAMETERS, footprints=['footprint:=/footprint'],
        obstacles=[f'{SOURCE}:=/obstacles'], **options))


def seconds(result, time):
    return (time - nanoseconds(0.0)) / SECOND


@pytest.mark.parametrize('clock', ('receive', HEADER))
def test_a_post_is_met_when_the_robot_is_there(tmp_path, clock):
    """The robot covers x from its origin to 1 m beyond: in contact from 2 to 3.25 s."""
    result = run(tmp_path / 'bag', drive(), clock=clock)
    assert result.problems == [] and result.verdict is Verdict.COLLISION
    assert seconds(result, result.origin) == (0.03 if clock == HEADER else 0.0)
    assert seconds(result, min(contact.first for contact in result.contacts)) == (
        pytest.approx(2.0, abs=1e-6))
    assert seconds(result, max(contact.last for contact in result.contacts)) == (
        pytest.approx(3.25, abs=1e-6))
    assert not any(source.rejected for source in result.sources)


@pytest.mark.parametrize('clock', ('receive', HEADER))
def test_as_live_a_post_is_met_soon_after(tmp_path, clock):
    result = run(tmp_path / 'bag', drive(), clock=clock, as_live=True)
    assert result.problems == [] and result.verdict is Verdict.COLLISION
    first = min(contact.first for contact in result.contacts)
    last = max(contact.last for contact in result.contacts)
    assert 2.03 <= seconds(result, first) <= 2.2
    assert 3.23 <= seconds(result, last) <= 3.6
    assert not any(source.rejected for source in result.sources)


def test_what_waits_is_told_in_time(tmp_path):
    """As live, later transforms delay what is found by as much, and change nothing else."""
    begins = []
    for delay in (0.0, 0.1):
        result = run(tmp_path / f'bag{delay}', drive(delay), as_live=True)
        begins.append(min(seconds(result, contact.first) for contact in result.contacts))
    assert begins[1] - begins[0] == pytest.approx(0.1, abs=0.01)


def test_transforms_that_come_too_late_make_the_robot_unknown(tmp_path):
    assert run(tmp_path / 'bag', drive(0.3)).verdict is Verdict.COLLISION, 'by the stamps'
    result = run(tmp_path / 'live', drive(0.3), as_live=True)
    assert result.verdict is Verdict.UNKNOWN and result.contacts == []
    for source in result.sources:
        assert set(source.rejected) == {'no transform', 'unknown frame'}
    assert 'the newest of base is' in result.sources[0].examples['no transform']


def test_static_frames_are_known_from_a_later_start_on(tmp_path):
    """They were sent once, at the beginning."""
    result = run(tmp_path / 'bag', drive(), start=1.0)
    assert result.verdict is Verdict.COLLISION
    assert all(set(source.rejected) <= {'no transform'} for source in result.sources)


def test_recordings_without_transforms_say_other_frame(tmp_path):
    messages = [message for message in drive() if not message[0].startswith('/tf')]
    result = run(tmp_path / 'bag', messages)
    assert result.verdict is Verdict.UNKNOWN
    assert {reason for source in result.sources for reason in source.rejected} == {'other frame'}
