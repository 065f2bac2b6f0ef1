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

"""The command prepare_kernels: compiles all kernels whose dependencies are installed."""

from __future__ import annotations

import sys

from sat_collision.extras import missing


def main() -> int:
    """Prepare all kernels, or those of the library alone if replay_check cannot run."""
    try:
        import sat_collision.replay.run  # noqa: F401
    except ModuleNotFoundError as error:
        if str(error.name).startswith('sat_collision'):
            raise
        print(f'preparing the library only, without replay_check: {missing(error)}', flush=True)
        return prepare_library()
    from sat_collision.replay.kernels import main as prepare_all
    return prepare_all()


def prepare_library() -> int:
    """Prepare the kernels of the library."""
    from sat_collision.geometry.preparation import prepare_pairs, Preparation

    def say(words: str) -> None:
        print(words, flush=True)

    preparation = Preparation(say, say)
    prepare_pairs()
    preparation.complete()
    return 0


if __name__ == '__main__':
    sys.exit(main())
