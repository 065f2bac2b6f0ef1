# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Maps in other frames: each part is placed by its frame as it is now, and follows it."""

from dataclasses import replace

from builders import box, serialised
from driving import Robot, SETS, SETTINGS
from monitors import START
import pytest
from sat_collision.messages.transform_listener import TF, TF_STATIC
from sat_collision.scene.streams import Endpoint

MAP = replace(SETS, obstacles=(replace(SETS.obstacles[0], timeout=0.0),))


def test_map_is_unknown_while_a_part_of_it_waits():
    """What waits may be in contact."""
    robot = Robot(MAP)
    robot.stand(0)
    robot.see(box(9), 0.0, 'odom', None)
    robot.see((), 0.0, 'odom', None)
    assert robot.status() == 'clear'
    robot.see(box(0), 0.0, 'base', None)
    assert 'waits for the transform' in robot.state().reasons[0]
    robot.move(0.0, 30.0)
    assert robot.status() == 'clear'


def map_robot(*link, settings=MAP):
    """Return a robot with a map that a frame with this transform has 50 m ahead of it."""
    robot = Robot(settings)
    robot.stand(0)
    robot.receive_transforms(*link)
    robot.see(box(0), 0.0, link[1][1], None)
    robot.see((), 0.0, 'odom', None)
    assert robot.status() == 'clear'
    return robot


def test_map_follows_a_static_frame_that_is_corrected():
    robot = map_robot(TF_STATIC, ('odom', 'site', 0, 50.0, 0.0))
    robot.receive_transforms(TF_STATIC, ('odom', 'site', 0, 0.5, 0.0))
    assert robot.status() == 'collision' and robot.seen == [(0.5, 0, 1.5, 1)]
    robot.at(9.0).stand(0)
    assert robot.status() == 'collision'


def test_all_of_a_map_follows_when_a_transform_ahead_of_the_clock_comes_to_count():
    """The first part was placed before, by the transform before."""
    robot = Robot(MAP)
    robot.stand(0)
    robot.move(0.0, 50.0, 'site')
    robot.move(0.5, 0.5, 'site')
    robot.see(box(0), 0.0, 'site', None)
    robot.at(0.6).see(box(9), 0.6, 'site', None)
    robot.see((), 0.6, 'site', None)
    assert robot.status() == 'collision' and [x for x, *_ in robot.seen] == [0.5, 9.5]


def test_part_of_a_map_in_the_fixed_frame_stays():
    """Though its place in a set was before that of a part which followed its frame."""
    robot = map_robot(TF_STATIC, ('odom', 'site', 0, 50.0, 0.0))
    for frame_id in 3 * ['site'] + 3 * ['odom']:
        for x, sent_in in ((20, frame_id), (30, frame_id), (70, 'site')):
            robot.see(box(x), 0.0, sent_in, None)
        robot.see((), 0.0, 'odom', None)
    robot.receive_transforms(TF_STATIC, ('odom', 'site', 0, 60.0, 0.0))
    assert [x for x, *_ in robot.seen] == [20, 30, 130]


def test_map_follows_a_moving_frame_and_is_unknown_without_it():
    """Once the last transform is older than the footprint's timeout, 1 s, and at a reset."""
    robot = map_robot(TF, ('odom', 'site', START, 50.0, 0.0))
    robot.at(1.0).stand(0)
    assert robot.status() == 'clear'
    robot.at(1.001)
    assert 'frame whose transform is too old' in robot.state().reasons[0]
    robot.at(1.2).move(1.1, 40.0, 'site')
    assert robot.status() == 'clear' and robot.seen == [(40, 0, 41, 1)]
    robot.move(1.2, 0.0, 'site')
    assert robot.status() == 'collision'
    robot.at(-3.0).stand(20)
    assert 'is a map in another frame' in robot.state().reasons[0]


