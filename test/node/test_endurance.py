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

"""What comes and goes leaves nothing behind."""

import os

from harness import box, RunningMonitor

APART = box(5, 5)


def held():
    """Return how many threads and open files this process has."""
    return len(os.listdir('/proc/self/task')), len(os.listdir('/proc/self/fd'))


def test_starts_and_stops(domain):
    """Of nodes that were at work, one after another."""
    counts = []
    for _ in range(12):
        monitor = RunningMonitor(domain, (), {})
        monitor.until(monitor.flag)
        monitor.close()
        counts.append(held())
    assert counts[-1] <= counts[3]


def test_publishers_that_come_and_go(start):
    """Each is heard, none is kept."""
    monitor = start()
    counts = []
    for _ in range(60):
        before = monitor.received['obstacle']
        publisher = monitor.publisher('obstacles')

        def heard():
            monitor.send_set('obstacles', APART)
            return monitor.received['obstacle'] > before
        monitor.until(heard, 'a message')
        monitor.node.destroy_publisher(publisher)
        monitor._publishers.clear()
        counts.append(held())
    assert counts[-1] <= counts[9]
