# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Whole sets in one message: polygon_msgs/Polygon2DCollection, and Polygon2DStamped footprints."""

from dataclasses import replace
import random

from builders import box, collection, polygon_2d, serialised
from monitors import BOW_TIE, CIRCLE, nanoseconds, NOW, World
from oracle import intersects
import pytest
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings

L_SHAPE = [(0, 3), (2, 3), (2, 5), (1, 5), (1, 4), (0, 4)]


class Collections(World):
    """A footprint and a source of collections, in one frame or with transforms."""

    def __init__(self, footprint=None, frame_id='', **changes):
        source = ObstacleSettings('lidar', '/lidar', type='polygon_collection')
        super().__init__(Settings(
            footprints=(FootprintSettings('robot', '/robot', type='polygon_2d'),),
            obstacles=(replace(source, **changes),), frame_id=frame_id), bool(frame_id))
        self.place(footprint or box(0))

    def place(self, footprint):
        assert self.receive('robot', polygon_2d(footprint, self.now)) is None

    def see(self, *polygons, ago=0.0, frame_id='map'):
        """Receive polygons as one message; return why it is refused."""
        return self.receive('lidar', collection(polygons, nanoseconds(self.time - ago), frame_id))

    @property
    def contacts(self):
        return [str(name) for name in self.state().contacts]

    @property
    def faults(self):
        return ' '.join(self.scene.source_faults)


def test_one_message_is_a_whole_set():
    """It is known from the first on, whatever was lost before it, and replaces the one before."""
    world = Collections()
    for lost, polygons, contacts in ((7, (box(5), box(10)), []),
                                     (0, (box(5), box(0.5), L_SHAPE), ['lidar/1']),
                                     (3, (box(5),), []), (0, (), [])):
        world.numbers['lidar'] += lost
        world.see(*polygons)
        assert world.status() == ('collision' if contacts else 'clear')
        assert (world.contacts, len(world.scene.obstacles)) == (contacts, len(polygons))


def test_polygons_that_are_far_are_placed_together_from_the_first_message_on(monkeypatch):
    """Sets of changing sizes make several groups grow, and the array that they share."""
    alone = []
    place = Contacts.place_obstacle
    monkeypatch.setattr(Contacts, 'place_obstacle', lambda self, one, where: (
        alone.append(str(one.name)), place(self, one, where)))
    world = Collections()
    for size in (10, 300, 40, 2000, 2000, 5, 2000, 300):
        world.at(world.time + 0.1).place(box(0))
        assert world.see(*(box(5 + k) for k in range(size - 1)), box(1.5)) is None
        assert len(world.scene.obstacles) == size and world.status() == 'clear'
    assert alone == []
    world.place(box(100.5))
    assert world.contacts == ['lidar/95', 'lidar/96']
    assert world.scene.nearest('robot', apart=True).separation == 0.5


@pytest.mark.parametrize('changes, message', [
    ({}, lambda ring: collection([ring], NOW)),
    ({'type': 'polygon', 'set_end': 'each_message'}, lambda ring: serialised(ring, NOW))],
    ids=['collection', 'each message'])
def test_numbers_are_not_needed(changes, message):
    """A middleware may give none."""
    world = Collections(**changes)
    for place, status in ((5, 'clear'), (0.5, 'collision'), (5, 'clear')):
        assert world.monitor.receive('lidar', message(box(place)), NOW, None) is None
        assert world.status() == status


def test_set_is_as_old_as_its_stamp():
    world = Collections(timeout=2.0)
    world.see(box(5), ago=1.0)
    assert world.status() == 'clear'
    world.at(1.5).place(box(0))
    assert world.status() == 'unknown'


def test_coordinates_are_float64():
    """At UTM coordinates float32 has steps of 0.5 m, and these two would touch."""
    north = 5_500_000.0
    world = Collections([(0, north), (1, north), (1, north + 1)])
    world.see([(1.1, north), (2, north), (2, north + 1)])
    assert world.status() == 'clear'
    world.see([(1.0, north + 0.5), (2, north), (2, north + 1)])
    assert world.status() == 'collision'


@pytest.mark.parametrize('wrong, reason', [
    (BOW_TIE, 'self-intersecting'), ([], 'empty'), ([(0, float('nan'))], 'not finite'),
    (CIRCLE, 'too many vertices')])
def test_refused_polygon_makes_the_source_unknown_until_the_next_good_message(wrong, reason):
    """Its index and reason are told, and the others count."""
    world = Collections()
    world.see(box(9))
    rejection = world.see(box(5), box(6), wrong, box(7))
    assert rejection.reason == reason and rejection.detail.startswith('polygon 2: ')
    assert f'polygon 2: {reason}' in world.faults and world.status() == 'unknown'
    assert world.monitor.rejected['lidar', reason] == 1
    world.see(wrong, box(0.5))
    assert world.status() == 'collision'
    world.see(box(5))
    assert world.status() == 'clear' and not world.faults


