# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The node under load for a long time, `make soak`: contacts at known times among 4,000 obstacles/s.

The obstacles come in all forms: sets with marks, without, with new stamps, with ids, and a map. A
robot is in turns on an obstacle and far from all, for 0.6 s each. Every contact must be reported
before it is over, and no flag may say clear after that. If the middleware loses messages the state
must be unknown, which raises the flag. While it is far the robot drives towards a walking person,
so times to collision must be those until they meet, and none may be given while unknown.
"""

import argparse
import bisect
import contextlib
from importlib.util import find_spec
import math
import operator
from pathlib import Path
import resource
import statistics
import sys
import time
from typing import NamedTuple

from _shared import ROOT, table
from builders import serialised
from geometry_msgs.msg import PolygonInstanceStamped
from matplotlib import pyplot
from node import cpu_time, ros, running
import numpy as np
from page_parts import replace_part
from traffic import FOOTPRINT_RATE, Form, regular, ROBOT, SET_RATE, tail, Traffic

_WHEN = operator.itemgetter(0)
# Of a set, at 10 Hz.
_OBSTACLES = 400
_SLICE = 10.0
_SETTLING = 3.0
_STAY = 30
_SETTLED_MINUTES = 5.0
# Speeds of the robot and the person, in m/s towards +x; when they meet if they go on, in s from
# the beginning of a stay far from all; and by how many seconds a time may be wrong: a footprint
# needs some time to the node, and a flag from it.
_ROBOT_SPEED, _WALK_SPEED = -10.0, 0.2
_MEET_AFTER = 2.5
_TRANSPORT = 0.1
_WALKER_RADIUS = 0.3
# In s; stays end before contact is so near, except where footprints pause.
_THRESHOLD = 1.0
# What comes of a map is not counted: its subscription is made anew when its publisher changes.
_FORMS = (Form('obstacle', 'obstacles'), Form('unmarked', 'unmarked', has_marks=False),
          Form('stamped', 'stamped', has_marks=False), Form('tracked', 'tracked', False, True),
          Form('mapped', 'mapped', is_counted=False))
if find_spec('polygon_msgs'):
    _FORMS += (Form('whole', 'whole', is_whole=True),)
_PARAMETERS = {'obstacles': f'[{", ".join(form.source for form in _FORMS)}, walker]',
               'obstacle.topic': 'obstacles', 'stamped.set_end': 'new_stamp',
               'unmarked.timeout': 0.5, 'tracked.timeout': 0.5, 'future_tolerance': 0.5,
               'tracked.type': 'polygon_instance',
               **({'whole.type': 'polygon_collection'} if len(_FORMS) > 5 else {}),
               'mapped.timeout': 0.0, 'mapped.set_end': 'empty_polygon',
               'walker.type': 'polygon_instance', 'walker.moving': 'true',
               'footprint.min_time_to_collision': _THRESHOLD}


class Reading(NamedTuple):
    """The resources that a slice of the soak used."""

    minutes: float  # since the beginning, at the end of the slice
    megabytes: float  # memory of the node's process
    microseconds: float  # its processor time a message
    latency: float  # the greatest from publish() to the flag that follows, in ms


class Verdict(NamedTuple):
    """The verdict on flags."""

    contacts: int  # how often the robot came onto an obstacle
    missed: int  # how often no flag was raised in time
    wrong_clears: int  # flags that said clear during a contact that had been reported
    releases: int  # how often it left
    held_back: int  # how often the flag did not fall in time
    false_alarms: int  # flags raised after the flag had fallen, with the robot clear


class Times(NamedTuple):
    """The verdict on times to collision."""

    given: int  # how many were given while the robot drove towards the person
    late: int  # of these, or of those in a contact, later than when they meet
    early: int
    while_unknown: int  # how many were given while the flag was raised far from all
    error: float  # the median error of those given, in ms: above 0 if late


class Drive:
    """
    The footprints of a robot that is on an obstacle, or drives towards a walking person.

    `stays` has when each stay began, by the monotonic clock, and when they meet in it, None for
    one on the obstacle.
    """

    def __init__(self, node):
        self._publisher = node.create_publisher(PolygonInstanceStamped, 'walker', 10)
        self._begun = time.time_ns()
        self._count = 0
        self.stays = []

    def footprint_at(self, stamp):
        """Return a footprint as `Traffic` does; the person is published with every fifth."""
        walker = 1000.0 + _WALK_SPEED * (stamp - self._begun) / 1e9
        if self._count % round(FOOTPRINT_RATE / SET_RATE) == 0:
            self._publisher.publish(
                serialised(regular(4, walker, 0.0, _WALKER_RADIUS), stamp, instance=1))
        is_first, is_on = self._count % _STAY == 0, self._count // _STAY % 2 == 0
        self._count += 1
        if is_first:
            now = time.monotonic()
            self._meet_at = stamp / 1e9 + _MEET_AFTER
            self.stays.append((now, None if is_on else now - time.time() + self._meet_at))
        x = 0.0
        if not is_on:
            left = self._meet_at - stamp / 1e9
            x = walker + _WALKER_RADIUS - ROBOT[0][0] + left * (_WALK_SPEED - _ROBOT_SPEED)
        return tail(np.add(ROBOT, (x, 0.0))), is_on, is_first


def judge_times(stays, flags, times):
    """Return the verdict on the times to collision received; see `Drive.stays` and `Traffic`."""
    errors, late, unknown = [], 0, 0
    for when, seconds in times:
        k = bisect.bisect_right(stays, when, key=_WHEN) - 1
        if k < 0 or math.isnan(seconds) or when - stays[k][0] < _TRANSPORT:
            continue
        meet = stays[k][1]
        if meet is None:
            late += seconds > 0.0
            continue
        errors.append(when + seconds - meet)
        around = flags[max(bisect.bisect_right(flags, when - _TRANSPORT, key=_WHEN) - 1, 0):
                       bisect.bisect_left(flags, when + _TRANSPORT, key=_WHEN)]
        is_near = seconds < _THRESHOLD + _TRANSPORT
        unknown += bool(around) and not is_near and all(flag for _, flag in around)
    late += sum(error > _TRANSPORT for error in errors)
    early = sum(error < -_TRANSPORT for error in errors)
    return Times(len(errors), late, early, unknown,
                 1e3 * statistics.median(errors or [math.nan]))


def memory(pid):
    """Return the memory of a process in MB."""
    return int(Path(f'/proc/{pid}/statm').read_text().split()[1]) * resource.getpagesize() / 1e6


def judge(changes, received):
    """Return the verdict on the flags received, given when contacts changed; see `Traffic`."""
    counts = {hit: [0, 0, 0] for hit in (True, False)}
    starts = [bisect.bisect_left(received, begun, key=_WHEN) for begun, _ in changes]
    for (_, hit), start, end in zip(changes, starts, [*starts[1:], len(received)]):
        flags = [flag for _, flag in received[start:end]]
        counts[hit][0] += 1
        if hit in flags:
            counts[hit][2] += sum(flag != hit for flag in flags[flags.index(hit):])
        else:
            counts[hit][1] += 1
    return Verdict(*counts[True], *counts[False])


def soak(minutes):
    """
    Run sets of obstacles at 10 Hz, and a robot that comes and goes, against a node's process.

    Every ten seconds the robot meets an obstacle of the next form, whose publisher is replaced by
    another one: until that is known the flag is raised. Returns readings, the verdicts on flags
    and on times, and how many obstacle messages were sent and lost.
    """
    readings = []
    with running('monitor', _PARAMETERS) as pid, \
            contextlib.closing(Traffic(_OBSTACLES, 4, True, _FORMS)) as traffic:
        drive = Drive(traffic.node)
        traffic.footprint_at = drive.footprint_at
        traffic.connect()
        # Before settling: it may take 2 s, and then the person is unknown for its timeout.
        count = traffic.taken()
        _, sent, _ = traffic.run(_SETTLING)
        for record in (traffic.changes, traffic.received, traffic.times):
            record.clear()
        used = cpu_time(pid)
        for k in range(round(60.0 * minutes / _SLICE)):
            traffic.restart()
            footprints, more, latencies = traffic.run(_SLICE)
            sent += more
            used, before = cpu_time(pid), used
            readings.append(Reading((k + 1) * _SLICE / 60.0, memory(pid),
                                    1e6 * (used - before) / (more + footprints),
                                    1e3 * max(latencies, default=float('nan'))))
            if k % 6 == 5:
                print('{:5.1f} min  {:.1f} MB  {:.1f} us a message, latency {:.1f} ms'.format(
                    *readings[-1]), flush=True)
        return (readings, judge(traffic.changes, traffic.received),
                judge_times(drive.stays, traffic.received, traffic.times), sent,
                sent - (traffic.taken() - count))


def summary(readings, verdict, times, sent, lost):
    """Return the figures of a soak as a table in Markdown."""
    settled = [one.megabytes for one in readings if one.minutes >= _SETTLED_MINUTES]
    return table(['what', 'how many'], [
        ['minutes', f'{readings[-1].minutes:.3g}'],
        ['obstacle messages', f'{sent:,}'],
        ['of these lost by the middleware', f'{lost:,}'],
        ['contacts, and missed', f'{verdict.contacts:,}, {verdict.missed}'],
        ['wrong clears', verdict.wrong_clears],
        ['departures, and not reported within 0.6 s',
         f'{verdict.releases:,}, {verdict.held_back}'],
        ['flags raised without a contact', verdict.false_alarms],
        ['greatest latency', f'{max(one.latency for one in readings):.0f} ms'],
        ['times to collision, and late or early by 0.1 s',
         f'{times.given:,}, {times.late + times.early}'],
        ['times given while unknown', times.while_unknown],
        ['their median error', f'{times.error:.1f} ms'],
        ['growth of memory after 5 minutes',
         f'{max(settled) / settled[0] - 1.0:.2%}' if len(settled) > 1 else '–']])


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
    with ros():
        readings, verdict, times, sent, lost = soak(parser.parse_args().minutes)
    text = summary(readings, verdict, times, sent, lost)
    print(text)
    plot(readings, ROOT / 'docs' / 'soak.png')
    replace_part(ROOT / 'docs' / 'reliability.md', 'soak', text)
    return (verdict.missed + verdict.wrong_clears + times.late + times.while_unknown > 0
            or not times.given)


if __name__ == '__main__':
    sys.exit(main())
