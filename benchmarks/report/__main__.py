# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Measure everything, and write the tables and plots of docs/report: `make report`.

With --written nothing is measured, and they are made from the figures stored there. With
--accuracy only the long run against the oracle is measured, `make accuracy`: any wrong answer is a
failure.
"""

import argparse
import json
from pathlib import Path
import sys
import time

sys.path.append(str(Path(__file__).parents[1]))

from _shared import compact, describe, ROOT  # noqa: E402, I100
import libraries  # noqa: E402
import methods  # noqa: E402
import numpy as np  # noqa: E402
from page_parts import with_tables  # noqa: E402
import plots  # noqa: E402
import scenes  # noqa: E402
import stability  # noqa: E402
import tables  # noqa: E402

PACKAGES = 'numpy', 'numba', 'shapely', 'pymunk', 'box2d'
PAGES = 'README.md', 'appendix.md'
SEEDS = 1, 2, 3, 4, 5


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--scale', type=float, default=1.0,
                        help='share of the usual number of pairs')
    parser.add_argument('--written', action='store_true',
                        help='write tables and plots from the figures stored before')
    parser.add_argument('--accuracy', metavar='PAIRS', type=lambda text: int(float(text)),
                        help='compare this many answers with the oracle, and measure nothing else')
    arguments = parser.parse_args()
    directory = ROOT / 'docs' / 'report'
    stored, accuracy = (directory / f'{name}.json' for name in ('figures', 'accuracy'))
    if arguments.accuracy:
        found = stability.long_run(arguments.accuracy, SEEDS[0])
        accuracy.write_text(compact({'machine': describe('numpy'), **found}) + '\n')
    elif not arguments.written:
        stored.write_text(compact(measure(arguments.scale)) + '\n')
    figures = json.loads(stored.read_text()) | {'accuracy': json.loads(accuracy.read_text())}
    plots.write_all(figures, directory)
    for page in PAGES:
        path = directory / page
        path.write_text(with_tables(path.read_text(), tables.TABLES, figures))
    return bool(figures['accuracy']['wrong'])


def measure(scale):
    """Return all figures of the report except those of the accuracy run."""
    start = time.perf_counter()
    figures = {'seeds': SEEDS, 'machine': describe(*PACKAGES)}
    for name, measured in {
            'speed': lambda rng: methods.measure(SEEDS, scale),
            'once': lambda rng: methods.once(rng, scale),
            'decisions': lambda rng: libraries.decisions(rng, int(500 * scale)),
            'separations': lambda rng: libraries.separations(rng, int(300 * scale)),
            'contact_times': lambda rng: libraries.contact_times(rng, int(300 * scale)),
            'stepping': lambda rng: scenes.stepping(rng, int(250 * scale)),
            'non_convex': lambda rng: libraries.non_convex(rng, int(200 * scale)),
            'stars': lambda rng: libraries.stars(),
            'steps': lambda rng: stability.by_step(rng, int(4000 * scale)),
            'examples': lambda rng: stability.examples(rng, int(4000 * scale)),
            'condition': lambda rng: stability.by_condition(rng, int(4000 * scale)),
            'families': lambda rng: stability.by_family(rng, int(8000 * scale)),
            'by_offset': lambda rng: stability.by_offset(rng, int(4000 * scale)),
            'float32': lambda rng: stability.by_float32(rng, int(4000 * scale)),
            'cost': lambda rng: scenes.cost()}.items():
        print(f'{time.perf_counter() - start:6.0f} s  {name}', file=sys.stderr)
        figures[name] = measured(np.random.default_rng(SEEDS[0]))
    figures['seconds'] = round(time.perf_counter() - start)
    return figures


if __name__ == '__main__':
    sys.exit(main())
