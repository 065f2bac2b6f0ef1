# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Publishes a scene: flags, separations, times to collision, contacts, states and markers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
import math
import sys
from typing import Any

import numpy as np
from sat_collision.geometry.pair.contact import contact
from sat_collision.messages.interfaces import (
    Bool, DiagnosticArray, Float64, MarkerArray, octets, PointCloud2, PointField, serialize)
from sat_collision.messages.markers import affordable, Markers
from sat_collision.messages.states import coordinate_step, States
from sat_collision.scene.footprints import State, Status
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import Settings

_NUMBERS = ('x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth')
# A point of ~/<footprint>/contacts.
_POINT = np.dtype([*((name, np.float32) for name in _NUMBERS), ('obstacle', np.uint32)])
_FIELDS = [
    *(PointField(name=name, offset=4 * k, count=1, datatype=PointField.FLOAT32)
      for k, name in enumerate(_NUMBERS)),
    PointField(name='obstacle', offset=4 * len(_NUMBERS), count=1, datatype=PointField.UINT32)]


def _number(value: float) -> Any:
    return serialize(Float64(data=value))


_FLAGS = {raised: serialize(Bool(data=raised)) for raised in (False, True)}
_UNKNOWN = _number(math.nan)


def contact_cloud(scene: Scene, name: str, stamp: Any) -> Any:
    """
    Return the contact points of a footprint; none if it is not in contact.

    Each point is one of the footprint, in the fixed frame, with z = 0. Its normal is the unit
    vector from the obstacle to the footprint; moving the footprint by depth (m) along it takes it
    out of the obstacle. For bodies apart within the margin the depth is minus their distance.
    `obstacle` is the index, from 0, of its name among the contacts in the state of the same stamp.
    """
    places = {obstacle: k for k, obstacle in enumerate(scene.state(name).contacts)}
    rows = []
    for obstacle, own, other in affordable(scene.contacts(name)):
        if obstacle in places:
            found = contact(own, other)
            depth = -found.separation if found.separation > 0.0 else found.depth
            rows += [(x, y, 0.0, *found.normal, 0.0, depth, places[obstacle])
                     for x, y in found.points_a]
    points = np.array(rows, _POINT)
    cloud = PointCloud2(height=1, width=len(points), fields=_FIELDS, is_dense=True,
                        is_bigendian=sys.byteorder == 'big', point_step=_POINT.itemsize,
                        row_step=points.nbytes, data=octets(points.tobytes()))
    cloud.header.stamp = stamp
    cloud.header.frame_id = scene.frame_id
    return cloud


