# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The picture of a plan in docs/recipes.md shows what its caption says."""

import pytest

pytest.importorskip('matplotlib')

from path_picture import BODY, draw, POSES, SHELVES  # noqa: E402, I100
from sat_collision import first_contact_along  # noqa: E402


def test_all_poses_are_free_and_a_turn_between_two_of_them_touches():
    assert all(first_contact_along(BODY, [pose], SHELVES) is None for pose in POSES)
    assert 4.0 < first_contact_along(BODY, POSES, SHELVES).pose < 5.0
    assert draw().axes
