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

"""Pictures of a replay: what they show, and that it can be read."""

import functools
from itertools import combinations
from pathlib import Path
import tempfile

import pytest

pytest.importorskip('matplotlib')

from matplotlib.colors import to_hex  # noqa: E402, I100
from matplotlib.patches import Rectangle  # noqa: E402
from matplotlib.text import Text  # noqa: E402
from recordings import box, drive, published, write  # noqa: E402
from sat_collision.replay.cli.command import main  # noqa: E402
from sat_collision.replay.cli.example import write_example  # noqa: E402
from sat_collision.replay.model.configuration import parameters_of_file  # noqa: E402
from sat_collision.replay.model.options import Options  # noqa: E402
from sat_collision.replay.output.drawing import CONTACT, rows_of  # noqa: E402
from sat_collision.replay.output.figure import draw_picture  # noqa: E402
from sat_collision.replay.run import check  # noqa: E402

CROWD = 9
_FOLDER = tempfile.TemporaryDirectory(prefix='sat_collision_drawings_')
FOLDER = Path(_FOLDER.name)


@functools.cache
def of_warehouse():
    """Return the result of the example."""
    path = FOLDER / 'warehouse'
    write_example(path)
    parameters = parameters_of_file(str(path / 'params.yaml'), '/footprint_monitor')
    return check(path, Options(parameters=parameters, keyframes=True))


def of_crowd():
    """Return the result of robots with long names that stand side by side and are all met."""
    names = [f'robot_with_a_long_name_number_{k}' for k in range(CROWD)]
    messages = []
    for tick in range(301):
        time = tick / 10
        messages += [(f'/robots/{name}', time, box(1.2 * k)) for k, name in enumerate(names)]
        met = tick % 20 < 2
        messages += [('/obstacles', time, box(1.2 * k, 0.9 if met else 3.0, 0.4))
                     for k in range(CROWD)]
        messages.append(('/obstacles', time, []))
    bag = write(FOLDER / ('recording_of_a_crowd_' + 'whose_name_is_long_' * 6), messages)
    topics = tuple(f'{name}:=/robots/{name}' for name in names)
    return check(bag, Options(footprints=topics, obstacles=('/obstacles',), keyframes=True))


def of_nothing():
    """Return the result of a recording without obstacles."""
    return check(write(FOLDER / 'nothing', [('/footprint', k / 10, box(0)) for k in range(20)]),
                 Options(keyframes=True))


@functools.cache
def of_long():
    """Return the result of a contact of a quarter of a second in five minutes."""
    return check(write(FOLDER / 'long', drive(300.0, rate=4.0, contact=(170.0, 170.2))),
                 Options(keyframes=True))


def of_published(name, marks=()):
    return pytest.param(lambda: check(published(name), Options(keyframes=True)), id=name,
                        marks=marks)


RESULTS = [of_warehouse, of_crowd, of_nothing, of_long, of_published('tysik_front_scan_polygons'),
           of_published('autoware_ego_trajectory_boxes', pytest.mark.long),
           of_published('commonroad_BEL_Zaventem-1_2_T-1', pytest.mark.long)]


def texts(figure):
    """Return what is written in a figure, and where in pixels."""
    figure.canvas.draw()
    unseen = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            unseen.update(text for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks())
                          if not low <= tick.get_loc() <= high
                          for text in (tick.label1, tick.label2))
    return [(text.get_text(), text.get_window_extent()) for text in figure.findobj(Text)
            if text.get_visible() and text.get_text().strip() and text not in unseen]


@pytest.mark.parametrize('made', RESULTS)
def test_no_text_of_a_picture_covers_another_or_is_cut_off(made):
    """Names of bodies, bars, footprints, titles and numbers."""
    figure = draw_picture(made())
    found = texts(figure)
    assert len(found) > 5
    for text, bounds in found:
        assert figure.bbox.x0 <= bounds.x0 and bounds.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= bounds.y0 and bounds.y1 <= figure.bbox.y1, text
    for (text, bounds), (other, covered) in combinations(found, 2):
        assert not bounds.overlaps(covered), (text, other)


def test_picture_says_what_it_is_of_and_whose_contact_is_which():
    """The recording's name above, obstacles beside their bars and bodies."""
    result = of_warehouse()
    written = [text for text, _ in texts(draw_picture(result))]
    assert 'warehouse: collision' in written
    assert '9.698 s: amr and people/0, 0.394 m deep' in written
    # The names of rows, and of the footprint that is seen in the scene of its contact.
    assert [written.count(name) for name in ('amr', 'forklift', 'cart')] == [2, 2, 2]
    # Beside its bar, and beside its body where there is room.
    assert [written.count(f'{name}') for name in ('people/0', 'warehouse/2', 'warehouse/6')] == [
        2, 2, 1]
    titles = [text for text in written if ' s: ' in text and ' and ' in text]
    assert titles == sorted(titles, key=lambda text: float(text.split()[0])) and len(titles) == 3


def test_each_bar_lies_in_the_row_of_its_footprint():
    """At the time of the contact."""
    result = of_warehouse()
    _, rows, *_ = draw_picture(result).axes
    bars = {rows.get_yticklabels()[round(patch.get_y() + patch.get_height() / 2)].get_text():
            (patch.get_x(), patch.get_x() + patch.get_width()) for patch in rows.patches
            if isinstance(patch, Rectangle) and to_hex(patch.get_facecolor()) == CONTACT}
    assert bars == {contact.footprint: pytest.approx(
        (result.since(contact.first), result.since(contact.last))) for contact in result.contacts}


def test_bars_that_overlap_in_time_have_rows_of_their_own(tmp_path):
    """Two obstacles at once; a later one has the first row again."""
    messages = [message for k in range(100) for message in (
        ('/footprint', k / 10, box(0)),
        ('/obstacles', k / 10, box(0.75 if 20 <= k < 50 else 3)),
        ('/obstacles', k / 10, box(-0.75 if 30 <= k < 60 or k > 80 else -4)),
        ('/obstacles', k / 10, []))]
    result = check(write(tmp_path / 'bag', messages), Options(keyframes=True))
    row, = rows_of(result)
    bars = sorted((bar.first, bar.row) for bar in row.bars if bar.contact)
    assert [row for _, row in bars] == [0, 1, 0] and row.end == 2


def test_short_contact_is_seen_on_a_long_axis():
    """Two pixels wide at least, in the row and as a shade."""
    result = of_long()
    assert len(result.contacts) == 1
    curves, rows, _ = draw_picture(result).axes
    for axes in (curves, rows):
        bar, = (patch for patch in axes.patches if to_hex(patch.get_facecolor()) == CONTACT)
        assert bar.get_window_extent().width >= 2.0


@pytest.mark.parametrize('ending', ('pdf', 'svg'))
def test_pictures_of_other_kinds_are_written(tmp_path, ending):
    """As the ending says."""
    path = tmp_path / f'picture.{ending}'
    main([str(write(tmp_path / 'bag', drive(2.0))), '--plot', str(path)])
    assert path.read_bytes()[:5] in (b'%PDF-', b'<?xml')
