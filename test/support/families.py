# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The hard families: named generators of pairs of bodies on which collision tests go wrong.

Each takes (rng, count, n) and returns a list of count pairs of (k, 2) float64 arrays; k is n, or
less where a family fixes its shapes or rounding removed a vertex. With their float64 coordinates
`CONVEX` bodies are strictly convex and counter-clockwise, exactly, and so are `EXTREME` ones,
whose numbers overflow and underflow; `SIMPLE` ones are simple, mostly not convex; `ALL` are
`CONVEX` and `SIMPLE` ones.
No family states its answers: the oracle computes them exactly.
"""

import numpy as np

import shapes


def random_pairs(rng, count, n):
    """Return a third far, a third within 0.1 of touching, a third overlapping; half separate."""
    shares = (count + 2) // 3, (count + 1) // 3, count // 3
    return sum((kind(rng, share, n) for kind, share in zip((clear, near, deep), shares)), [])


def clear(rng, count, n):
    """Return bodies of unit size, 0.2 to 4 apart."""
    return _placed(rng, count, n, rng.uniform(0.2, 4, count))


def near(rng, count, n):
    """Return bodies of unit size within 0.1 of touching, half of them apart."""
    return _placed(rng, count, n, rng.uniform(-0.1, 0.1, count))


def deep(rng, count, n):
    """Return overlapping bodies of unit size, at most 0.9 of the way to where they touch."""
    a, b = shapes.polygons(rng, count, n), shapes.polygons(rng, count, n)
    heading = shapes.directions(rng, count)
    reach, _ = shapes.reach(a, b, heading)
    return _pairs(a, b + ((reach * rng.uniform(0, 0.9, count))[:, None] * heading)[:, None])


def hair_gaps(rng, count, n):
    """Return pairs with gaps and overlaps of 1e-17 to 1e-9 of their size."""
    return _placed(rng, count, n, _hairs(rng, count))


def many_sided(rng, count, n):
    """Return nearly regular bodies within 1e-6 of touching, for 256 and 1024 vertices."""
    a, b = shapes.regular(rng, count, n), shapes.regular(rng, count, n)
    return _placed(rng, count, n, _hairs(rng, count, -12, -6), a, b)


def far_offsets(rng, count, n):
    """Return near bodies moved up to 1e8 away, where their coordinates are coarse."""
    gap = np.where(rng.random(count) < 0.5, _hairs(rng, count, -9, -1), 0)
    offset = 10.0 ** rng.uniform(2, 8, (count, 1)) * shapes.directions(rng, count)
    return _moved(_placed_arrays(rng, count, n, gap), offset)


def slivers(rng, count, n):
    """Return bodies 1e-12 to 1e-3 as wide as long, paired with slivers and with full ones."""
    a = shapes.polygons(rng, count, n, 10.0 ** rng.uniform(-12, -3, count))
    b = shapes.polygons(rng, count, n, 10.0 ** rng.uniform(-12, 0, count))
    return _placed(rng, count, n, _hairs(rng, count, -17, -6), a, b)


def vertex_on_vertex(rng, count, n):
    """Return lattice bodies at most one step from sharing one vertex."""
    return _on_lattice(rng, *_vertex_on_vertex(rng, count, n)[:2])


def vertex_on_edge(rng, count, n):
    """Return lattice bodies at most one step from a vertex of one on an edge of the other."""
    return _on_lattice(rng, *_vertex_on_edge(rng, count, n)[:2])


def edge_on_edge(rng, count, n):
    """Return lattice bodies at most one step from edges on one line that share a part."""
    return _on_lattice(rng, *_edge_on_edge(rng, count, n)[:2])


def one_ulp(rng, count, n):
    """Return lattice bodies in contact of all three kinds, except for one ulp of one vertex."""
    shares = (count + 2) // 3, (count + 1) // 3, count // 3
    pairs = []
    for contact, share in zip((_vertex_on_vertex, _vertex_on_edge, _edge_on_edge), shares):
        a, b, vertex = contact(rng, share, n)
        rows = np.arange(share)
        towards = rng.choice([-np.inf, np.inf], (share, 2))
        touching = b[rows, vertex]
        b[rows, vertex] = np.where(rng.random((share, 2)) < 0.7,
                                   np.nextafter(touching, towards), touching)
        pairs += _pairs(a, b)
    return pairs


def rectangles_on_edge(rng, count, n):
    """Return rotated rectangles that share an edge, exactly or up to rounding."""
    del n
    along, half = shapes.directions(rng, count), rng.uniform(0.1, 2, (3, count, 1))
    across = along[:, ::-1] * [-1, 1]
    centre = rng.uniform(-10, 10, (count, 2))
    a = shapes.rectangle(centre, half[0] * along, half[1] * across)
    b = shapes.rectangle(centre + (half[0] + half[2]) * along, half[2] * along, half[1] * across)
    shared = rng.random(count) < 0.5
    b[shared, 0], b[shared, 3] = a[shared, 1], a[shared, 2]
    return _pairs(a, b)


def collinear_edges(rng, count, n):
    """Return bodies with edges end to end on one line, on opposite sides or the same side."""
    a = shapes.polygons(rng, count, n) + rng.uniform(-10, 10, (count, 1, 2))
    along = a[:, 1] - a[:, 0]
    across = along[:, ::-1] * [-1, 1]
    start = a[:, 1] + along * (_hairs(rng, count) * (rng.random(count) < 0.5))[:, None]
    end = start + along * rng.uniform(0.1, 2, (count, 1))
    opposite = (a[:, 1] + start)[:, None] - a
    first = np.stack([a[:, 0], a[:, 1], a[:, 0] + across], axis=1)
    second = np.stack([start, end, end + across], axis=1)
    half = count // 2
    return _pairs(a[:half], opposite[:half]) + _pairs(first[half:], second[half:])


def flat_arcs(rng, count, n):
    """Return bodies that nearly touch along arcs so flat that all vertices seem collinear."""
    x = np.arange(n - 1.0) - n // 2
    rise = np.ldexp(1.0, rng.integers(-44, -20, (count, 1)))
    shear = rng.integers(-3, 4, (count, 2, 2))
    shear[np.linalg.det(shear) < 0.5] = [[1, 2], [-1, 1]]
    ring = np.empty((count, n, 2))
    ring[:, :-1, 0], ring[:, :-1, 1], ring[:, -1] = x, x**2 * rise, [0, n]
    ring = ring @ shear
    i, rows = rng.integers(0, n - 1, count), np.arange(count)
    middle = ring[rows, i] + ring[rows, np.minimum(i + rng.integers(0, 2, count), n - 2)]
    step = shear[:, 1] * rise * rng.integers(-1, 2, (count, 1))
    return _pairs(ring, (middle + step)[:, None] - ring)


def containment(rng, count, n):
    """Return a body inside another, half of them touching its boundary from inside."""
    a, b = shapes.polygons(rng, count, n), shapes.polygons(rng, count, n)
    size = 10.0 ** rng.uniform(-3, -0.3, (count, 1, 1))
    inside = np.where(rng.random((count, 1, 1)) < 0.5,
                      a[:, :1] + size * (a - a[:, :1]), 0.2 * size * b)
    swap = rng.random((count, 1, 1)) < 0.5
    return _pairs(np.where(swap, inside, a), np.where(swap, a, inside))


def float32_round_trip(rng, count, n):
    """Return near bodies rounded to float32 as in messages, up to 10 km away."""
    gap = np.where(rng.random(count) < 0.5, _hairs(rng, count, -9, -3), 0)
    a, b = _placed_arrays(rng, count, n, gap)
    offset = 10.0 ** rng.uniform(-3, 4, (count, 1)) * shapes.directions(rng, count)
    return _pairs(*((x + offset[:, None]).astype(np.float32).astype(float) for x in (a, b)))


def points_and_segments(rng, count, n):
    """Return points and segments on, near and along a polygon's edge and each other."""
    a = shapes.polygons(rng, count, n) + rng.choice([0, 1, 100], (count, 1, 1))
    along = a[:, 1] - a[:, 0]
    share = np.where(rng.random(count) < 0.5, rng.uniform(-0.2, 1.2, count),
                     rng.integers(0, 3, count) / 2)
    pairs = []
    for i, body in enumerate(shapes.convex(a)):
        edge, point = a[i, :2], a[i, :1] + share[i] * along[i]
        stab = np.concatenate([point, point + rng.normal(size=2)])
        further = np.concatenate([point, point + rng.uniform(-1, 1) * along[i]])
        beside = np.nextafter(point, rng.choice([-200, 200], 2))
        pairs.append([(body, point), (body, stab), (body, further), (edge, point), (edge, stab),
                      (edge, further), (point, beside), (point, point)][i % 8])
    return [pair[::rng.choice([-1, 1])] for pair in pairs]


