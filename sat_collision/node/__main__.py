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

"""Where the process of the node begins."""

from __future__ import annotations

from collections.abc import Sequence
import os
import sys

from sat_collision import __version__
from sat_collision.node.signals import end_on_signals

_STDERR = 2


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT, SIGTERM or SIGHUP and return the exit status."""
    if '--version' in (sys.argv if args is None else args):
        print(f'sat_collision {__version__}')
        return 0
    _fill_standard_streams()
    end_on_signals()
    # Not before: it takes so long to import that a signal may come meanwhile.
    from sat_collision.node.process import run
    return run(args)


def _fill_standard_streams() -> None:
    """
    Open /dev/null as each standard stream that is closed.

    Else the next file that is opened takes its place, and what is printed goes there: into the
    pipe that ends the node on signals, for one.
    """
    while (opened := os.open(os.devnull, os.O_RDWR)) <= _STDERR:
        os.set_inheritable(opened, True)
    os.close(opened)


if __name__ == '__main__':
    sys.exit(main())