class Outputs:
    """
    The publishers of a scene; figures are computed only for topics with subscribers.

    Their node is one of rclpy, or a stand-in that writes a bag.
    """

    def __init__(self, node: Any, settings: Settings, scene: Scene,
                 flag_qos: Any = 10, measures: bool = True) -> None:
        self._clock = node.get_clock()
        self._scene = scene
        self._common_flag = node.create_publisher(Bool, '~/collision', flag_qos)
        self._flags = {one.name: node.create_publisher(Bool, f'~/{one.name}/collision', flag_qos)
                       for one in settings.footprints}

        def publishers(kind: Any, topic: str, names: Iterable[str]) -> dict[str, Any]:
            return {name: node.create_publisher(kind, f'~/{name}/{topic}', 10) for name in names}

        self._separations = publishers(Float64, 'separation', self._flags)
        self._times = publishers(Float64, 'time_to_collision', self._flags)
        self._paths = publishers(Float64, 'path_contact_distance', (
            one.name for one in settings.footprints if one.path))
        self._clouds = publishers(PointCloud2, 'contacts', self._flags)
        self._raised: set[str] = set()
        self._node_name = node.get_fully_qualified_name()
        self._states = States(self._node_name, settings)
        self._state_publisher = node.create_publisher(DiagnosticArray, '~/state', 10)
        self._markers = Markers()
        self._marker_publisher = node.create_publisher(MarkerArray, '~/markers', 1)
        self._marker_message = b''
        # Whether that message is up to date; must be unset when a body has changed.
        self.markers_current = False
        # Whether distances are measured; may be set later. If not, states say so, and neither
        # contacts nor markers are published.
        self.measures = measures
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Apply settings, which may change the meaning of every flag."""
        self._states.settings = settings
        self._raising = [Status.COLLISION, Status.IMMINENT]
        if settings.unknown_is_collision:
            self._raising.append(Status.UNKNOWN)
        # If none is enabled, all count: they are unknown.
        self._watched = {one.name for one in settings.footprints if one.enabled} or {*self._flags}
        self.update(self._flags)
        self.find_subscribers()

    def update(self, names: Iterable[str]) -> None:
        for name in names:
            if self._scene.status(name) in self._raising:
                self._raised.add(name)
            else:
                self._raised.discard(name)
        self.markers_current = False

    def publish_rise(self, names: Iterable[str]) -> None:
        """Publish that footprints were in collision, although they no longer are."""
        if not self._watched.isdisjoint(names):
            self._common_flag.publish(_FLAGS[True])
        for name in names:
            self._flags[name].publish(_FLAGS[True])

    def publish_flags(self, names: Iterable[str] | None = None) -> None:
        """Publish the common flag, and those of some footprints or (None) of all."""
        self._common_flag.publish(_FLAGS[not self._raised.isdisjoint(self._watched)])
        for name in self._flags if names is None else names:
            self._flags[name].publish(_FLAGS[name in self._raised])

    def find_subscribers(self) -> None:
        """Find out which topics have subscribers: asking takes as long as publishing a flag."""
        self._measured, self._timed, self._clouded = (
            {name for name, publisher in publishers.items() if publisher.get_subscription_count()}
            for publishers in (self._separations, self._times, self._clouds))
        self._with_states = self._state_publisher.get_subscription_count() > 0
        self._scene.tracks_motion = self._states.settings.horizon > 0.0 and bool(
            self._with_states or self._timed or self._marker_publisher.get_subscription_count())

    def publish_figures(self, names: Collection[str]) -> Iterator[None]:
        """
        Publish what has subscribers, except flags: figures of some footprints, and all states.

        It goes on from footprint to footprint, and yields after each. The figures of one are all
        of one time; one that changes after its turn is to be published again.
        """
        scene = self._scene
        # Subscribers that come meanwhile get the next states, so that all are new.
        with_states = self._with_states
        if not (with_states or self._measured or self._timed or self._clouded):
            return
        stamp = self._clock.now().to_msg()
        for name in self._flags if with_states else names:
            is_named = name in names
            is_known = self.measures and scene.status(name) is not Status.UNKNOWN
            is_measured = is_named and name in self._measured
            is_timed = is_named and name in self._timed
            nearest = scene.nearest(name) if is_known and (with_states or is_measured) else None
            prediction = scene.prediction(name) if is_known and (with_states or is_timed) else None
            if is_measured:
                self._separations[name].publish(
                    _number(nearest.separation if nearest else math.inf) if is_known else _UNKNOWN)
            if is_timed:
                self._times[name].publish(_number(prediction.seconds) if prediction and
                                          prediction.is_known else _UNKNOWN)
            if with_states:
                self._states.write(name, scene.state(name), coordinate_step(scene, name),
                                   prediction, self.measures)
                self._states.write_moving(name, scene, nearest, prediction)
                self._states.pack(name)
            if is_named and self.measures and name in self._clouded:
                self._clouds[name].publish(contact_cloud(scene, name, stamp))
            yield
        if with_states:
            self._state_publisher.publish(self._states.message(stamp))

    def statuses(self) -> list[Any]:
        """Return a status of each footprint, without the values that change all the time."""
        states = States(self._node_name, self._states.settings, moving=False)
        states.update(self._scene)
        return states.statuses

    def publish_unknown(self, reason: str) -> list[Any]:
        """
        Raise all flags and report all states as unknown; return these statuses.

        May be called from another thread than the other methods: it shares only the publishers.
        """
        for publisher in (self._common_flag, *self._flags.values()):
            publisher.publish(_FLAGS[True])
        for publisher in (*self._separations.values(), *self._times.values(),
                          *self._paths.values()):
            publisher.publish(_UNKNOWN)
        states = States(self._node_name, self._states.settings)
        state = State(Status.UNKNOWN, (), (reason,), None)
        for name in self._flags:
            states.write(name, state, 0.0)
            states.pack(name)
        if self._state_publisher.get_subscription_count():
            self._state_publisher.publish(states.message(self._clock.now().to_msg()))
        return states.statuses

    def publish_path(self, name: str) -> None:
        """Publish how far along its path a footprint meets an obstacle, NaN if not checked."""
        found = self._scene.path_checks.get(name)
        self._paths[name].publish(_number(found.metres) if found else _UNKNOWN)
        self.markers_current = False

    def publish_markers(self, draws: bool = True) -> None:
        """Publish the markers if they have subscribers: those drawn last unless it draws."""
        if self.measures and self._marker_publisher.get_subscription_count():
            if draws and not self.markers_current or not self._marker_message:
                self._marker_message = serialize(self._markers.message(self._scene))
                self.markers_current = not self._markers.moves
            self._marker_publisher.publish(self._marker_message)
