# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The node: topics and parameters around a Monitor, and its process until a signal ends it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
import gc
import os
import sys
import time
from typing import Any

import rclpy
from rclpy.clock import JumpThreshold, TimeJump
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import QoSSubscriptionMatchedInfo
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.logging import (
    get_logger, get_logger_effective_level, get_logger_level, LoggingSeverity, set_logger_level)
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSLivelinessPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier
from sat_collision.extras import in_one_line
from sat_collision.geometry.body.polygon import max_in_time
from sat_collision.geometry.compiled.compilation import kernel_problem
from sat_collision.geometry.compiled.jit import KERNEL
from sat_collision.geometry.preparation import Preparation
from sat_collision.messages.cdr import stamped
from sat_collision.messages.outputs import Outputs
from sat_collision.messages.rejections import Rejection
from sat_collision.messages.transform_listener import TRANSFORM_TOPICS
from sat_collision.monitor import Monitor
from sat_collision.node.health import Health
from sat_collision.node.loop import Loop, PublisherEvent
from sat_collision.node.parameters import Parameters
from sat_collision.node.publishers import faults_of
from sat_collision.node.signals import Signalled
from sat_collision.node.subscriptions import (
    LateSubscriptions, subscribe_transforms, Subscriptions, transform_type)
from sat_collision.node.watchdog import ClockWatch, Every, Systemd, Watchdog
from sat_collision.scene.parameters import is_name_of, ParameterError, parameters_by_node
from sat_collision.scene.settings import NEVER, POLYGON, Settings, TF
import yaml

NAME = 'footprint_monitor'

# QoS offered to subscribers of flags, in s: a flag arrives within each deadline; without one, the
# monitor counts as dead once the lease expires.
_DEADLINE = 0.3
_LEASE = 0.5

# Max period of ticks in s, and so the max delay of what is due by time alone. Waking the process
# costs far more than the work of a tick.
_TICK = 0.1
_HEALTH_PERIOD = 1.0
_LOG_PERIOD = 1.0
# Start-up time in s, after which what is still unknown is logged: with a tick, within 2 s.
_STARTED = 1.8
# On what, and in which type, `sat_collision.demo.publish` publishes.
_TRIED = [('/footprint', POLYGON), ('/obstacles', POLYGON)]
# Max time in s for which predictions, paths and figures hold up messages, beyond one footprint's.
_LONGEST_PART = 1e-3
# Min ticks in the time after which the watchdog reports a stall.
_TICKS_IN_TIME = 3.0
_SHORTEST_TICK = 0.02


def flag_qos() -> QoSProfile:
    """Return the QoS of the publishers of flags: with a deadline and a liveliness lease."""
    return QoSProfile(
        depth=10, deadline=Duration(seconds=_DEADLINE),
        liveliness=QoSLivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(seconds=_LEASE))


class _Publisher(Publisher):
    """A publisher that reports its failures instead of raising them."""

    def __init__(self, report: Callable[[str, Exception], None], *args: Any, **options: Any
                 ) -> None:
        super().__init__(*args, **options)
        self._report = report

    def publish(self, message: Any) -> None:
        try:
            super().publish(message)
        except _rclpy.RCLError as error:
            self._report(self.topic_name, error)


