# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Many polygons received together: runs of messages, and whole sets in one message."""

from dataclasses import replace
import random

from builders import box, collection, polygon_2d, SECOND, serialised, transforms
from monitors import BOW_TIE, CIRCLE, nanoseconds, NOW, SETTINGS, World
from oracle import intersects
import pytest
from sat_collision.messages.ingest import Batch
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.settings import (
    EACH_MESSAGE, EMPTY_POLYGON, FootprintSettings, NEW_STAMP, ObstacleSettings, SET_ENDS,
    Settings)
from sat_collision.scene.streams import Endpoint

NON_CONVEX = [(0, 3), (2, 3), (2, 5), (0, 5), (1, 4)]


def snapshot(monitor):
    """Return everything observable of a monitor."""
    scene = monitor.scene
    obstacles = [(str(name), polygon.vertices.tolist()) for name, polygon in scene.obstacles]
    names = {name for name, _ in scene.obstacles}
    return scene.state('robot'), sorted(obstacles), known(monitor, names)


def known(monitor, names):
    """Return what does not depend on where bodies are, and how old the named obstacles are."""
    scene = monitor.scene
    times = sorted((one.name, one.time) for source in scene.sources.values()
                   for one in source.store if one.row is not None and one.name in names)
    return (scene.unknown_reasons('robot'), times, scene.deadline,
            scene.source_faults, monitor.rejected, monitor.received, scene.lost(),
            'lidar' in monitor.waiting)


