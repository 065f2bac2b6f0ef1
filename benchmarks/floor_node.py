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

"""
What no node in Python can do without: the same publishes, and nothing else.

Raw subscriptions, callbacks that look at a byte at most; in rclpy's events executor, or with
--loop in the loop of our node, which takes messages in batches.
"""

import sys
import time

import counts
from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sat_collision.node import loop
from sat_collision.node.quality import flag_qos
from sat_collision.node.signals import end_on_signals, Signalled
from std_msgs.msg import Bool

_SIGN_OF_FIRST_X = 27
_TICK = 0.1


class Floor(Node):
    """Answers a footprint by the sign of its first x, with as many flags as the monitor has."""

    def __init__(self, in_loop):
        super().__init__('footprint_monitor')
        self._flags = [serialize_message(Bool(data=raised)) for raised in (False, True)]
        self._flag = self._flags[0]
        self._received = 0
        self._ticked = 0.0
        # Not _publishers, which is rclpy's own list of all that a node has.
        self._flag_publishers = [
            self.create_publisher(Bool, topic, flag_qos())
            for topic in ('~/footprint/collision', '~/collision')]
        group = loop.Reserved() if in_loop else None
        self.inputs = [
            loop.Input('footprint', self.create_subscription(
                PolygonStamped, 'footprint', self._answer, 1, raw=True, callback_group=group),
                ends_rest=True),
            loop.Input('obstacles', self.create_subscription(
                PolygonStamped, 'obstacles', self._count, QoSProfile(depth=1000), raw=True,
                callback_group=group))]
        self._counts = counts.Counts(self)
        self._next_count = 0.0
        if not in_loop:
            self.create_timer(_TICK, self.tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _answer(self, data):
        self._flag = self._flags[data[_SIGN_OF_FIRST_X] > 127]
        self._publish()

    def _count(self, data):
        self._received += 1

    present = staticmethod(time.time_ns)

    def receive(self, name, messages, now):
        """Take messages, for the loop."""
        take = self._answer if name == 'footprint' else self._count
        for data, _ in messages:
            take(data)

    def begin_stream(self, name):
        """Do nothing."""

    def end_batch(self, messages, seconds):
        """Do nothing."""

    def note_backlog(self, name, backlog):
        """Do nothing."""

    def tick(self, now=0, is_all_taken=True):
        """Publish the flags, and once a second how many messages there were."""
        self._publish()
        if time.monotonic() >= self._next_count:
            self._next_count = time.monotonic() + 1.0
            self._counts.publish(self._received)
        self._ticked = time.monotonic()

    def due(self, now, steady):
        """Return when the next tick is due."""
        return self._ticked + _TICK

    def _publish(self):
        for publisher in self._flag_publishers:
            publisher.publish(self._flag)


def main():
    end_on_signals()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    in_loop = '--loop' in sys.argv
    node = Floor(in_loop)
    ended = Signalled()
    if in_loop:
        runner = loop.Loop(node, node.inputs, node, lambda: 0.002)
        runner.run(ended)
        runner.close()
    else:
        executor = EventsExecutor(context=node.context)
        executor.add_node(node)
        while not ended():
            # A wait for what never comes costs less a message than `spin_once`.
            executor.spin_until_future_complete(Future(), timeout_sec=0.2)
        executor.remove_node(node)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    sys.exit(main())
