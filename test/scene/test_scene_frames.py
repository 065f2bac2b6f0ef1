# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The frame of the scene: how it is chosen, and bodies in other frames."""

from dataclasses import replace

from stage import CART, clear_stage, EVERY_KIND, LIDAR, REFUSED, ROBOT, Stage


def test_frame_is_that_of_all_footprints_of_the_last_second():
    """The first footprint came in a wrong frame; obstacles follow with their next set."""
    stage = Stage(footprints=[ROBOT, CART])
    stage.robot(frame='odom', name='cart')
    stage.send(10)
    assert stage.robot(frame='map') == 'other frame', 'they do not agree'
    assert stage.at(0.5).robot(name='cart') is None
    assert stage.scene.frame_id == 'map'
    stage.robot()
    assert stage.status('robot') == stage.status('cart') == 'unknown'
    stage.send(10)
    assert stage.status('robot') == stage.status('cart') == 'clear'


def test_frame_ignores_footprints_older_than_a_second():
    """A footprint still in the old frame is unknown from then on."""
    stage = Stage(footprints=[ROBOT, replace(CART, timeout=0.0)])
    stage.robot(frame='odom', name='cart')
    assert stage.at(1.0).robot() == 'other frame'
    assert stage.at(1.001).robot() is None
    assert stage.state('cart').reasons[0] == (
        "footprint cart on /cart/footprint is not in the frame 'map'")


def test_first_footprint_sets_the_frame():
    stage = Stage()
    assert stage.scene.frame_id == ''
    stage.robot(frame='odom')
    assert stage.scene.frame_id == 'odom'
    assert stage.see(0.5, frame='map') == 'other frame'
    stage.end()
    assert stage.status() == 'unknown'
    assert stage.state().reasons == (REFUSED + 'other frame',)
    stage.at(0.1).see(0.5, frame='odom')
    assert stage.status() == 'collision'


@EVERY_KIND
def test_obstacles_received_before_the_frame_is_known(settings):
    """Those in another frame are refused then."""
    stage = Stage(settings)
    stage.see(0.5, frame='odom', instance=1)
    stage.see(9.5, frame='map', instance=2)
    stage.end()
    stage.robot(frame='odom')
    assert list(stage.held.values()) == [0.5]
    assert stage.status() == 'collision'
    assert stage.state().reasons[-1].endswith('a message was refused: other frame')
    for time in (0.1, 2.0, 3.2):
        stage.at(time).robot(frame='odom')
        stage.see(0.5, frame='odom', instance=1)
        stage.see(8.5, frame='odom', instance=2)
        stage.end()
        assert stage.status() == 'collision'
        assert (stage.state().reasons == ()) == (settings is LIDAR or time > 3)


def test_refusal_before_the_frame_is_known_keeps_its_reason():
    stage = Stage()
    stage.refuse('not finite')
    stage.end()
    stage.robot()
    assert stage.state().reasons == (REFUSED + 'not finite',)


def test_configured_frame_refuses_other_frames_from_the_start():
    stage = Stage(frame_id='map')
    assert stage.see(0.5, frame='odom') == 'other frame'
    stage.end()
    assert stage.robot(frame='odom') == 'other frame'
    assert stage.state().reasons == (
        "footprint robot on /footprint is not in the frame 'map'", REFUSED + 'other frame')
    stage.at(0.1).see(0.5)
    stage.robot()
    assert stage.status() == 'collision'


def test_second_footprint_in_another_frame_is_unknown():
    """The first one is not affected."""
    stage = Stage(footprints=[ROBOT, CART])
    stage.send(10)
    stage.robot()
    assert stage.robot(10, name='cart', frame='odom') == 'other frame'
    assert (stage.status('robot'), stage.status('cart')) == ('clear', 'unknown')


def test_footprint_that_changes_its_frame_is_unknown():
    """If no frame is configured, the frame changes and the obstacles must follow."""
    for settings in ({'frame_id': 'map'}, {}):
        stage = clear_stage(**settings)
        stage.robot(frame='odom')
        assert stage.status() == 'unknown'
        assert (stage.scene.footprints == []) == bool(settings)


def test_step_back_in_time_resets_the_frame():
    """The next recording may use another one."""
    stage = clear_stage()
    for time in (-1.0, -0.9):
        stage.at(time)
    stage.robot(frame='odom')
    for stamp in (-1.0, None):
        stage.see(10, stamp, frame='odom')
        stage.end(stamp)
    assert stage.status() == 'clear'


def test_refused_or_disabled_footprint_does_not_set_the_frame():
    stage = Stage(footprints=[replace(CART, enabled=False), ROBOT])
    stage.refuse(name='robot')
    stage.robot(name='cart', frame='odom')
    assert stage.scene.frame_id == ''
