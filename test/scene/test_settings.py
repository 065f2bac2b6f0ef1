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

"""Settings: each has a meaning, and a default that it may have."""

from dataclasses import FrozenInstanceError, MISSING

import pytest
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, specs
from stage import LIDAR, ROBOT

KINDS = (Settings, FootprintSettings, ObstacleSettings)
EVERY_SETTING = [(kind, name) for kind in KINDS for name in specs(kind)]


@pytest.mark.parametrize('kind, name', EVERY_SETTING)
def test_default_is_one_that_it_may_have(kind, name):
    """Every number has limits, and lies within them; what has choices is one of them."""
    default, spec = specs(kind)[name]
    assert spec.description
    assert (type(default) in (int, float)) == (spec.limits is not None)
    if spec.limits:
        least, greatest = spec.limits
        assert least <= default <= greatest
    if spec.choices:
        assert default in spec.choices


def test_only_names_and_topics_must_be_given():
    """Everything else has a default."""
    needed = {kind: [name for name, (default, _) in specs(kind).items() if default is MISSING]
              for kind in KINDS}
    assert needed == {Settings: ['footprints', 'obstacles'], FootprintSettings: ['topic'],
                      ObstacleSettings: ['topic']}


def test_what_shapes_the_node_is_not_live():
    """Names, topics, types, the frame, what memory is set aside for, and the lock stay."""
    fixed = {name for kind, name in EVERY_SETTING if not specs(kind)[name][1].live}
    assert fixed == {'footprints', 'obstacles', 'frame_id', 'lock_parameters', 'max_vertices',
                     'odometry', 'radius_vertices', 'rate', 'tf_cache_time', 'topic', 'type'}


def test_settings_cannot_be_changed_in_place():
    """A change is another Settings, which somebody has to apply."""
    for settings in (ROBOT, LIDAR, Settings((ROBOT,), (LIDAR,))):
        with pytest.raises(FrozenInstanceError):
            settings.enabled = False
