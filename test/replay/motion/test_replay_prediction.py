# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""Times to collision predicted from recorded motion."""

import csv
from fractions import Fraction
import json
import math
from xml.etree import ElementTree

from builders import SECOND, serialised
import numpy as np
from published import DATA
import pytest
from recordings import box, check, declared, INSTANCE, main, nanoseconds, SOURCE, STAMPS, write
from sat_collision.replay.model.result import Options, Verdict
import shapely
from shapely.affinity import affine_transform

NUPLAN = json.loads((DATA / 'prediction.json').read_text())['time_to_collision']


def since(result, samples):
    """Return samples by tenths of a second since the recording begins."""
    return {round((time - result.origin) * 10 / SECOND): value for time, value in samples}


def approach(gap=Fraction(5), back=30):
    """Return a robot at 5/4 m/s before a wall, which drives back after some tenths."""
    messages = []
    for k in range(back + 20):
        x = Fraction(min(k, 2 * back - k), 8)
        messages += [('/footprint', k / 10, box(float(x))),
                     ('/obstacles', k / 10, box(float(1 + gap))), ('/obstacles', k / 10, [])]
    return messages


def test_time_until_within_the_margin(tmp_path):
    result = check(write(tmp_path / 'bag', approach()),
                   Options(min_ttc=0.5, parameters={'margin': 0.25}))
    samples = since(result, result.footprints[0].time_to_collision)
    assert samples[29] == pytest.approx(0.9, abs=1e-9)


def test_times_before_a_wall_are_exact(tmp_path):
    """Unknown at first, then 5 m at 5/4 m/s, and none while it drives back."""
    result = check(write(tmp_path / 'bag', approach()), Options(min_ttc=0.5))
    footprint, = result.footprints
    samples = since(result, footprint.time_to_collision)
    assert result.unknown[0].last == nanoseconds(0.1) and samples.pop(0) is None
    for k, value in samples.items():
        exact = (5 - Fraction(k, 8)) / Fraction(5, 4)
        if 10 < k < 30:
            assert exact - Fraction(1, 10**9) < value <= exact
        elif k != 10:
            assert value is None
    least = footprint.soonest
    assert (least.time, least.obstacle) == (nanoseconds(2.9), f'{SOURCE}/0')
    assert least.time_to_collision == samples[29] == pytest.approx(1.1, abs=1e-9)
    assert result.verdict is Verdict.CLEAR


def test_time_with_two_moving_bodies(tmp_path):
    """12 m apart at 2 m/s and 3 m/s; every tenth message is refused."""
    messages = []
    for k in range(20):
        own = box(k / 5) if k % 10 else [*box(k / 5), (math.nan, 0)]
        messages += [('/footprint', k / 10, own), ('/obstacles', k / 10, box(13 - 3 * k / 10)),
                     ('/obstacles', k / 10, [])]
    result = check(write(tmp_path / 'bag', messages), Options(min_ttc=0.0))
    samples = since(result, result.footprints[0].time_to_collision)
    found = {k: value for k, value in samples.items() if value is not None}
    assert found == {k: pytest.approx(2.4 - k / 10, abs=1e-5)
                     for k in (*range(1, 9), *range(11, 19))}


@pytest.mark.parametrize('seed', range(4))
def test_times_on_arcs_are_never_late(tmp_path, seed):
    """Compared with constant twists sampled every millisecond."""
    rng = np.random.default_rng(seed)
    speed, turn = rng.uniform(1, 3), rng.choice([-1, 1]) * rng.uniform(0.3, 1.0)
    outline = shapely.Polygon([(-0.5, -0.3), (1, -0.3), (1, 0.3), (-0.5, 0.3)])

    def placed(time):
        c, s = math.cos(turn * time), math.sin(turn * time)
        return affine_transform(outline, [c, -s, s, c, speed / turn * s, speed / turn * (1 - c)])

    x, y = placed(2.6).centroid.coords[0]
    wall = shapely.box(x - 0.4, y - 0.4, x + 0.4, y + 0.4)
    messages = []
    for k in range(15):
        messages += [('/footprint', k / 10, [*placed(k / 10).exterior.coords][:-1]),
                     ('/walls', k / 10, [*wall.exterior.coords][:-1])]
    result = check(write(tmp_path / 'bag', messages),
                   Options(footprints=('/footprint',), obstacles=('/walls',), min_ttc=0.0,
                           parameters=declared(STAMPS, 'walls')))
    touched = next(time for time in np.arange(0, 3.5, 1e-3) if placed(time).intersects(wall))
    samples = since(result, result.footprints[0].time_to_collision)
    found = {k: value for k, value in samples.items() if value is not None}
    assert len(found) >= 10
    for k, value in found.items():
        assert touched - 1e-3 - 2e-3 / speed <= value + k / 10 <= touched + 1e-4