class FootprintMonitor(Node):
    """
    Publishes whether footprints collide with obstacles.

    Everything happens in one thread, that of the loop whose `Receiver` it is: messages are checked
    in batches, changes are published once per batch, and a tick by the steady clock does whatever
    is due by time alone.
    Options are those of `rclpy.node.Node`. Invalid initial parameters raise a ParameterError.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NAME, **options)
        parameters = Parameters(self)
        settings = parameters.settings
        self._preparation = Preparation(self.get_logger().info, self.get_logger().warning)
        self._prepare(settings)
        self._clock_topic = self.resolve_topic_name('/clock')
        self._clock_watch = ClockWatch()
        self._is_clock_set = False
        self._choose_clock()
        self._watch_jumps(settings.future_tolerance)
        transforms = transform_type(self, settings)
        self._monitor = Monitor(settings, transforms is not None,
                                max_non_convex=max_in_time(settings.max_vertices))
        self._scene = self._monitor.scene
        middleware = get_rmw_implementation_identifier()
        self._scene.use_middleware(middleware)
        self._outputs = Outputs(self, settings, self._scene, flag_qos(),
                                self._preparation.is_complete())
        self._health = Health(self, {'kernel': KERNEL, 'middleware': middleware,
                                     'problem of kernels': kernel_problem() or 'none'},
                              parameters.changes)
        self._logged: dict[tuple[str, str], float] = {}
        self._inputs = Subscriptions(self, settings, self._health, self.note_event)
        self._transform_inputs = subscribe_transforms(self, transforms) if transforms else []
        self._reports_unknown_at = time.monotonic() + _STARTED
        self._advised: set[str] = set()
        self._now = 0
        self._ticked = self._tick_ended = self._draws_at = 0.0
        # What messages come before: what is left of it, and what is to be done after that.
        self._parts: Iterator[None] = iter(())
        self._looks_ahead = self._checks_paths = False
        self._figures_due: set[str] = set()
        # The footprints that a message has come for since they were last looked ahead.
        self._looks_first: set[str] = set()
        self._looking = Every(_TICK)
        self._reporting = Every(_HEALTH_PERIOD)
        self._systemd = Systemd()
        self._watchdog = Watchdog(self._on_stall, self._on_recovery)
        self._is_stalled = False
        self._set_rates(settings)
        inputs = [*self._transform_inputs, *self._inputs.inputs]
        self._late_inputs = LateSubscriptions(self, settings, inputs)
        self.loop = Loop(self, inputs, self, lambda: self._scene.settings.max_batch_delay)
        parameters.on_change(self._configure)

    def create_publisher(self, *args: Any, **options: Any) -> Any:
        """Create a publisher whose failures are logged and counted, and do not end the node."""
        return super().create_publisher(
            *args, publisher_class=partial(_Publisher, self._note_unpublished), **options)

    def _note_unpublished(self, topic: str, error: Exception) -> None:
        self._health.count_event(topic, 'not published', 1)
        self.get_logger().error(f'{topic}: {in_one_line(error)}',
                                throttle_duration_sec=_LOG_PERIOD)

    def _set_rates(self, settings: Settings) -> None:
        self._publishing = Every(1.0 / settings.publish_rate)
        self._marking = Every(1.0 / settings.marker_rate)
        self._tick_period = min(_TICK, 1.0 / settings.publish_rate, 1.0 / settings.marker_rate,
                                (settings.watchdog or 1.0) / _TICKS_IN_TIME)
        self._watchdog.use(settings.watchdog)

    def _prepare(self, settings: Settings) -> None:
        """Wait for the kernels that measure distances if flags depend on distances."""
        if settings.margin or any(one.min_time_to_collision for one in settings.footprints):
            self._preparation.complete()

    def _configure(self, settings: Settings) -> None:
        """Apply changed parameters and publish what follows from them."""
        self._prepare(settings)
        self._set_rates(settings)
        self._jumps.unregister()
        self._watch_jumps(settings.future_tolerance)
        self._log(self._monitor.update(settings))
        self._inputs.configure(settings)
        self._outputs.configure(settings)
        self._looks_ahead = True
        self._publish_all()

    def _watch_jumps(self, tolerance: float) -> None:
        """Notice where the simulated clock steps by more than a tolerance in s, or begins."""
        self._tolerance = tolerance
        least = round(tolerance * 1e9) + 1
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=Duration(nanoseconds=least),
                          min_backward=Duration(nanoseconds=-least), on_clock_change=True),
            post_callback=self._on_jump)

    def _on_jump(self, jump: TimeJump) -> None:
        self._choose_clock()
        self._is_clock_set = True

    def _choose_clock(self) -> None:
        """Set whether time is read from the system clock or from a simulated one."""
        self._is_simulated = self.get_clock().ros_time_is_active

    def present(self, steady: float) -> int:
        """Return the present time in ns; if the clock was set, begin anew."""
        is_set, self._is_clock_set = self._is_clock_set, False
        if self._is_simulated:
            now = int(self.get_clock().now().nanoseconds)
        else:
            now = time.time_ns()
            is_set |= self._clock_watch.steps(now, steady, self._tolerance)
        if is_set and self._monitor.set_clock(now):
            self._health.count_event('the clock', 'steps beyond future_tolerance', 1)
            advice = ('; if /clock only comes that seldom, raise future_tolerance above its step, '
                      'or the rate of /clock') if self._is_simulated else ''
            self.get_logger().warning(
                f'the clock was set by more than future_tolerance, {self._tolerance:g} s: all '
                f'begins anew{advice}', throttle_duration_sec=_LOG_PERIOD)
            self._publish_changes()
        return now

    def receive(self, name: str, messages: Sequence[bytes], now: int, number: int | None,
                arrived: int) -> None:
        if name in TRANSFORM_TOPICS:
            for k, data in enumerate(messages):
                self._log(self._monitor.receive_transforms(
                    name, data, now, number and number + k, arrived))
            return
        # Commands have the name of their footprint before a dot.
        if (footprint := name.partition('.')[0]) in self._scene.looking_ahead:
            self._looks_first.add(footprint)
        if self._late_inputs.are_without_stamps(name):
            messages = [stamped(data) for data in messages]
        if rejections := self._monitor.receive_batch(name, messages, now, number, arrived):
            self._log(rejections)

    def begin_stream(self, name: str) -> None:
        one = self._inputs.publishers.get(name)
        if one and (endpoints := one.at_beginning()) is not None:
            self._monitor.update_publishers(name, endpoints)

    def change_publisher(self, name: str) -> None:
        self._monitor.interrupt(name)

    def note_event(self, name: str, event: PublisherEvent) -> bool:
        publishers = self._inputs.publishers[name]
        is_new = False
        if isinstance(event, QoSSubscriptionMatchedInfo):
            if event.total_count_change or event.current_count_change:
                publishers.note_matched(event)
                is_new = event.total_count_change != 0
        elif event.not_alive_count_change or event.alive_count_change:
            change = event.not_alive_count_change
            publishers.note_liveliness(event.not_alive_count, change)
            topic = self._scene.settings_of(name).topic
            self._health.count_event(topic, 'liveliness lost', max(change, 0))
            is_new = change < 0
        if is_new:
            self.begin_stream(name)
            self._monitor.interrupt(name)
        return is_new

    def receive_mixed(self, name: str, messages: Sequence[bytes], now: int,
                      arrived: int) -> None:
        self._log(self._monitor.receive_mixed(name, messages, now, arrived))

    def advance(self, now: int) -> None:
        self._log(self._monitor.advance(now))

    def end_batch(self, messages: int, seconds: float) -> None:
        self._publish_changes()
        self._looks_ahead = True
        self._outputs.markers_current = False
        self._health.count_batch(messages, seconds)

    def due(self, now: int, steady: float) -> float:
        until = (self._monitor.deadline - now) / 1e9
        change = min(steady + until, self._publishing.next)
        due = min(max(change, self._ticked + _SHORTEST_TICK), self._ticked + self._tick_period)
        # Ticks that take long leave time between them, for what comes after flags, too.
        taken = self._tick_ended - self._ticked
        return max(due, self._tick_ended + min(taken, self._tick_period / 2.0))

    def tick(self, now: int) -> None:
        self._ticked = steady = time.monotonic()
        self._systemd.turned()
        goes_on = self._watchdog.turned()
        if goes_on:
            # `now` may have been read before the stall.
            now = self.present(time.monotonic())
        if self._looking.due(steady) or goes_on:
            self._look_around(now, steady)
        if self._monitor.deadline < now:
            self._outputs.markers_current = False
        self._log(self._monitor.advance(now))
        self._publish_changes()
        self._looks_ahead = True
        if self._publishing.due(steady) or goes_on:
            self._publish_all()
            self._checks_paths = True
        if self._marking.due(steady):
            self._publish_markers()
        if self._reporting.due(steady):
            faults = [fault for one in self._transform_inputs for fault in faults_of(self, one)]
            self._health.publish(self._monitor, self.loop.backlogs, self._outputs.statuses(),
                                 faults)
            topic = self.resolve_topic_name(TF)
            if self._transform_inputs and not self.count_publishers(topic):
                faults.append(f'{topic} has no publisher: start what publishes the transforms')
            self._scene.note_transforms(tuple(faults))
            for name, source in self._scene.sources.items():
                if source.knowledge.is_known and source.advice and name not in self._advised:
                    self._advised.add(name)
                    self.get_logger().info(source.advice)
        self._tick_ended = time.monotonic()

    def _publish_markers(self) -> None:
        """Publish the markers; drawing them takes no more than a tenth of the time."""
        begun = time.monotonic()
        draws = begun >= self._draws_at
        self._outputs.publish_markers(draws)
        if draws:
            self._draws_at = begun + 10.0 * (time.monotonic() - begun)

    def _look_around(self, now: int, steady: float) -> None:
        """Poll what gives no event: publishers, clock, middleware, kernels being compiled."""
        for name, publishers in self._inputs.publishers.items():
            if (endpoints := publishers.news(name in self.loop.backlogs)) is not None:
                self._monitor.update_publishers(name, endpoints)
        for name, fault in self._late_inputs.follow():
            if name in self._monitor.paths.names:
                self._monitor.paths.note_fault(name, fault)
            else:
                self._scene.note_command_fault(name.partition('.')[0], fault)
        for one in self._inputs.inputs:
            if self._inputs.renew(one, self._scene.wants_history(one.name)):
                self._monitor.renew(one.name)
        if steady >= self._reports_unknown_at:
            self._report_unknown()
        self._scene.stop_clock(self._clock_fault(now, steady) if self._is_simulated else '')
        if not self._outputs.measures and self._preparation.is_complete():
            self._outputs.measures = True

    def _clock_fault(self, now: int, steady: float) -> str:
        """Return why simulated time cannot be trusted, empty if it can."""
        if not self.handle.get_count_publishers(self._clock_topic):
            return f'{self._clock_topic} has no publisher, and use_sim_time is true'
        if now and self._clock_watch.stands(now, steady, self._scene.settings.clock_timeout):
            return (f'the clock stands still: {self._clock_topic} tells the same time, or comes '
                    'no more')
        return ''

    def destroy_node(self) -> None:
        """Stop the watchdog, notify systemd and destroy the node."""
        self._watchdog.close()
        self._systemd.ends()
        super().destroy_node()

    def _on_stall(self, stalled: float) -> None:
        """Publish that everything is unknown; called from the watchdog's thread."""
        reason = f'the monitor has been stalled for {stalled:.1f} s'
        self._health.publish_stall(reason, self._outputs.publish_unknown(reason))
        if not self._is_stalled:
            self._is_stalled = True
            self.get_logger().error(f'{reason}: all flags are raised until it goes on')

    def raise_flags(self) -> None:
        """Publish that everything is unknown, as the last thing."""
        self._outputs.publish_unknown('the monitor has ended by an error')

    def _on_recovery(self, stalled: float) -> None:
        """Log the end of a stall; the tick publishes the current states next."""
        self._is_stalled = False
        # What is left of these is as old as the stall.
        self._parts = iter(())
        self._health.count_stall(stalled)
        self.get_logger().error(f'the monitor goes on after a stall of {stalled:.1f} s')

    def _report_unknown(self) -> None:
        """Log once, after the start-up time, what is still unknown, why, and what to try."""
        self._reports_unknown_at = NEVER
        reasons = {reason for footprint in self._scene.settings.footprints
                   if footprint.enabled for reason in self._scene.unknown_reasons(footprint.name)}
        for reason in sorted(reasons):
            self.get_logger().warning(f'unknown since the start: {reason}')
        for name, fault in self._late_inputs.faults.items():
            if fault:
                self.get_logger().warning(f'{name}: {fault}')
        inputs = self._scene.settings.inputs
        if ([(one.topic, one.type) for one in inputs] == _TRIED and not any(
                self.count_publishers(topic) for topic, _ in _TRIED)):
            self.get_logger().info('nothing is published yet; to try the node, publish a robot '
                                   f'and a post: {sys.executable} -m sat_collision.demo.publish')

    def _log(self, rejections: Iterable[Rejection]) -> None:
        """Log rejected messages, once a second at most for each source and reason."""
        for rejection in rejections:
            key = rejection.name, rejection.reason
            now = time.monotonic()
            if now - self._logged.get(key, -_LOG_PERIOD) >= _LOG_PERIOD:
                self._logged[key] = now
                self.get_logger().warning(rejection.text)

    def go_on(self, now: int) -> bool:
        """Look ahead, check paths and publish figures, for a short time; return if more is due."""
        self._now = now
        until = time.monotonic() + _LONGEST_PART
        while True:
            if self._looks_first:
                self._look_ahead(self._looks_first.pop())
            elif next(self._parts, self) is self:
                if not (self._looks_ahead or self._checks_paths or self._figures_due):
                    return False
                self._parts = self._next_parts()
            if time.monotonic() >= until:
                return True

    def _next_parts(self) -> Iterator[None]:
        """Look ahead, check paths and publish figures, each as far as due, by footprints."""
        if self._looks_ahead:
            self._looks_ahead = False
            for name in self._scene.looking_ahead:
                self._look_ahead(name)
                yield
        if self._checks_paths:
            self._checks_paths = False
            for footprint in self._scene.settings.footprints:
                if footprint.path:
                    self._log(self._monitor.paths.check(
                        self._now, [footprint], self._outputs.measures))
                    self._outputs.publish_path(footprint.name)
                    yield
        if self._figures_due:
            due, self._figures_due = self._figures_due, set()
            yield from self._outputs.publish_figures(due)

    def _look_ahead(self, name: str) -> None:
        if name in self._scene.looking_ahead:  # parameters may have changed
            self._scene.look_ahead(name)
            self._publish_changes()

    def _publish_all(self) -> None:
        """Publish all flags at once, and all figures after what messages are there."""
        # What came before may have taken long, and nothing is known any more.
        self._log(self._monitor.advance(self.present(time.monotonic())))
        self._publish_changes()
        self._outputs.publish_flags()
        self._outputs.find_subscribers()
        self._figures_due.update(one.name for one in self._scene.settings.footprints)

    def _publish_changes(self) -> None:
        """Publish the flags that have changed at once, and figures after further messages."""
        changed, brief = self._scene.take_changes()
        if changed or brief:
            self._outputs.update(changed)
            self._outputs.publish_rise(brief)
            self._outputs.publish_flags({*brief, *changed})
            self._figures_due.update(brief, changed)


