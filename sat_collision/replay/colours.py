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

"""Verdicts in colour, on terminals that show any."""

from __future__ import annotations

import os
from typing import TextIO

from sat_collision.replay.verdict import Verdict

_GREEN, _RED, _YELLOW, _MAGENTA = 32, 31, 33, 35
_COLOURS = {Verdict.CLEAR: _GREEN, Verdict.COLLISION: _RED, Verdict.UNKNOWN: _YELLOW,
            Verdict.BAD_INPUT: _MAGENTA}


def with_colour(lines: list[str], verdict: Verdict, stream: TextIO) -> list[str]:
    """Return lines whose verdict, at the end of one, is coloured if the stream should have it."""
    # https://no-color.org: whatever it is set to, unless it is empty.
    if os.environ.get('NO_COLOR') or os.environ.get('TERM') == 'dumb' or not stream.isatty():
        return lines
    word = verdict.words.upper()
    coloured = f'\033[1;{_COLOURS[verdict]}m{word}\033[0m'
    return [line.removesuffix(word) + coloured if line.endswith(f' {word}') else line
            for line in lines]
