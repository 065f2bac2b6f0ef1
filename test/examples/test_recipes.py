# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The recipes of docs/recipes.md with a running monitor, and its picture of a plan."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import Point32, Polygon  # noqa: E402, I100
from harness import box, to_time  # noqa: E402
from sat_collision import first_contact_along  # noqa: E402
from std_msgs.msg import Header  # noqa: E402

PAGE = (Path(__file__).resolve().parents[2] / 'docs' / 'recipes.md').read_text()


def recipe(heading, language, number=0):
    """Return a code block under a heading."""
    _, text = PAGE.split(f'\n## {heading}\n')
    block = text.partition('\n## ')[0].split(f'```{language}\n')[1 + number]
    return block.partition('```')[0]


def functions(heading, number=0):
    known = {}
    exec(recipe(heading, 'python', number), known)
    return SimpleNamespace(**known)


def parameters_of_a_map(folder, at_once=False):
    """Return the arguments of a monitor of the static map, sent one by one or in one message."""
    text = recipe('A static map', 'yaml')
    if at_once:
        pytest.importorskip('polygon_msgs', reason='make .venv/messages.stamp builds it')
        text = text.replace('set_end: empty_polygon', 'type: polygon_collection')
    file = folder / 'params.yaml'
    file.write_text(text)
    return '--params-file', str(file)


@pytest.mark.parametrize('at_once', (False, True), ids=('one by one', 'in one message'))
def test_static_map(start, tmp_path, at_once):
    """It is sent once, before the monitor has found its publisher."""
    monitor = start(parameters_of_a_map(tmp_path, at_once))
    known = functions('A static map', int(at_once))
    publisher = (known.publish_map_at_once if at_once else known.publish_map)(
        monitor.node, [box(0.0), box(5.0), [(9.0, 0.0), (9.0, 5.0)]])
    for x, state in ((2.0, 'clear'), (4.0, 'collision'), (8.5, 'collision'), (2.0, 'clear')):
        monitor.send_until(state, 'footprint', box(x))
    assert publisher.get_subscription_count() == 1


@pytest.mark.parametrize('outlines', ([box(0.0), [], box(5.0)], [box(0.0), []], [[]]))
def test_map_with_an_empty_outline_is_refused(outlines):
    """Sent, it would end the set, and all outlines before it would be lost."""
    with pytest.raises(ValueError, match='outline'):
        functions('A static map').publish_map(None, outlines)


def test_zones_of_vda_5050(start, tmp_path):
    """Blocked zones stop the robot, others do not; the next set replaces them."""
    monitor = start(parameters_of_a_map(tmp_path))
    publish_map = functions('A static map').publish_map
    blocked_zones = functions('Zones of VDA 5050').blocked_zones

    def zone_set(**kinds):
        zones = [{'zoneId': name, 'zoneType': kind, 'vertices': [
                  {'x': x, 'y': y} for x, y in box(int(name.removeprefix('at')), 0)]}
                 for name, kind in kinds.items()]
        return json.dumps({'headerId': 1, 'timestamp': '2026-01-01T00:00:00.000Z',
                           'version': '3.0.0', 'manufacturer': 'm', 'serialNumber': 's',
                           'zoneSet': {'mapId': 'hall', 'zoneSetId': 'z', 'zones': zones}})

    publisher = publish_map(monitor.node, blocked_zones(
        zone_set(at0='BLOCKED', at5='SPEED_LIMIT', at8='BLOCKED')))
    for x, state in ((0.5, 'collision'), (5.5, 'clear'), (9.0, 'collision'), (9.5, 'clear')):
        monitor.send_until(state, 'footprint', box(x))
    monitor.node.destroy_publisher(publisher)
    publisher = publish_map(monitor.node, blocked_zones(zone_set(at5='BLOCKED')))
    for x, state in ((5.5, 'collision'), (0.5, 'clear')):
        monitor.send_until(state, 'footprint', box(x))
    with pytest.raises(KeyError):
        blocked_zones('{"zones": []}')


def test_costmap_converter(start):
    """A closed ring, a line, a point and a disc, without a frame."""
    monitor = start()
    to_set = functions('costmap_converter').to_set
    ring = box(5.0)

    def state_is(state, x):
        outlines = [*ring, ring[0]], [(8.0, 0.0), (9.0, 0.0)], [(12.0, 0.5)], [(15.0, 0.5)]
        message = SimpleNamespace(header=Header(stamp=to_time(monitor.now())), obstacles=[
            SimpleNamespace(polygon=Polygon(points=[Point32(x=x, y=y) for x, y in outline]),
                            radius=1.5 if outline == [(15.0, 0.5)] else 0.0)
            for outline in outlines])
        for obstacle in to_set(message, 'map'):
            monitor.publisher('obstacles').publish(obstacle)
        monitor.send('footprint', box(x))
        monitor.spin(0.03)
        return monitor.state() == state
    for x, state in ((2.0, 'clear'), (4.0, 'collision'), (10.0, 'clear'), (9.0, 'collision'),
                     (11.5, 'collision'), (12.5, 'collision'), (16.4, 'collision'),
                     (2.0, 'clear')):
        monitor.until(lambda: state_is(state, x), f'{state} at {x}', 60.0)


@pytest.mark.parametrize('radius', (0.0, 1.5))
def test_costmap_converter_without_points_is_refused(radius):
    """What has no place is no reason to call it clear."""
    message = SimpleNamespace(header=Header(), obstacles=[
        SimpleNamespace(polygon=Polygon(), radius=radius)])
    with pytest.raises(ValueError):
        functions('costmap_converter').to_set(message, 'map')


def test_plan_of_the_picture_is_free_but_for_a_turn_that_touches():
    """As its caption says: between two poses, each of which is free."""
    pytest.importorskip('matplotlib')
    from path_picture import BODY, draw, POSES, SHELVES
    assert all(first_contact_along(BODY, [pose], SHELVES) is None for pose in POSES)
    assert 4.0 < first_contact_along(BODY, POSES, SHELVES).pose < 5.0
    assert draw().axes
