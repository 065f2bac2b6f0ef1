# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Benchmarks with a node: how the soak judges flags and times, and the floor in C++."""

import contextlib
import sys

from generate import ROOT
import pytest

sys.path.append(str(ROOT / 'benchmarks'))

rclpy = pytest.importorskip('rclpy')
pytest.importorskip('matplotlib')

import node  # noqa: E402, I100
from soak import judge, judge_times, Times, Verdict  # noqa: E402
from traffic import Traffic  # noqa: E402

CHANGES = [(0.0, True), (1.0, False), (2.0, True), (3.0, False)]
GOOD = [(0.01, False), (0.02, True), (0.5, True), (1.01, True), (1.02, False), (1.9, False),
        (2.1, True), (3.1, False)]


@pytest.mark.parametrize('flags, expected', [
    (GOOD, Verdict(2, 0, 0, 2, 0, 0)),
    ([one for one in GOOD if one != (2.1, True)], Verdict(2, 1, 0, 2, 0, 0)),
    (sorted([*GOOD, (0.7, False), (0.8, False)]), Verdict(2, 0, 2, 2, 0, 0)),
    (sorted([*GOOD, (1.5, True)]), Verdict(2, 0, 0, 2, 0, 1)),
    ([one for one in GOOD if one[0] < 3.0], Verdict(2, 0, 0, 2, 1, 0)),
    ([], Verdict(2, 2, 0, 2, 2, 0)),
], ids=['good', 'missed', 'wrong clears', 'false collision', 'delayed', 'silence'])
def test_verdict_on_flags(flags, expected):
    """A flag may be late while the robot stays, but not after that."""
    assert judge(CHANGES, flags) == expected


NAN = float('nan')
STAYS = [(0.0, None), (1.0, 3.5), (2.0, None)]
FLAGS = [(0.01, True), (1.01, False), (2.01, True)]
TIMES = [(0.01, NAN), (0.02, 0.0), (0.9, 0.0), (1.01, 0.0), (1.2, 2.31), (1.5, 2.01), (2.2, 0.0)]


@pytest.mark.parametrize('times, flags, expected', [
    (TIMES, FLAGS, Times(2, 0, 0, 0, pytest.approx(10.0))),
    ([*TIMES, (2.3, 0.5)], FLAGS, Times(2, 1, 0, 0, pytest.approx(10.0))),
    ([(1.2, 2.5), (1.5, 2.3), (1.6, 1.5)], FLAGS, Times(3, 2, 1, 0, pytest.approx(200.0))),
    (TIMES, [(0.01, True), (1.25, False), (2.01, True)], Times(2, 0, 0, 0, pytest.approx(10.0))),
    (TIMES, [(0.01, True), (1.4, False), (2.01, True)], Times(2, 0, 0, 1, pytest.approx(10.0))),
    ([(1.5, NAN)], [(0.01, True)], Times(0, 0, 0, 0, pytest.approx(NAN, nan_ok=True))),
], ids=['good', 'in contact', 'late and early', 'delayed flag', 'late flag', 'none'])
def test_verdict_on_times(times, flags, expected):
    """Times in the first moments of a stay may belong to the one before."""
    assert judge_times(STAYS, flags, times) == expected


TOPICS = ('/footprint_monitor/collision', '/footprint_monitor/footprint/collision', '/diagnostics')


def test_skipped_with_a_word_without_rclcpp(monkeypatch, capsys):
    monkeypatch.setenv('PATH', '')
    assert node.measure_cpp() is None
    assert 'apt install cmake g++ ros-jazzy-rclcpp' in capsys.readouterr().err


@pytest.mark.long
def test_floor_in_cpp_publishes_and_counts_as_in_python(tmp_path, monkeypatch, domain):
    program = node.build_floor(tmp_path)
    if not program:
        pytest.skip('apt install ros-jazzy-rclcpp')
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    rclpy.init()
    try:
        assert published_by(program) == published_by('floor')
    finally:
        rclpy.shutdown()


def published_by(kind):
    """Return the QoS of what a node publishes, which must answer and count its obstacles."""
    with node.running(kind), contextlib.closing(Traffic(10, 4)) as traffic:
        traffic.connect()
        before = traffic.taken()
        _, sent, _ = traffic.run(0.5)
        assert traffic.received[-1][1] is traffic.changes[-1][1]
        assert traffic.taken() - before == sent
        found = {topic: traffic.node.get_publishers_info_by_topic(topic) for topic in TOPICS}
        return {topic: [str(info.qos_profile) for info in infos] for topic, infos in found.items()}
