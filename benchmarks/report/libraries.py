# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Libraries from PyPI, called pair by pair from Python: times and errors.

Each makes a body of convex vertices and decides whether two meet; some measure how far apart they
are, or when they meet in motion. Box2D computes in float32, gives polygons a skin of 1 cm, welds
vertices nearer than 2.5 mm and takes at most 16 of them.
"""

from fractions import Fraction
import math
from typing import Callable, NamedTuple

from _shared import medians
import families
from methods import counts, Pairs, run, sample, shapely_shape
import numpy as np
import oracle
import rationals
from sat_collision import contact, intersects, Polygon, separation, time_of_contact
import shapely

try:
    import Box2D
except ImportError:
    Box2D = None
try:
    # The C function under Shape.shapes_collide, which in pymunk 7.3 asserts on separate shapes.
    from pymunk import Body, Poly, Segment
    from pymunk._chipmunk_cffi import lib as chipmunk
except ImportError:
    chipmunk = None

LABELS = {'improved': 'sat_collision', 'shapely': 'shapely', 'chipmunk': 'Chipmunk',
          'box2d': 'Box2D'}
SAMPLES = 100
REPEATS = 5
SIDES = 4, 16, 64
RATED = 16
NON_CONVEX_SIDES = 16, 64, 256
STAR_SIDES = 8, 64, 256, 1024
STARS_APART = 0.01, 1.0, 1.4
# Families in which numbers overflow and underflow, the first four; then rounding decides the sign.
MEASURED = 'near', 'deep', *families.EXTREME, 'extreme_scales', 'hair_gaps', 'vertex_on_edge', \
    'slivers', 'containment', 'far_offsets'


class Library(NamedTuple):
    """The functions of a library; None for those that it does not have."""

    make: Callable  # makes a body of an (n, 2) array
    meets: Callable  # of two bodies
    distance: Callable | None = None  # of two bodies
    # When an array first meets another one that moves by a vector from time 0 to 1, None if never.
    time: Callable | None = None
    max_vertices: int = 10**6
    is_fragile: bool = False  # whether hard pairs may end the process


def _chipmunk_shape(body):
    place = Body(body_type=Body.STATIC)
    points = body.tolist()
    shape = Poly(place, points) if len(body) > 2 else Segment(place, points[0], points[-1], 0)
    shape.cache_bb()
    return shape


def _sampled_time(body, other, move):
    """Test with shapely at equal time steps, as many programs do."""
    a, b = shapely_shape(body), shapely_shape(other)
    for k in range(SAMPLES + 1):
        x, y = k / SAMPLES * move
        if a.intersects(shapely.affinity.translate(b, x, y)):
            return k / SAMPLES
    return None


def _box2d_time(body, other, move):
    sweeps = Box2D.b2Sweep(), Box2D.b2Sweep()
    for sweep, end in zip(sweeps, ((0, 0), tuple(move.tolist()))):
        sweep.localCenter, sweep.c0, sweep.c = (0, 0), (0, 0), end
        sweep.a0 = sweep.a = sweep.alpha0 = 0
    state, time = Box2D.b2TimeOfImpact(
        shapeA=_box2d_shape(body), shapeB=_box2d_shape(other),
        sweepA=sweeps[0], sweepB=sweeps[1], tMax=1.0)
    return time if state in (Box2D.b2TOIOutput.e_touching, Box2D.b2TOIOutput.e_overlapped) \
        else None


def _box2d_shape(body):
    return Box2D.b2PolygonShape(vertices=body.tolist())


LIBRARIES = {
    'improved': Library(Polygon, intersects, separation,
                        lambda a, b, move: time_of_contact(a, a, b, b + move)),
    'shapely': Library(shapely_shape, shapely.intersects, shapely.distance, _sampled_time),
}
if chipmunk is not None:
    LIBRARIES['chipmunk'] = Library(
        _chipmunk_shape, lambda a, b: chipmunk.cpShapesCollide(a._shape, b._shape).count > 0)
if Box2D is not None:
    HERE = Box2D.b2Transform()
    HERE.SetIdentity()
    LIBRARIES['box2d'] = Library(
        _box2d_shape,
        lambda a, b: Box2D.b2TestOverlap(a, 0, b, 0, HERE, HERE),
        lambda a, b: Box2D.b2Distance(shapeA=a, shapeB=b, transformA=HERE, transformB=HERE,
                                      useRadii=False).distance,
        _box2d_time, 16, True)


def decisions(rng, count):
    """Return the ns of making a body and of deciding a near pair, and wrong answers."""
    rows = _near_times(rng, count, 'meets')
    for kind in ('near', 'hard'):
        pairs, meet = sample(rng, RATED, kind, 4 * count)
        for name, library in LIBRARIES.items():
            if kind == 'near' or not library.is_fragile:
                answers = np.array([library.meets(*map(library.make, pair)) for pair in pairs])
                rows.append({'library': name, 'kind': kind, **counts(answers, meet)})
    return rows


def separations(rng, count):
    """Return the ns of measuring a separation, and its errors, see `_errors`."""
    rows = _near_times(rng, count, 'distance')
    for family in MEASURED:
        of = {**families.CONVEX, **families.EXTREME, 'deep': families.deep}[family]
        pairs = of(rng, count, 8)
        exact = [_separation(a, b) for a, b in pairs]
        for name, library in LIBRARIES.items():
            if library.distance and (family == 'near' or not library.is_fragile):
                rows.append({'library': name, 'family': family, **_errors(name, pairs, exact)})
    return rows


def _near_times(rng, count, question):
    """Return the ns of making a body and of asking a question, a field of `Library`."""
    rows = []
    for n in SIDES:
        pairs, _ = sample(rng, n, 'near', count)
        for name, library in LIBRARIES.items():
            ask = getattr(library, question)
            if ask and n <= library.max_vertices:
                bodies = [[library.make(body) for body in pair] for pair in pairs]
                rows.append({'library': name, 'n': n, **_times(len(pairs), {
                    'make': lambda: [library.make(a) for a, _ in pairs],
                    'ask': lambda: [ask(a, b) for a, b in bodies]})})
    return rows


def contact_times(rng, count):
    """
    Return the ns of computing when two bodies meet, and the errors.

    One body moves by twice the path to the other's middle, offset by up to where it just passes.
    """
    rows = []
    for n in (4, RATED):
        moves = [(a, b, _move(rng, a, b)) for a, b in families.clear(rng, count, n)]
        exact = [_first_contact(*moving) for moving in moves]
        for name, library in LIBRARIES.items():
            if not library.time:
                continue
            found = [library.time(*moving) for moving in moves]
            both = [abs(float(Fraction(one) - other)) * math.hypot(*move) for one, other, (
                *_, move) in zip(found, exact, moves) if None not in (one, other)]
            seen = [(one is not None, other is not None) for one, other in zip(found, exact)]
            rows.append({
                'library': name, 'n': n, 'pairs': len(moves),
                'contacts': sum(is_contact for _, is_contact in seen),
                'missed': seen.count((False, True)), 'invented': seen.count((True, False)),
                'median': float(np.median(both)), 'worst': max(both),
                **_times(len(moves), {'ask': lambda: [library.time(*one) for one in moves]})})
    return rows


def non_convex(rng, count):
    """Return the ns of a pair of combs in each other's gaps, mostly not convex."""
    rows = []
    for n in NON_CONVEX_SIDES:
        pairs = families.interlocked_combs(rng, count, n)
        meet, _ = oracle.intersects_pairs(pairs)
        prepared = Pairs(pairs)
        for name in ('improved', 'shapely'):
            make = LIBRARIES[name].make
            rows.append({'library': name, 'n': len(pairs[0][0]), 'pairs': len(pairs),
                         'wrong': int((run(name, prepared) != meet).sum()),
                         **_times(len(pairs), {'make': lambda: [make(a) for a, _ in pairs],
                                               'ask': lambda: run(name, prepared)})})
    return rows


