# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Publishers in their own processes, which can be killed and stopped at any moment.

A process runs one of the functions below, which gets a `Topic`. Each publishes an obstacle or a
robot that is in contact while `Topic.touching` is set.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import contextlib
import math
import multiprocessing
import os
import signal
import time
from typing import Any, NamedTuple

from builders import box, collection, odometry, serialised, transforms
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
import rclpy
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock

SECOND = 10**9
ROBOT = box(0, 0)
TOUCHING = box(0.5, 0.5)
APART = box(5, 5)
LEASE = 0.5

# The fork server has no threads of ROS, and has imported what takes long.
_PROCESSES = multiprocessing.get_context('forkserver')
_PROCESSES.set_forkserver_preload(['rclpy', 'nav_msgs.msg', 'numpy'])

RELIABLE = {'depth': 10_000}
BEST_EFFORT = {'depth': 10, 'reliability': ReliabilityPolicy.BEST_EFFORT}
LATCHED = {'depth': 100, 'durability': DurabilityPolicy.TRANSIENT_LOCAL}
ALIVE = {'depth': 10, 'liveliness': LivelinessPolicy.AUTOMATIC, 'liveliness_lease_duration': LEASE}
IN_TIME = {'depth': 10, 'deadline': 0.05}


def profile(qos: dict[str, Any]) -> QoSProfile:
    """Return a profile of a dictionary, whose durations are in seconds."""
    return QoSProfile(**{name: Duration(seconds=value) if isinstance(value, float) else value
                         for name, value in qos.items()})


class World:
    """What all processes see, without locks: a process may be killed while it holds one."""

    def __init__(self) -> None:
        # Whether the robot and the obstacle are in contact in truth.
        self.touching = _PROCESSES.RawValue('b', 1)
        # By how many ns the simulated clock is ahead of the machine's.
        self.offset = _PROCESSES.RawValue('q', 0)


class Shared(NamedTuple):
    """What a publisher's process and who started it tell each other."""

    world: World
    ended: Any
    sent: Any


class Topic:
    """One publisher, in the process that does one of the functions below."""

    def __init__(self, node: rclpy.node.Node, name: str, kind: type, qos: dict[str, Any],
                 shared: Shared) -> None:
        self.node = node
        self._world, self._ended, self._sent = shared
        self.publisher = node.create_publisher(kind, name, profile(qos))
        self._with_ids = kind is PolygonInstanceStamped
        # The set that is gathered, where all of it goes into one message.
        self._gathered = [] if kind.__name__ == 'Polygon2DCollection' else None

    @property
    def touching(self) -> bool:
        return bool(self._world.touching.value)

    @property
    def obstacle(self) -> list[tuple[float, float]]:
        """The polygon of the obstacle that touches or not."""
        return TOUCHING if self.touching else APART

    def now(self) -> int:
        return time.time_ns() + self._world.offset.value

    def is_over(self) -> bool:
        """Tell whether the process has been asked to end."""
        return bool(self._ended.value)

    def send(self, points: Sequence[tuple[float, ...]], stamp: int | None = None,
             instance: int = 0, frame_id: str = 'map', length: int | None = None) -> None:
        """Publish a polygon, stamped now by default, or only some first bytes of it."""
        if self._gathered is not None:
            self._gathered.append(points)
            return
        data = serialised(points, self.now() if stamp is None else stamp, frame_id,
                          instance if self._with_ids else None)
        self.publish(data[:length])

    def publish(self, data: bytes) -> None:
        """Publish the bytes of a message."""
        self.publisher.publish(data)
        self._sent.value += 1

    def end(self, stamp: int) -> None:
        """End the set of a stamp."""
        if self._gathered is None:
            self.send((), stamp)
        else:
            self.publish(collection(self._gathered, stamp))
            self._gathered.clear()

    def every(self, period: float, seconds: float = math.inf) -> Iterator[int]:
        """Yield the time in ns once per period, for some seconds or until the process ends."""
        begun = time.monotonic()
        k = 0
        while not self.is_over() and k * period < seconds:
            yield self.now()
            # Periods missed while the process was stopped are skipped.
            k = max(k + 1, math.floor((time.monotonic() - begun) / period))
            time.sleep(max(begun + k * period - time.monotonic(), 0.0))

    def until_subscribed(self) -> None:
        """Wait for a subscription."""
        for _ in self.every(0.002):
            if self.publisher.get_subscription_count():
                return