@pytest.mark.parametrize('scene', NUPLAN, ids=lambda scene: scene['name'])
def test_scenes_of_nuplan(tmp_path, scene):
    """The time at the scene's moment is the first of its exact ones."""
    def at(points, velocity, tenths):
        return (np.array(points) + np.array(velocity) * tenths / 10).tolist()

    messages = []
    for k in range(5):
        for number, (track, velocity, _, _) in enumerate(scene['tracks'], 1):
            messages.append(('/tracks', k / 10, serialised(
                at(track, velocity, k - 3), nanoseconds(k / 10), instance=number)))
        messages.append(('/ego', k / 10, at(scene['ego'], scene['ego_velocity'], k - 3)))
    result = check(write(tmp_path / 'bag', messages, types={'/tracks': INSTANCE}), Options(
        footprints=('/ego',), obstacles=('tracks:=/tracks',), min_ttc=scene['horizon'],
        parameters={'tracks.timeout': 0.2, 'future_tolerance': 0.05}))
    samples = since(result, result.footprints[0].time_to_collision)
    first = min((exact for *_, exact in scene['tracks'] if exact is not None), default=None)
    assert samples[3] == (first if first is None else pytest.approx(first, abs=1e-4))


def test_no_time_while_unknown(tmp_path):
    """Before the first whole set, and while the wall is silent."""
    messages = [(topic, time, content) for topic, time, content in approach(Fraction(3), back=20)
                if topic == '/footprint' or not 1.0 < time < 3.0]
    result = check(write(tmp_path / 'bag', messages),
                   Options(min_ttc=0.0, parameters={f'{SOURCE}.timeout': 0.5}))
    unknown = [(one.first, one.last) for one in result.unknown]
    assert len(unknown) == 2 and unknown[1][1] - unknown[1][0] > SECOND
    known = 0
    for time, value in result.footprints[0].time_to_collision:
        known += value is not None
        assert value is None or not any(first <= time < last for first, last in unknown)
    assert known > 5


def test_min_ttc(tmp_path, capsys):
    """It drives back 1.1 s before the wall."""
    bag = str(write(tmp_path / 'bag', approach()))
    files = {option: str(tmp_path / f'result.{option}') for option in ('json', 'csv', 'junit')}
    outputs = [part for option, path in files.items() for part in (f'--{option}', path)]
    assert main([bag, *outputs, '--max-unknown', '1']) == 0
    footprint, = json.load(open(files['json']))['bags'][0]['footprints']
    assert not {'soonest', 'time_to_collision'} & {*footprint}
    assert main([bag, '--min-ttc', '1']) == main([bag, '--min-ttc', '0']) == 0
    capsys.readouterr()
    page = tmp_path / 'page.html'
    assert main([bag, *outputs, '--plot', str(page), '--min-ttc', '1.5']) == 1
    assert '"ahead":[[0.0,null],[0.1,null],' in page.read_text()
    words = f'a collision with {SOURCE}/0 was 1.100 s ahead at 2.900 s, --min-ttc is 1.5 s'
    assert f'footprint: {words}' in capsys.readouterr().out
    failure = ElementTree.parse(files['junit']).find('.//testcase[@name="footprint"]/failure')
    assert failure.get('message') == words
    found, = json.load(open(files['json']))['bags']
    footprint, = found['footprints']
    assert (found['verdict'], found['min_ttc'], found['contacts']) == ('collision', 1.5, [])
    assert footprint['soonest'] == {'time_to_collision': pytest.approx(1.1, abs=1e-9),
                                    'time': nanoseconds(2.9), 'obstacle': f'{SOURCE}/0'}
    with open(files['csv'], newline='') as file:
        rows = [row for row in csv.DictReader(file) if row['kind'] == 'time to collision']
    assert [float(row['time_to_collision_s']) for row in rows] == [
        value for _, value in footprint['time_to_collision'] if value is not None]
    assert rows[-1]['first_ns'] == str(nanoseconds(2.9))
    assert main([bag, '--min-ttc', '1.5', '--expect', files['json']]) == 0


def test_min_ttc_needs_recorded_motion(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['bag', '--min-ttc', '1', '--as-live'])
    assert ended.value.code == 3 and '--min-ttc' in capsys.readouterr().err
