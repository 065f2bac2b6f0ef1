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

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

from sat_collision.messages.interfaces import Bool, DiagnosticArray, MarkerArray, serialize
from sat_collision.messages.markers import Markers
from sat_collision.messages.states import coordinate_step, States
from sat_collision.scene.footprints import State, Status
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import Settings

_FLAGS = {raised: serialize(Bool(data=raised)) for raised in (False, True)}


class NodeLike(Protocol):
    """What is asked of a node: rclpy's, or a stand-in that writes a bag."""

    def get_name(self) -> str:
        """Return the name without the namespace."""

    def get_clock(self) -> Any:
        """Return a clock whose now() has to_msg()."""

    def create_publisher(self, kind: Any, topic: str, qos: Any) -> Any:
        """Return what has publish() and get_subscription_count()."""


class Outputs:
    """
    The publishers of a scene; what nobody subscribes to, and what has not changed, costs nothing.

    Parameters
    ----------
    node : NodeLike
    settings : Settings
    scene : Scene
    flag_qos : optional
        What `node` takes as the quality of service of the flags.

    Attributes
    ----------
    markers_current : bool
        Whether the markers made last show the scene as it is; to be unset when a body has changed.

    """

    def __init__(self, node: NodeLike, settings: Settings, scene: Scene,
                 flag_qos: Any = 10) -> None:
        self._clock = node.get_clock()
        self._scene = scene
        self._common_flag = node.create_publisher(Bool, '~/collision', flag_qos)
        self._flags = {
            footprint.name: node.create_publisher(Bool, f'~/{footprint.name}/collision', flag_qos)
            for footprint in settings.footprints}
        self._raised: set[str] = set()
        self._node_name = node.get_name()
        self._states = States(self._node_name, settings)
        self._state_publisher = node.create_publisher(DiagnosticArray, '~/state', 10)
        self._unwritten: set[str] = set()
        self._markers = Markers()
        self._marker_publisher = node.create_publisher(MarkerArray, '~/markers', 1)
        self._marker_message: Any = None
        self.markers_current = False
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Apply settings, with which every flag may mean something else."""
        self._states.settings = settings
        self._raising = ((Status.COLLISION, Status.UNKNOWN) if settings.unknown_is_collision
                         else (Status.COLLISION,))
        # If none is enabled, nothing is known: all are unknown.
        self._watched = ({footprint.name for footprint in settings.footprints if footprint.enabled}
                         or set(self._flags))
        self.update(self._flags)

    def update(self, names: Iterable[str]) -> None:
        """Take note of the new states of footprints."""
        for name in names:
            if self._scene.status(name) in self._raising:
                self._raised.add(name)
            else:
                self._raised.discard(name)
        self._unwritten.update(names)
        self.markers_current = False

    def publish_rise(self, names: Iterable[str]) -> None:
        """Publish that footprints were in collision, although they are not any more."""
        for name in names:
            self._flags[name].publish(_FLAGS[True])
        if not self._watched.isdisjoint(names):
            self._common_flag.publish(_FLAGS[True])

    def publish(self, names: Iterable[str] | None = None) -> None:
        """Publish the common flag, the flags of some footprints or of all, and all states."""
        for name in self._flags if names is None else names:
            self._flags[name].publish(_FLAGS[name in self._raised])
        self._common_flag.publish(_FLAGS[not self._raised.isdisjoint(self._watched)])
        if self._state_publisher.get_subscription_count():
            self._publish_states()

    def publish_unknown(self, reason: str) -> None:
        """
        Raise all flags and call all states unknown, whatever is known of them.

        For a thread other than the one that all else is called from: it shares the publishers
        only.
        """
        for publisher in (self._common_flag, *self._flags.values()):
            publisher.publish(_FLAGS[True])
        if self._state_publisher.get_subscription_count():
            states = States(self._node_name, self._states.settings)
            state = State(Status.UNKNOWN, (), (reason,), None)
            for name in self._flags:
                states.write(name, state, 0.0)
            self._state_publisher.publish(states.message(self._clock.now().to_msg()))

    def _publish_states(self) -> None:
        polygons = dict(self._scene.footprints)
        for name in self._flags:
            state = self._scene.state(name)
            step = coordinate_step(polygons.get(name))
            if name in self._unwritten or not self._states.is_current(name, step):
                self._states.write(name, state, step)
            nearest = self._scene.nearest(name)
            named = {*state.contacts, *((nearest[0],) if nearest else ())}
            self._states.write_moving(name, state.age, nearest, self._scene.newer_by(name, named),
                                      self._scene.origin(name))
        self._unwritten.clear()
        self._state_publisher.publish(self._states.message(self._clock.now().to_msg()))

    def publish_markers(self) -> None:
        """Publish the markers if somebody wants them."""
        if self._marker_publisher.get_subscription_count():
            if not self.markers_current:
                self._marker_message = self._markers.message(self._scene)
                self.markers_current = True
            self._marker_publisher.publish(self._marker_message)