class Publisher:
    """
    A process that publishes until it is ended or killed, from when somebody subscribes.

    The script is one of the functions below, and takes the options; `kind` is the type of
    messages, and `qos` has the arguments of QoSProfile. What is latched is sent at once.
    """

    def __init__(self, world: World, domain: int, script: Callable[..., None], topic: str,
                 node: str, kind: type = PolygonStamped, qos: dict[str, Any] = RELIABLE,
                 **options: Any) -> None:
        self._ended = _PROCESSES.RawValue('b', 0)
        self._sent = _PROCESSES.RawValue('q', 0)
        self.process = _PROCESSES.Process(target=_publish, args=(
            Shared(world, self._ended, self._sent), domain, script, topic, node, kind, qos,
            options))
        self.process.start()

    @property
    def sent(self) -> int:
        """The number of messages it has published."""
        return int(self._sent.value)

    def end(self) -> None:
        """End it in order."""
        self._ended.value = 1
        self.process.join()

    def kill(self) -> None:
        self.process.kill()
        self.process.join()


@contextlib.contextmanager
def suspended(pid: int) -> Iterator[None]:
    """Stop a process meanwhile."""
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def _publish(shared: Shared, domain: int, script: Callable[..., None], topic: str, node: str,
             kind: type, qos: dict[str, Any], options: dict[str, Any]) -> None:
    context = rclpy.Context()
    context.init(domain_id=domain)
    made = rclpy.create_node(node, context=context)
    published = Topic(made, topic, kind, qos, shared)
    if qos != LATCHED:
        published.until_subscribed()
    script(published, **options)
    # Fast DDS may wait for ever here, if it discovers others at that moment.
    signal.alarm(10)
    made.destroy_node()
    context.shutdown()


def robot(topic: Topic, x: float = 0.0) -> None:
    """Publish a footprint at rest."""
    for stamp in topic.every(0.02):
        topic.send(box(x, 0), stamp)


def robot_ahead(topic: Topic, by_odometry: bool = False) -> None:
    """Move onto the obstacle right after a message stamped ahead."""
    was_touching = False
    for stamp in topic.every(0.05):
        touching = topic.touching
        begins, was_touching = touching and not was_touching, touching
        stamp += 9 * SECOND // 10 if begins else 0
        x = 0.0 if touching and not begins else 50.0
        if by_odometry:
            topic.publish(odometry('map', 'base', stamp, x, 0.0))
        else:
            topic.send(box(x, 0), stamp)


def transform_ahead(topic: Topic) -> None:
    """Publish one transform stamped an hour ahead, then good ones."""
    for ahead in (0.0, 3600.0):
        topic.publish(transforms(('map', 'base', topic.now() + round(ahead * SECOND), 0.0, 0.0)))
    for stamp in topic.every(0.02):
        topic.publish(transforms(('map', 'base', stamp, 0.0, 0.0)))


def clock(topic: Topic) -> None:
    """Publish the simulated time, which can be stepped."""
    for stamp in topic.every(0.02):
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(stamp, SECOND)
        topic.publish(serialize_message(message))


def sets(topic: Topic, count: int = 200, period: float = 0.1, spread: float = 0.0,
         late: float = 0.0, sees: bool = True, cut: int | None = None,
         marks: bool = True) -> None:
    """
    Publish sets whose last obstacle touches or not, if it is seen, with or without their ends.

    In seconds are the period of sets, the spread from the first to the last message of one,
    and the delay of the last one. In the middle of the tenth set the process sends itself the
    signal `cut`.
    """
    for number, stamp in enumerate(topic.every(period)):
        for k in range(count - 1):
            topic.send(box(10 + 2 * k, 50), stamp, k + 1)
            if spread and k % 20 == 19:
                time.sleep(spread * 20 / count)
            if cut and number == 10 and k == count // 2:
                os.kill(os.getpid(), cut)
        time.sleep(late)
        topic.send(topic.obstacle if sees else APART, stamp, count)
        if marks:
            topic.end(stamp)


def once(topic: Topic, points: Sequence[tuple[float, float]], has_stamp: bool) -> None:
    """Publish one polygon, and leave, as `ros2 topic pub --once` does."""
    topic.send(points, topic.now() if has_stamp else 0)
    topic.publisher.wait_for_all_acked(Duration(seconds=2.0))


def repeated(topic: Topic,
             messages: Sequence[tuple[Sequence[tuple[float, float]] | None, float | None, int]]
             ) -> None:
    """
    Send messages again and again, each of which is a tuple of points, age and id.

    Without points it is of the obstacle that touches or not; without an age, in s, it has no
    stamp.
    """
    for stamp in topic.every(0.1):
        for points, age, instance in messages:
            topic.send(topic.obstacle if points is None else points,
                       0 if age is None else stamp - round(age * SECOND), instance)


