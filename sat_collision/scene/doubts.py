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

"""Why a source of obstacles cannot be trusted, in words."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from sat_collision.scene.settings import ObstacleSettings

# Stamps so far from the present, in ns, are by another clock.
FAR = 3600 * 10**9
BY_ANOTHER_CLOCK = ('more than an hour from the clock of this node: set use_sim_time: true where '
                    'a recording or a simulation tells the time by /clock')


@dataclass(slots=True)
class Doubts:
    """
    What is wrong with a source of obstacles.

    Attributes
    ----------
    is_heard : bool
        Whether anything has come since the source was last forgotten.
    is_far : bool
        Whether all that came of late had stamps of another clock than ours.
    is_silent : bool
        Whether nothing has come for longer than the timeout.
    is_known : bool
        Whether a set has been whole since of which nothing was missed.
    is_lossy : bool
        Whether messages were lost that nothing has made up for yet.
    is_cut : bool
        Whether the window cuts sets in two.
    is_behind : bool
        Whether messages are more than can be checked.
    publishers : int or None
        How many there are, None if that is not known.
    is_left : bool
        Whether there was a publisher, and is none any more.
    refusals : Counter
        How many obstacles are refused, by reason.

    """

    is_heard: bool = False
    is_far: bool = False
    is_silent: bool = False
    is_known: bool = False
    is_lossy: bool = False
    is_cut: bool = False
    is_behind: bool = False
    publishers: int | None = None
    is_left: bool = False
    refusals: Counter[str] = field(default_factory=Counter)

    def note_late(self, age: int) -> None:
        """Take note that a message was of no use because of its age in ns."""
        self.is_far |= age > FAR

    def hear(self) -> bool:
        """Take note of a sign of life; tell whether it was missed before."""
        was_missed = not self.is_heard or self.is_silent
        if was_missed:
            self.is_heard, self.is_far, self.is_silent = True, False, False
        return was_missed

    def in_words(self, settings: ObstacleSettings, in_sets: bool) -> tuple[str, ...]:
        """Return a sentence for each doubt, none for a source that is disabled."""
        if not settings.enabled:
            return ()
        timeout = f'{settings.timeout:g} s'
        words = []
        if self.is_left:
            words.append('has no publisher any more')
        elif self.is_far and (self.is_silent or not self.is_heard):
            words.append(f'has stamps that are {BY_ANOTHER_CLOCK}')
        elif not self.is_heard:
            words.append('has not been heard yet')
        elif self.is_silent:
            words.append(f'has been silent for longer than its timeout of {timeout}')
        elif in_sets and not self.is_known:
            words.append('has not sent a whole set yet')
        if in_sets and (self.publishers or 0) > 1:
            words.append(f'has {self.publishers} publishers, whose sets cannot be told apart: '
                         'give each a topic and a name of its own, use ids, or set accumulate')
        if self.is_lossy:
            words.append('lost messages on the way, which may have told of obstacles, '
                         f'{_cure(settings, in_sets)}; publish less at once or raise the depth '
                         'of the subscription')
        if in_sets and self.is_cut:
            words.append('sends sets that set_window cuts in two: set it to more than a set '
                         'takes or to 0 with one stamp a set, use ids, or set accumulate')
        if self.is_behind:
            words.append('sends more than can be checked: messages come too late or are lost')
        words += [f'sent what was refused: {reason}' for reason in sorted(+self.refusals)]
        return tuple(f'obstacle source {settings.name} on {settings.topic} {word}'
                     for word in words)


def _cure(settings: ObstacleSettings, in_sets: bool) -> str:
    """Say until when a loss counts."""
    if in_sets:
        return 'and has not sent a whole set since'
    if settings.timeout:
        return f'and its timeout of {settings.timeout:g} s has not passed since'
    return 'and, as nothing of it times out, counts until it is disabled and enabled again'
