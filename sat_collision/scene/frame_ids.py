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
"""Names of frames as received from others, made safe to print."""

import re

LONGEST_FRAME_ID = 255
_PLAIN = re.compile(r'[A-Za-z0-9_./-]{1,64}')
_MOST_SHOWN = 64


def in_quotes(text: str) -> str:
    """Return a text of no more than 64 characters, all of them visible: no new line, no colour."""
    shown = repr(text[:_MOST_SHOWN])
    return f'{shown} and so on' if len(text) > _MOST_SHOWN else shown


def in_words(name: str) -> str:
    """Return the name of a frame as it is, but in quotes where anything but letters is in it."""
    return name if _PLAIN.fullmatch(name) else in_quotes(name)
