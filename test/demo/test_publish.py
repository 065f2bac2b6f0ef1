# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""What there is to try the node with."""

import signal
import subprocess

import pytest

pytest.importorskip('rclpy')


def test_what_the_node_says_is_printed(start, run):
    """A contact and its end, from publishers in a process of their own, until an interrupt."""
    start()
    process = run('-m', 'sat_collision.demo.publish', stdout=subprocess.PIPE, text=True)
    said = [process.stdout.readline() for _ in range(2)]
    while not ('/footprint_monitor: in contact with obstacle/0\n' in said
               and said[-1] == '/footprint_monitor: clear\n'):
        said.append(process.stdout.readline())
        assert said[-1], said
    assert said[0].startswith('publishing /footprint')
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0
