# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Paths of footprints: received, placed, followed and checked ahead of the robot."""

from dataclasses import replace
import math

from builders import box, path, SECOND
from monitors import MAP, MapWorld, OUTLINE, World
import numpy as np
import pytest
from sat_collision.messages.markers import Markers
from sat_collision.messages.transform_listener import TF, TF_STATIC
from sat_collision.scene.parameters import check_outlines, ParameterError
from sat_collision.scene.path import FollowedPath
from sat_collision.scene.settings import FootprintSettings, Settings

ROBOT = FootprintSettings('robot', TF, points=OUTLINE, frame_id='base', rate=1000.0,
                          path='/plan', timeout=5.0)
# The square from x = 5 to 6 on the x axis.
AHEAD = box(5, -0.5)
STRAIGHT = [(x, 0.0, 0.0) for x in np.linspace(0.0, 10.0, 21)]
IDENTITY = 0.0, 0.0, 0.0, 0.0, 1.0
# A goal at (3, 3), turned to the left.
UPWARDS = (3.0, 3.0, 0.0, 0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
NONE = 0.0, 0.0, 0.0, 0.0, 0.0
LONG = {'points': (-1, -0.2, 1, -0.2, 1, 0.2, -1, 0.2)}


class Follower(MapWorld):
    """A monitor of a robot with a path among obstacles."""

    def __init__(self, *polygons, settings={}, **robot):
        super().__init__((replace(ROBOT, **robot),), *polygons, **settings)

    def plan(self, poses, stamp=0, **more):
        self.monitor.receive('robot.path', path(poses, stamp, **more), self.now, None)
        return self.check()

    def check(self):
        """Return what is found: NaN metres where it is unknown, and only there."""
        self.rejections += self.monitor.paths.check(self.now)
        found = self.scene.path_checks['robot']
        assert math.isnan(found.metres) == found.text.startswith('unknown: ')
        return found

    @property
    def text(self):
        return self.value('path contact')


def at_start(*polygons, x=0.0, y=0.0, yaw=0.0, **more):
    return Follower(*polygons, **more).move(0.0, x, y, yaw)


def followed(poses):
    """Return a path of x, y and yaw."""
    path = FollowedPath(np.full((len(poses), 7), 0.5))
    path.poses = np.array(poses, float)
    return path


@pytest.mark.parametrize('order', ['<', '>'])
def test_first_contact_ahead(order):
    world = at_start(box(9, -0.5), AHEAD)
    found = world.plan(STRAIGHT, order=order)
    assert found.metres == pytest.approx(4.5, abs=1e-6)
    assert (found.pose, str(found.obstacle)) == (pytest.approx(9.0, abs=1e-6), 'map/2')
    assert world.text == 'map/2 at pose 9.00, after 4.500 m'
    # It never changes the flag.
    assert world.status() == 'clear'
    drawn = [one for one in Markers().message(world.scene).markers if one.ns == 'robot/path']
    places = [(point.x, point.y) for point in drawn[0].points]
    assert max(places) == (pytest.approx(5.0, abs=1e-6), 0.25) and min(places) == (0.0, 0.0)


def test_way_and_outline_of_a_contact_are_those_of_a_path_that_turns():
    world = at_start(box(1.5, 5.0), **LONG)
    found = world.plan([(0, 0, 0), (2, 0, 0), (2, 0, math.pi / 2), (2, 9, math.pi / 2)])
    assert found.way == pytest.approx(np.array([(0, 0), (2, 0), (2, 0), (2, 4)]), abs=1e-6)
    assert found.outline == pytest.approx(
        np.array([(2.2, 3), (2.2, 5), (1.8, 5), (1.8, 3)]), abs=1e-6)


def test_last_of_the_paths_received_together_counts():
    world = at_start(AHEAD)
    world.monitor.receive_batch(
        'robot.path', [path(poses, 0) for poses in (STRAIGHT, STRAIGHT[:2])], world.now)
    assert world.check().metres == math.inf


def test_no_contact_and_contact():
    world = at_start(box(5, 0.3))
    assert (world.plan(STRAIGHT).metres, world.text) == (math.inf, 'none')
    assert world.move(0.1, 4.8, 0.2).status() == 'collision'
    assert (world.check().metres, str(world.check().obstacle)) == (0.0, 'map/1')


def test_margin_and_changed_outline_count():
    world = at_start(box(5, 0.3), settings={'margin': 0.1})
    assert world.plan(STRAIGHT).metres == pytest.approx(4.5 - math.sqrt(0.01 - 0.05 ** 2))
    world.use(margin=0.0)
    assert world.check().metres == math.inf
    world.use('robot', points=(-0.5, -0.5, 0.5, -0.5, 0.5, 0.5, -0.5, 0.5))
    assert world.move(0.1, 0.0).check().metres == pytest.approx(4.5, abs=1e-6)


def test_obstacles_of_other_sources_do_not_count():
    world = Follower(AHEAD, obstacles=('other',), settings={
        'obstacles': (MAP, replace(MAP, name='other', topic='/other'))})
    world.send_map('other', box(7, -0.5))
    world.move(0.0, 0.0)
    assert world.plan(STRAIGHT).metres == pytest.approx(6.5, abs=1e-6)


def test_what_is_unknown_is_said():
    world = Follower(AHEAD)
    world.at(1.0).check()
    assert world.text == f'unknown: {"; ".join(world.state().reasons)}'
    world.move(1.1, 0.0).check()
    assert world.text == 'unknown: no path on /plan yet'
    world.monitor.paths.note_fault('robot.path', '/plan has no publisher')
    world.check()
    assert world.text == 'unknown: /plan has no publisher'
    assert world.plan(STRAIGHT).metres < 5.0
    world.plan([])
    assert world.text == 'unknown: no plan, as the last path on /plan is empty'
    world.plan(STRAIGHT)
    assert world.at(7.0).status() == 'unknown'
    assert 'older than its timeout' in world.check().reason
    assert world.move(7.1, 0.0).check().metres < 5.0


def test_state_that_is_unknown_since_the_last_check_says_so():
    """And not what was found of the path before."""
    world = at_start(box(5, 3.0))
    assert (world.plan(STRAIGHT).metres, world.text) == (math.inf, 'none')
    assert world.at(7.0).text == f'unknown: {"; ".join(world.state().reasons)}'
    world.use('robot', enabled=False)
    assert world.text == 'unknown: footprint robot is disabled'


def test_part_behind_the_robot_does_not_count():
    world = at_start(box(1, -0.5), AHEAD, x=3.0)
    assert world.plan(STRAIGHT).metres == pytest.approx(1.5, abs=1e-6)
    found = world.move(0.1, 3.7, 0.1).check()
    assert (found.metres, found.pose) == pytest.approx((0.8, 9.0), abs=1e-6)
    assert world.move(0.2, 7.0).check().metres == math.inf


def test_progress_goes_back_with_the_robot_but_not_a_little():
    """One that backs up by less than its reach is still where it has been furthest."""
    world = at_start(AHEAD)
    assert world.plan([(0, 0, 0), (10, 0, 0)]).metres == pytest.approx(4.5, abs=1e-6)
    for time, x, metres in ((0.1, 3.0, 1.5), (0.2, 2.5, 1.5), (0.3, 2.0, 2.5), (0.4, 3.2, 1.3)):
        assert world.move(time, x).check().metres == pytest.approx(metres, abs=1e-6)


@pytest.mark.parametrize('yaw, off', [(0.0, 0.001), (0.0, 0.002), (0.02, 0.0), (0.1, 0.0)])
def test_metres_count_from_the_robot_however_uneven_the_path_is(yaw, off):
    """By travel poses that are off by 1 mm turn it; what is just behind it is no matter."""
    rng = np.random.default_rng(1)
    world = at_start(box(9, -0.5), [(1.0, -0.2), (1.1, 0.2), (1.0, 0.2)], x=2.0)
    track = [(x, off * rng.normal(), *(IDENTITY if off else [yaw * rng.normal() + 1e-9]))
             for x in np.linspace(0.0, 10.0, 401)]
    world.plan(track)
    for k in range(1, 100):
        metres = world.move(0.01 * k, 2.0 + 0.05 * k).check().metres
        assert metres == pytest.approx(6.5 - 0.05 * k, abs=0.06)


@pytest.mark.parametrize('step', [6.0, 0.1])
def test_robot_that_goes_back_does_not_get_to_the_end_of_its_lap(step):
    world = at_start(box(4, -0.5))
    corners = [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0), (0.0, 0.0)]
    world.plan([(*place, 1e-9) for place in along(corners, step)])
    for time, x, metres in ((0, 1.0, 2.5), (1, 0.5, 2.5), (2, 0.0, 3.5), (3, 0.5, 3.0),
                            (4, 2.0, 1.5)):
        assert world.move(time, x).check().metres == pytest.approx(metres, abs=1e-3)


