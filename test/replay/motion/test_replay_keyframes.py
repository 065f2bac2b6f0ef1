# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The keyframes of a replay: the positions of all bodies by which contacts were decided."""

from builders import serialised
import pytest
from recordings import box, check, drive, INSTANCE, MARKS, nanoseconds, published, STAMPS, write
from sat_collision.geometry.body.polygon import Polygon
from sat_collision.geometry.query import separation
from sat_collision.replay.model.result import moments_of, Options
from sat_collision.replay.output.page import write_page

RECORDINGS = ('autoware_ego_trajectory_boxes', 'commonroad_BEL_Zaventem-1_2_T-1',
              'commonroad_USA_Lanker-1_1_ego1247', 'tysik_front_scan_polygons')
WITH_IDS = {'obstacle.type': 'polygon_instance'}


def with_keyframes(path, set_end=MARKS, **options):
    """Return the result of a check with keyframes."""
    result = check(path, Options(keyframes=True, **options), set_end=set_end)
    assert not result.problems
    return result


def nearest(keyframes, time):
    """Return the number of the moment nearest to a time."""
    return min(range(len(keyframes.moments)),
               key=lambda number: abs(keyframes.moments[number] - nanoseconds(time)))


def places(keyframes, time, is_footprint=False):
    """Return left ends of bodies by name, and whether they are known, at a time."""
    number = nearest(keyframes, time)
    return {span.name: (span.ring[:, 0].min(), span.known) for body, span in keyframes.at(number)
            if body.is_footprint is is_footprint}


def agree(result, as_live):
    """Compare the separation of each pair in contact with its depth."""
    assert result.contacts
    found = {}
    for contact in result.contacts:
        found.setdefault(contact.deepest, []).append(contact)
    for time, contacts in found.items():
        number = result.keyframes.number(time)
        assert result.keyframes.moments[number] == time
        # As live, several contacts may be deepest at one time between messages; one is shown.
        for contact in contacts if not as_live else [max(contacts, key=lambda one: one.depth)]:
            own = result.keyframes.footprint(contact.footprint).at(number)
            other = result.obstacle_of(contact).at(number)
            assert own.known and other.known
            assert separation(Polygon(own.ring), Polygon(other.ring)) == -contact.depth


@pytest.mark.parametrize('as_live', (False, True), ids=('motion', 'live'))
@pytest.mark.parametrize('name', RECORDINGS)
def test_keyframes_agree_with_the_depth_of_contacts(name, as_live):
    """Exactly, at the deepest moment of each."""
    agree(with_keyframes(published(name), STAMPS, as_live=as_live), as_live)


def test_keyframes_of_a_momentary_contact(tmp_path):
    """As live, the robot comes to where the person was, who leaves at the same time."""
    messages = []
    for tick in range(40):
        messages += [('/footprint', tick / 10, box(2.5 if tick >= 10 else 0.0)),
                     ('/obstacles', tick / 10, box(6.0 if tick >= 10 else 3.0)),
                     ('/obstacles', tick / 10, [])]
    result = with_keyframes(write(tmp_path / 'bag', messages), as_live=True)
    contact, = result.contacts
    assert contact.first == contact.last == contact.deepest and contact.depth == 0.5
    agree(result, True)


def test_bodies_are_interpolated_between_messages(tmp_path):
    """A footprint at 1 Hz and an obstacle with an id at 2 Hz."""
    messages = [('/footprint', time, box(2.0 * time)) for time in range(11)]
    messages += [('/obstacles', time / 2, serialised(box(30.0 - time), nanoseconds(time / 2),
                                                     instance=7)) for time in range(21)]
    result = with_keyframes(write(tmp_path / 'bag', messages, types={'/obstacles': INSTANCE}),
                            None, parameters=WITH_IDS)
    for time in (0.3, 4.5, 7.77):
        number = nearest(result.keyframes, time)
        moment = (result.keyframes.moments[number] - nanoseconds(0)) / 1e9
        found, = (span for body, span in result.keyframes.at(number) if body.is_footprint)
        assert found.known and found.ring[:, 0].min() == pytest.approx(2.0 * moment, abs=1e-5)
        (name, (x, known)), = places(result.keyframes, time).items()
        assert name.endswith('/7') and known and x == pytest.approx(30.0 - 2 * moment, abs=1e-5)