def latched(topic: Topic, first: Sequence[tuple[float, float]] = APART, count: int = 5,
            frame_id: str = 'map') -> None:
    """Publish a latched map once, and stay."""
    _map(topic, 0, first, count, frame_id)
    for _ in topic.every(0.02):
        pass


def _map(topic: Topic, stamp: int, first: Sequence[tuple[float, float]], count: int = 5,
         frame_id: str = 'map', y: float = 5.0) -> None:
    """Publish a map of one obstacle and others far away, and its end."""
    topic.send(first, stamp, frame_id=frame_id)
    for k in range(1, count):
        topic.send(box(5 + 2 * k, y), stamp, frame_id=frame_id)
    topic.send((), stamp, frame_id=frame_id)


def map_sent_again(topic: Topic, set_back: float = 0.0, **others: Any) -> None:
    """
    Publish a map twice, and whenever the obstacle moves.

    Its clock is set back by some s, or its other obstacles differ, after the first time.
    """
    _map(topic, topic.now(), topic.obstacle)
    while not topic.is_over():
        time.sleep(0.5)
        was_touching = topic.touching
        _map(topic, topic.now() - round(set_back * SECOND), topic.obstacle, **others)
        for _ in topic.every(0.02):
            if topic.touching != was_touching:
                break


def corrected_transform(topic: Topic) -> None:
    """Publish the static transform of map2: where nothing touches, or where an obstacle does."""
    was_touching = None
    for stamp in topic.every(0.02):
        if topic.touching != was_touching:
            was_touching = topic.touching
            topic.publish(transforms(('map', 'map2', stamp, 0.0 if was_touching else 50.0, 0.0)))


def own_stamps(topic: Topic, marks: bool = True) -> None:
    """Publish sets whose obstacles come 30 ms apart, each stamped when it is sent."""
    while not topic.is_over():
        for points in (topic.obstacle, box(7, 5), box(9, 5), *([()] if marks else ())):
            topic.send(points)
            time.sleep(0.03)


def slow_clock(topic: Topic, behind: float = 0.0) -> None:
    """
    Publish sets of which the obstacle has the stamp of the set before, or is behind it by some s.

    So it is with a simulated clock that steps slowly, and where several threads stamp.
    """
    before = topic.now()
    for stamp in topic.every(0.1):
        topic.send(topic.obstacle, before - round(behind * SECOND))
        for points in (APART, ()):
            topic.send(points, stamp)
        before = stamp


def tracks(topic: Topic, obstacles: dict[int, tuple[float, float]], awake: float = math.inf,
           killed: float = math.inf) -> None:
    """
    Publish ids, of which 0 is the obstacle that touches or not.

    Each has a period and the time of its first message. After `awake` seconds it is silent for
    3 s; after `killed` seconds the process kills itself.
    """
    for seconds in (awake, math.inf):
        due = {instance: first for instance, (_, first) in obstacles.items()}
        begun = time.monotonic()
        for stamp in topic.every(0.02, seconds):
            elapsed = time.monotonic() - begun
            if elapsed > killed:
                os.kill(os.getpid(), signal.SIGKILL)
            for instance, (period, _) in obstacles.items():
                if elapsed >= due[instance]:
                    due[instance] += period
                    topic.send(topic.obstacle if instance == 0 else box(5 + 2 * instance, 5),
                               stamp, instance)
        for _ in topic.every(0.02, 3.0):
            pass


def undecodable(topic: Topic, polygons: Sequence[Any] = (None, ())) -> None:
    """Send messages that are cut off while in contact; None is the obstacle."""
    for stamp in topic.every(0.02):
        for points in polygons:
            topic.send(topic.obstacle if points is None else points, stamp,
                       length=-5 if topic.touching else None)


def flood(topic: Topic) -> None:
    """Send ten thousand messages a second that are none."""
    for _ in topic.every(0.001):
        for _ in range(10):
            topic.publish(b'no message')


def refused(topic: Topic, points: Sequence[tuple[float, float]] = TOUCHING,
            frame_id: str = 'map', length: int | None = None) -> None:
    """Send messages that are refused while in contact, each followed by a good obstacle."""
    for stamp in topic.every(0.1):
        if topic.touching:
            topic.send(points, stamp, 0, frame_id, length)
        else:
            topic.send(APART, stamp, 0)
        topic.send(box(9, 5), stamp, 1)


def late_for_deadlines(topic: Topic, count: int) -> None:
    """Publish sets on this topic and more less often than their deadline promises."""
    others = [topic.node.create_publisher(PolygonStamped, f'late{k}', profile(IN_TIME))
              for k in range(1, count)]
    for stamp in topic.every(0.5):
        for publisher in (topic.publisher, *others):
            publisher.publish(serialised(APART, stamp))
            publisher.publish(serialised((), stamp))
