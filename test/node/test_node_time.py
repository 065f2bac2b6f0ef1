# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A node with simulated time, and its ticks."""

from functools import partial
import itertools
import time
from types import SimpleNamespace

from builders import serialised
from harness import APART, health, LASTING, SECOND, to_parameters, to_time, TOUCHING
import pytest
import rclpy
from rosgraph_msgs.msg import Clock
from sat_collision.node.footprint_monitor import FootprintMonitor
from sat_collision.scene.streams import Endpoint

HOUR = 3600 * SECOND


def begin(monitor, obstacle, state):
    """Let the simulated time begin, and the monitor be in a state by an obstacle."""
    monitor.set_clock(HOUR)
    monitor.send_both(obstacle, stamp=HOUR)
    monitor.await_state(state)


def test_ages_count_in_simulated_time(start):
    """All is unknown before it begins; while it stands still, messages stay fresh."""
    monitor = start(use_sim_time=True)
    monitor.send_both(APART, stamp=HOUR)
    monitor.until(lambda: monitor.received.total() == 3)
    monitor.await_state('unknown')
    assert 'clock' in monitor.reason()
    monitor.until_flags(True)
    monitor.further('~/state')
    begin(monitor, APART, 'clear')
    monitor.further('~/collision', 14)
    assert monitor.state() == 'clear', 'the clock stands still'
    monitor.set_clock(HOUR + 3 * SECOND // 2)
    monitor.await_state('unknown')
    assert monitor.value('age') == '1.500'


def test_clock_before_1970_is_refused(start):
    """It ended the node, because rclpy has no such time."""
    monitor = start(use_sim_time=True)
    monitor.set_clock(HOUR)
    monitor.publisher('/clock', Clock).publish(Clock(clock=to_time(-SECOND)))
    assert monitor.logged('/clock', 'refused')
    monitor.send_both(APART, stamp=HOUR)
    monitor.await_state('clear')


def test_stopped_clock_is_unknown(start):
    """The simulation hangs: ages no longer grow."""
    monitor = start(use_sim_time=True, clock_timeout=0.5)
    monitor.set_clock(HOUR)
    monitor.send_both(APART, stamp=HOUR)
    monitor.until_reason('stands still')
    assert monitor.state() == 'unknown'
    stamps = itertools.count(HOUR + SECOND // 100, SECOND // 100)
    monitor.until(lambda: monitor.set_clock(next(stamps)) or monitor.state() == 'clear')


def test_clock_without_a_publisher_is_unknown(start):
    """The simulator has ended: time may go on without it."""
    monitor = start(use_sim_time=True, clock_timeout=0.0, **LASTING)
    begin(monitor, APART, 'clear')
    monitor.leave('/clock')
    monitor.until_reason('/clock has no publisher')
    assert monitor.state() == 'unknown'
    monitor.set_clock(HOUR)
    monitor.await_state('clear')


@pytest.mark.parametrize('step', [-60, 3], ids=['back', 'ahead'])
def test_clock_that_steps_drops_everything(start, step):
    """A recording starts again, or its player skips a part; log and health tell it."""
    monitor = start(use_sim_time=True, footprint__timeout=0.0, obstacle__timeout=2.0,
                    future_tolerance=0.6)
    begin(monitor, TOUCHING, 'collision')
    later = HOUR + step * SECOND
    monitor.set_clock(later, at_once=True)
    monitor.await_state('unknown')
    assert monitor.value('age') == ''
    monitor.logged('clock was set by more than future_tolerance')
    monitor.until(lambda: health(monitor).get('the clock: steps beyond future_tolerance') == '1')
    # What was told before counts for one timeout more.
    for tenths, state in ((1, 'collision'), (10, 'collision'), (19, 'collision'), (21, 'clear')):
        monitor.set_clock(later + tenths * SECOND // 10)
        monitor.send_both(APART, stamp=later + tenths * SECOND // 10)
        monitor.await_state(state)


def test_clock_that_comes_once_in_future_tolerance_is_not_set(start):
    """By one ns more it is; the log says what to do if it only comes seldom."""
    monitor = start(use_sim_time=True, **LASTING)
    assert monitor.set_parameters(future_tolerance=0.5) == [None]
    begin(monitor, APART, 'clear')
    half = SECOND // 2
    for later, wanted in ((HOUR + half, ('clear', '0.500')), (HOUR, ('clear', '0.000')),
                          (HOUR + half + 1, ('unknown', ''))):
        monitor.set_clock(later, at_once=True)
        monitor.until(lambda: (monitor.state(), monitor.value('age')) == wanted, wanted)
    monitor.logged('if /clock only comes that seldom, raise future_tolerance')


def test_step_of_the_system_clock_begins_anew(start, monkeypatch):
    """It was set by 5 s, as by NTP at the start of a robot without a battery for its clock."""
    offset = 0
    time_ns = time.time_ns
    monkeypatch.setattr('sat_collision.node.footprint_monitor.time', SimpleNamespace(
        **{**vars(time), 'time_ns': lambda: time_ns() + offset}))
    monitor = start(future_tolerance=4.0, **LASTING)
    monitor.become('clear', APART)
    offset = 5 * SECOND
    monitor.await_state('unknown')
    monitor.until_reason('since the clock was set')
    for _ in range(2):
        monitor.send_both(APART, stamp=time_ns() + offset)
    monitor.await_state('clear')


def test_simulated_time_can_be_switched_on_and_off(start):
    """Each switch drops what was received by the other clock."""
    monitor = start()
    monitor.repeat_until('clear', lambda: monitor.send_both(APART))
    assert monitor.set_parameters(use_sim_time=True) == [None]
    monitor.until_reason('no clock yet')
    begin(monitor, TOUCHING, 'collision')
    assert monitor.set_parameters(use_sim_time=False) == [None]
    monitor.await_state('unknown')
    monitor.repeat_until('clear', lambda: monitor.send_both(APART, stamp=monitor.now()))


def test_recording_played_without_simulated_time(start):
    """State, log and health name the parameter to set."""
    monitor = start(footprint__timeout=1.0)
    monitor.send_both(APART, stamp=monitor.now() - 365 * 24 * HOUR)
    monitor.logged('/obstacles was rejected, too old', 'set use_sim_time: true')
    monitor.until(lambda: monitor.reason().count('set use_sim_time: true') == 2, 'a reason')
    clock = monitor.node.create_publisher(Clock, '/clock', 1)
    monitor.until(monitor.health)
    monitor.until(lambda: '/clock is published' in monitor.health().message, 'a warning')
    monitor.node.destroy_publisher(clock)
    monitor.until(lambda: '/clock is published' not in monitor.health().message, 'no warning')


def test_tick_is_due_at_the_next_deadline(domain):
    """As when a source falls silent; not later, and not at once."""
    context = rclpy.Context()
    context.init(domain_id=domain)
    node = FootprintMonitor(context=context, parameter_overrides=to_parameters(
        {'watchdog': 0.0, 'obstacle.timeout': 0.1, 'obstacle.set_end': 'each_message'}))
    steady = time.monotonic()
    now = node.present(steady)
    node.tick(now)
    node._monitor.update_publishers('obstacle', [Endpoint('its gid', '/mapper')])
    # However long it took here.
    ticked = node._tick_ended = node._ticked
    assert node.due(now, steady) == ticked + 0.1, 'nothing changes by itself'
    node.receive('obstacle', [serialised(APART, now)], now, 1, now)
    about = partial(pytest.approx, rel=0.0, abs=1e-6)
    # As if some time had passed by both clocks.
    late = ticked + 0.03
    assert node.due(now + SECOND // 20, late) == about(late + 0.05)
    assert node.due(now + SECOND // 10, late) == about(late)
    assert node.due(now + SECOND, late) == about(ticked + 0.02), 'no more often than that'
    node._tick_ended = ticked + 0.03
    assert node.due(now + SECOND, late) == about(ticked + 0.06), 'as long again as the last took'
    node._ticked = node._tick_ended = ticked + 0.08
    assert node.due(now - SECOND, late) == about(ticked + 0.1), 'flags are due, whatever ticked'
    node.destroy_node()
    context.shutdown()