def test_two_poses_are_a_path_and_one_is():
    world = at_start(AHEAD, x=3.0)
    assert world.plan([(0, 0, 0), (10, 0, 0)]).metres == pytest.approx(1.5, abs=1e-6)
    assert world.plan([(2, 0, 0)]).metres == math.inf
    assert world.plan([(5, 0, 1)]).metres == 0.0


def circles(turns, radius=3.0, step=64):
    return [(radius * math.sin(angle), radius - radius * math.cos(angle), angle)
            for angle in np.linspace(0.0, turns * math.tau, turns * step + 1)]


def test_loops_are_told_apart_by_progress():
    """A spiral's second turn comes to the place of the first one; the obstacle is at its end."""
    track = [*circles(2), (4.0, 0.0, 4 * math.pi)]
    world = at_start(box(4.2, -0.5))
    length = 2 * math.tau * 3.0
    assert world.plan(track).metres == pytest.approx(length + 3.7, abs=0.01)
    for k, (x, y, yaw) in enumerate(track[:-1], 1):
        metres = world.move(0.01 * k, x, y, yaw).check().metres
        assert metres == pytest.approx(length * (1 - (k - 1) / 128) + 3.7, abs=0.03), k
    assert world.move(2.0, 3.0, 0.0).check().metres == pytest.approx(0.7, abs=0.03)