def run(args: Sequence[str]) -> int:
    """Run the node with ROS arguments until a signal ends it; return the exit status."""
    try:
        context = _begin_ros(args)
    except RuntimeError as error:  # raised by rcl for an unreadable parameter file, too
        what = 'unknown arguments ' if isinstance(error, _rclpy.UnknownROSArgsError) else ''
        print(f'{NAME}: cannot start: {what}{in_one_line(error)}', file=sys.stderr)
        return 1
    # At debug rcl logs each take.
    if get_logger_level('rcl') is LoggingSeverity.UNSET:
        set_logger_level('rcl', max(LoggingSeverity.INFO, get_logger_effective_level('rcl')))
    try:
        node = FootprintMonitor(context=context)
    except (ParameterError, ParameterException, NameValidationException) as error:
        get_logger(NAME).fatal(in_one_line(error))
        rclpy.shutdown(context=context)
        return 1
    for words in unused_files(args, node.get_fully_qualified_name()):
        node.get_logger().warning(words)
    # Exempt the objects made so far from later garbage collections, each of some 70 ms.
    gc.freeze()
    try:
        node.loop.run(Signalled())
    except Exception:
        node.raise_flags()
        raise
    node.get_logger().info('stopped by a signal')
    node.destroy_node()
    rclpy.shutdown(context=context)
    return 0


