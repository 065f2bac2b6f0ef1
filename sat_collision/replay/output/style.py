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

"""Colours, and what pictures and pages say in the same words."""

from __future__ import annotations

import colorsys
from pathlib import Path

from sat_collision.replay.model.keyframes import Keyframes, ShownBody
from sat_collision.replay.model.result import Result

CONTACT, UNKNOWN, OBSTACLE, INK = '#d62728', '#9aa0a6', '#5b7089', '#2b3138'
# None of them is red or grey, which say something.
_LINES = ('#1f77b4', '#e08214', '#7b52ab', '#1a9e96', '#8c564b', '#3f8f3f', '#c2559d', '#6b7a1f')
# Of more footprints: hues from orange to violet.
_FIRST_HUE, _LAST_HUE = 0.08, 0.9


def colours(result: Result) -> dict[str, str]:
    """Return the colour of each footprint, another one for each."""
    names = [footprint.name for footprint in result.footprints]
    if len(names) <= len(_LINES):
        return dict(zip(names, _LINES))
    found = {}
    for k, name in enumerate(names):
        hue = _FIRST_HUE + (_LAST_HUE - _FIRST_HUE) * k / len(names)
        parts = colorsys.hls_to_rgb(hue, (0.38, 0.5, 0.6)[k % 3], 0.6)
        found[name] = '#' + ''.join(f'{round(255 * part):02x}' for part in parts)
    return found


def name_of(result: Result) -> str:
    """Return what a recording is called."""
    return Path(result.bag).name or result.bag


def distance(separation: float) -> str:
    """Return a separation in words."""
    if separation > 0.0:
        return f'{separation:.3g} m apart'
    return f'{-separation:.3g} m deep' if separation < 0.0 else 'touching'


def touching(result: Result, keyframes: Keyframes, time: int) -> set[ShownBody]:
    """Return the footprints and obstacles that are in contact at a time."""
    found = [(keyframes.footprint(contact.footprint), result.obstacle_of(contact))
             for contact in result.contacts if contact.first <= time <= contact.last]
    return {body for pair in found for body in pair if body is not None}
