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

"""The page of the benchmarks: every sentence with a figure in it is made from the figures."""

import textwrap

from kernel import GOALS
from node import TITLES

_KERNELS = {'monitor': 'numba', 'plain': 'plain Python'}
# Times the floor, by the number of obstacles at 10 Hz.
_FLOOR_GOALS = {10: 1.4, 100: 1.2, 1000: 1.0}


def text(figures, profiles):
    """Return the page in Markdown."""
    sections = [_head(figures)]
    for name, section in (('kernel', _kernel), ('scene', _scene), ('node', _node),
                          ('frames', _frames), ('startup', _startup)):
        if name in figures:
            sections.append(section(figures[name]))
    if 'profile' in figures:
        sections.append(_profile(profiles.get('before'), figures['profile']))
    return '\n\n'.join(sections) + '\n'


def _wrapped(paragraph):
    return textwrap.fill(' '.join(paragraph.split()), 99)


def _table(head, rows):
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join(f'| {" | ".join(map(str, line))} |' for line in lines)


def _goal(met, goal):
    return f'{"met" if met else "**missed**"}: {goal}'


def _times(ratio):
    return f'{ratio:.1f} times' if ratio < 20 else f'{ratio:.0f} times'


def _head(figures):
    described = ', '.join(f'{key} {value}' for key, value in figures['machine'].items())
    return '# How fast\n\n' + _wrapped(
        f"""Every figure stands beside that of a rival or of a floor, measured in the same run by
        turns; times are medians. `make bench` measures everything again and writes this page from
        [`figures.json`](figures.json). Measured on: {described}; seed {figures['seed']}.""")


def _kernel(rows):
    lines = []
    for row in rows:
        ratio = row['shapely'] / row['ours']
        goal = GOALS.get(row['vertices']) if row['load'] == 'random_pairs' else None
        lines.append([row['load'].replace('_', ' '), row['vertices'], f'{row["ours"]:.0f}',
                      f'{row["shapely"]:.0f}', _times(ratio),
                      _goal(ratio >= goal, f'{goal} times') if goal else '',
                      f'{row["setup"]:.1f}', row['wrong']])
    random = {row['vertices']: row['ours'] for row in rows if row['load'] == 'random_pairs'}
    growth = random[1024] / random[8]
    worst = max(row['ours'] / random[row['vertices']] for row in rows
                if row['load'] != 'random_pairs')
    return '\n\n'.join([
        '## The kernel\n\n![Time against vertices](kernel.png)',
        _wrapped('Distinct pairs, streamed through one call of each side; random pairs are a '
                 'third far, a third within 0.1 of touching, a third overlapping. Shapely is '
                 'called vectorised. The setup is that of one polygon, once for its message.'),
        _table(['pairs', 'vertices', 'ns a pair', 'shapely', 'faster', 'goal', 'setup µs',
                'answers unlike shapely'], lines),
        _wrapped(f'From 8 to 1024 vertices the time grows {growth:.1f} times '
                 f'({_goal(growth <= 10, "at most 10")}). Pairs that touch exactly, which plain '
                 f'doubles cannot decide, take up to {worst:.1f} times as long as random ones '
                 f'({_goal(worst <= 10, "at most 10")}).')])


