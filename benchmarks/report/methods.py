# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The methods compared, each as a loop over many pairs, and the pairs: speed and errors.

Bodies are prepared beforehand: as packed arrays, boxes, centres of gravity, shapely's shapes.
Pairs are of four kinds, with n vertices each, and come with their exact answers.
"""

from collections import Counter, defaultdict
from functools import cached_property, partial
import itertools
import sys
from typing import NamedTuple

from _shared import medians, times
import families
import numba
import numpy as np
import oracle
import rivals
from sat_collision import intersects_pairs, Polygon, PolygonSet
from sat_collision.geometry.body.layout import Packed, packed_size
from sat_collision.geometry.body.packing import pack
from sat_collision.geometry.compiled.jit import elements, indexable, kernel, scratch
from sat_collision.geometry.pair.intersection import convex_meet
import shapely


class Method(NamedTuple):
    """
    The name and style of a method, its kernel, and the kernel that prepares each body for it.

    The colours are safe for the colour-blind (Okabe and Ito, and Tol).
    """

    label: str
    colour: str
    marker: str
    kernel: object = None
    prepare: object = None


METHODS = {
    'traditional': Method('traditional', '#000000', 'o', rivals.traditional),
    'traditional_float32': Method('traditional, float32', '#7f7f7f', 's',
                                  rivals.traditional),
    'boxed': Method('box pre-test', '#56B4E9', '^', rivals.boxed, rivals.bounds),
    'published_a': Method('published A', '#D55E00', 'v', rivals.published_a,
                          rivals.centre_of_gravity),
    'published_b': Method('published B', '#CC79A7', 'D', rivals.published_b,
                          rivals.centre_of_gravity),
    'hybrid': Method('published, hybrid', '#AA4499', '<', rivals.hybrid,
                     rivals.centre_of_gravity),
    'closest': Method('published, Eq. 3–4', '#999933', '>', rivals.closest),
    'literal': Method('published, Eq. 5', '#CC6677', 'd', rivals.literal,
                      rivals.centre_of_gravity),
    'binary': Method('binary-search SAT', '#E69F00', 'h', rivals.binary, rivals.head),
    'gjk': Method('GJK', '#332288', 'p', rivals.gjk, rivals.head),
    'filtered': Method('filtered orientations', '#117733', '8', rivals.filtered, rivals.head),
    'improved': Method('improved', '#009E73', '*'),
    'shapely': Method('shapely', '#0072B2', 'X'),
}
LABELS = {name: method.label for name, method in METHODS.items()}
# Measured only for wrong answers.
UNTIMED = 'traditional_float32',
REPEATS = 5
ONCE_SIDES = 4, 16, 64
KINDS = 'clear', 'near', 'deep', 'hard'
SIDES = 3, 4, 8, 16, 32, 64, 256
HARD = (families.hair_gaps, families.far_offsets, families.slivers, families.vertex_on_vertex,
        families.vertex_on_edge, families.edge_on_edge, families.one_ulp, families.flat_arcs,
        families.float32_round_trip)
# Families of bodies with many vertices, with how many; fewer of their pairs are measured.
MANY = {'many_sided': (256, 1024)}


def shapely_shape(body):
    if len(body) > 2:
        return shapely.Polygon(body)
    return shapely.LineString(body) if len(body) == 2 else shapely.Point(body[0])


class Pairs:
    """Pairs of convex bodies, prepared for each method when first needed."""

    def __init__(self, pairs):
        self.sides = [a for a, _ in pairs], [b for _, b in pairs]
        self._prepared = {}

    def __len__(self):
        return len(self.sides[0])

    def prepared(self, prepare):
        """Return what a function makes of each body, an array a side."""
        if prepare not in self._prepared:
            self._prepared[prepare] = [np.array([prepare(body) for body in bodies])
                                       for bodies in self.sides]
        return self._prepared[prepare]

    @cached_property
    def packed(self):
        return [_pack(bodies, np.float64) for bodies in self.sides]

    @cached_property
    def packed_float32(self):
        with np.errstate(over='ignore'):
            return [_pack(bodies, np.float32) for bodies in self.sides]

    @cached_property
    def sets(self):
        return [PolygonSet(map(Polygon, bodies)) for bodies in self.sides]


def run(name, pairs):
    """Return the answers of a method."""
    if name == 'improved':
        return intersects_pairs(*pairs.sets)
    if name == 'shapely':
        return shapely.intersects(*pairs.prepared(shapely_shape))
    return steps(name, pairs) == 0


def steps(name, pairs):
    """Return the step at which a rival calls each pair apart, 0 if none."""
    method, prepare = METHODS[name].kernel, METHODS[name].prepare
    found = np.empty(len(pairs), np.int8)
    (a, a_ends), (b, b_ends) = (pairs.packed_float32 if name == 'traditional_float32'
                                else pairs.packed)
    if prepare is None:
        _stream(method, a, a_ends, b, b_ends, found)
    else:
        of_a, of_b = pairs.prepared(prepare)
        _stream_prepared(method, a, a_ends, of_a, b, b_ends, of_b, found)
    return found


def run_once(name, pairs):
    """Return the answers of a method for bodies used once, including their preparation."""
    if name == 'shapely':
        return shapely.intersects(*(shapely.polygons(np.stack(bodies)) for bodies in pairs.sides))
    method, prepare = METHODS[name].kernel, METHODS[name].prepare
    if name != 'improved' and prepare is None:
        return run(name, pairs)
    answers = np.empty(len(pairs), np.bool_)
    (a, a_ends), (b, b_ends) = pairs.packed
    if name == 'improved':
        _pack_and_meet(a, a_ends, b, b_ends, answers)
    else:
        _stream_once(method, prepare, a, a_ends, b, b_ends, answers)
    return answers


def _pack(bodies, dtype):
    ends = np.cumsum([0] + [len(body) for body in bodies])
    return indexable(np.concatenate(bodies).astype(dtype)), ends


@kernel
def _borrowed(array):
    """
    Return an array without its reference count, for the inside of a hot loop.

    Passing an array on counts references atomically, which costs more than a collision check.
    """
    return numba.carray(elements(array), array.shape)


@kernel
def _stream(method, a, a_ends, b, b_ends, found):
    a, b = _borrowed(a), _borrowed(b)
    for i in range(len(found)):
        found[i] = method(a[a_ends[i]:a_ends[i + 1]], b[b_ends[i]:b_ends[i + 1]])


@kernel
def _stream_prepared(method, a, a_ends, of_a, b, b_ends, of_b, found):
    a, b, of_a, of_b = _borrowed(a), _borrowed(b), _borrowed(of_a), _borrowed(of_b)
    for i in range(len(found)):
        found[i] = method(a[a_ends[i]:a_ends[i + 1]], b[b_ends[i]:b_ends[i + 1]], of_a[i], of_b[i])


@kernel
def _stream_once(method, prepare, a, a_ends, b, b_ends, answers):
    a, b = _borrowed(a), _borrowed(b)
    for i in range(len(answers)):
        p = a[a_ends[i]:a_ends[i + 1]]
        q = b[b_ends[i]:b_ends[i + 1]]
        answers[i] = not method(p, q, prepare(p), prepare(q))


@kernel
def _pack_and_meet(a, a_ends, b, b_ends, answers):
    """Check, clean and pack convex bodies as those of messages are, and decide."""
    for i in range(len(answers)):
        n, m = a_ends[i + 1] - a_ends[i], b_ends[i + 1] - b_ends[i]
        p, q = scratch(packed_size(n)), scratch(packed_size(m))
        _, n, _, _, _ = pack(a[a_ends[i]:a_ends[i + 1]].ravel(), p, n, 0)
        _, m, _, _, _ = pack(b[b_ends[i]:b_ends[i + 1]].ravel(), q, m, 0)
        answers[i] = convex_meet(Packed(p, 0, n), Packed(q, 0, m))


def measure(seeds, scale=1.0):
    """Return a row of answers and times for each method and kind of pairs, of all seeds."""
    rows = []
    for n, kind in itertools.product(SIDES, KINDS):
        found, taken = defaultdict(Counter), defaultdict(list)
        for seed in seeds:
            pairs, meet = sample(np.random.default_rng([seed, n]), n, kind, _count(n, scale))
            prepared = Pairs(pairs)
            with np.errstate(all='ignore'):
                for name in METHODS:
                    found[name].update(counts(run(name, prepared), meet))
            for name, seconds in times({name: partial(run, name, prepared) for name in found
                                        if name not in UNTIMED}, REPEATS).items():
                taken[name] += [1e9 * one / len(pairs) for one in seconds]
        rows += [{'n': n, 'kind': kind, 'method': name, **found[name], **({
            'ns': np.quantile(taken[name], [0.5, 0.25, 0.75]).round(1).tolist()}
            if name in taken else {})} for name in found]
        print(f'speed: {n}, {kind}', file=sys.stderr)
    return rows


def once(rng, scale=1.0):
    """Return the time of near pairs in ns if bodies are prepared for each pair."""
    rows = []
    for n in ONCE_SIDES:
        pairs = sample(rng, n, 'near', _count(n, scale))[0]
        # Of those whose vertices rounding has not made fewer, so that shapely takes an array.
        prepared = Pairs([pair for pair in pairs if len(pair[0]) == len(pair[1]) == n])
        tasks = {name: partial(run_once, name, prepared) for name in METHODS
                 if name not in UNTIMED}
        for name, task in tasks.items():
            if (task() != run(name, prepared)).any():
                raise AssertionError(f'{name} answers otherwise where bodies are used once')
        rows += [{'method': name, 'n': n, 'ns': round(seconds / len(prepared) * 1e9, 1)}
                 for name, seconds in medians(tasks, REPEATS).items()]
    return rows


def _count(n, scale):
    """Return how many pairs a seed: enough for rates of a per cent, and seconds for a method."""
    return max(8, int(scale * min(1200, max(300, 40_000 // n))) // 2 * 2)


def of_family(rng, family, count, sides):
    """Return count pairs of a family, in equal shares of the numbers of vertices it is for."""
    if family.__name__ in MANY:
        sides, count = MANY[family.__name__], count // 25
    return sum((chunked(family, rng, max(1, count // len(sides)), n) for n in sides), [])


def sample(rng, n, kind, count):
    """
    Return count pairs of a kind and their exact answers; half of near and hard pairs are apart.

    Clear pairs are all apart and deep ones all overlap, so of equal numbers of the four kinds half
    are apart.
    """
    if kind in ('clear', 'deep'):
        pairs = _generate(rng, n, kind, count)
        return pairs, oracle.intersects_pairs(pairs)[0]
    found = {False: [], True: []}
    while min(len(pairs) for pairs in found.values()) < count // 2:
        pairs = _generate(rng, n, kind, count)
        for pair, meet in zip(pairs, oracle.intersects_pairs(pairs)[0].tolist()):
            found[meet].append(pair)
    pairs = [*found[False][:count // 2], *found[True][:count // 2]]
    order = rng.permutation(len(pairs))
    return [pairs[i] for i in order], order >= count // 2


def chunked(generate, rng, count, n):
    """Return count pairs of a generator of families, made in parts that fit into memory."""
    pairs = []
    for part in chunks(count, n):
        pairs += generate(rng, part, n)
    return pairs


def chunks(count, n):
    """Yield numbers of pairs that fit into memory, count in all."""
    size = min(max(5_000_000 // n**2, 4), 10_000)
    while count > 0:
        yield min(size, count)
        count -= size


def counts(answers, meet):
    """Return the numbers of pairs, of those apart, of false collisions and of false clears."""
    return {'pairs': len(meet), 'apart': int((~meet).sum()),
            'false_collisions': int((answers & ~meet).sum()),
            'false_clears': int((~answers & meet).sum())}


def _generate(rng, n, kind, count):
    if kind != 'hard':
        return chunked(getattr(families, kind), rng, count, n)
    pairs = sum((chunked(family, rng, -(-count // len(HARD)), n) for family in HARD), [])
    return [pairs[i] for i in rng.permutation(len(pairs))]
