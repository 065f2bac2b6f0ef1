# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The floor in C++ does what the floor in Python does, or is skipped with a word."""

import contextlib
import sys

from generate import ROOT
import pytest

sys.path.append(str(ROOT / 'benchmarks'))

rclpy = pytest.importorskip('rclpy')
pytest.importorskip('matplotlib')

import node  # noqa: E402, I100
from traffic import Traffic  # noqa: E402, I100

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
