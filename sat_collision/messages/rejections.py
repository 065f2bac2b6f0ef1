# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Why messages are refused, in words that say what to do."""

from __future__ import annotations

from typing import NamedTuple

from sat_collision.geometry.body.polygon import NOT_CONVEX, Reason
from sat_collision.scene import frames
from sat_collision.scene.frames import in_quotes
from sat_collision.scene.obstacle_store import OTHER_FRAME, TOO_MANY
from sat_collision.scene.scene import FROM_FUTURE, OVERTAKEN
from sat_collision.scene.settings import BY_ANOTHER_CLOCK, FAR
from sat_collision.scene.sources import TOO_OLD

BAD_PATH = 'no coordinates of a path'
TOO_MANY_POSES = 'too many poses'
BAD_COMMAND = 'no velocity of a robot'
COMMAND_FRAME = 'command in another frame'
EMPTY_FRAME_ID = 'empty frame_id'
NO_ORIENTATION = 'pose without orientation'
LONG_FRAME_ID = 'long frame_id'
OTHER_BODY = 'odometry of another body'
POSE_FRAME = 'pose in another frame'
UNDECODABLE = 'undecodable'

_ADVICE = {
    BAD_PATH: 'the publisher must send finite numbers',
    BAD_COMMAND: 'the publisher must send finite numbers, of up to 1000 m/s or rad/s',
    COMMAND_FRAME: 'the publisher must send it in the frame of the outline, or name none',
    EMPTY_FRAME_ID: 'the publisher must say which frame the polygon is in',
    NO_ORIENTATION: 'the publisher must send an orientation of each pose, or of none but the '
                    'last',
    FROM_FUTURE: 'set the clocks of both machines by one, to within future_tolerance',
    LONG_FRAME_ID: 'the publisher must name a frame as tf2 has it',
    OTHER_BODY: 'give the topic that tells where the outline is, or publish the transform from '
                'its frame to this one',
    OTHER_FRAME: 'publish all in one frame that does not move with a robot, or set the parameter '
                 'frame_id to one that /tf connects with the others',
    OVERTAKEN: 'let one publisher send the footprint, in the order of its stamps',
    POSE_FRAME: 'the planner must send all poses in the frame of the path, or name none for them',
    Reason.EMPTY.value: 'the publisher must send where the footprint is',
    Reason.NOT_FINITE.value: 'the publisher must send finite coordinates only',
    Reason.SELF_INTERSECTING.value: 'the publisher must send the outline of a simple polygon',
    Reason.TOO_MANY_VERTICES.value: 'simplify the polygon or raise the parameter max_vertices',
    TOO_MANY: 'publish fewer obstacles or raise the parameter max_count of the source',
    TOO_OLD: 'check clocks and delays, or raise the parameter timeout',
    TOO_MANY_POSES: 'let the planner send fewer poses, or raise the parameter max_path_poses',
    UNDECODABLE: 'check that the publisher has the message type that this topic should have',
    frames.BAD_FRAME_ID: 'correct the header of the publisher, or the parameter frame_id',
    frames.BAD_NAMES: 'a transform must name two frames',
    frames.BAD_TRANSFORM: 'the publisher must send finite numbers and a quaternion that is not '
                          'zero',
    frames.GAP: 'publish transforms more often than once in max_tf_gap, by one clock',
    frames.LOOP: 'let each frame have one publisher',
    frames.NO_TRANSFORM: 'check clocks and the rate of /tf, or raise the parameter '
                         'transform_timeout',
    frames.NOT_CONNECTED: 'check which transforms are published on /tf and /tf_static',
    frames.OLD_LATEST: 'check the rate of /tf, or raise the parameter timeout',
    frames.OLD_TRANSFORM: 'check the clocks, and that the frame has one publisher',
    frames.TILTED: 'obstacles must lie in the plane; what is tilted by less than the parameter '
                   'max_tilt is projected',
    frames.TOO_MANY_FRAMES: 'find the publisher that makes up names of frames',
    frames.UNKNOWN_FRAME: 'correct the frame_id, or publish its transform on /tf or /tf_static',
}


class Rejection(NamedTuple):
    """A message that was refused."""

    name: str  # of the footprint or source that it was for
    topic: str
    reason: str  # a few words without figures, by which rejections are counted
    detail: str  # what is wrong with this message

    @property
    def text(self) -> str:
        """A full sentence: topic, reason, and what to do."""
        advice = f'; {_ADVICE[self.reason]}'
        if BY_ANOTHER_CLOCK in self.detail:
            advice = ''
        elif NOT_CONVEX in self.detail:
            advice = '; simplify the polygon or run the node with numba'
        return (f'{self.name}: a message on {self.topic} was rejected, {self.reason}: '
                f'{self.detail}{advice}')


def detail_of(refusal: str, frame_id: str, fixed: str, age: float, timeout: float) -> str:
    """
    Return what is wrong with a message that the scene has refused.

    `frame_id` is its frame, `fixed` that of the scene; its age is by its stamp. Times are in s.
    """
    if refusal == OTHER_FRAME:
        return f'it is in {in_quotes(frame_id)}, all else in {in_quotes(fixed)}'
    far = f', {BY_ANOTHER_CLOCK}' if abs(age) > FAR / 1e9 else ''
    if refusal == TOO_OLD:
        return f'its stamp is {age:.3f} s old, past the timeout of {timeout:g} s{far}'
    if refusal == FROM_FUTURE:
        return f'its stamp is {-age:.3f} s ahead of the clock{far}'
    if refusal == OVERTAKEN:
        return 'a footprint with a later stamp came before it'
    return 'the source holds max_count obstacles already'
