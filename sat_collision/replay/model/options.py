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

"""What to check recordings with, and how."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sat_collision.replay.bag.storage import Limits

NODE = '/footprint_monitor'
RECEIVE = 'receive'
HEADER = 'header'


@dataclass(frozen=True)
class Options:
    """
    How to check recordings; times in s.

    Attributes
    ----------
    parameters : dict
        Parameters of the node by dotted name.
    footprints, obstacles : tuple of str
        Topics, or NAME:=TOPIC.
    node : str
        Full name of the node.
    as_live : bool
        Answer what the monitor would have said, instead of what touched by recorded motion.
    clock : str
        RECEIVE or HEADER: the time of a message is when it was received, or its stamp.
    start, duration : float
        What part to check, from the recording's beginning.
    max_unknown : float
        For how long in all a footprint may be unknown.
    max_undetermined : float or None
        For how long in all the motion of a footprint or source may be undetermined; None for any.
    min_ttc : float or None
        The least time to collision that is allowed, 0 for any; None not to predict any.
    sample : float
        As live, how often to measure the separation from the nearest obstacle.
    keyframes : bool
        Keep where the bodies were, to be drawn.
    write_bag : str or None
        As live, where to write what the node would have published.
    limits : Limits
        How much memory and disk may be taken.
    debug : bool
        Show where an unexpected error is raised.

    """

    parameters: Mapping[str, object] = field(default_factory=dict)
    footprints: tuple[str, ...] = ()
    obstacles: tuple[str, ...] = ()
    node: str = NODE
    as_live: bool = False
    clock: str = RECEIVE
    start: float = 0.0
    duration: float | None = None
    max_unknown: float = 1.0
    max_undetermined: float | None = None
    min_ttc: float | None = None
    sample: float = 0.1
    keyframes: bool = False
    write_bag: str | None = None
    limits: Limits = Limits()
    debug: bool = False
