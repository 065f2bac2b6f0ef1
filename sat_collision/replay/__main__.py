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

"""Where the command replay_check begins, or python -m sat_collision.replay."""

from __future__ import annotations

from collections.abc import Sequence
import sys

from sat_collision.replay.interrupts import insistent_interrupts

# That of an unknown verdict.
_STATUS_OF_INTERRUPTED = 2


def main(args: Sequence[str] | None = None) -> int:
    """Run the command until it is done, or interrupted, and return the exit status."""
    try:
        with insistent_interrupts():
            # Not before: it takes so long to import that an interrupt may come meanwhile.
            from sat_collision.replay.command import main as run
            return run(args)
    except KeyboardInterrupt:
        print('replay_check: interrupted', file=sys.stderr)
        return _STATUS_OF_INTERRUPTED


if __name__ == '__main__':
    sys.exit(main())
