# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The entry point of the demo; names a missing library in one line, and compiles nothing."""

from __future__ import annotations

from collections.abc import Sequence
import signal
import sys

from sat_collision.extras import missing


def main(args: Sequence[str] | None = None) -> int:
    """Run the demo; return the exit status."""
    # While libraries load there is nothing to put away.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    try:
        from sat_collision.demo.show import show
    except ModuleNotFoundError as error:
        print(f'sat_collision_demo: {missing(error)}', file=sys.stderr)
        return 1
    compile_nothing()
    return show(args)


def compile_nothing() -> None:
    """
    Run the node in plain Python, which is fast enough, unless its kernels are compiled.

    The first flags then come after a second instead of six or more.
    """
    from sat_collision.geometry.compiled.compilation import use_plain_python
    from sat_collision.geometry.preparation import is_prepared
    if not is_prepared():
        use_plain_python()


if __name__ == '__main__':
    sys.exit(main())