def test_older_stamp_replaces_nothing():
    """Both count until a newer one comes; of a map the order decides."""
    for timeout, then in ((2.0, 'collision'), (0.0, 'clear')):
        world = Collections(timeout=timeout)
        world.see(box(0.5))
        world.see(box(5), ago=1.0)
        assert world.status() == then
        world.see(box(6))
        assert world.status() == 'clear' and len(world.scene.obstacles) == 1


def test_more_than_max_count_is_refused():
    world = Collections(max_count=3)
    assert world.see(*[box(5)] * 4).reason == 'too many obstacles'
    assert world.status() == 'unknown'
    world.see(*[box(5)] * 3)
    assert world.status() == 'clear'


def test_undecodable_message_is_refused():
    world = Collections()
    world.see(box(5))
    assert world.receive('lidar', collection([box(5)], NOW)[:-1]).reason == 'undecodable'
    assert world.status() == 'unknown'
    world.see(box(5))
    assert world.status() == 'clear'


def test_set_without_obstacles_needs_no_frame():
    world = Collections(frame_id='map')
    assert world.see(frame_id='nowhere') is None
    assert world.status() == 'clear'


def test_later_set_needs_only_its_own_transform():
    """The one before it waits in vain, and its obstacles are replaced."""
    world = Collections(frame_id='map')
    world.receive_transforms(TF_STATIC, ('map', 'odom', 0, 0.0, 10.0))
    world.see(box(0.5), frame_id='lost')
    assert world.status() == 'unknown'
    world.see(box(0.5), frame_id='odom')
    assert world.status() == 'clear'


def test_polygons_far_from_the_footprint_as_received_meet_it_where_their_frame_is():
    """Those that are far are written together; here they are near once moved."""
    world = Collections(frame_id='map')
    world.receive_transforms(TF_STATIC, ('map', 'odom', 0, -49.5, 0.0))
    for at, status in ((50, 'collision'), (60, 'clear'), (50, 'collision')):
        world.see(box(90), box(at), box(70), frame_id='odom')
        assert world.status() == status


def test_map_follows_its_frame():
    """A static transform that is corrected moves a map that was sent once."""
    world = Collections(frame_id='map', timeout=0.0)
    world.receive_transforms(TF_STATIC, ('map', 'odom', 0, 0.0, 10.0))
    world.see(box(0.5), box(20), frame_id='odom')
    assert world.status() == 'clear'
    world.receive_transforms(TF_STATIC, ('map', 'odom', 0, 0.0, 0.5))
    assert world.status() == 'collision'


@pytest.mark.parametrize('seed', range(30))
def test_contacts_are_exact_whatever_the_shapes(seed):
    """Ordinary polygons are written at once, others and those near the footprint one by one."""
    rng = random.Random(seed)
    shapes = (box(0), L_SHAPE, [(0, 0)], [(0, 0), (2, 2)], [(0, 0), (3, 0), (0, 3)], CIRCLE[::20])
    at = rng.uniform(-3, 3)
    footprint = [(x + at, y) for x, y in rng.choice(shapes)]
    world = Collections(footprint)
    for _ in range(4):
        polygons = []
        for _ in range(rng.choice((0, 1, 5, 40))):
            dx, dy = (rng.choice((0.0, 1.0, rng.uniform(-12, 12))) for _ in range(2))
            polygons.append([(x + dx, y + dy) for x, y in rng.choice(shapes)])
        world.see(*polygons)
        met = {f'lidar/{k}' for k, one in enumerate(polygons) if intersects(footprint, one)}
        assert {*world.contacts} == met
        assert world.status() == ('collision' if met else 'clear')


@pytest.mark.parametrize('changes', [
    {}, {'set_end': 'empty_polygon'}, {'set_end': 'new_stamp'}, {'type': 'polygon_instance'},
    {'timeout': 0.0, 'set_end': 'empty_polygon'}], ids=str)
@pytest.mark.parametrize('assumed', (False, True))
def test_without_numbers_only_sets_in_one_message_are_known(changes, assumed):
    """A loss would not be seen, unless the user promises that there is none."""
    world = World(Settings((FootprintSettings('robot', '/robot'),), (
        ObstacleSettings('lidar', '/lidar', assume_no_loss=assumed, **changes),)), False)
    world.scene.use_middleware('rmw_example')
    with_id = 1 if 'type' in changes else None
    for now in range(9):
        world.at(now)
        for name, points, instance in (('robot', box(0), None), ('lidar', box(5), with_id),
                                       ('lidar', (), with_id)):
            data = serialised(points, world.now, instance=instance)
            world.monitor.receive(name, data, world.now, None)
    assert world.status() == ('clear' if assumed else 'unknown')
    faults = ' '.join(world.scene.source_faults)
    if assumed:
        summary = world.scene.sources['lidar'].summary
        assert not faults and summary.endswith('assuming that none was lost')
    else:
        assert 'rmw_example' in faults and 'assume_no_loss: true' in faults
