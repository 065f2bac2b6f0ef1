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

"""
The node under load for a long time: 4,000 obstacles a second, and what is known to happen.

A robot is by turns on an obstacle and far from all, for 0.6 s each. Every contact must be told
before it is over, and no flag may say clear once it has been told. Where the middleware loses
messages the monitor has to say so: it is unknown then, which raises the flag.
"""

import argparse
import bisect
import contextlib
from pathlib import Path
import resource
import sys
from typing import NamedTuple

import matplotlib
from node import cpu_time, ros, running
from traffic import Reader, Traffic

ROOT = Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / 'docs'), str(ROOT / 'benchmarks' / 'report')]

from page_parts import replace_part  # noqa: E402, I100
from words import table  # noqa: E402

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100

_SLICE = 10.0
_SETTLING = 3.0
_STAY = 30
_SETTLED_MINUTES = 5.0


class Reading(NamedTuple):
    """What a slice of the soak took."""

    minutes: float  # since the beginning, at the end of the slice
    megabytes: float  # memory of the node's process
    microseconds: float  # its processor time a message
    latency: float  # the greatest from publish() to the flag that follows, in ms


class Verdict(NamedTuple):
    """What the flags said of contacts."""

    contacts: int  # how often the robot came onto an obstacle
    missed: int  # how often no flag said so in time
    wrong_clears: int  # flags that said clear during a contact that had been reported
    releases: int  # how often it left
    held_back: int  # how often the flag did not fall in time
    false_alarms: int  # flags raised after the flag had fallen, with the robot clear


def memory(pid):
    """Return the memory of a process in MB."""
    return int(Path(f'/proc/{pid}/statm').read_text().split()[1]) * resource.getpagesize() / 1e6


def judge(changes, heard):
    """Return the verdict on flags heard, given what changed when; see `Traffic`."""
    times = [when for when, _ in heard]
    counts = {hit: [0, 0, 0] for hit in (True, False)}
    ends = [when for when, _ in changes[1:]] + [float('inf')]
    for (begun, hit), ended in zip(changes, ends):
        flags = [flag for _, flag in
                 heard[bisect.bisect_left(times, begun):bisect.bisect_left(times, ended)]]
        told = hit in flags
        counts[hit][0] += 1
        counts[hit][1] += not told
        if told:
            counts[hit][2] += sum(flag != hit for flag in flags[flags.index(hit):])
    return Verdict(*counts[True], *counts[False])


def soak(minutes, obstacles):
    """
    Run sets of obstacles at 10 Hz, and a robot that comes and goes, against a node's process.

    The publisher of the obstacles is replaced by another one every ten seconds. Returns readings,
    the verdict, and how many obstacle messages were sent and lost.
    """
    readings = []
    with running('monitor') as process, contextlib.closing(Reader()) as reader, \
            contextlib.closing(Traffic(obstacles, 4, 1, _STAY)) as traffic:
        traffic.connect()
        traffic.run(_SETTLING)
        traffic.changes.clear()
        traffic.heard.clear()
        count, used, sent = reader.steady(), cpu_time(process.pid), 0
        for k in range(round(60.0 * minutes / _SLICE)):
            traffic.restart()
            footprints, more, latencies = traffic.run(_SLICE)
            sent += more
            used, before = cpu_time(process.pid), used
            readings.append(Reading((k + 1) * _SLICE / 60.0, memory(process.pid),
                                    1e6 * (used - before) / (more + footprints),
                                    1e3 * max(latencies, default=float('nan'))))
            if k % 6 == 5:
                print(f'{readings[-1].minutes:5.1f} min  {readings[-1].megabytes:.1f} MB  '
                      f'{readings[-1].microseconds:.1f} us a message, greatest latency '
                      f'{max(one.latency for one in readings[-6:]):.1f} ms', flush=True)
        return (readings, judge(traffic.changes, traffic.heard), sent,
                sent - (reader.steady() - count))


def growth(readings):
    """Return by what part the memory grew after the first minutes, None if there are no more."""
    settled = [one.megabytes for one in readings if one.minutes >= _SETTLED_MINUTES]
    return max(settled) / settled[0] - 1.0 if len(settled) > 1 else None


def summary(readings, verdict, sent, lost):
    """Return the figures of a soak as a table in Markdown."""
    grown = growth(readings)
    return table(['what', 'how many'], [
        ['minutes', f'{readings[-1].minutes:.3g}'],
        ['obstacle messages', f'{sent:,}'],
        ['of these lost by the middleware', f'{lost:,}'],
        ['contacts, and missed', f'{verdict.contacts:,}, {verdict.missed}'],
        ['wrong clears', verdict.wrong_clears],
        ['departures, and not told within 0.6 s', f'{verdict.releases:,}, {verdict.held_back}'],
        ['flags raised without a contact', verdict.false_alarms],
        ['greatest latency', f'{max(one.latency for one in readings):.0f} ms'],
        ['growth of memory after 5 minutes', '–' if grown is None else f'{grown:.2%}']])


def plot(readings, path):
    """Draw memory, processor time and latency over time."""
    figure, axes = pyplot.subplots(3, 1, figsize=(8.0, 6.4), sharex=True, layout='constrained')
    minutes = [0.0] + [one.minutes for one in readings]
    for one, values, label in zip(axes, list(zip(*readings))[1:], (
            'memory [MB]', 'processor time\na message [µs]', 'greatest latency\nof 10 s [ms]')):
        one.stairs(values, minutes, baseline=None)
        one.set(ylabel=label, ylim=(0.0, 1.15 * max(values)))
        one.grid(alpha=0.3)
    axes[-1].set(xlabel='time [min]', xlim=(0.0, minutes[-1]))
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--minutes', type=float, default=30.0)
    parser.add_argument('--obstacles', type=int, default=400, help='of a set, at 10 Hz')
    parser.add_argument('--plot', metavar='FILE', help='a picture of it')
    parser.add_argument('--write', metavar='FILE', type=Path,
                        help='a page whose figures are to be replaced')
    arguments = parser.parse_args()
    with ros():
        readings, verdict, sent, lost = soak(arguments.minutes, arguments.obstacles)
    text = summary(readings, verdict, sent, lost)
    print(text)
    if arguments.plot:
        plot(readings, arguments.plot)
    if arguments.write:
        replace_part(arguments.write, 'soak', text)
    return verdict.missed + verdict.wrong_clears > 0


if __name__ == '__main__':
    sys.exit(main())
