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

"""What the live node and the replay tool share: bytes in, states out."""

from collections import Counter
from typing import NamedTuple

from sat_collision.messages import decode, MessageError
from sat_collision.polygon import Polygon, PolygonError, Reason
from sat_collision.scene import Scene
from sat_collision.settings import ObstacleSettings, POLYGON_INSTANCE
from sat_collision.sources import OTHER_FRAME, TOO_MANY, TOO_OLD

EMPTY_FRAME_ID = 'empty frame_id'
UNDECODABLE = 'undecodable'

_ADVICE = {
    EMPTY_FRAME_ID: 'the publisher must say which frame the polygon is in',
    OTHER_FRAME: 'publish in that frame, or choose another by the parameter frame_id',
    Reason.EMPTY.value: 'the publisher must send where the footprint is',
    Reason.NOT_FINITE.value: 'the publisher must send finite coordinates only',
    Reason.SELF_INTERSECTING.value: 'the publisher must send the outline of a simple polygon',
    Reason.TOO_MANY_VERTICES.value: 'simplify the polygon or raise the parameter max_vertices',
    TOO_MANY: 'publish fewer obstacles or raise the parameter max_count of the source',
    TOO_OLD: 'check clocks and delays, or raise the parameter timeout of the source',
    UNDECODABLE: 'check that the publisher has the message type that this topic should have',
}


class Rejection(NamedTuple):
    """
    A message that was not taken.

    Attributes
    ----------
    name, topic : str
        The footprint or source that it was for, and its topic.
    reason : str
        A few words without figures, to count by.
    detail : str
        What is wrong with this very message.

    """

    name: str
    topic: str
    reason: str
    detail: str

    @property
    def text(self):
        """The whole story as a sentence: topic, reason, and what to do."""
        return (f'{self.name}: a message on {self.topic} was rejected, {self.reason}: '
                f'{self.detail}; {_ADVICE[self.reason]}')


class Monitor:
    """
    Takes serialised messages and keeps the scene that they make.

    A message of no use is counted and returned as a Rejection, and never raises. The scene is
    told of it, because it stands for a body whose place is not known.

    Parameters
    ----------
    settings : Settings

    Attributes
    ----------
    scene : Scene
        Tells the states, and is where settings are changed.
    received : Counter
        All messages, by name of the footprint or source.
    rejected : Counter
        The messages that were not taken, by (name, reason).

    """

    def __init__(self, settings):
        self.scene = Scene(settings)
        self.received = Counter()
        self.rejected = Counter()

    def receive(self, name, data, now):
        """
        Take a message; one for what is disabled is ignored.

        Parameters
        ----------
        name : str
            Name of the footprint or source.
        data : bytes
            The serialised PolygonStamped or PolygonInstanceStamped.
        now : int
            Present time in ns, by the clock of the header stamps.

        Returns
        -------
        Rejection or None

        """
        self.received[name] += 1
        settings = self.scene.settings_of(name)
        refusal = self._take(settings, data, now) if settings.enabled else None
        if refusal is None:
            return None
        reason, detail = refusal
        self.rejected[name, reason] += 1
        return Rejection(name, settings.topic, reason, str(detail))

    def _take(self, settings, data, now):
        """Hand a message to the scene; return reason and detail if it is of no use."""
        scene = self.scene
        name = settings.name
        is_obstacle = isinstance(settings, ObstacleSettings)
        try:
            stamp, frame_id, points, instance = decode(
                data, is_obstacle and settings.type == POLYGON_INSTANCE)
        except MessageError as error:
            scene.refuse(name, UNDECODABLE, now)
            return UNDECODABLE, error
        if not frame_id:
            scene.refuse(name, EMPTY_FRAME_ID, now, stamp, instance)
            return EMPTY_FRAME_ID, 'its header names no frame'
        polygon = None
        if len(points) or not is_obstacle:
            try:
                polygon = Polygon(points, scene.settings.max_vertices)
            except PolygonError as error:
                scene.refuse(name, error.reason.value, now, stamp, instance)
                return error.reason.value, error
        if is_obstacle:
            refusal = scene.obstacle(name, polygon, frame_id, stamp, now, instance)
        else:
            refusal = scene.footprint(name, polygon, frame_id, stamp, now)
        if refusal == OTHER_FRAME:
            return refusal, f"it is in '{frame_id}', all else in '{scene.frame_id}'"
        if refusal == TOO_MANY:
            return refusal, f'there are {settings.max_count} already'
        if refusal == TOO_OLD:
            return refusal, (f'its stamp is {(now - stamp) / 1e9:.3f} s old, past the timeout of '
                             f'{settings.timeout:g} s')
        return None
