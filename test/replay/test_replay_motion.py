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

"""What touched by recorded motion: between messages, at equal stamps, and with its own doubts."""

import json

from builders import SECOND, serialised
import pytest
from recordings import box, INSTANCE, needs_shared, SHARED, SOURCE, START, write
from sat_collision.replay.command import main
from sat_collision.replay.options import Options
from sat_collision.replay.result import AT_A_FRAME, BETWEEN_FRAMES, Verdict
from sat_collision.replay.run import check

NAMES = ('autoware_ego_trajectory_boxes', 'commonroad_BEL_Zaventem-1_2_T-1',
         'commonroad_USA_Lanker-1_1_ego1247', 'tysik_front_scan_polygons')


def since(result, *times):
    """Return times in seconds since the recording begins."""
    return [None if time is None else (time - result.origin) / SECOND for time in times]


def at(time, points, delay=0.0, topic='/obstacles'):
    """Return a message stamped at a time that comes later."""
    return topic, time + delay, serialised(points, START + round(time * SECOND))


def test_leader_at_constant_distance_is_not_touched(tmp_path):
    """
    0.10 m ahead, both at 2 m/s with frames at 10 Hz, the footprint 20 ms earlier.

    As live its place of before is taken for its place now, 0.20 m back.
    """
    messages = []
    for k in range(40):
        t = k / 10
        messages += [at(t, box(2 * t), topic='/footprint'), at(t + 0.02, box(2 * t + 1.14))]
    bag = write(tmp_path / 'bag', messages)
    result = check(bag)
    assert result.verdict is Verdict.CLEAR and result.contacts == []
    values = [value for _, value in result.footprints[0].separation if value is not None]
    assert len(values) >= 38
    assert values == pytest.approx([0.1] * len(values), abs=1e-5)
    assert check(bag, Options(as_live=True)).verdict is Verdict.COLLISION


@pytest.mark.parametrize('first', ['/footprint', '/obstacles'])
def test_order_within_a_stamp_means_nothing(tmp_path, first):
    """Two cars 2 m apart at 3 m a frame, all messages of a frame at one stamp."""
    messages = []
    for k in range(50):
        frame = [('/footprint', k / 10, box(3 * k)), ('/obstacles', k / 10, box(3 * k + 3))]
        messages += frame if first == '/footprint' else frame[::-1]
    result = check(write(tmp_path / 'bag', messages))
    assert (result.verdict, result.contacts) == (Verdict.CLEAR, [])
    assert [value for _, value in result.footprints[0].separation] == [2.0] * 50


def test_thin_wall_between_two_frames(tmp_path, capsys):
    """0.5 m long at 10 m/s, frames at 10 Hz: in no frame does it touch the wall."""
    wall = [(20.6, -1), (20.61, -1), (20.61, 2), (20.6, 2)]
    messages = [message for k in range(41) for message in (
        ('/footprint', k / 10, [(k, 0), (k + 0.5, 0), (k + 0.5, 0.5), (k, 0.5)]),
        ('/obstacles', k / 10, wall))]
    bag = write(tmp_path / 'bag', messages)
    assert main([str(bag)]) == 1
    assert 'between 2.000 and 2.100 s' in capsys.readouterr().out
    result = check(bag)
    contact, = result.contacts
    assert contact.found == BETWEEN_FRAMES
    assert since(result, *contact.between) == [2.0, 2.1]
    assert since(result, contact.first, contact.last) == pytest.approx([2.01, 2.061], abs=1e-6)
    assert contact.depth == pytest.approx(0.01 + 0.25, abs=1e-5)
    assert result.footprints[0].collision == contact.last - contact.first


@needs_shared
@pytest.mark.parametrize('clock', ('receive', 'header'))
@pytest.mark.parametrize('name', NAMES)
def test_shared_recordings_say_what_is_true_at_equal_stamps(name, clock):
    """Every separation, every least one and every contact, against those found by shapely."""
    moments = json.loads((SHARED / f'{name}_moments.json').read_text())
    result = check(SHARED / f'{name}_sqlite3', Options(
        clock=clock, parameters={'footprint.timeout': 3.0, f'{SOURCE}.timeout': 3.0}))
    curve = dict(result.footprints[0].separation)
    for moment in moments:
        assert max(curve[moment['stamp']], 0.0) == pytest.approx(moment['least'], abs=1e-9)
        touching = {f'{SOURCE}/{index}' for index in moment['touching']}
        found = [contact for contact in result.contacts if contact.found == AT_A_FRAME
                 and contact.first <= moment['stamp'] <= contact.last]
        assert len(found) == len(touching)
    assert (result.verdict is Verdict.COLLISION) == any(one['touching'] for one in moments)
