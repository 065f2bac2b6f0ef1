# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages received as a run give the same as one after the other."""

from dataclasses import replace
import random

from builders import box, SECOND, serialised, transforms
from monitors import BOW_TIE, NOW, SETTINGS
import pytest
from sat_collision.messages.ingest import Batch
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import EACH_MESSAGE, EMPTY_POLYGON, NEW_STAMP, SET_ENDS
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
            scene.source_faults, monitor.rejected, monitor.received, monitor.lost,
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