def random_set(source, stamp, frame_id):
    """Return messages with one stamp: far, touching, refused, non-convex, ended or not."""
    count = source.choice((1, 2, 5, 30))
    messages = [serialised(box(10 + k, source.uniform(-5, 5)), stamp, frame_id)
                for k in range(count)]
    for _ in range(source.choice((0, 0, 1, 3))):
        k = source.randrange(count)
        messages[k] = source.choice((
            serialised(box(0.5), stamp, frame_id),
            serialised(box(1.2), stamp, frame_id),
            serialised(BOW_TIE, stamp, frame_id),
            serialised(NON_CONVEX, stamp, frame_id),
            serialised([(4, 4)] * 5, stamp, frame_id),
            serialised(box(float('nan')), stamp, frame_id),
            serialised(box(10), stamp, 'elsewhere'),
            serialised(box(10), stamp + source.choice((1, SECOND // 200, 3 * SECOND)), frame_id),
            serialised(box(10), stamp - 3 * SECOND, frame_id),
            serialised(box(10), 0, frame_id),
            serialised(box(10), stamp, frame_id, order='>'),
            serialised(box(10), stamp, frame_id)[:-1],
            serialised(box(10), stamp, frame_id) + b'\0\0\0\0',
            messages[k][:20] + b'\xff\xff\xff\xff' + messages[k][24:],
            b''))
    return messages + [serialised([], stamp, frame_id)] * source.choice((0, 1, 1, 1, 2))


@pytest.mark.parametrize('seed', range(60))
def test_batches_give_the_same_as_single_messages(seed):
    """
    With losses, by numbers or not, other frames, a margin, and sets split between batches.

    What is known is the same if no contacts are decided.
    """
    source = random.Random(seed)
    timeout, set_ends = source.choice((
        (0.0, (EMPTY_POLYGON, EACH_MESSAGE)), (1.0, SET_ENDS), (1.0, SET_ENDS)))
    settings = replace(SETTINGS, margin=source.choice((0.0, 0.0, 0.5)), obstacles=(
        replace(SETTINGS.obstacles[0], max_count=source.choice((10, 100)),
                timeout=timeout, set_end=source.choice(set_ends)),))
    follows = source.choice((False, True))
    places = [], [], [], []
    monitors = [Monitor(settings, True, one if follows else None, decides_contacts=k < 3)
                for k, one in enumerate(places)]
    singly, alone, together, undecided = monitors
    singly.ingest.apply_run = lambda *_: 0
    now, number = source.choice((NOW, NOW, SECOND // 5)), source.choice((1, 7, None))
    for monitor in monitors:
        monitor.receive_transforms('/tf_static', transforms(('map', 'laser', 0, 0.25, 3.0, 1.5)),
                                   now)
        monitor.update_publishers('lidar', [Endpoint('gid', '/tracker')])
    left = []
    for _ in range(12):
        now += source.choice((SECOND // 20, SECOND // 10, 7 * SECOND // 10, 2 * SECOND))
        robot = serialised(box(source.choice((0, 0, -5))), now)
        stamp = now + source.choice((0, 0, 0, SECOND // 20, -SECOND // 2))
        left += random_set(source, stamp, source.choice(('map', 'map', 'laser')))
        cut = source.choice((len(left), source.randrange(len(left) + 1)))
        batches = []
        for data in left[:cut]:
            if not batches or source.random() < 0.03:
                if number is not None and batches:
                    number += source.choice((0, 1))
                batches.append((number, []))
            batches[-1][1].append(data)
            if number is not None:
                number += 1
        left = left[cut:]
        answer, *others = (monitor.receive('robot', robot, now) for monitor in monitors)
        assert others == [answer] * 3
        for first, batch in batches:
            now += source.choice((0, 0, SECOND // 100))
            if first is None and source.random() < 0.3:
                for monitor in monitors:
                    monitor.lose('lidar')
            rejections = together.receive_batch('lidar', batch, now, first)
            assert undecided.receive_batch('lidar', batch, now, first) == rejections
            rejected = []
            for k, data in enumerate(batch, first or 0):
                expected = singly.receive_batch('lidar', [data], now, first and k)
                assert alone.receive_batch('lidar', [data], now, first and k) == expected
                assert snapshot(alone) == snapshot(singly)
                rejected += expected
            assert [*rejections] == rejected
            assert snapshot(together) == snapshot(singly)
            names = {name for name, _ in singly.scene.obstacles}
            names -= {name for name, _, _ in singly.scene.contacts('robot')}
            assert known(undecided, names) == known(singly, names)
            changes, *others = (monitor.scene.take_changes() for monitor in monitors[:3])
            assert others == [changes, changes]
    placed, *others = ([(one.shape, one._replace(points=None))
                       for placement in place for one in placement.each()] for place in places)
    assert others == [placed] * 3 and bool(placed) == follows


def ordinary(k, stamp):
    return serialised(box(10 + k), stamp)


@pytest.mark.parametrize('size', (1, 21))
@pytest.mark.parametrize('set_end', (EMPTY_POLYGON, NEW_STAMP))
@pytest.mark.parametrize('unusual, margin, status', [
    (lambda stamp: serialised(box(1), stamp), 0.0, 'collision'),
    (lambda stamp: serialised(box(1.25), stamp), 0.5, 'collision'),
    (lambda stamp: serialised(NON_CONVEX, stamp), 0.0, 'clear'),
    (lambda stamp: serialised(BOW_TIE, stamp), 0.0, 'unknown'),
    (lambda stamp: ordinary(10, stamp)[:20] + b'\5\0\0\0' + ordinary(10, stamp)[24:], 0.0,
     'unknown'),
], ids=['touching', 'within the margin', 'not convex', 'refused', 'another count'])
def test_unusual_message_in_a_run_is_received_by_itself(
        monkeypatch, size, set_end, unusual, margin, status):
    """All others are received in runs, once there have been three sets of as many."""
    monitor = Monitor(replace(SETTINGS, margin=margin, obstacles=(
        replace(SETTINGS.obstacles[0], set_end=set_end),)))
    applied = []
    apply_run = monitor.ingest.apply_run

    def apply(*arguments):
        applied.append(apply_run(*arguments))
        return applied[-1]

    monkeypatch.setattr(monitor.ingest, 'apply_run', apply)
    monitor.receive('robot', serialised(box(0)), NOW)
    number = 1
    for stamp in range(NOW, NOW + 4 * SECOND // 10, SECOND // 10):
        batch = [ordinary(k, stamp) for k in range(20)]
        if stamp == NOW + 3 * SECOND // 10:
            batch[10] = unusual(stamp)
        del applied[:]
        batch.append(serialised([], stamp))
        for k in range(0, 21, size):
            monitor.receive_batch('lidar', batch[k:k + size], stamp, number + k)
        number += 21
    assert sum(applied) == 19 and max(applied) == min(size, 10)
    assert monitor.scene.state('robot').status.value == status


def test_runs_go_through_the_robot_if_no_contacts_are_decided():
    """But not what is odd; what is known depends on the stamps."""
    monitor = Monitor(replace(SETTINGS, obstacles=(
        replace(SETTINGS.obstacles[0], set_end='new_stamp'),)), placements=[],
        decides_contacts=False)
    monitor.receive('robot', serialised(box(0)), NOW)
    taken = []
    for k in range(5):
        stamp = NOW + k * SECOND // 10
        now = stamp + SECOND // 2
        odd = [serialised(NON_CONVEX, stamp), ordinary(9, stamp)] if k < 2 else []
        batch = Batch([serialised(box(0), stamp), *(ordinary(k, stamp) for k in range(8)), *odd])
        taken.append(monitor.receive_run('lidar', batch, 0, now))
        monitor.receive_batch('lidar', batch.messages[taken[-1]:], now)
    assert taken == [0, 0, 0, 9, 9]
    assert monitor.scene.state('robot').contacts == ()
    expires = stamp - SECOND // 10 + round(SETTINGS.obstacles[0].timeout * SECOND)
    monitor.advance(expires)
    assert monitor.scene.source_faults == ()
    monitor.advance(expires + 1)
    assert monitor.scene.source_faults != ()


@pytest.mark.parametrize('number, then, happens, count', [
    (25, 27, '', 8), (25, 28, '', 12), (25, 27, 'interrupt', 12), (None, None, 'lose', 12)],
    ids=['whole', 'loss', 'interruption', 'loss without numbers'])
def test_set_received_in_two_runs_replaces_none_if_it_has_a_gap(number, then, happens, count):
    """The set before stays beside it and the next one, by whose stamp it ends."""
    monitor = Monitor(replace(SETTINGS, obstacles=(
        replace(SETTINGS.obstacles[0], set_end=NEW_STAMP),)))
    # Sets before, whose rows are used again: only then are obstacles received together.
    for k in range(6):
        monitor.receive_batch('lidar', [ordinary(j, NOW + k) for j in range(4)], NOW + k,
                              number and 1 + 4 * k)
    polygons = [ordinary(j, NOW + 6) for j in range(4)]
    monitor.receive_batch('lidar', polygons[:2], NOW + 6, number)
    if happens:
        getattr(monitor, happens)('lidar')
    monitor.receive_batch('lidar', polygons[2:], NOW + 6, then)
    monitor.receive_batch('lidar', [ordinary(j, NOW + 7) for j in range(4)], NOW + 7,
                          then and then + 2)
    assert len(monitor.scene.obstacles) == count


def test_oldest_of_a_set_is_named_where_it_begins_a_run():
    """Three that are received together are older than the one before them."""
    monitor = Monitor(replace(SETTINGS, obstacles=SETTINGS.obstacles[:1]))
    monitor.update_publishers('lidar', [Endpoint('gid', '/tracker')])
    end = serialised([], NOW)
    # Sets before, whose rows are used again: only then are obstacles received together.
    for k in range(4):
        monitor.receive_batch('lidar', [serialised(box(10), NOW)] * 4 + [end], NOW, 1 + 5 * k)
    old = NOW - SECOND * 19 // 10
    messages = [serialised(box(10), NOW), *[serialised(box(10), old)] * 3]
    assert monitor.receive_batch('lidar', messages, NOW, 21) == []
    monitor.receive_batch('lidar', [end], NOW + SECOND // 5, 25)
    fault, = monitor.scene.source_faults
    assert 'whose oldest obstacle, lidar/1, is 2.1 s old' in fault


# --- collections: polygon_msgs/Polygon2DCollection, and Polygon2DStamped footprints


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


def test_older_message_replaces_no_newer_one_of_which_a_part_was_refused():
    """Both count, and not all is known, until a newer one comes."""
    world = Collections()
    world.see(box(0.5), BOW_TIE)
    world.see(box(5), ago=0.1)
    assert world.contacts == ['lidar/0'] and 'self-intersecting' in world.faults
    world.at(0.1).see(box(8))
    assert world.status() == 'clear' and len(world.scene.obstacles) == 1


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
    """The index and reason of the first one are told; those that are good count."""
    world = Collections()
    world.see(box(9))
    rejection = world.see(box(5), box(6), wrong, box(7), wrong)
    assert rejection.reason == reason and rejection.detail.startswith('polygon 2: ')
    assert f'polygon 2: {reason}' in world.faults and world.status() == 'unknown'
    assert world.monitor.rejected['lidar', reason] == 2
    world.see(wrong, box(0.5))
    assert world.status() == 'collision'
    world.see(box(5))
    assert world.status() == 'clear' and not world.faults


def test_polygons_refused_for_several_reasons_are_all_told():
    """The first one of each reason, in one rejection."""
    world = Collections()
    rejection = world.see(box(5), [], BOW_TIE, [], BOW_TIE)
    assert rejection.reason == 'empty'
    assert [one[:9] for one in rejection.detail.split('; ')] == ['polygon 1', 'polygon 2']
    assert world.monitor.rejected == {('lidar', 'empty'): 2, ('lidar', 'self-intersecting'): 2}


def test_more_than_max_count_is_refused():
    world = Collections(max_count=3)
    assert world.see(*[box(5)] * 4).reason == 'too many obstacles'
    assert world.status() == 'unknown'
    world.see(*[box(5)] * 3)
    assert world.status() == 'clear'


def test_set_without_obstacles_needs_no_frame():
    world = Collections(frame_id='map')
    assert world.see(frame_id='nowhere') is None
    assert world.status() == 'clear'


def test_polygons_far_from_the_footprint_as_received_meet_it_where_their_frame_is():
    """Those that are far are written together; here they are near once moved."""
    world = Collections(frame_id='map')
    world.receive_transforms(TF_STATIC, ('map', 'odom', 0, -49.5, 0.0))
    for at, status in ((50, 'collision'), (60, 'clear'), (50, 'collision')):
        world.see(box(90), box(at), box(70), frame_id='odom')
        assert world.status() == status


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