def _scene(scene):
    one = {row['obstacles']: row for row in scene['one']}
    fleet = scene['fleet']
    each = 1e3 * one[10_000]['us'] / 10_000
    first, last = scene['message'][0], scene['message'][-1]
    resident = scene['replacing']['resident']
    growth = (resident[-1] - resident[1]) / 1e6
    return '\n\n'.join([
        '## The scene\n\n![One footprint against many obstacles](scene.png)',
        _wrapped(f"""A footprint of 4 vertices against obstacles of 4 vertices scattered over
        {scene['map']:.0f} m x {scene['map']:.0f} m. The rival, shapely's STRtree, has to be built
        again whenever an obstacle moves, which the last column contains."""),
        _table(['obstacles', 'µs', 'ns an obstacle', 'STRtree µs', 'STRtree built and queried µs'],
               [[f'{row["obstacles"]:,}', f'{row["us"]:.2f}',
                 f'{1e3 * row["us"] / row["obstacles"]:.2f}', f'{row["tree_us"]:.1f}',
                 f'{row["tree_build_us"]:,.0f}'] for row in scene['one']]),
        _wrapped(f"""At 10,000 obstacles that is {each:.2f} ns an obstacle
        ({_goal(each <= 1.5, 'at most 1.5')}), at 10 it is {one[10]['us']:.2f} µs
        ({_goal(one[10]['us'] < 1.0, 'less than 1')}). A fleet of {fleet['footprints']} footprints
        against {fleet['obstacles']:,} obstacles takes {fleet['us'] / 1e3:.2f} ms; the STRtree,
        once built, {fleet['tree_us'] / 1e3:.2f} ms."""),
        _wrapped("""A message, from its bytes to the changed states, in scenes of one footprint:
        an obstacle costs the same whatever the size of the scene, a footprint the scan more."""),
        _table(['obstacles', 'obstacle message µs', 'footprint message µs'],
               [[f'{row["obstacles"]:,}', f'{row["obstacle_us"]:.1f}',
                 f'{row["footprint_us"]:.1f}'] for row in scene['message']]),
        _wrapped(f"""From {first['obstacles']} to {last['obstacles']:,} obstacles the cost of an
        obstacle message changes by a factor of {last['obstacle_us'] / first['obstacle_us']:.2f}.
        """),
        _table(['vertices', 'bytes an obstacle in the packed arrays', 'with all of the scene'],
               [[row['vertices'], f'{row["packed"]:.0f}', f'{row["scene"]:.0f}']
                for row in scene['memory']]),
        _wrapped(f"""Replacing obstacles by {scene['replacing']['messages']:,} messages changed
        the memory of the process by {growth:.1f} MB, from {resident[1] / 1e6:.0f} MB after the
        first tenth of them.""")])


def _node(node):
    loads = node['loads']
    rows = []
    for one in loads:
        own, floor, loop = one['together']['us'].values()
        ratio, goal = one['together']['times_floor'], _FLOOR_GOALS[one['obstacles']]
        alone, floor_alone, _, rival = (one[kind]['cpu_us'] for kind in TITLES)
        rows.append([one['obstacles'], one['vertices'], f'{own:.1f}', f'{floor:.1f}',
                     f'{loop:.1f}', f'{ratio:.2f}', _goal(ratio <= goal, f'at most {goal}'),
                     f'{alone:.1f}', f'{rival:.1f}', f'{rival / alone:.1f}',
                     f'{rival / floor_alone:.1f}'])
    p99 = max(one['monitor']['p99_ms'] for one in loads if one['obstacles'] == 1000)
    held = [rate for rate in node['rates'] if rate['lost'] == 0 and rate['kind'] == 'monitor']
    best = max((rate['sent_per_second'] for rate in held), default=0.0)
    bursts = [{**one, 'vertices': '4, all at once'} for one in node['bursts']]
    return '\n\n'.join([
        '## The node\n\n![Processor time and latency](node.png)',
        _wrapped(f"""One footprint at 50 Hz, every one of which changes the flag, and sets of
        obstacles at 10 Hz, spread over the period, from another process. Shapely in a callback
        has SingleThreadedExecutor, typed messages and one flag. The floor has
        EventsExecutor, raw subscriptions, callbacks that do nothing, and the same publishes; the
        floor in our loop has that instead, which takes messages in batches. Processor time is
        that of all threads, DDS's too, in µs a message. The node and its floors take the same
        messages at the same time on one core, so that none of them has the better moments of the
        machine: medians of {3 * node['repeats']} starts. Alone are nodes that have the core to
        themselves, one after the other: medians of {node['repeats']} runs by turns; greatest
        latencies and losses of all of them."""),
        _table(['obstacles', 'vertices', 'sat_collision', 'floor', 'floor in our loop',
                'times the floor', 'goal', 'sat_collision alone', 'shapely in a callback alone',
                'times less', 'floor alone, times less'], rows),
        _wrapped(_against_rival(loads)),
        'From `publish()` of a footprint to the arrival of its flag, ms:',
        _table(['obstacles', 'vertices', 'node', 'half below', '99 of 100 below', 'most',
                'obstacles lost', 'footprints unanswered'],
               [[one['obstacles'], one['vertices'], TITLES[kind],
                 *(f'{one[kind][name]:.2f}' for name in ('p50_ms', 'p99_ms', 'max_ms')),
                 one[kind]['lost'], one[kind]['unanswered']]
                for one in loads + bursts for kind in TITLES if kind in one]),
        _wrapped(f"""With 1,000 obstacles 99 of 100 flags come within {p99:.2f} ms
        ({_goal(p99 < 4.0, 'less than 4')}). Obstacle messages a second that the node takes on
        one core without losing any: {best:,.0f} ({_goal(best >= 59_000, 'at least 60,000')})."""),
        _table(['kernel', 'asked for', 'sent a second', 'lost', 'share of the core'],
               [[_KERNELS[rate['kind']], f'{rate["asked_per_second"]:,}',
                 f'{rate["sent_per_second"]:,.0f}', rate['lost'], f'{rate["core"]:.0%}']
                for rate in node['rates']])])