def _begin_ros(args: Sequence[str]) -> Context:
    """Initialise ROS, without a log file if none can be written."""
    def begin(*more: str) -> Context:
        context = Context()
        rclpy.init(args=['--ros-args', *args, *more], context=context,
                   signal_handler_options=SignalHandlerOptions.NO)
        return context
    try:
        return begin()
    except RuntimeError as error:
        if 'failed to initialize logging' not in str(error):
            raise
        print(f'{NAME}: the log goes to this stream only, not to a file: {in_one_line(error)}',
              file=sys.stderr)
        return begin('--disable-external-lib-logs')


def unused_files(ros: Sequence[str], node: str) -> Iterator[str]:
    """
    Yield a warning for each parameter file that has no parameters for a node.

    `ros` has the ROS arguments, `node` is the full name of the node.
    """
    for option, path in zip(ros, ros[1:]):
        if option != '--params-file' or not os.path.isfile(path):  # a pipe can be read only once
            continue
        # Values may be of any kind, as rcl has read them already.
        with open(path, 'rb') as file:
            names = [name for content in yaml.load_all(file, yaml.BaseLoader)
                     for name, _ in parameters_by_node(content)]
        if not any(is_name_of(name, node) for name in names):
            only = f', only for {", ".join(names)}' if names else ''
            yield (f'{path} has no parameters for {node}{only}: call it /** there, which is any '
                   'node')
