# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Compare random recordings with the oracle of recorded motion: `make motion`."""

import argparse
from pathlib import Path
import tempfile

from test_replay_theory import compare, FORMS


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--recordings', type=float, default=1e6)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(int(parser.parse_args().recordings)):
            compare(number, FORMS[number % len(FORMS)], Path(folder, 'recording'))
            if (number + 1) % 1000 == 0:
                print(f'{number + 1} recordings agree', flush=True)


if __name__ == '__main__':
    main()
