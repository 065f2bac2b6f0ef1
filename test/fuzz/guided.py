# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Coverage-guided fuzzing of messages with atheris, if it is installed.

The arguments are those of libFuzzer, such as -runs=1000000.
"""

import os
from pathlib import Path
import sys
import tempfile

os.environ['NUMBA_DISABLE_JIT'] = '1'

import atheris  # noqa: E402

with atheris.instrument_imports(include=['sat_collision.messages', 'sat_collision.monitor']):
    from builders import box, odometry, serialised, transforms  # noqa: I100, from fuzz's path
    from fuzz import check_message
    from sat_collision.messages.cdr import decode_odometry, decode_transforms, MessageError
    from sat_collision.messages.transform_listener import TF, TF_STATIC
    from sat_collision.monitor import Monitor
    from sat_collision.replay.model.configuration import settings_of

MONITOR = Monitor(settings_of({'frame_id': 'map'}), transforms=True)


def take(data):
    """Receive bytes as the kind of message that their first one selects."""
    kind, data = data[:1], bytes(data[1:])
    if kind in (b'f', b'o'):
        check_message(data, 'footprint' if kind == b'f' else 'obstacle', MONITOR)
        return
    try:
        decode_odometry(data) if kind == b'p' else decode_transforms(data)
    except MessageError as error:
        assert str(error).isprintable()
    for one in MONITOR.receive_transforms(TF if kind == b't' else TF_STATIC, data, 10**18):
        assert one.text.isprintable()


def main():
    """Start from valid messages."""
    good = {'f': serialised(box(0.0)), 'o': serialised(box(3.0), order='>'),
            't': transforms(('map', 'odom', 1, 2.0, 3.0)),
            's': transforms(('odom', 'base', 1, 2.0, 3.0)),
            'p': odometry('map', 'base', 1, 2.0, 3.0)}
    with tempfile.TemporaryDirectory() as folder:
        for kind, data in good.items():
            Path(folder, kind).write_bytes(kind.encode() + data)
        atheris.Setup([*sys.argv, folder], take)
        atheris.Fuzz()


if __name__ == '__main__':
    main()