def test_unknown_body_stays_in_place_and_is_marked(tmp_path):
    """The footprint is silent from 4 s to 8 s."""
    messages = [message for message in drive(12.0, contact=(0, 0))
                if message[0] != '/footprint' or not 4.0 < message[1] < 8.0]
    result = with_keyframes(write(tmp_path / 'bag', messages))
    known = {time: places(result.keyframes, time, True)['footprint'][1] for time in (2, 6, 10)}
    assert known == {2: True, 6: False, 10: True}


def test_removed_obstacle_leaves_the_keyframes(tmp_path):
    messages = [message for k in range(101) for message in (
        ('/footprint', k / 10, box(0)), ('/obstacles', k / 10, box(3)),
        *([('/obstacles', k / 10, box(6))] if k < 50 else []), ('/obstacles', k / 10, []))]
    path = write(tmp_path / 'bag', messages)
    for as_live in (False, True):
        keyframes = with_keyframes(path, as_live=as_live).keyframes
        assert [len(places(keyframes, time)) for time in (2, 8)] == [2, 1]


def test_moments_are_dense_around_contacts_and_few_in_all(tmp_path):
    """Ten minutes with one contact of half a second."""
    result = with_keyframes(
        write(tmp_path / 'bag', drive(600.0, rate=2.0, contact=(300.0, 300.5))))
    moments = moments_of(result)
    assert moments == result.keyframes.moments == sorted(set(moments)) and len(moments) < 500
    near = [time for time in moments if abs(time - nanoseconds(300.0)) < 1e9]
    assert len(near) > 20
    assert max(b - a for a, b in zip(moments, moments[1:])) < 2e9


@pytest.mark.parametrize('as_live', (False, True), ids=('motion', 'live'))
def test_fault_of_the_drawing_is_said_and_loses_nothing_else(tmp_path, as_live):
    """The recording is removed before the second pass."""
    path = write(tmp_path / 'bag', drive())
    plain = check(path, Options(as_live=as_live))
    result = check(path, Options(as_live=as_live, keyframes=True), lambda share: (
        path / 'bag.mcap').unlink(missing_ok=True))
    assert plain.problems == []
    assert 'read again to be drawn' in result.problems[0]
    assert result.contacts == plain.contacts != []


@pytest.mark.parametrize('as_live', (False, True), ids=('motion', 'live'))
def test_keyframes_do_not_change_the_result(tmp_path, as_live):
    """The second pass, which draws, counts no message or fault twice; progress goes on in it."""
    path = write(tmp_path / 'bag', drive())
    with (path / 'bag.mcap').open('r+b') as file:
        file.truncate(file.seek(0, 2) - 100)
    plain = check(path, Options(as_live=as_live))
    shares = []
    result = check(path, Options(as_live=as_live, keyframes=True), shares.append)
    assert plain.problems and plain.keyframes is None and result.keyframes
    assert sum(share < 0.5 for share in shares) == sum(share >= 0.5 for share in shares) > 0
    assert shares == sorted(shares) and shares[-1] <= 1.0
    assert result.keyframes.moments[-1] == moments_of(plain)[-1]
    result.keyframes = None
    assert plain == result


def test_bodies_that_come_and_go_between_two_moments_are_left_out(tmp_path):
    """There are moments every 0.25 s, and the page can be written."""
    messages = [message for k in range(1000) for message in (
        ('/footprint', k / 10, box(0)), ('/obstacles', k / 10, box(3 + k % 50)[:3 + k % 2]))]
    result = with_keyframes(write(tmp_path / 'bag', messages), STAMPS)
    assert all(body.spans for body in result.keyframes.bodies)
    write_page([result], tmp_path / 'page.html')
