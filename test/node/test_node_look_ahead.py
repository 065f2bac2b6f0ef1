# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a node does after flags: messages that come meanwhile have theirs published first."""

import importlib
import time

from harness import APART, box, polygon_message, ROBOT
import pytest
from rclpy.duration import Duration

NAMES = [f'robot{k}' for k in range(12)]
# Of each that a node looks ahead for: where it is predicted, and the parameters.
FLAGS = 'sat_collision.scene.scene', {f'{name}__min_time_to_collision': 1.0 for name in NAMES}
FIGURES = 'sat_collision.scene.view', {}


@pytest.mark.parametrize(('module', 'parameters'), [FLAGS, FIGURES])
def test_message_during_predictions_has_its_flag_published_first(
        start, monkeypatch, module, parameters):
    """It does not wait until the others are predicted, each of which takes longer than a part."""
    running = start(footprints=NAMES, obstacle__timeout=60.0, **parameters,
                    **{f'{name}__timeout': 0.0 for name in NAMES})
    for k, name in enumerate(NAMES):
        running.send(name, box(0, 10 * k))
    running.send_set('obstacles', APART)
    for name in NAMES:
        running.await_state('clear', name)
    publisher = running.publisher(NAMES[-1])
    happened = []
    module = importlib.import_module(module)
    predict = module.predict

    def predict_slowly(footprint, *others):
        if footprint.settings.name == NAMES[2] and 'sent' not in happened:
            publisher.publish(polygon_message(APART, running.now()))
            assert publisher.wait_for_all_acked(Duration(seconds=60))
            happened.append('sent')
        happened.append(footprint.settings.name)
        time.sleep(0.002)
        return predict(footprint, *others)

    flag = running.monitor._outputs._flags[NAMES[-1]]
    publish = flag.publish

    def publish_flag(data):
        if data[4]:
            happened.append('raised')
        publish(data)
    monkeypatch.setattr(flag, 'publish', publish_flag)
    monkeypatch.setattr(module, 'predict', predict_slowly)
    running.until(lambda: 'raised' in happened, 'a flag')
    between = happened[happened.index('sent') + 1:happened.index('raised')]
    assert between in ([NAMES[2]], [NAMES[2], NAMES[-1]])
    running.send(NAMES[-1], ROBOT)
    running.until(lambda: happened.count(NAMES[-2]) > 2, 'predictions of the others')
