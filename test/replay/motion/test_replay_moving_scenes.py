# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Random scenes in random moving frames, replayed as live."""

import pytest

pytest.importorskip('rosbags')

from moving_scenes import FIXED, MovingScene, OUTLINE, WINDOW, WINDOWS  # noqa: E402, I100
import oracle  # noqa: E402
from recordings import check, INSTANCE, START, write  # noqa: E402
from sat_collision.replay.losses import UNSEEN  # noqa: E402
from sat_collision.replay.model.result import Options  # noqa: E402

TF = 'tf2_msgs/msg/TFMessage'
TYPES = {'/tf': TF, '/tf_static': TF, '/obstacles': INSTANCE}
PARAMETERS = {
    'frame_id': FIXED, 'transform_timeout': 1.0, 'footprints': ['robot', 'cart'],
    'obstacles': ['seen'], 'robot.topic': '/footprint', 'robot.timeout': 0.0, 'cart.timeout': 0.0,
    'cart.frame_id': 'base', 'cart.rate': 1000.0, 'cart.points': [
        number for corner in OUTLINE for number in (corner.real, corner.imag)],
    'seen.topic': '/obstacles', 'seen.type': 'polygon_instance', 'seen.timeout': 60.0}


def touching(result, time):
    """Return the footprints and obstacles in contact at a time."""
    at = START + round(time * 1e9)
    return {(contact.footprint, contact.obstacle) for contact in result.contacts
            if contact.first <= at and (at < contact.last or contact.at_end)}


@pytest.mark.parametrize('seed', range(8))
def test_contacts_are_those_of_the_fixed_frame(tmp_path, seed):
    """And those of the true poses, at the end of each window when all messages have arrived."""
    scene = MovingScene(seed, START)
    moving, fixed = (
        check(write(tmp_path / name, [(topic, time, data) for time, topic, data in events],
                    types=TYPES), Options(parameters=PARAMETERS, as_live=True))
        for name, events in (('moving', scene.moving), ('fixed', scene.fixed)))
    for result in (moving, fixed):
        assert (result.problems, result.notes) == ([], [UNSEEN])
        assert not any(source.rejected for source in result.sources)
    for window in range(WINDOWS):
        end = (window + 1) * WINDOW
        bodies = {**scene.truth[window], 'cart': scene.outline(end)}
        rings = {name: [(corner.real, corner.imag) for corner in ring]
                 for name, ring in bodies.items()}
        true = {(name, f'seen/{key}') for name in ('robot', 'cart')
                for key in rings.keys() - {'robot', 'cart'}
                if oracle.intersects(rings[name], rings[key])}
        assert touching(moving, end) == touching(fixed, end) == true
