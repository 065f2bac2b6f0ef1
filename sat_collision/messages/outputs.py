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

"""What the node publishes of a scene: flags, states and markers."""

from sat_collision.messages.interfaces import Bool, DiagnosticArray, MarkerArray, serialize
from sat_collision.messages.markers import Markers
from sat_collision.messages.states import States
from sat_collision.scene.footprints import Status

_FLAGS = {raised: serialize(Bool(data=raised)) for raised in (False, True)}


class Outputs:
    """
    The publishers of a scene; what nobody subscribes to, and what has not changed, costs nothing.

    Parameters
    ----------
    node : rclpy.node.Node
    settings : Settings
    scene : Scene

    Attributes
    ----------
    markers_current : bool
        Whether the markers made last show the scene as it is; to be unset when a body has changed.

    """

    def __init__(self, node, settings, scene):
        self._clock = node.get_clock()
        self._scene = scene
        self._common_flag = node.create_publisher(Bool, '~/collision', 10)
        self._flags = {
            footprint.name: node.create_publisher(Bool, f'~/{footprint.name}/collision', 10)
            for footprint in settings.footprints}
        self._raised = set()
        self._states = States(node.get_name(), settings)
        self._state_publisher = node.create_publisher(DiagnosticArray, '~/state', 10)
        self._unwritten = set()
        self._markers = Markers()
        self._marker_publisher = node.create_publisher(MarkerArray, '~/markers', 1)
        self._marker_message = None
        self.markers_current = False
        self.configure(settings)

    def configure(self, settings):
        """Apply settings, with which every flag may mean something else."""
        self._states.settings = settings
        self._raising = ((Status.COLLISION, Status.UNKNOWN) if settings.unknown_is_collision
                         else (Status.COLLISION,))
        # If none is enabled, nothing is known: all are unknown.
        self._watched = ({footprint.name for footprint in settings.footprints if footprint.enabled}
                         or set(self._flags))
        self.update(self._flags)

    def update(self, names):
        """Take note of the new states of footprints."""
        for name in names:
            if self._scene.status(name) in self._raising:
                self._raised.add(name)
            else:
                self._raised.discard(name)
        self._unwritten.update(names)
        self.markers_current = False

    def publish(self, names=None):
        """Publish the common flag, the flags of some footprints or of all, and all states."""
        for name in self._flags if names is None else names:
            self._flags[name].publish(_FLAGS[name in self._raised])
        self._common_flag.publish(_FLAGS[not self._raised.isdisjoint(self._watched)])
        if self._state_publisher.get_subscription_count():
            self._publish_states()

    def _publish_states(self):
        for name in self._flags:
            state = self._scene.state(name)
            step = self._scene.coordinate_step(name)
            if name in self._unwritten or not self._states.is_current(name, step):
                self._states.write(name, state, step)
            self._states.write_moving(name, state.age, self._scene.nearest(name))
        self._unwritten.clear()
        self._state_publisher.publish(self._states.message(self._clock.now().to_msg()))

    def publish_markers(self):
        """Publish the markers if somebody wants them."""
        if self._marker_publisher.get_subscription_count():
            if not self.markers_current:
                self._marker_message = self._markers.message(self._scene)
                self.markers_current = True
            self._marker_publisher.publish(self._marker_message)
