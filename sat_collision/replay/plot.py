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

"""Results drawn into a file of the kind that its ending says."""

from __future__ import annotations

from sat_collision.replay.result import Result


def plot(result: Result, path: str) -> None:
    """
    Draw a result.

    Parameters
    ----------
    result : Result
        Of a check with `film`.
    path : str
        File to write: .gif is an animation, .html a page, all others a picture.

    """
    ending = path.rpartition('.')[2].lower()
    if ending == 'html':
        plot_all([result], path)
    elif ending == 'gif':
        from sat_collision.replay.drawing.animation import write_animation
        write_animation(result, path)
    else:
        from sat_collision.replay.drawing.picture import draw_picture
        draw_picture(result).savefig(path)


def plot_all(results: list[Result], path: str) -> None:
    """Write one page of several results, which are of checks with `film`."""
    from sat_collision.replay.drawing.page import write_page
    write_page(results, path)
