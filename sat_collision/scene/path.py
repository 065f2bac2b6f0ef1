# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The path that a footprint is about to follow, and its first contact."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.polygon import Affine2D, Polygon
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.velocity import is_upside_down, Pose

# Shares of the reach that are taken for rounding.
_SLACK = 1e-6


class PathCheck(NamedTuple):
    """Where a path first meets an obstacle, ahead of the robot."""

    metres: float  # from the robot on, along the path; 0 in contact, infinity for none
    reason: str = ''  # why it is unknown; then metres are NaN
    pose: float = math.nan  # counted from 0 in the path received, 3.25 between 3 and 4
    obstacle: ObstacleId | None = None
    way: NDArray[np.float64] | None = None  # (n, 2): the path from the robot to the contact, m
    outline: NDArray[np.float64] | None = None  # the vertices of the footprint there
    is_by_travel: bool = False  # whether the direction of travel stands for orientations
    may_come: bool = False  # whether a later transform may yet give it a place

    @property
    def text(self) -> str:
        if self.reason:
            return f'unknown: {self.reason}'
        text = 'none' if math.isinf(self.metres) else (
            f'{self.obstacle} at pose {self.pose:.2f}, after {self.metres:.3f} m')
        return text + ('; by the direction of travel, as the poses have no orientations'
                       if self.is_by_travel else '')


class FollowedPath:
    """A path in its own frame, of finite poses, and how far along it the robot is."""

    def __init__(self, numbers: NDArray[np.float64]) -> None:
        """
        Take x, y, z and the quaternion of each pose, (k, 7).

        A quaternion that is zero says nothing; the yaw is NaN where nothing else does.
        """
        sizes = np.abs(numbers[:, 3:]).max(axis=1, keepdims=True)
        x, y, z, w = (numbers[:, 3:] / np.where(sizes, sizes, math.nan)).T
        yaws = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
        self.poses = np.column_stack([numbers[:, :2], yaws])
        self.is_by_travel = not numbers[:-1, 3:6].any() and self._turn_to_travel()
        self.progress = 0.0

    def _turn_to_travel(self) -> bool:
        """
        Let each way from pose to pose be straight ahead, with turns on the spot between them.

        So each pose but the first is there twice: as the end of a way, and as the start of the
        next one or the goal. Return whether that turns any pose.
        """
        places, goal = self.poses[:, :2], self.poses[-1]
        ways = np.diff(places, axis=0)
        moving = np.flatnonzero(ways.any(axis=1))
        if not len(moving):
            return False
        following = np.searchsorted(moving, np.arange(len(ways))).clip(max=len(moving) - 1)
        x, y = ways[moving[following]].T
        headings = np.arctan2(y, x)
        if math.isnan(goal[2]):
            goal[2] = headings[-1]
        self.poses[:-1, 2] = headings
        if not self.poses[:, 2].any():
            return False
        self.poses = np.vstack([np.column_stack([
            np.repeat(places, 2, axis=0)[1:-1], np.repeat(headings, 2)]), goal])
        return True

    def move(self, affine: Affine2D) -> None:
        """Move the path to the frame to which a map leads."""
        a, b, x, d, e, y = affine
        px, py, yaw = self.poses.T
        turned = math.atan2(d, a) + (-yaw if is_upside_down(affine) else yaw)
        self.poses = np.column_stack([a * px + b * py + x, d * px + e * py + y, turned])

    def advance(self, pose: Pose, reach: float) -> None:
        """
        Move the progress on to where the path is nearest to the robot; it never goes back.

        Angles count as ways of a point at `reach` (m). Of several parts of the path that are as
        near, to within the reach, the first one counts.
        """
        first = min(int(self.progress), len(self.poses) - 2)
        if first < 0:
            return
        # Of each segment the gap is at least that of its start less its length, without angles,
        # and at most that of its end. Neither is the first above the second by rounding.
        off = pose - self.poses[first:]
        away = np.hypot(off[:, 0], off[:, 1])
        lengths = np.hypot(*np.diff(self.poses[first:, :2], axis=0).T)
        least = np.minimum(away[:-1] - lengths, away[1:])
        near = np.flatnonzero(least <= _gaps(off[1:], reach).min() + reach)
        starts, ends = self.poses[first + near], self.poses[first + near + 1]
        steps = _steps(starts, ends)
        off = off[near]
        along = _nearest_shares(steps, off, reach)
        if near[0] == 0:
            along[0] = max(along[0], self.progress - first)
        gaps = _gaps(off - _moved(steps, along), reach)
        k = int(np.argmax(gaps <= gaps.min() + reach))
        # On to the next segment where neither it nor the pose between them is farther.
        goes_on = ((np.diff(near[k:]) == 1) & (np.diff(gaps[k:]) <= 0.0)
                   & (_gaps(pose - ends[k:-1], reach) <= gaps[k:-1] + _SLACK * reach))
        k += int(np.argmin(np.append(goes_on, False)))
        self.progress = first + int(near[k]) + float(along[k])

    def at(self, place: float) -> NDArray[np.float64]:
        """Return the pose at a place, on the arc between two poses."""
        k = min(int(place), max(len(self.poses) - 2, 0))
        share = place - k
        if share == 0.0:
            at: NDArray[np.float64] = self.poses[k]
            return at
        ends = self.poses[k:k + 2]
        there: NDArray[np.float64] = ends[0] + _moved(_steps(ends[:1], ends[1:]), share)[0]
        return there

    def _received(self, place: float) -> float:
        """Return which pose, or place between poses, of the path received a place is."""
        return place // 2.0 + min(place % 2.0, 1.0) if self.is_by_travel else place

    def check(self, footprint: Footprint, outline: Polygon, contacts: Contacts) -> PathCheck:
        """Check the path from the progress on."""
        if touched := footprint.contacts_reported:
            return PathCheck(0.0, pose=self._received(self.progress), obstacle=touched[0],
                             is_by_travel=self.is_by_travel)
        k = int(self.progress)
        ahead = np.vstack([self.at(self.progress), self.poses[k + 1:]])
        found = contacts.first_on_path(footprint, outline, ahead)
        if found is None:
            return PathCheck(math.inf, is_by_travel=self.is_by_travel)
        body, pose, metres = found
        place = k + pose if pose >= 1.0 else self.progress + pose * (k + 1 - self.progress)
        x, y, yaw = there = self.at(place)
        c, s = math.cos(yaw), math.sin(yaw)
        way = np.vstack([ahead[:int(pose) + 1], there])[:, :2]
        return PathCheck(
            metres, '', self._received(place), body.name, way,
            outline.vertices @ [(c, s), (-s, c)] + (x, y), self.is_by_travel)