def test_reversing_and_turns_on_the_spot():
    """A robot drives to a cusp and back; turns; and poses are repeated."""
    out = [(x, 0.0, 0.0) for x in np.linspace(0.0, 3.0, 31)]
    back = [(3.0, 0.0, 0.0)] * 2 + [(x, 0.0, 0.0) for x in np.linspace(3.0, -3.0, 61)]
    turn = [(-3.0, 0.0, yaw) for yaw in np.linspace(0.0, math.pi / 2, 10)]
    up = [(-3.0, y, math.pi / 2) for y in np.linspace(0.0, 5.0, 51)]
    world = at_start(box(-3.5, 4.0))
    assert world.plan([*out, *back, *turn, *up]).metres == pytest.approx(12.5, abs=0.01)
    time, slack = 0.0, 1.2
    for part, first in ((out, 0.0), (back[2:], 3.0), (turn, 9.0), (up[:30], 9.0)):
        for k, pose in enumerate(part):
            time += 0.01
            left = 12.5 - first - (0.1 * k if part is not turn else 0.0)
            # Where parts of the path are as near the first one counts, so it may be behind.
            metres = world.move(time, *pose).check().metres
            assert left - 0.01 <= metres <= left + slack, (first, k)
    world = at_start([(-0.4, -0.35)])
    on_the_spot = [(0, 0, yaw) for yaw in np.linspace(0.0, 1.5, 16)]
    found = world.plan([*on_the_spot, (5, 0, 1.5)])
    assert found.metres == 0.0 and 2.0 < found.pose < 15.0
    world.move(0.1, 0.0, 0.0, 1.5)
    assert (world.status(), world.check().metres) == ('clear', math.inf)


def test_there_and_back_with_few_poses():
    """What lies before the robot on the way out counts, though the way back is as near."""
    world = at_start(AHEAD, x=1.0)
    there = [(0.0, 0.0, 1e-9), (9.0, 0.0, 1e-9), (0.0, 0.0, 1e-9)]
    assert world.plan(there).metres == pytest.approx(3.5, abs=1e-6)
    assert world.move(0.1, 2.0).check().metres == pytest.approx(2.5, abs=1e-6)