@pytest.mark.parametrize('link, changes, reason', [
    ((TF, ('odom', 'site', START, 50.0, 0.0)), {'footprints': (
        replace(MAP.footprints[0], timeout=0.5),)}, 'past the timeout by 0.4 s'),
    ((TF_STATIC, ('odom', 'site', 0, 50.0, 0.0, 0.0, 0.0, 0.04, 0.0, 0.9992)),
     {'max_tilt': 0.01}, 'tilted by')], ids=['timeout', 'tilt'])
def test_frame_of_a_map_counts_by_the_present_parameters(link, changes, reason):
    robot = map_robot(*link)
    robot.at(0.9).stand(0)
    robot.monitor.update(replace(robot.settings, **changes))
    assert robot.status() == 'unknown' and reason in robot.state().reasons[0]
    robot.monitor.update(robot.settings)
    assert robot.status() == 'clear'


@pytest.mark.parametrize('enabled, status', [(True, 'unknown'), (False, 'clear')])
def test_enabled_footprints_limit_how_old_the_frame_of_a_map_may_be(enabled, status):
    cart = replace(MAP.footprints[0], name='cart', topic='/cart', timeout=0.2, enabled=enabled)
    robot = map_robot(TF, ('odom', 'site', START, 50.0, 0.0),
                      settings=replace(MAP, footprints=(*MAP.footprints, cart)))
    robot.at(0.9).stand(0)
    assert robot.status() == status


def test_frame_in_which_a_map_was_sent_does_not_matter_for_the_next():
    """Though /tf is silent, so that nothing else tells of frames."""
    robot = map_robot(TF, ('odom', 'site', START, 50.0, 0.0))
    robot.at(2.0).stand(0)
    robot.see(box(9), 2.0, 'odom', None)
    assert 'too old' in ''.join(robot.state().reasons)
    robot.see((), 2.0, 'odom', None)
    assert robot.status() == 'clear'


@pytest.mark.parametrize('frame_id, topic, link', [
    ('laser', TF, ('odom', 'base')), ('map', TF_STATIC, ('odom', 'map'))])
def test_map_is_requested_again_once_its_transform_has_come(frame_id, topic, link):
    """A latched map is sent only once, and at the start transforms may come later."""
    robot = Robot(replace(SETTINGS, obstacles=(
        replace(SETTINGS.obstacles[0], timeout=0.0, set_end='empty_polygon'),)))
    robot.see(box(9), 'none', frame_id)
    robot.at(5.0).see((), 'none', frame_id)
    assert len(robot.reasons) == 1 and not robot.scene.wants_history('lidar')
    robot.receive_transforms(TF, ('odom', 'elsewhere', robot.now, 0.0, 0.0))
    assert not robot.scene.wants_history('lidar')
    robot.receive_transforms(topic, (*link, robot.now, 0.0, 0.0))
    assert robot.scene.wants_history('lidar')
    robot.scene.renew('lidar')
    robot.numbers['lidar'] = 0
    robot.send_map('lidar', box(9))
    assert not robot.scene.source_faults and not robot.scene.wants_history('lidar')


@pytest.mark.parametrize('is_disabled', [False, True], ids=['renewed', 'disabled'])
def test_older_map_does_not_stand_in_for_one_that_waited_when_it_was_dropped(is_disabled):
    """The new subscription receives both again, the older one first."""
    robot = Robot(MAP)
    robot.stand(0)
    robot.monitor.update_publishers('lidar', [Endpoint('a', '/a')])

    def see(*numbers):
        for number in numbers:
            data = serialised((box(20), (), box(0.5), ())[number - 1], robot.now,
                              'base' if number == 3 else 'odom')
            robot.monitor.receive('lidar', data, robot.now, number)
    see(1, 2, 3, 4)
    for enabled in (False, True) if is_disabled else ():
        robot.use('lidar', enabled=enabled)
    robot.monitor.renew('lidar')
    see(1, 2)
    assert robot.status() == 'unknown'
    robot.move(0.0)
    see(3, 4)
    assert robot.status() == 'collision'
