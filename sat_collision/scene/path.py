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

from functools import cached_property
import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.polygon import Affine2D, Polygon
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.velocity import is_upside_down, Pose

_Array: TypeAlias = NDArray[np.float64]

# A shorter way from pose to pose, in m, has no direction: it may be one of rounding.
_SHORTEST = 1e-6
# How close to each other, in m and rad, are the places that are compared with the robot's, unless
# they would be more than so many, and the poses.
_CLOSE = 0.05
_MANY = 20_000
# Paths are uneven: one is followed on to where it is nearest to the robot as long as it leads away
# by no more than this share of the reach; angles count as this share of what they are.
_BUMP = 0.04
_OF_ANGLES = 0.2


class PathCheck(NamedTuple):
    """Where a path first meets an obstacle, ahead of the robot."""

    metres: float  # from the robot on, along the path; 0 in contact, infinity for none
    reason: str = ''  # why it is unknown; then metres are NaN
    pose: float = math.nan  # counted from 0 in the path received, 3.25 between 3 and 4
    obstacle: ObstacleId | None = None
    way: _Array | None = None  # (n, 2): the path from the robot to the contact, m
    outline: _Array | None = None  # the vertices of the footprint there
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

    def __init__(self, numbers: _Array) -> None:
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
        moving = np.flatnonzero(abs(ways).max(axis=1) > _SHORTEST)
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

    @cached_property
    def _divided(self) -> _Array:
        """Return places on the path, close to each other, the metres until there and the poses."""
        steps = _steps(self.poses[:-1], self.poses[1:])
        sizes = np.hypot(*steps[:, :2].T) + abs(steps[:, 2])
        counts = np.ceil(sizes / max(_CLOSE, sizes.sum() / _MANY)).clip(1).astype(int)
        k = np.repeat(np.arange(len(steps)), counts)
        shares = (np.arange(len(k)) - (np.cumsum(counts) - counts)[k]) / counts[k]
        there = np.vstack([self.poses[k] + _moved(steps[k], shares), self.poses[-1:]])
        ways = np.append(0.0, np.cumsum(np.hypot(*np.diff(there[:, :2], axis=0).T)))
        return np.column_stack([np.append(k + shares, len(steps)), ways, there])

    def advance(self, pose: Pose, reach: float) -> None:
        """
        Move the progress to where the path is nearest to the robot, back only by a reach or more.

        Angles count as ways of a point at `reach` (m). Of several parts of the path that are as
        near, to within the reach, the first one ahead counts, but one behind that is nearer along
        the path by more than twice the reach.
        """
        places, ways, close = self._divided[:, 0], self._divided[:, 1], self._divided[:, 2:]
        gaps = _gaps(pose - close, reach)
        own = int(np.searchsorted(places, self.progress, 'right')) - 1
        # How far along the path each place is from the last one; behind that, by two reaches more.
        ahead = ways - ways[own]
        ahead[:own] = 2.0 * reach - ahead[:own]
        near = gaps.min() + reach + np.diff(ways).max(initial=0.0)
        k = int(np.argmin(np.where(gaps <= near, ahead, math.inf)))
        # From there on, or back, to the nearest one before the path leads away.
        on = 1 if k >= own else -1
        away = _gaps(pose - close[k::on], 0.0 if self.is_by_travel else _OF_ANGLES * reach)
        leads_away = away > np.minimum.accumulate(away) + _BUMP * reach
        k += on * int(np.argmin(gaps[k::on][:int(np.argmax(np.append(leads_away, True)))]))
        place = _between(places, close, k, pose, reach)
        self.progress = max(self.progress, place) if on > 0 else place

    def at(self, place: float) -> _Array:
        """Return the pose at a place, on the arc between two poses."""
        k, share = int(place), place % 1.0
        if share == 0.0:
            return np.asarray(self.poses[k])
        ends = self.poses[k:k + 2]
        return np.asarray(ends[0] + _moved(_steps(ends[:1], ends[1:]), share)[0])

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


def _steps(starts: _Array, ends: _Array) -> _Array:
    """Return x, y and turn from poses to others, the shorter way round."""
    steps = ends - starts
    steps[:, 2] = _wrapped(steps[:, 2])
    return steps


def _between(places: _Array, close: _Array, k: int, pose: Pose, reach: float) -> float:
    """Return the nearest place beside place k; here angles count as ways across."""
    k = max(k - 1, 0)
    size = 1.0, 1.0, reach
    steps = _steps(close[k:-1][:2], close[k + 1:][:2]) * size
    off = _steps(close[k:-1][:2], np.array([pose])) * size
    squares = (steps ** 2).sum(axis=1)
    shares = ((off * steps).sum(axis=1) / np.where(squares, squares, 1.0)).clip(0.0, 1.0)
    if not len(shares):
        return 0.0
    j = int(np.argmin(((off - shares[:, None] * steps) ** 2).sum(axis=1)))
    return float(places[k + j] + shares[j] * (places[k + j + 1] - places[k + j]))


def _moved(steps: _Array, shares: _Array | float) -> _Array:
    """Return x, y and turn of shares of steps, each an arc."""
    turns = 1j * steps[:, 2]
    parts = np.divide(np.expm1(turns * shares), np.expm1(turns), where=turns != 0.0,
                      out=np.zeros(len(steps)) + shares + 0j)
    ways = steps[:, :2] @ (1.0, 1j) * parts
    return np.column_stack([ways.real, ways.imag, steps[:, 2] * shares])


def _gaps(off: _Array, reach: float) -> _Array:
    """Return how far places off by x, y and an angle are, where that counts at `reach` (m)."""
    return np.asarray(np.hypot(off[:, 0], off[:, 1]) + reach * abs(_wrapped(off[:, 2])))


def _wrapped(angles: _Array) -> _Array:
    """Return angles between -pi and pi."""
    return np.asarray(angles - math.tau * np.rint(angles / math.tau))
