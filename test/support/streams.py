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

"""Messages that are published continuously while a test runs."""

from contextlib import contextmanager
import threading
import time

from harness import APART, Peer


@contextmanager
def streaming(domain, topic, rate, points=APART):
    """Publish a polygon repeatedly from a thread, at a rate in Hz."""
    stop = threading.Event()
    peer = Peer(domain)

    def stream():
        due = time.monotonic()
        while not stop.wait(max(due - time.monotonic(), 0.0)):
            peer.send(topic, points, stamp=0)
            # A busy machine catches up, but by no more than this.
            due = max(due + 1 / rate, time.monotonic() - 0.5)

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        peer.close()
