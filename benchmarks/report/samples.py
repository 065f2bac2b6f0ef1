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

"""The pairs of bodies for measurements: four kinds, n vertices each, with the exact answers."""

import families
import oracle

KINDS = 'clear', 'near', 'deep', 'hard'
SIDES = 3, 4, 8, 16, 32, 64, 256
HARD = (families.hair_gaps, families.far_offsets, families.slivers, families.vertex_on_vertex,
        families.vertex_on_edge, families.edge_on_edge, families.one_ulp, families.flat_arcs,
        families.float32_round_trip)
# Families for bodies of many vertices, which are measured less often, and with how many.
MANY = {'many_sided': (256, 1024)}


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
