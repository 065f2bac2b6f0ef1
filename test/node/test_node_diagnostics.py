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

"""What /diagnostics says of states and sources, and how far apart things are as a number."""

import math

from diagnostic_msgs.msg import DiagnosticStatus
from harness import box, values
from sat_collision.scene.scene import Scene

ROBOT = box(0, 0)
APART = box(5, 0)
TOUCHING = box(0.75, 0)
LASTING = {'footprint__timeout': 0.0, 'obstacle__timeout': 60.0}


def level(monitor, name):
    status = monitor.told(name)
    return status and status.level


def test_contact_and_unknown_reach_diagnostics(start):
    """By the node's full name, so that two robots do not mix."""
    monitor = start(['-r', '__ns:=/robot1'], **LASTING)
    monitor.name = 'robot1/footprint_monitor'
    name = '/robot1/footprint_monitor: footprint'
    monitor.until(lambda: level(monitor, name) == DiagnosticStatus.STALE, 'unknown')
    assert 'has no publisher' in monitor.told(name).message
    monitor.send_set('/robot1/obstacles', TOUCHING)
    monitor.send_until('collision', '/robot1/footprint', ROBOT)
    monitor.until(lambda: level(monitor, name) == DiagnosticStatus.ERROR
                  and not values(monitor.told(name))['reason'], 'a contact')
    status = monitor.told(name)
    assert status.message == 'in contact with obstacle/0'
    assert status.hardware_id == '/robot1/footprint'
    assert values(status) == {'state': 'collision', 'obstacles in contact': 'obstacle/0',
                              'reason': ''}
    monitor.send_set('/robot1/obstacles', APART)
    monitor.until(lambda: level(monitor, name) == DiagnosticStatus.OK, 'clear')
    assert monitor.health().name == '/robot1/footprint_monitor: health'


def test_health_warns_of_a_source_while_it_is_silent(start):
    """Without a publisher, then all is well, then silent, then well again."""
    monitor = start(footprint__timeout=0.0, obstacle__timeout=1.5)

    def warned(words):
        health = monitor.health()
        return health and health.level == DiagnosticStatus.WARN and words in health.message

    def well():
        monitor.send_set('/obstacles', APART)
        monitor.spin(0.1)
        return monitor.health().level == DiagnosticStatus.OK
    monitor.until(lambda: warned('/obstacles has no publisher'), 'a warning')
    monitor.send('/footprint', ROBOT)
    monitor.until(well, 'health')
    assert monitor.health().message == 'running'
    monitor.until(lambda: warned('/obstacles has been silent'), 'a warning')
    monitor.until(well, 'health again')


def test_separation_follows_the_scene_and_is_never_stale(start):
    """Not a number, infinity with nothing around, a gap, a depth, and not a number again."""
    monitor = start(footprint__timeout=1.0, obstacle__timeout=60.0)
    heard = monitor.listen('~/footprint/separation')

    def until(value, what):
        def is_so():
            if not math.isnan(value):
                monitor.send('/footprint', ROBOT)
                monitor.spin(0.02)
            return heard and (heard[-1].data == value
                              or math.isnan(value) and math.isnan(heard[-1].data))
        monitor.until(is_so, what)
    until(math.nan, 'nothing known')
    monitor.send_set('/obstacles')
    until(math.inf, 'nothing around')
    monitor.send_set('/obstacles', APART)
    until(4.0, 'a gap')
    monitor.send_set('/obstacles', TOUCHING)
    until(-0.25, 'a depth')
    monitor.await_state('unknown')
    until(math.nan, 'a stale footprint')
    assert values(monitor.status())['least separation'] == ''


def test_separation_is_worked_out_only_for_who_subscribes(start, monkeypatch):
    """The nearest obstacle is not even looked for."""
    asked = []
    nearest = Scene.nearest
    monkeypatch.setattr(Scene, 'nearest', lambda *a, **b: asked.append(1) or nearest(*a, **b))
    monitor = start(**LASTING)
    monitor.send_set('/obstacles', APART)
    monitor.send('/footprint', ROBOT)
    monitor.until(lambda: monitor.flag() is False)
    monitor.until(monitor.health)
    assert not asked
    monitor.until(lambda: monitor.listen('~/footprint/separation') and asked)
