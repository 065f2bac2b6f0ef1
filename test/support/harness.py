# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A running node and a client that talks to it over DDS, each with a participant of its own."""

from contextlib import contextmanager
import threading
import time

from builders import box, polygon_message
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
from rcl_interfaces.msg import Log
import rclpy
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from sat_collision.node.footprint_monitor import FootprintMonitor
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool, Float64
from visualization_msgs.msg import MarkerArray

# The longest wait for anything, however busy the machine is, in s.
TIMEOUT = 60.0
# A participant that takes longer to match does not match at all, in s.
LONGEST_MATCH = 10.0
SECOND = 10**9
ROBOT = box(0, 0)
APART = box(5, 5)
TOUCHING = box(1, 1)
LASTING = {'footprint__timeout': 0.0, 'obstacle__timeout': 60.0}

_KINDS_BY_END = {'separation': Float64, 'time_to_collision': Float64, 'contacts': PointCloud2,
                 'path_contact_distance': Float64}
_KINDS = {'~/state': DiagnosticArray, '/diagnostics': DiagnosticArray, '~/markers': MarkerArray,
          '/rosout': Log}


def to_time(stamp):
    return Time(sec=stamp // SECOND, nanosec=stamp % SECOND)


def to_ns(time):
    return time.sec * SECOND + time.nanosec


def to_parameters(values):
    """Build parameters; two underscores in a name stand for the dot."""
    return [Parameter(name.replace('__', '.'), value=value) for name, value in values.items()]


class Peer:
    """A node that publishes to the monitor and keeps the messages received from it."""

    def __init__(self, domain, name='footprint_monitor', own_name='peer'):
        self._domain = domain
        self._own_name = own_name
        self.name = name
        self._publishers = {}
        self._received = {}
        self._last_stamps = {}
        self._join()

    def _join(self):
        self.context = rclpy.Context()
        self.context.init(domain_id=self._domain)
        self.node = rclpy.create_node(self._own_name, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.shutdown()

    def joined(self, create, count):
        """
        Return an endpoint once it counts one on the other side; `create` makes it.

        On a busy machine about one of a thousand participants never hears of the endpoints of
        another one in its process, whatever it creates (Fast DDS 2.14.5). So a peer that has no
        other endpoints yet leaves, and joins again.
        """
        endpoint = create()
        for _ in range(0 if self._publishers or self._received else 4):
            end = time.monotonic() + LONGEST_MATCH
            self.until(lambda: count(endpoint) or time.monotonic() > end)
            if count(endpoint):
                break
            Peer.close(self)
            self._join()
            endpoint = create()
        return endpoint

    def spin(self, seconds=0.0):
        """Receive what has arrived, for some time."""
        end = time.monotonic() + seconds
        self._executor.spin_once(timeout_sec=0.005)
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.005)

    def until(self, condition, what='what was awaited', timeout=TIMEOUT):
        """Spin until the condition holds and return its value; fail if it never does."""
        end = time.monotonic() + timeout
        while not (value := condition()):
            last = self._received.get(f'/{self.name}/state', [])[-1:]
            assert time.monotonic() < end, f'{what} did not happen; the last state is {last}'
            self.spin()
        return value

    def repeat(self, send, condition, what='what was awaited', timeout=TIMEOUT):
        """Call a function that sends again and again until a condition holds; return its value."""
        def sent():
            send()
            self.spin(0.03)
            return condition()
        return self.until(sent, what, timeout)

    def publisher(self, topic, kind=PolygonStamped, qos=100):
        """Return a publisher that the monitor has found."""
        if topic not in self._publishers:
            publisher = self._publishers[topic] = self.joined(
                lambda: self.node.create_publisher(kind, topic, qos),
                Publisher.get_subscription_count)
            self.until(lambda: publisher.get_subscription_count()
                       and self._matches_publisher(topic), f'a subscription to {topic}')
        return self._publishers[topic]

    def send(self, topic, points, stamp=None, frame_id='map', instance=None):
        """Publish a polygon, stamped about now by default."""
        if stamp is None:
            stamp = max(self.now(), self._last_stamps.get(topic, 0) + SECOND // 40)
            self._last_stamps[topic] = stamp
        message = polygon_message(points, stamp, frame_id, instance)
        self.publisher(topic, type(message)).publish(message)

    def send_set(self, topic, *polygons, stamp=None, **options):
        """Publish a whole set: polygons with one stamp, and an empty one that ends it."""
        for points in (*polygons, []):
            self.send(topic, points, stamp, **options)
            stamp = self._last_stamps[topic] if stamp is None else stamp

    def send_both(self, *polygons, stamp=None):
        """Publish the footprint and a set of obstacles."""
        self.send('footprint', ROBOT, stamp)
        self.send_set('obstacles', *polygons, stamp=stamp)

    def leave(self, topic):
        """Destroy our publisher of a topic."""
        self.node.destroy_publisher(self._publishers.pop(topic))

    def now(self):
        return self.node.get_clock().now().nanoseconds

    def listen(self, topic, qos=100):
        """Return the list that collects all messages on a topic from now on."""
        kind = _KINDS.get(topic) or _KINDS_BY_END.get(topic.rpartition('/')[2], Bool)
        topic = topic.replace('~', f'/{self.name}')
        if topic not in self._received:
            received = []
            subscription = self.joined(
                lambda: self.node.create_subscription(kind, topic, received.append, qos),
                Subscription.get_publisher_count)
            self._received[topic] = received
            self.until(lambda: subscription.get_publisher_count()
                       and self._matches_subscription(topic), f'a publisher of {topic}')
        return self._received[topic]

    def further(self, topic, count=4):
        """Wait for some more messages on a topic; return them."""
        received = self.listen(topic)
        before = len(received)
        self.until(lambda: len(received) >= before + count, f'messages on {topic}')
        return received[before:]

    def _matches_publisher(self, topic):
        """Tell whether the monitor has found our publisher."""
        return True

    def _matches_subscription(self, topic):
        """Tell whether the monitor has found our subscription."""
        return True

    def flag(self, footprint=None):
        """Return the last flag received, the common one or a footprint's, None if none."""
        received = self.listen(f'~/{footprint}/collision' if footprint else '~/collision')
        return received[-1].data if received else None

    def until_flags(self, raised, *footprints):
        """Wait until the common flag and those of footprints are raised or not."""
        self.until(lambda: all(self.flag(name) is raised
                               for name in (None, *(footprints or ['footprint']))),
                   f'flags {raised}')

    def status(self, footprint='footprint'):
        """Return the last status received of a footprint."""
        for array in reversed(self.listen('~/state')):
            for status in array.status:
                if status.name.endswith(f': {footprint}'):
                    return status
        return None

    def value(self, key, footprint='footprint'):
        """Return a value of a footprint's last status, empty before the first."""
        status = self.status(footprint)
        return values(status)[key] if status else ''

    def state(self, footprint='footprint'):
        """Return a footprint's state: clear, collision or unknown; empty before the first."""
        return self.value('state', footprint)

    def contacts(self, footprint='footprint'):
        """Return the names of the obstacles in contact."""
        listed = self.value('obstacles in contact', footprint)
        return listed.split(', ') if listed else []

    def reason(self, footprint='footprint'):
        """Return why a footprint's state is what it is; empty before the first."""
        return self.value('reason', footprint)

    def until_reason(self, *words, timeout=TIMEOUT):
        """Wait until the reason of the state has all these words."""
        self.until(lambda: all(word in self.reason() for word in words), f'a reason with {words}',
                   timeout)

    def states(self):
        """Return all states of the first footprint that were received, in order."""
        return [values(array.status[0])['state'] for array in self.listen('~/state')]

    def health(self):
        """Return the health that /diagnostics reported last, None before the first."""
        received = self.listen('/diagnostics')
        return received[-1].status[0] if received else None

    def diagnostic(self, name):
        """Return the last status of a name in /diagnostics, None before the first."""
        received = self.listen('/diagnostics')
        return next((status for array in reversed(received) for status in array.status
                     if status.name == name), None)

    def logged(self, *words):
        """Return the node's log lines with all these words, once there is one."""
        qos = QoSProfile(depth=1000, durability=rclpy.qos.DurabilityPolicy.TRANSIENT_LOCAL)
        received = self.listen('/rosout', qos)

        def lines():
            return [log.msg for log in received if all(word in log.msg for word in words)]
        return self.until(lines, f'a log line with {words}')

    def become(self, state, *polygons):
        """Send the footprint and a set, and wait for a state; return its status."""
        self.send_both(*polygons)
        return self.await_state(state)

    def send_until(self, state, topic, points, **options):
        """Publish a polygon repeatedly until the footprint is in a state."""
        self.repeat_until(state, lambda: self.send(topic, points, **options))

    def send_set_until(self, state, topic, *polygons, **options):
        """Publish a set repeatedly until the footprint is in a state."""
        self.repeat_until(state, lambda: self.send_set(topic, *polygons, **options))

    def repeat_until(self, state, send):
        """Call a function that sends again and again until the footprint is in a state."""
        self.repeat(send, lambda: self.state() == state, f'footprint {state}')

    def await_state(self, state, footprint='footprint', timeout=TIMEOUT):
        """Wait until the footprint's last state is the given one; return its status."""
        self.until(lambda: self.state(footprint) == state, f'{footprint} {state}', timeout)
        return self.status(footprint)

    def set_parameters(self, **parameters):
        """Set parameters by the node's service; return why each was refused, None if accepted."""
        client = AsyncParameterClient(self.node, self.name)
        self.until(client.services_are_ready, 'the parameter services')
        future = client.set_parameters(to_parameters(parameters))
        results = self.until(future.done, 'an answer') and future.result().results
        return [None if result.successful else result.reason for result in results]


def values(status):
    """Return a diagnostic status' values as a dictionary."""
    return {value.key: value.value for value in status.values}


def health(peer):
    """Return the values of the last /diagnostics by key, empty before the first."""
    status = peer.health()
    return values(status) if status else {}


class MonitorPeer(Peer):
    """A peer in the process of a monitor, which knows what the monitor has found."""

    def __init__(self, domain, arguments, parameters):
        self._monitor_context = rclpy.Context()
        self._monitor_context.init(args=['--ros-args', *arguments], domain_id=domain)
        # Most tests send sets that an empty polygon ends.
        ends = {f'{name}__set_end': 'empty_polygon'
                for name in parameters.get('obstacles', ['obstacle'])
                if '--params-file' not in arguments and f'{name}__type' not in parameters}
        self.monitor = FootprintMonitor(
            context=self._monitor_context,
            # On a busy machine the loop of a test may stall for longer than a watchdog allows.
            parameter_overrides=to_parameters({'watchdog': 0.0, **ends, **parameters}))
        super().__init__(domain)

    def close(self):
        self.monitor.destroy_node()
        self._monitor_context.shutdown()
        super().close()

    def _matches_publisher(self, topic):
        topic = self.node.resolve_topic_name(topic)
        return any(subscription.topic_name == topic and subscription.get_publisher_count()
                   for subscription in self.monitor.subscriptions)

    def _matches_subscription(self, topic):
        return all(publisher.topic_name != topic or publisher.get_subscription_count()
                   for publisher in self.monitor.publishers)


class RunningMonitor(MonitorPeer):
    """A monitor that runs in its own thread, seen from a peer."""

    def __init__(self, domain, arguments, parameters):
        super().__init__(domain, arguments, parameters)
        self._clock = 0
        self._stop = threading.Event()
        self._error = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def set_clock(self, stamp, at_once=False):
        """
        Publish /clock, in ns, until the monitor's clock reads it.

        It goes on to times of the next minute in small steps, to others `at_once`.
        """
        publisher = self.publisher('/clock', Clock)

        def reads(time):
            publisher.publish(Clock(clock=to_time(time)))
            self.spin()
            return self.monitor.get_clock().now().nanoseconds == time
        while not at_once and self._clock < stamp - SECOND // 2 < self._clock + 60 * SECOND:
            self._clock += SECOND // 2
            self.until(lambda: reads(self._clock), 'a clock')
        self._clock = stamp
        self.until(lambda: reads(stamp), 'a clock')

    def _matches_publisher(self, topic):
        """Tell whether the monitor has found our publisher, if it is to."""
        topic = self.node.resolve_topic_name(topic)
        if topic == '/clock' and not (self.monitor.count_publishers(topic) and
                                      'publisher' not in self.monitor._scene._clock_fault):
            return False
        publishers = self.monitor._inputs.publishers
        try:
            return super()._matches_publisher(topic) and all(
                publishers[one.name].reported for one in self.monitor._inputs.inputs
                if one.subscription.topic_name == topic)
        except InvalidHandle:
            # The node is creating the subscription again.
            return False

    @property
    def received(self):
        """Number of messages received by the node, by name."""
        return self.monitor._monitor.received

    def _run(self):
        try:
            self.monitor.loop.run(self._stop.is_set)
        except Exception as error:
            self._error = error

    def until(self, condition, what='what was awaited', timeout=TIMEOUT):
        return super().until(lambda: self._check() or condition(), what, timeout)

    def _check(self):
        if self._error:
            raise self._error

    def close(self):
        self._stop.set()
        self._thread.join()
        super().close()
        self._check()


def lines_until(process, words):
    """Return the lines that a process writes up to one with some words."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if words in line:
            return lines
    raise AssertionError(f'the process ended without a word of {words}: {lines}')


@contextmanager
def streaming(domain, topic, rate, points=APART):
    """Publish a polygon repeatedly from a thread, at a rate in Hz."""
    stop = threading.Event()
    peer = Peer(domain)

    def stream():
        due = time.monotonic()
        while not stop.wait(max(due - time.monotonic(), 0.0)):
            peer.send(topic, points, stamp=0)
            # A busy machine catches up, but by no more than this.
            due = max(due + 1 / rate, time.monotonic() - 0.5)

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        peer.close()