def stars():
    """Return the ns of contacts of two stars, by how far their centres are apart, in radii."""
    rows = []
    for n in STAR_SIDES:
        angle = np.arange(n) * 2.0 * np.pi / n
        star = np.where(np.arange(n) % 2, 1.0, 0.5)[:, None] * np.column_stack(
            [np.cos(angle), np.sin(angle)])
        # One is turned by half the angle between two tips.
        c, s = np.cos(np.pi / n), np.sin(np.pi / n)
        other = star @ [[c, s], [-s, c]]
        for apart in STARS_APART:
            pair = Polygon(star), Polygon(other + [apart, 0.1])
            rows.append({'n': n, 'apart': apart, 'depth': contact(*pair).depth, **_times(
                1, {'ns': lambda pair=pair: contact(*pair)})})
    return rows


def _times(count, tasks):
    """Return the median time of each task for one of its pairs, in ns."""
    for task in tasks.values():
        task()
    return {name: round(seconds / count * 1e9, 1)
            for name, seconds in medians(tasks, REPEATS).items()}


def _separation(a, b):
    """Return the exact signed separation of two convex bodies, as a rational."""
    p, q = Polygon(a), Polygon(b)
    return (-rationals.exact_depth(p, q) if oracle.intersects(a, b)
            else rationals.exact_distance(p, q))


def _errors(name, pairs, exact):
    """Return errors in ulp of the largest coordinate; of others than ours for pairs apart."""
    library = LIBRARIES[name]
    with np.errstate(all='ignore'):
        found = [(float(library.distance(*map(library.make, pair))), truth, pair)
                 for pair, truth in zip(pairs, exact) if truth > 0 or name == 'improved']
    errors = [abs(Fraction(value) - truth)
              / Fraction(float(np.spacing(max(np.abs(body).max() for body in pair))))
              for value, truth, pair in found if math.isfinite(value)]
    worst = max(errors, default=0)
    return {'pairs': len(found), 'worst_ulp': float(worst) if worst < 10**300 else math.inf,
            'wrong_signs': sum((value > 0) != (truth > 0) for value, truth, _ in found),
            'unusable': len(found) - len(errors)}


def _move(rng, a, b):
    towards = 2.0 * (a.mean(axis=0) - b.mean(axis=0))
    return towards + rng.uniform(-6.0, 6.0) * towards[::-1] * (-1, 1) / np.hypot(*towards)


def _first_contact(a, b, move):
    """Return the exact time at which a body that moves first meets another one, or None."""
    times = []
    a, b = ([[Fraction(value) for value in point] for point in body.tolist()] for body in (a, b))
    for body, other, sign in ((a, b, -1), (b, a, 1)):
        x, y = (Fraction(sign * value) for value in move.tolist())
        for vertex in body:
            for start, end in zip(other, other[1:] + other[:1]):
                ex, ey = end[0] - start[0], end[1] - start[1]
                wx, wy = start[0] - vertex[0], start[1] - vertex[1]
                across = x * ey - y * ex
                if across:
                    time, share = (wx * ey - wy * ex) / across, (wx * y - wy * x) / across
                    if 0 <= time <= 1 and 0 <= share <= 1:
                        times.append(time)
    return min(times, default=None)