def test_robot_within_a_turn_on_the_spot():
    world = at_start(x=5.0, yaw=0.6)
    world.plan([(0.0, 0.0, 0.1), (5.0, 0.0, 0.1), (5.0, 0.0, 1.1), (9.0, 4.0, 1.1)])
    assert world.monitor.paths.latest['robot.path'].path.progress == pytest.approx(1.5)


def test_orientations_of_identity_are_replaced_by_the_direction_of_travel():
    """A long robot goes round a corner between posts that it would hit if it did not turn."""
    corner = [(x, 0.0) for x in np.linspace(0.0, 3.0, 31)] + [
        (3.0, y) for y in np.linspace(0.1, 3.0, 30)]
    world = at_start([(3.4, 2.0)], [(2.6, 2.0)])
    poses = [(*at, *IDENTITY) for at in corner]
    found = world.plan([*poses[:-1], UPWARDS])
    assert found.metres == math.inf and found.is_by_travel
    assert world.text == 'none; by the direction of travel, as the poses have no orientations'
    # With orientations those count.
    found = world.plan([(*at, 0.0, 0.0, 0.0, math.sin(1e-6), 1.0) for at in corner])
    assert 4.0 < found.metres < 5.0 and not found.is_by_travel


CORNER = (0.0, 0.0), (10.0, 0.0), (10.0, 10.0)


def along(corners, step):
    """Return places on the way from corner to corner, no farther apart than a step."""
    return [*(tuple(place) for start, end in zip(corners, corners[1:]) for place in np.linspace(
        start, end, math.ceil(math.dist(start, end) / step), endpoint=False)), corners[-1]]


@pytest.mark.parametrize('corners', [
    CORNER, ((0, 0), (3, 0), (9, 0), (9, 6)), ((0, 0), (7, 0), (0, 2)),
    (*[(0, 0)] * 2, *[(8, 0)] * 3, *[(8, -4)] * 2)])
@pytest.mark.parametrize('step', [100.0, 2.0, 0.25])
def test_by_travel_the_way_between_poses_is_straight(corners, step):
    """However few poses say so, and however often one is repeated."""
    world = at_start(AHEAD)
    places = along(corners, step) if step < 100.0 else corners
    found = world.plan([(*place, *IDENTITY) for place in places])
    assert found.metres == pytest.approx(4.5, abs=1e-6) and found.is_by_travel
    k = int(found.pose)
    assert (found.pose - k) * math.dist(*places[k:k + 2]) == pytest.approx(
        4.5 - math.dist((0, 0), places[k]), abs=1e-6)
    # From where the robot is the rest is as long, and in contact it is at that pose.
    assert world.move(0.1, 3.2).check().metres == pytest.approx(1.3, abs=1e-6)
    assert world.check().pose == pytest.approx(found.pose, abs=1e-6)
    world.move(0.2, 4.5)
    assert (world.check().metres, world.check().pose) == (0.0, pytest.approx(found.pose))


