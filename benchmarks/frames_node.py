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
The monitor, with --floor one that does nothing with /tf, where tf2_msgs may be missing.

With --loop-floor it is not the monitor but a node that answers transforms by one byte of them.

Nobody looks into serialised messages, so another type stands in for TFMessage.
"""

import sys
import types

from floor_node import Floor
from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sat_collision.node import loop
from sat_collision.node.signals import end_on_signals, Signalled


class TransformFloor(Floor):
    """Takes transforms, and answers each message by the sign of its last number but six."""

    def __init__(self):
        super().__init__(True)
        self.inputs.append(loop.Input('/tf', self.create_subscription(
            PolygonStamped, '/tf', print, QoSProfile(depth=100), raw=True,
            callback_group=loop.Reserved())))

    def receive(self, name, messages, now):
        """Take messages, for the loop."""
        if name != '/tf':
            super().receive(name, messages, now)
            return
        for data, _ in messages:
            flag = self._flags[data[-49] > 127]
            if flag is not self._flag:
                self._flag = flag
                self._publish()


def main():
    if '--loop-floor' in sys.argv:
        end_on_signals()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = TransformFloor()
        runner = loop.Loop(node, node.inputs, node, lambda: 0.002)
        runner.run(Signalled())
        runner.close()
        node.destroy_node()
        rclpy.shutdown()
        return 0
    messages = types.ModuleType('tf2_msgs.msg')
    messages.TFMessage = PolygonStamped
    sys.modules.update({'tf2_msgs': types.ModuleType('tf2_msgs'), 'tf2_msgs.msg': messages})
    from sat_collision.monitor import Monitor
    from sat_collision.node.__main__ import main as run_monitor
    if '--floor' in sys.argv:
        Monitor.receive_transforms = lambda *_: ()
    return run_monitor()


if __name__ == '__main__':
    sys.exit(main())
