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

"""A result as a short animation: the scene as it moves, and whose contact when below it."""

from __future__ import annotations

from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
import numpy as np
from PIL import Image
from sat_collision.replay.drawing.bands import lanes_of
from sat_collision.replay.drawing.labels import fit
from sat_collision.replay.drawing.lanes import draw_lanes, height, label_lanes, ROW
from sat_collision.replay.drawing.scene import draw_scene, look_at_all
from sat_collision.replay.drawing.words import distance, INK, name_of
from sat_collision.replay.film import deepest_contacts, Film
from sat_collision.replay.result import Contact, Result

_DPI = 80
_FRAMES = 72
_MOST_CONTACTS = 5
# For how many ms a moment is shown, and one at which a contact is deepest.
_SHOWN = 120
_STILL = 1000


def write_animation(result: Result, path: str) -> None:
    """
    Write a result as an animated GIF of some ten seconds, small enough for a message.

    Parameters
    ----------
    result : Result
        Of a check with `film`.
    path : str

    """
    film = result.film or Film([result.start or 0])
    lanes = lanes_of(result)
    below = ROW * height(lanes)
    figure = Figure(figsize=(9, 5.6 + below), dpi=_DPI,
                    layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1))
    canvas: Any = FigureCanvasAgg(figure)
    scene, lane_axes = figure.subplots(2, 1, height_ratios=(5, below))
    draw_lanes(result, lanes, lane_axes)
    title = figure.suptitle(f'{name_of(result)}: {result.verdict.words}', fontsize=13,
                            fontweight='bold', color=INK)
    fit(title, 0.96 * figure.bbox.width)
    scene.set_title(' ', fontsize=10)
    scene.set(xlabel='x [m]', ylabel='y [m]')
    for _ in range(2):
        figure.draw_without_rendering()
        look_at_all(scene, film)
    figure.set_layout_engine('none')
    label_lanes(result, lanes, lane_axes)
    cursor = lane_axes.axvline(0.0, color=INK, linewidth=1.5, zorder=6)
    contacts = {film.number(contact.deepest): contact
                for contact in deepest_contacts(result)[:_MOST_CONTACTS]}
    frames, durations = [], []
    for number in _numbers(film, contacts):
        for artist in (*scene.patches, *scene.lines, *scene.texts):
            artist.remove()
        draw_scene(result, film, number, scene)
        time = result.since(film.moments[number])
        words = scene.set_title(_words(time, contacts.get(number)), fontsize=10)
        fit(words, scene.bbox.width)
        cursor.set_xdata([time, time])
        canvas.draw()
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
        durations.append(_STILL if number in contacts else _SHOWN)
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=durations, loop=0)


def _numbers(film: Film, contacts: dict[int, Contact]) -> list[int]:
    """Return the numbers of the moments to show: evenly spread, and where contacts are deepest."""
    first, last = film.moments[0], film.moments[-1]
    even = {film.number(first + (last - first) * k // _FRAMES) for k in range(_FRAMES + 1)}
    return sorted(even | contacts.keys())


def _words(time: float, contact: Contact | None) -> str:
    if contact is None:
        return f'{time:.2f} s'
    return (f'{time:.2f} s: {contact.footprint} and {contact.obstacle}, '
            f'{distance(0.0 - contact.depth)}')
