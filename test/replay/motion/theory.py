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
import gc
from multiprocessing import Pool
from pathlib import Path
import sys
import tempfile
from time import perf_counter

from random_recordings import compare, FORMS

TOGETHER = 1000


def wrong_in(first):
    """Compare recordings from a number on; return what is wrong."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, first + TOGETHER):
            seed, k = divmod(number, len(FORMS))
            try:
                compare(seed, FORMS[k], Path(folder, 'recording'))
            except Exception as error:
                found.append(f'recording {seed}, {FORMS[k]}: {type(error).__name__}: {error}')
    gc.collect()
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--recordings', type=float, default=1e6)
    begin, done, wrong = perf_counter(), 0, 0
    last = int(parser.parse_args().recordings)
    # Garbage is collected after each thousand, which takes a tenth less time.
    with Pool(initializer=gc.disable) as pool:
        for found in pool.imap_unordered(wrong_in, range(0, last, TOGETHER)):
            done += TOGETHER
            wrong += len(found)
            rate = done / (perf_counter() - begin)
            print(*found, f'{done} recordings, {wrong} wrong, {rate:.0f} a second', sep='\n',
                  flush=True)
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