def test_by_travel_it_turns_on_the_spot_at_a_pose():
    """Which is said, and adds no metres, and which it is within; the last turn is to the goal."""
    places = [(*place, *IDENTITY) for place in ((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (3.0, 3.0))]
    beside_corner, beside_goal = [(3.4, 0.3)], [(3.4, 3.1)]
    for post, pose, metres in ((beside_corner, 1.0, 3.0), (beside_goal, 3.0, 6.0)):
        world = at_start(post, **LONG)
        found = world.plan(places)
        assert (found.pose, found.metres) == (pytest.approx(pose), pytest.approx(metres))
        assert found.way[-1] == pytest.approx(places[int(pose)][:2])
    # After the turn at the corner there is nothing.
    world = at_start(beside_corner, **LONG)
    assert world.plan([*places[:2], UPWARDS]).pose == pytest.approx(1.0)
    assert world.move(0.1, 3.0, 0.01, math.pi / 2).check().metres == math.inf
    # A goal without orientation is not turned to.
    world = at_start(beside_goal, **LONG)
    assert world.plan([*places[:3], (3.0, 3.0, *NONE)]).metres == math.inf


def test_by_travel_a_goal_that_is_turned_is_reached_before_the_turn():
    """Of two poses, too, where all the way is along x."""
    world = at_start(AHEAD)
    goal = 10.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0
    found = world.plan([(0.0, 0.0, *IDENTITY), goal])
    assert found.metres == pytest.approx(4.5, abs=1e-6) and found.is_by_travel


def test_random_paths_by_travel_as_shapely_sees_them():
    """Sampled densely on each straight leg, and in each turn on the spot between two of them."""
    import shapely
    rng = np.random.default_rng(8)
    outline = np.reshape(OUTLINE, (-1, 2))
    count = 0
    for _ in range(100):
        places = rng.uniform(-4.0, 4.0, (rng.integers(2, 6), 2)).round(1)
        post = rng.uniform(-3.0, 3.0, (1, 2)) + rng.uniform(-0.3, 0.3, (3, 2))
        world = Follower(post).move(0.0, *places[0], math.atan2(*(places[1] - places[0])[::-1]))
        found = world.plan([*((*place, *IDENTITY) for place in places[:-1]), (*places[-1], *NONE)])
        obstacle, poses, metres = shapely.Polygon(post), [], []
        gone, before = 0.0, None
        for start, end in zip(places, places[1:]):
            way = complex(*(end - start))
            heading = np.angle(way)
            if before is not None:
                turn = np.angle(np.exp(1j * (heading - before)))
                poses += [(*start, before + turn * share) for share in np.linspace(0, 1, 200)]
                metres += [gone] * 200
            poses += [(*(start + share * (end - start)), heading)
                      for share in np.linspace(0.0, 1.0, 500)]
            metres += [gone + abs(way) * share for share in np.linspace(0.0, 1.0, 500)]
            gone, before = gone + abs(way), heading
        x, y, yaw = np.array(poses).T[:, :, None]
        c, s = np.cos(yaw), np.sin(yaw)
        there = shapely.polygons(np.stack([outline[:, 0] * c - outline[:, 1] * s + x,
                                           outline[:, 0] * s + outline[:, 1] * c + y], axis=-1))
        near = shapely.distance(there, obstacle)
        met = np.flatnonzero(near == 0.0)
        if len(met):
            count += 1
            assert found.metres <= metres[met[0]] + 1e-9
        # Where it is met bodies are within 1 mm, and within the step of a sample.
        if found.obstacle:
            k = int(np.searchsorted(metres, found.metres - 0.03))
            assert near[k:np.searchsorted(metres, found.metres + 0.03)].min() <= 0.03
        else:
            assert not len(met)
    assert count > 12


def test_path_in_another_frame_waits_for_its_transform():
    world = at_start(AHEAD)
    found = world.plan(STRAIGHT, stamp=world.now, frame_id='map')
    assert 'the path on /plan has no place: ' in found.reason
    stamp = world.now
    world.receive_transforms(TF, ('map', 'odom', stamp, 0.0, 1.0, 0.0))
    assert world.check().metres == math.inf
    world.receive_transforms(TF, ('map', 'odom', stamp + 1, 1.0, 0.0, 0.0))
    # It stays where it was at its stamp, until the next one comes.
    assert world.check().metres == math.inf
    world.move(0.1, 0.0)
    world.receive_transforms(TF, ('map', 'odom', world.now, 0.0, 0.0, math.pi / 2))
    turned = [(-y, x, yaw + math.pi / 2) for x, y, yaw in STRAIGHT]
    assert world.plan(turned, stamp=world.now, frame_id='map').metres == pytest.approx(4.5)
    assert world.check().metres == pytest.approx(4.5)


@pytest.mark.parametrize('frame_id', ['odom', 'ned'])
@pytest.mark.parametrize('robot_in', ['odom', 'ned'])
def test_frames_that_are_upside_down(frame_id, robot_in):
    """To the right, past a post to the left, to which the outline reaches if it is upright."""
    world = Follower(box(1.5, -5.0), points=(-0.2, -0.25, 0.2, -0.25, 0.2, 2.0, -0.2, 2.0))
    world.receive_transforms(TF_STATIC, ('odom', 'ned', 0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
    world.move(0.0, 0.0, parent=robot_in)
    side = 1.0 if frame_id == 'ned' else -1.0
    found = world.plan([(0.0, side * y, side * math.pi / 2) for y in (0.0, 9.0)],
                       stamp=world.now, frame_id=frame_id)
    assert found.metres == pytest.approx(3.8 if robot_in == 'odom' else math.inf, abs=1e-6)


@pytest.mark.parametrize('lacks', ['obstacles', 'kernels'])
def test_path_in_another_frame_is_placed_at_once(lacks):
    """Something else is lacking for longer than transforms are kept."""
    world = World(Settings(frame_id='odom', footprints=(ROBOT,), obstacles=(MAP,)))
    if lacks != 'obstacles':
        world.send_map('map', AHEAD)
    world.monitor.receive('robot.path', path(STRAIGHT, world.now, frame_id='map'), world.now)
    for time in range(20):
        world.move(time, 0.0)
        world.receive_transforms(TF, ('map', 'odom', world.now, 0.0, 0.0, 0.0))
        world.monitor.paths.check(world.now, measures=lacks != 'kernels')
    if lacks == 'obstacles':
        world.send_map('map', AHEAD)
    world.monitor.paths.check(world.now)
    assert world.scene.path_checks['robot'].metres == pytest.approx(4.5, abs=1e-6)


@pytest.mark.parametrize(('poses', 'more', 'reason'), [
    ([(0, 0, 0)] * 31, {}, 'too many poses'),
    ([(0, math.nan, 0)], {}, 'no coordinates of a path'),
    ([(0, 0, 0, 0, math.inf, 0, 1)], {}, 'no coordinates of a path'),
    ([(0, 0, 0), (1e101, 0, 0)], {}, 'no coordinates of a path'),
    ([(0, 0, 1.5), (1, 0, *NONE), (2, 0, 1.5)], {}, 'pose without orientation'),
    ([(0, 0, 1.5), (1, 0, 1.5), (2, 0, *NONE)], {}, 'pose without orientation'),
    ([(0, 0, *NONE)], {}, 'pose without orientation'),
    ([(1, 0, *NONE)] * 3, {}, 'pose without orientation'),
    (STRAIGHT, {'frame_id': ''}, 'empty frame_id'),
    (STRAIGHT, {'pose_frame': 'map'}, 'pose in another frame'),
    (STRAIGHT, {'stamp': 2000 * SECOND}, 'from the future')])
def test_refused_paths(poses, more, reason):
    """The next good one counts."""
    world = at_start(AHEAD, settings={'max_path_poses': 30})
    world.plan(STRAIGHT)
    world.plan(poses, **more)
    assert world.text == f'unknown: the last path on /plan was refused: {reason}'
    assert world.reasons == [reason] and world.rejections[0].text
    assert world.status() == 'clear'
    assert world.plan(STRAIGHT).metres < 5.0
    assert world.reasons == [reason]


@pytest.mark.parametrize('places, robot, progress', [
    ([(-4, 0), (0, 0), (16, 0), (20, 0)], [(-0.4, 0), (12, 0)], 1.75),
    # It comes back, nearer than on its way out.
    ([(0, 0), (16, 0), (17, 0), (17, 0.2), (16, 0.2), (4, 0.2)], [(4, 0.15)], 0.25),
    # It comes back the same way, all of which is still ahead.
    ([(0, 0), (10, 0), (0, 0)], [(2, 0), (5, 0)], 0.5),
    ([(0, 0), (10, 0), (0, 0)], [(2, 0), (10, 0), (8, 0)], 1.2),
    # The robot has gone back, where the end of the path is nearer than what is ahead of it.
    ([(0, 0), (10, 0), (10, 3), (3, 3), (2.5, 3)], [(9, 0), (0, 0)], 0.0)])
def test_progress_is_where_the_path_is_nearest(places, robot, progress):
    """Whatever lies between parts of it that are near."""
    path = followed([(*place, 0.0) for place in places])
    for x, y in robot:
        path.advance((x, y, 0.0), 0.5)
    assert path.progress == pytest.approx(progress)


def test_message_of_no_bytes_is_refused():
    world = at_start()
    world.monitor.receive('robot.path', b'', world.now, None)
    assert math.isnan(world.check().metres) and 'was refused: undecodable' in world.text
    assert world.reasons == ['undecodable']


def test_first_of_two_passes_counts_also_between_the_places_compared():
    """The way back has one of these just where a robot with a point as outline is."""
    path = followed([(0, 0, 0), (10, 0, 0), (-0.025, 0, 0)])
    path.advance((5.025, 0.0, 0.0), 1e-3)
    assert path.progress == pytest.approx(0.5025)


@pytest.mark.parametrize(('low', 'high', 'reach'), [(-2, 2, 0.0), (15, 99, 0.5), (90, 100, 1e100)])
def test_every_path_has_a_place_nearest_to_the_robot(low, high, reach):
    """However rounding falls, of a path towards the robot: far away, or of a point as outline."""
    rng = np.random.default_rng(5)
    for _ in range(100):
        way = rng.uniform(-1.0, 1.0, 2) * 10.0 ** rng.uniform(low, high)
        path = followed([(*way * share, 0.1) for share in sorted(rng.uniform(0.0, 1.0, 3))])
        for share in rng.uniform(0.0, 1.0, 2):
            path.advance((*way * (1.0 if share > 0.5 else share), 0.1), reach)
            assert 0.0 <= path.progress <= 2.0


@pytest.mark.parametrize('turn', [-3.0, -1.5, 1e-9, 0.5, math.pi])
def test_robot_on_an_arc(turn):
    """It is on the arc between two poses, not on the chord, so metres count from there."""
    def on_arc(share):
        away = 6.0 / turn * complex(math.sin(turn * share), 1.0 - math.cos(turn * share))
        return away.real, away.imag, turn * share

    for share in (0.15, 0.5, 0.85):
        path = followed([on_arc(0.0), on_arc(1.0)])
        path.advance(on_arc(share), 0.5)
        assert path.progress == pytest.approx(share, abs=1e-6)
        assert path.at(share) == pytest.approx(on_arc(share), abs=1e-6)


def test_progress_within_a_segment_is_the_nearest_of_many_places():
    """Of arcs, lines and turns on the spot but for rounding, robots beside them, any outline."""
    rng = np.random.default_rng(6)
    for _ in range(500):
        turn = rng.uniform(-3.1, 3.1) * rng.choice([1.0, 0.1, 1e-9])
        twist = complex(*rng.normal(size=2)) * rng.choice([2.0, 0.1, 1e-6, 1e-12])
        start, yaw = complex(*rng.uniform(-5.0, 5.0, 2)), rng.uniform(-3.0, 3.0)
        reach = rng.choice([0.0, 0.3, 2.0])

        def on_arc(share):
            return start + twist * np.expm1(1j * turn * share) / (1j * turn), yaw + turn * share

        def gaps(share):
            place, angle = on_arc(share)
            return abs(place - robot) + reach * abs(np.angle(np.exp(1j * (angle - heading))))

        near, heading = on_arc(rng.uniform())
        robot = near + complex(*rng.normal(size=2)) * rng.choice([0.0, 0.05, 1.0])
        heading += rng.normal() * rng.choice([0.1, 1.0])
        path = followed([(place.real, place.imag, angle) for place, angle in map(on_arc, (0, 1))])
        path.advance((robot.real, robot.imag, heading), reach)
        # Of places that are as near to within the reach the first one counts.
        assert gaps(path.progress) <= gaps(np.linspace(0.0, 1.0, 2001)).min() + reach + 1e-4


@pytest.mark.parametrize('off', [0.0, 1e-9, -1e-9])
def test_goal_beside_the_last_pose_by_rounding_turns_no_robot(off):
    """By travel; it would hit the side of its corridor, 0.35 m away."""
    world = at_start([(0.0, 0.35), (9.0, 0.35)])
    world.plan([*((x, 0.0, *IDENTITY) for x in range(6)), (5.0, off, *IDENTITY)])
    assert world.check().metres == math.inf


POST = [(0.69, 0.52), (0.79, 0.52), (0.79, 0.62), (0.69, 0.62)]


@pytest.mark.parametrize('off', [0.0, 1e-12, 1e-6, 1e-3, 0.01])
@pytest.mark.parametrize('robot', [(0.03, 0.0), (0.0, -0.03), (0.0, 0.03)])
def test_turn_on_the_spot_but_for_rounding_is_not_skipped(off, robot):
    """A robot a little away from the start of its plan, which first turns it into a post."""
    world = at_start(POST, x=robot[0], y=robot[1], **LONG)
    found = world.plan([(0, 0, 1e-9), (off, 0, math.pi / 2), (off, -3, math.pi / 2)])
    assert 0.2 < found.pose < 0.3 and found.metres <= off


def test_standing_robot_does_not_go_on_along_a_turn():
    """The plan turns it by steps whose places differ by 1 um; it is located to 5 mm."""
    rng = np.random.default_rng(0)
    turn = [(*rng.normal(size=2) * 1e-6, yaw) for yaw in np.linspace(0.001, math.pi / 2, 17)]
    world = at_start(POST, **LONG)
    world.plan(turn)
    for k in range(1, 201):
        found = world.move(k / 10, *rng.normal(0.0, 0.005, 2)).check()
        assert found.pose == pytest.approx(3.75, abs=0.01)


@pytest.mark.parametrize('size', [1e-320, 1e-200, 1e-3, 1.0, 5.0, 9e99])
def test_quaternions_of_any_length_are_orientations(size):
    found = at_start([(2.0, 0.35)]).plan([(x, 0.0, 0.0, 0.0, 0.0, size, size) for x in range(4)])
    assert found.metres == pytest.approx(1.75, abs=1e-3) and not found.is_by_travel


def test_outline_that_is_lost_in_rounding_is_unknown():
    corner = 0.0, 0.0, 2.0, 0.0, 2.0, 0.5, 0.5, 0.5, 0.5, 2.0, 0.0, 2.0
    world = at_start(AHEAD, points=corner)
    assert 'cannot be checked' in world.plan([(4e15, 1e16, 0.5)]).reason


def test_clock_that_is_set_forgets_the_path():
    world = at_start(AHEAD)
    world.plan(STRAIGHT)
    assert math.isnan(world.move(-100.0, 0.0).check().metres)


def test_path_that_tells_that_the_clock_was_set_counts():
    """It is the first message after that."""
    world = at_start(AHEAD)
    world.time = -100.0
    world.plan(STRAIGHT, world.now)
    world.move(-99.9, 0.0)
    world.send_map('map', AHEAD)
    assert world.check().metres == pytest.approx(4.5, abs=1e-6)


def test_path_of_before_the_clock_starts_is_judged_when_it_has():
    """A good one counts, and one from the future is refused."""
    for stamp, reasons in (0, []), (2000 * SECOND, ['from the future']):
        world = Follower()
        world.monitor.receive('robot.path', path(STRAIGHT, stamp), 0)
        assert world.monitor.paths.check(0) == []
        world.move(0.0, 0.0)
        world.check()
        assert world.reasons == reasons and math.isnan(world.check().metres) is bool(reasons)


def test_next_path_counts_where_it_may_have_more_poses():
    world = at_start(AHEAD, settings={'max_path_poses': 20})
    assert math.isnan(world.plan(STRAIGHT).metres)
    assert math.isnan(world.use(max_path_poses=21).check().metres)
    assert world.plan(STRAIGHT).metres == world.use(max_path_poses=20).check().metres
    assert world.reasons == ['too many poses']


def test_a_footprint_without_outline_has_no_path():
    with pytest.raises(ParameterError, match='robot.path: a path moves the frame'):
        check_outlines(Settings((FootprintSettings('robot', '/f', path='/plan'),), (MAP,)))