def _against_rival(loads):
    """Say how much less the node takes, apart where not even the floor takes five times less."""
    own, floor = ([one['rival']['cpu_us'] / one[kind]['cpu_us'] for one in loads]
                  for kind in ('monitor', 'floor'))
    least = min((own[k] for k in range(len(loads)) if floor[k] >= 5), default=0.0)
    tight = [k for k in range(len(loads)) if floor[k] < 5]
    words = [f"""Where the floor takes at least 5 times less than shapely in a callback, the
        node takes at least {least:.1f} times less ({_goal(least >= 5, 'at least 5')})."""]
    if tight:
        words.append(f"""Elsewhere the floor takes {min(floor[k] for k in tight):.1f} times less
            at least, the node {min(own[k] for k in tight):.1f} times: so few messages find a
            process asleep whose code has left the caches, and waking it is most of the cost.""")
    return ' '.join(words)


def _frames(figures):
    rows = [[f'{row["transforms"]}', f'{row["monitor_us"]:.0f}', f'{row["floor_us"]:.0f}',
             f'{row["ratio"]:.2f}', _goal(row['ratio'] <= 1.5, '1.5 times')]
            for row in figures['sizes']]
    robots, other = figures['robots'], figures['other_frame']
    monitor, floor = figures['latency']['monitor'], figures['latency']['floor']
    return '\n\n'.join([
        '## Frames',
        _wrapped('`/tf` at 100 Hz, beside a monitor that takes its bytes and does nothing with '
                 'them; processor time a message in µs.'),
        _table(['transforms', 'sat_collision', 'floor', 'ratio', 'goal'], rows),
        _wrapped(
            f"""An outline that moves with one frame at 100 Hz, and is placed at 50 Hz, makes that
            {figures["outline"]["ratio"]:.2f} times the floor. A message in another frame, whose
            map is at hand, costs {other["more_us"]:.2f} µs more than one in the fixed frame
            ({other["fixed_us"]:.1f} µs), {_goal(other["more_us"] <= 1.0, "at most 1 µs")}. 2,000
            transforms a second in as many messages take {100 * robots["core"]:.1f} % of a core
            ({_goal(robots["core"] <= 0.1, "10 %")}), {robots["ratio"]:.2f} times the floor. From
            publishing a transform to the flag that follows from it: {monitor["p50_ms"]:.2f} ms (99
            of 100 below {monitor["p99_ms"]:.1f}), of a node that looks at one byte of it
            {floor["p50_ms"]:.2f} ({floor["p99_ms"]:.1f}).""")])


def _startup(startup):
    return '## Start-up\n\n' + _wrapped(
        f"""From the start of the process to the arrival of its first flag:
        {startup['warm_s']:.2f} s, {startup['warm_s'] / startup['floor_s']:.1f} times the floor's
        {startup['floor_s']:.2f} s. The first start after an installation compiles the kernels,
        says so in the log, and takes {startup['cold_s']:.0f} s; what measures distances is
        compiled while it runs.""")


def _profile(before, after):
    profiles = [('before', before), ('now', after)] if before else [('now', after)]
    sections = [
        '## Where the time goes',
        _wrapped(f"""The node under {after['obstacles']:,} obstacles at 10 Hz, by cProfile, which
        makes calls dearer: own time in µs a message, of what is called for every other message
        at least.""")]
    for name, profile in profiles:
        sections += [
            f'{name.capitalize()}: {profile["cpu_us"]:.1f} µs a message without the profiler, '
            f'{profile["profiled_us"]:.1f} µs in Python with it.',
            _table(['function', 'calls a message', 'own µs'],
                   [[f'`{row["function"]}`', f'{row["calls"]:.1f}', f'{row["own_us"]:.2f}']
                    for row in profile['functions']])]
    return '\n\n'.join(sections)