def _steps(starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x, y and turn from poses to others, the shorter way round."""
    steps = ends - starts
    steps[:, 2] = _wrapped(steps[:, 2])
    return steps


def _nearest_shares(steps: NDArray[np.float64], off: NDArray[np.float64], reach: float
                    ) -> NDArray[np.float64]:
    """Return at which share of each step, an arc, the gap to a place off its start is least."""
    dx, dy, turns = steps.T
    x, y, angles = off.T
    sizes = dx * dx + dy * dy
    # Along the chord and to the left of it, in units of its length.
    units = np.where(sizes == 0.0, 1.0, sizes)
    along, beside = (x * dx + y * dy) / units, (y * dx - x * dy) / units
    # From the centre of the arc, in units of its radius, as all that follows.
    s, c = np.sin(turns / 2.0), np.cos(turns / 2.0)
    ahead, outwards = (2.0 * along - 1.0) * s, c - 2.0 * beside * s
    lever = 2.0 * s * reach / np.sqrt(units)
    # The gap is least at an end; where the heading is the same; or where the place gets farther
    # as fast as the heading nearer, when the line from one place to the other passes the centre
    # at the lever, to one side of where the places are nearest. Angles from the arc's middle on.
    squares = np.array([np.ones(len(s)), ahead ** 2 + outwards ** 2])
    shift = np.subtract(*np.arctan2(lever, np.sqrt(np.maximum(squares - lever ** 2, 0.0))))
    nearest = np.arctan2(ahead, outwards)
    least = np.array([nearest - shift, nearest + shift, _wrapped(angles - turns / 2.0)])
    shares = 0.5 + np.divide(least, turns, where=turns != 0.0, out=np.array([along - 0.5] * 3))
    # What overflows is not a number, for which the start stands.
    shares = np.vstack([np.zeros(len(s)), np.fmin(np.fmax(shares, 0.0), 1.0), np.ones(len(s))])
    off, steps = np.tile(off, (len(shares), 1)), np.tile(steps, (len(shares), 1))
    gaps = _gaps(off - _moved(steps, shares.ravel()), reach).reshape(shares.shape)
    best = np.argmin(gaps, axis=0)
    return np.asarray(shares[best, np.arange(len(best))])


def _moved(steps: NDArray[np.float64], shares: NDArray[np.float64] | float
           ) -> NDArray[np.float64]:
    """Return x, y and turn of shares of steps, each an arc."""
    halves = steps[:, 2] / 2.0
    lengths = np.divide(np.sin(halves * shares), np.sin(halves), where=halves != 0.0,
                        out=np.zeros(len(steps)) + shares)
    angles = halves * (shares - 1.0)
    c, s = lengths * np.cos(angles), lengths * np.sin(angles)
    dx, dy, turns = steps.T
    return np.column_stack([c * dx - s * dy, s * dx + c * dy, turns * shares])


def _gaps(off: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Return how far places off by x, y and an angle are, where that counts at `reach` (m)."""
    gaps: NDArray[np.float64] = np.hypot(off[:, 0], off[:, 1]) + reach * abs(_wrapped(off[:, 2]))
    return gaps


def _wrapped(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles between -pi and pi."""
    return np.asarray(angles - math.tau * np.rint(angles / math.tau))
