# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What docs/stability.md promises is what is stored."""

import pytest

pytest.importorskip('rosbags')

from surface import STORED, surface  # noqa: E402


def test_stable_surface_is_as_stored():
    """Whether names, types, defaults, limits or signatures have changed."""
    stored, found = STORED.read_text().splitlines(), surface()
    gone = [line for line in stored if line not in found]
    new = [line for line in found if line not in stored]
    assert not (gone or new), '\n'.join([
        'what docs/stability.md promises has changed. A line that is gone, or has another type,',
        'default, limit or signature, needs a major version; a new one a minor version. Both need',
        'a line in CHANGELOG.rst. If it is meant, make surface writes test/surface.txt anew.',
        *(f'- {line}' for line in gone), *(f'+ {line}' for line in new)])