def extreme_scales(rng, count, n):
    """Return pairs of other families scaled by a power of two between 1e-150 and 1e150."""
    half = count // 2
    pairs = hair_gaps(rng, half, n) + vertex_on_edge(rng, count - half, n)
    return [(a * scale, b * scale)
            for (a, b), scale in zip(pairs, np.ldexp(1.0, rng.integers(-430, 431, count)))]


def notched(rng, count, n):
    """Return an L, a U, a comb and a star, each with a body that just fits into a recess."""
    ell = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]])
    star = shapes.star(max(n // 2, 3))
    slot = np.array([[1, 1], [2, 1], [2, 3], [1, 3]])
    fits = [(ell, slot), (shapes.comb(2), slot), (shapes.comb(max(n // 4, 2)), slot),
            (star, star[1:4])]
    pairs = []
    for i in range(count):
        outline, notch = fits[i % 4]
        centre = notch.mean(axis=0)
        pairs.append(_turned(rng, outline, centre + (1 - _slack(rng)) * (notch - centre)))
    return pairs


def interlocked_combs(rng, count, n):
    """Return combs with their teeth in each other's gaps."""
    comb = shapes.comb(max(n // 4, 2))
    width = comb[:, 0].max()
    slacks = [_slack(rng) for _ in range(count)]
    return [_turned(rng, comb, [width + 1, 4 + slack] - shapes.comb(len(comb) // 4, slack))
            for slack in slacks]


def tiny_edges(rng, count, n):
    """Return bodies with an edge at the origin that underflows, and points near their boundary."""
    pairs = []
    for _ in range(count):
        few = n // 4
        angle = np.sort(np.concatenate([rng.uniform(0, 10.0 ** rng.uniform(-3, -0.5), few),
                                        rng.uniform(0, 2 * np.pi, n - 2 - few)]))
        ring = np.stack([np.sin(angle), 1 - np.cos(angle)], axis=1) * rng.uniform(0.5, 4, 2)
        scale, tiny = [(1.0, 10.0 ** rng.uniform(-323, -300)), (2.0**-500, 2.0**-560)][
            rng.integers(2)]
        ring = _quarter_turned(rng, np.concatenate([[[0, 0], [tiny, 0]], ring * scale]))
        pairs.append((shapes.hull(ring), _near_boundary(rng, ring)))
    return pairs


def mixed_exponents(rng, count, n):
    """Return bodies with edges from the smallest doubles to 1, at and near the origin."""
    pairs = []
    for _ in range(count):
        bodies = []
        for _ in range(2):
            angle = np.sort(rng.uniform(0, 3.5, n - 1))
            length = 2.0 ** -np.sort(rng.integers(0, 1075, n - 1))[::-1]
            edges = np.stack([np.cos(angle), np.sin(angle)], axis=1) * length[:, None]
            ring = np.concatenate([[[0, 0]], np.cumsum(edges, axis=0)])
            bodies.append(_quarter_turned(rng, ring))
        a, b = bodies
        other = [b, -a, b + 2.0 ** -rng.integers(0, 1075), _near_boundary(rng, a)][
            rng.integers(4)]
        pairs.append((shapes.hull(a), shapes.hull(other)))
    return pairs


def wide_spans(rng, count, n):
    """Return pairs of other families scaled until products and even differences overflow."""
    kinds = near, hair_gaps, vertex_on_edge, containment, points_and_segments
    pairs = sum((kind(rng, count // 6, n) for kind in kinds), [])
    rings = shapes.convex(shapes.polygons(rng, count - len(pairs), n))
    pairs += [(ring, _near_boundary(rng, ring)) for ring in rings]
    scaled = []
    for a, b in pairs:
        largest = max(abs(a).max(), abs(b).max(), 2.0**-60)
        exponent = int(rng.integers(500, 1024) - np.frexp(largest)[1])
        scaled.append((np.ldexp(a, exponent), np.ldexp(b, exponent)))
    return scaled


def level_arcs(rng, count, n):
    """Return bodies that nearly touch along arcs whose total rise is below rounding."""
    pairs = []
    for _ in range(count):
        x = np.arange(n - 1.0) - rng.integers(0, n)
        ring = np.stack([x, x**2 * 2.0 ** -rng.integers(44, 62)], axis=1)
        ring = np.concatenate([ring, [[x.mean().round(), 2.0 ** rng.integers(0, 9)]]])
        i, k = rng.integers(0, n - 1, 2)
        other = ring[i] + ring[k] - ring + [0, rng.integers(-3, 4) * 2.0 ** -rng.integers(44, 60)]
        turn, move = rng.integers(4), rng.integers(-2, 3, 2) * 2.0 ** rng.integers(-30, 9)
        a, b = (_turn_by_quarters(body, turn) + move for body in (ring, other))
        pairs.append((shapes.hull(a), shapes.hull(b)))
    return pairs


CONVEX = {family.__name__: family for family in (
    random_pairs, near, hair_gaps, many_sided, far_offsets, slivers, vertex_on_vertex,
    vertex_on_edge, edge_on_edge, one_ulp, rectangles_on_edge, collinear_edges, flat_arcs,
    containment, float32_round_trip, points_and_segments, extreme_scales)}
EXTREME = {family.__name__: family for family in (
    tiny_edges, mixed_exponents, wide_spans, level_arcs)}
SIMPLE = {family.__name__: family for family in (notched, interlocked_combs)}
ALL = {**CONVEX, **SIMPLE}


def _pairs(a, b):
    return list(zip(shapes.convex(a), shapes.convex(b)))


def _moved(bodies, offset):
    return _pairs(*(body + offset[:, None] for body in bodies))


def _hairs(rng, count, least=-17, greatest=-9):
    """Return signed lengths between 10**least and 10**greatest."""
    return rng.choice([-1, 1], count) * 10.0 ** rng.uniform(least, greatest, count)


def _placed_arrays(rng, count, n, gap, a=None, b=None):
    """Return two bodies with a gap, or an overlap of -gap, along the axis where they meet."""
    a = shapes.polygons(rng, count, n) if a is None else a
    b = shapes.polygons(rng, count, n) if b is None else b
    heading = shapes.directions(rng, count)
    reach, cosine = shapes.reach(a, b, heading)
    return a, b + ((reach + gap / np.maximum(cosine, 0.1))[:, None] * heading)[:, None]


def _placed(rng, count, n, gap, a=None, b=None):
    return _pairs(*_placed_arrays(rng, count, n, gap, a, b))


def _extreme(bodies, direction):
    return (bodies @ direction[:, :, None])[..., 0].argmax(axis=1)


def _vertex_on_vertex(rng, count, n):
    a, b, rows = shapes.lattice(rng, count, n), shapes.lattice(rng, count, n), np.arange(count)
    heading = shapes.directions(rng, count)
    vertex = _extreme(b, -heading)
    b += (a[rows, _extreme(a, heading)] - b[rows, vertex])[:, None]
    return a, b, vertex


def _vertex_on_edge(rng, count, n):
    a, b, rows = shapes.lattice(rng, count, n), shapes.lattice(rng, count, n), np.arange(count)
    edge = a[:, 1] - a[:, 0]
    vertex = _extreme(b, edge[:, ::-1] * [-1, 1])
    b += (a[:, 0] + edge * rng.integers(0, 5, (count, 1)) / 4 - b[rows, vertex])[:, None]
    return a, b, vertex


def _edge_on_edge(rng, count, n):
    a = shapes.lattice(rng, count, n)
    edge = a[:, 1] - a[:, 0]
    b = (a[:, 0] + a[:, 1] + edge * rng.integers(-5, 6, (count, 1)) / 4)[:, None] - a
    return a, b, np.ones(count, int)


def _on_lattice(rng, a, b):
    """Move some bodies by one step of the lattice, and scale all by powers of two."""
    step = rng.integers(-1, 2, (len(a), 1, 2)) * (rng.random((len(a), 1, 1)) < 0.5)
    scale = np.ldexp(1.0, rng.integers(-60, 61, (len(a), 1, 1)))
    return _pairs(a * scale, (b + step) * scale)


def _quarter_turned(rng, ring):
    return _turn_by_quarters(ring, rng.integers(4))


def _turn_by_quarters(ring, quarters):
    for _ in range(quarters):
        ring = ring[:, ::-1] * [-1, 1]
    return ring


def _near_boundary(rng, ring):
    """Return a point, sometimes a segment, close to an edge or a vertex on either side."""
    k = rng.integers(len(ring))
    along, inwards = rng.choice([-1, 1], 2) * 10.0 ** rng.uniform(-6, -0.3, 2)
    point = ring[k] + abs(along) * (ring[k - 1] - ring[k])
    point = point + inwards * (ring.mean(axis=0) - point)
    return np.array([point, ring[k - 2]] if rng.random() < 0.2 else [point])


def _slack(rng):
    return rng.choice([0, _hairs(rng, 1)[0], rng.uniform(-0.1, 0.1)])


def _turned(rng, a, b):
    """Return both bodies rotated and moved together, or unchanged, in either order."""
    if rng.random() < 0.7:
        along, offset = shapes.directions(rng, 1)[0], rng.uniform(-10, 10, 2)
        turn = np.array([along, along[::-1] * [-1, 1]])
        a, b = a @ turn + offset, b @ turn + offset
    return (a, b) if rng.random() < 0.5 else (b, a)
