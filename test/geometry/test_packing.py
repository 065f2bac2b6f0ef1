# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Packing polygons for kernels, and moving them, also through chains of frames."""

from fractions import Fraction
import math
from operator import mul
import random

from compiled import callable_here
import families
import numpy as np
import oracle
import pytest
from rationals import rounded, twice_area
from sat_collision import intersects, Polygon
from sat_collision.geometry.body import layout
from sat_collision.geometry.body.layout import BOUNDS, Packed, packed_size
from sat_collision.geometry.body.packing import moved_points, pack_convex, PAIR, TRIPLE
from sat_collision.geometry.body.polygon import UNMOVED
from sat_collision.geometry.compiled.jit import indexable
from sat_collision.geometry.sets.packed_set import PackedSet
from sat_collision.scene.frames import Frames
from sat_collision.scene.rotations import accepted, affine_of, composed, fixed
import shapes

CONVEX = {**families.CONVEX, **families.EXTREME}


def disc(polygon):
    packed = np.asarray(polygon.packed[0])
    return packed[0], packed[1], packed[6]


@pytest.mark.parametrize('name', CONVEX)
def test_disc_is_inside(name):
    """In rationals: its centre is at least the radius away from the line of every edge."""
    for pair in CONVEX[name](np.random.default_rng(1), 60, 7):
        for polygon in map(Polygon, pair):
            x, y, radius = map(Fraction, disc(polygon))
            ring = [(Fraction(a), Fraction(b)) for a, b in polygon.vertices.tolist()]
            for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1]):
                turn = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
                square = (bx - ax) ** 2 + (by - ay) ** 2
                assert turn >= 0 and turn ** 2 >= radius ** 2 * square


def test_no_disc_if_a_height_overflows():
    """The height over the long edge is unknown, so no collision follows from the others."""
    triangle = Polygon([(0, 0), (1e155, 1e155), (-1e150, 1e150)])
    assert disc(triangle)[2] == 0.0
    rng = np.random.default_rng(6)
    for point in rng.normal(size=(500, 2)) * 10.0 ** rng.uniform(149, 156, (500, 1)):
        body = point + np.array([(0, 0), (1e152, 0), (0, 1e152)])
        assert intersects(triangle, body) == oracle.intersects(triangle.vertices, body)


def test_no_disc_if_the_length_of_an_edge_underflows():
    """It is rounded to one or two of the smallest doubles."""
    tiny = 2.0 ** -1074
    polygon = Polygon([(-2.0**80, -2.0**80), (0, 0), (tiny, tiny * 2), (2.0**79, 2.0**81),
                       (-2.0**80, 2.0**80)])
    assert len(polygon.vertices) == 5 and polygon.is_convex
    assert disc(polygon)[2] == 0.0


def test_disc_of_a_box_and_near_the_largest_double():
    """Its centre is finite and inside, although sums of coordinates overflow."""
    polygon = Polygon([(1.2e308, 1.2e308), (1.7e308, 1.2e308), (1.7e308, 1.7e308)])
    assert disc(polygon)[:2] == pytest.approx(polygon.centroid)
    assert polygon.centroid == pytest.approx([1.7e308 - 5e307 / 3, 1.2e308 + 5e307 / 3])
    assert intersects(polygon, polygon.centroid[None])
    assert disc(Polygon([(0, 0), (4, 0), (4, 2), (0, 2)])) == pytest.approx((2, 1, 1))


@pytest.mark.parametrize('count', [17, 128, 129, 1000])
def test_table_entry_is_near_the_support(count):
    """Only a few of many vertices are left to climb."""
    polygon = Polygon(shapes.polygons(np.random.default_rng(2), 1, count)[0])
    vertices, packed = polygon.vertices, Packed(polygon.packed[0], 0, count)
    near_support, table_sector = callable_here(layout.near_support, layout.table_sector)
    first = packed_size(count) - 2 * count
    for ux, uy in shapes.directions(np.random.default_rng(3), 300).tolist():
        near = (near_support(packed, table_sector(count, ux, uy)) - first) // 2
        support = int((vertices @ [ux, uy]).argmax())
        assert min((near - support) % count, (support - near) % count) <= max(2, count // 20)


def test_packed_non_convex_polygon_ends_with_its_outline():
    outline = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]]
    polygon = Polygon(outline)
    packed = np.asarray(polygon.packed[0])
    assert packed[BOUNDS].tolist() == [0, 0, 3, 3]
    assert packed[int(packed[0]):int(packed[1])].reshape(-1, 2).tolist() == outline
    assert len(packed) == packed[1] and polygon.packed[1] == -len(polygon.parts)
    assert sum(twice_area(part.vertices) for part in polygon.parts) == twice_area(outline)


@pytest.mark.parametrize('corner', [8e306, -1.7e308, 1.7e308])
def test_large_bodies_are_recognised_as_equal(corner):
    """A NaN would never be recognised as equal."""
    for ring in ([(0, 0), (1, 0), (1, -1)], [(0, 0), (1, 0), (1, 1), (0.5, 0.25)]):
        polygon = Polygon(np.array(ring) * corner)
        assert np.isfinite(polygon.packed[0]).all()
        again = Polygon(polygon.vertices).packed
        assert PackedSet([polygon]).place(0, again, PackedSet()) is None


# Except for coordinates that float32 cannot hold.
ALL = {name: family for name, family in families.ALL.items() if name != 'extreme_scales'}
U = Fraction(1, 2**53)


def random_affine(rng, reach=1e3):
    """Return an affine map: a rotation, sometimes mirrored or squeezed, and a translation."""
    angle = rng.uniform(-np.pi, np.pi)
    cosine, sine = np.cos(angle), np.sin(angle)
    squeezed = rng.choice([1.0, -1.0, 0.997])
    x, y = rng.uniform(-reach, reach, 2)
    return tuple(map(float, (cosine, -sine * squeezed, x, sine, cosine * squeezed, y)))


def message(ring):
    """Return points as received: bytes, offset and count."""
    points = np.column_stack([ring, np.full(len(ring), 7.0)]).astype(np.float32)
    return b'head' + points.tobytes(), 4, len(points)


def to_double(value):
    """Return the double nearest to a rational, as a rational."""
    return Fraction(float(value))


def moved_by_rationals(ring, affine):
    """Return the doubles after four roundings, and the largest error / bound."""
    a, b, c, d, e, f = map(Fraction, affine)
    points = []
    worst = Fraction(0)
    for x, y in np.asarray(ring).astype(np.float32).astype(float).tolist():
        x, y = Fraction(x), Fraction(y)
        point = []
        for p, q, r in ((a, b, c), (d, e, f)):
            found = to_double(to_double(to_double(p * x) + to_double(q * y)) + r)
            bound = U * abs(found) + (2 * U + U * U) * (abs(p * x) + abs(q * y))
            bound += Fraction(1, 2**1073)
            worst = max(worst, abs(found - (p * x + q * y + r)) / bound)
            point.append(float(found))
        points.append(point)
    return points, worst


@pytest.mark.parametrize('reach', [10.0, 1e3])
@pytest.mark.parametrize('name', ALL)
def test_each_coordinate_is_rounded_four_times(name, reach):
    """In the given order, with an error within the lemma; the body is that of these points."""
    rng = np.random.default_rng(11)
    largest = made = 0
    for ring, _ in ALL[name](rng, 40, 9):
        affine = random_affine(rng, reach)
        wanted, error = moved_by_rationals(ring, affine)
        found = np.asarray(moved_points(*message(ring), TRIPLE, affine)).reshape(-1, 2)
        assert found.tolist() == wanted
        largest = max(largest, error)
        try:
            body = Polygon(wanted)
        except ValueError as error:
            with pytest.raises(ValueError, match=str(error)[:12]):
                Polygon.from_float32(*message(ring), affine=affine)
        else:
            assert Polygon.from_float32(*message(ring), affine=affine) == body
            made += 1
    assert 0.2 < largest <= 1 and made > 0


@pytest.mark.parametrize('affine', [UNMOVED, random_affine(np.random.default_rng(13))])
def test_moved_messages_pack_as_polygons_do(affine):
    """Non-convex or refused polygons have 0 vertices."""
    rng = np.random.default_rng(14)
    kinds = set()
    for _ in range(300):
        ring = rng.integers(-9, 9, (rng.integers(1, 6), 2))
        array = np.empty(packed_size(len(ring)))
        count = pack_convex(*message(ring), TRIPLE, indexable(array), 1000, affine)
        try:
            polygon = Polygon.from_float32(*message(ring), affine=affine)
        except ValueError:
            assert count == 0
            kinds.add('refused')
            continue
        assert count == (polygon.packed[1] if polygon.is_convex else 0)
        kinds.add(polygon.is_convex)
        assert affine != UNMOVED or polygon == Polygon(ring)
        if count:
            assert array[:packed_size(count)].tolist() == list(polygon.packed[0])
    assert kinds == {True, False, 'refused'}


def test_mirrored_body_is_reordered():
    """A laser mounted upside down sends vertices clockwise."""
    polygon = Polygon.from_float32(*message([(0, 0), (2, 0), (2, 1)]),
                                   affine=(1.0, 0.0, 5.0, 0.0, -1.0, 0.0))
    assert polygon.vertices.tolist() == [[5, 0], [7, -1], [7, 0]]


@pytest.mark.parametrize('coordinate', (np.nan, np.inf, -np.inf))
def test_non_finite_coordinates_are_refused(coordinate):
    rng = np.random.default_rng(15)
    for affine in (UNMOVED, random_affine(rng)):
        data = message([(0, 0), (1, coordinate), (1, 1)])
        assert pack_convex(*data, TRIPLE, indexable(np.empty(50)), 10, affine) == 0
        with pytest.raises(ValueError, match='not finite'):
            Polygon.from_float32(*data, affine=affine)
    with pytest.raises(ValueError, match='vertex 1 is not finite'):  # once it is moved
        Polygon.from_float32(*message([(0, 0), (3e38, 0), (0, 1)]),
                             affine=(1e300, 0.0, 0.0, 0.0, 1.0, 0.0))


@pytest.mark.parametrize('affine', [UNMOVED, random_affine(np.random.default_rng(16))])
def test_float64_bytes_are_packed_exactly(affine):
    """At UTM coordinates, where float32 has steps of 0.5 m."""
    rng = np.random.default_rng(17)
    for _ in range(100):
        ring = rng.normal((600_000.0, 5_500_000.0), 1.0, (rng.integers(1, 9), 2))
        a, b, c, d, e, f = affine
        wanted = [[a * x + b * y + c, d * x + e * y + f] for x, y in ring.tolist()]
        data = b'12345678' + ring.tobytes()
        found = np.asarray(moved_points(data, 8, len(ring), PAIR, affine)).reshape(-1, 2)
        assert found.tolist() == wanted


@pytest.mark.parametrize('start, count', [(0, 3), (5, 2), (-4, 2), (4, -1), (4, 2**40)])
def test_points_beyond_the_bytes_are_an_error(start, count):
    with pytest.raises(ValueError, match='are not in 28 bytes'):
        Polygon.from_float32(bytes(28), start, count)


def test_limit_of_vertices_has_to_be_an_integer():
    with pytest.raises(TypeError, match='True is not an integer'):
        Polygon.from_float32(*message([(0, 0), (2, 0), (2, 1)]), True)


# The number of frames from the body up to a common one, and from the fixed frame up to it.
CHAINS = {'one yaw': (1, 0), 'two frames': (2, 0), 'ten frames': (5, 5), 'both under UTM': (1, 1),
          'all but the same frame': (2, 2)}
STEPS = 500
_NUMBERS = 7
_UTM = (448_262.37, 5_411_932.68, 117.2)


def starts_of(rng, name, count):
    """Return chains as arrays: seven numbers of each transform, then x and y of a point."""
    up, down = CHAINS[name]
    chains = np.empty((count, _NUMBERS * (up + down) + 2))
    transforms = chains[:, :-2].reshape(count, up + down, _NUMBERS)
    transforms[..., :3] = (rng.uniform(-1, 1, (*transforms.shape[:2], 3))
                           * 2.0 ** rng.integers(-6, 5, (*transforms.shape[:2], 1)))
    # Yaw alone, or with slight roll and pitch; some quaternions are not of length 1.
    angle = rng.uniform(-np.pi, np.pi, transforms.shape[:2])
    transforms[..., 3:5] = (rng.normal(0, 0.01, (*transforms.shape[:2], 2))
                            * (rng.random((count, 1, 1)) < 0.5))
    transforms[..., 5], transforms[..., 6] = np.sin(angle / 2), np.cos(angle / 2)
    transforms[..., 3:] *= np.where(rng.random((count, 1, 1)) < 0.2,
                                    rng.uniform(0.5, 2, (count, 1, 1)), 1.0)
    chains[:, -2:] = rng.uniform(-1, 1, (count, 2)) * 2.0 ** rng.integers(-3, 8, (count, 1))
    if name == 'both under UTM':
        transforms[..., :3] += _UTM
    elif name == 'all but the same frame':
        # Large terms cancel, and the point is near the origin.
        transforms[:, up:] = transforms[:, :up]
        chains[:, -2:] *= 2.0 ** rng.integers(-70, -40, (count, 1))
    return chains


def evaluate(name, chain):
    """Return the larger error of a moved point's coordinates, relative to its bound."""
    up, down = CHAINS[name]
    transforms = [tuple(row) for row in chain[:-2].reshape(-1, _NUMBERS).tolist()]
    ups, downs = transforms[:up], transforms[up:]
    frames = Frames(10**9)
    for side, chain_of_side in (('up', ups), ('down', downs)):
        for k, transform in enumerate(chain_of_side, 1):
            parent = 'common' if k == len(chain_of_side) else f'{side}{k}'
            frames.insert(parent, f'{side}{k - 1}', 0, transform, True)
    affine = frames.lookup_affine('down0' if down else 'common', 'up0', 0).affine
    point = np.array([*chain[-2:], 0.0], np.float32)
    found = moved_points(point.tobytes(), 0, 1, TRIPLE, affine)
    (x, y, _), origin, w = moved(ups, downs, point[:2].tolist())
    r = math.hypot(*point[:2].tolist())
    travelled = sum(abs(part) for transform in transforms for part in transform[:3])
    composing = len(transforms) * 2.0 ** -120 * (1.0 + travelled)
    return max(
        abs(n * w - true * d) / (d * w) / (
            2.0 ** -53 * (abs(n / d) + abs(c / w) + 3.0 * r) + composing)
        for (n, d), true, c in zip(map(float.as_integer_ratio, np.asarray(found).tolist()),
                                   (x, y), origin))


def moved(ups, downs, point):
    """
    Return a point of the plane of the first frame in the last one, and that frame's origin.

    Both as three integers, to be divided by a third result.
    """
    (x, y), w = _integers(point)
    points = (x, y, 0), (0, 0, 0)
    for transform in ups:
        square, matrix = _turn(transform[3:])
        shift, unit = _integers(transform[:3])
        points = [[unit * sum(map(mul, row, at)) + t * square * w for row, t in zip(matrix, shift)]
                  for at in points]
        w *= square * unit
    for transform in reversed(downs):
        square, matrix = _turn(transform[3:])
        shift, unit = _integers(transform[:3])
        points = [[unit * value - t * w for value, t in zip(at, shift)] for at in points]
        points = [[sum(map(mul, row, at)) for row in zip(*matrix)] for at in points]
        w *= square * unit
    return *points, w


def _integers(numbers):
    """Return doubles times their common denominator, and that denominator."""
    ratios = [number.as_integer_ratio() for number in numbers]
    unit = max(denominator for _, denominator in ratios)
    return [numerator * (unit // denominator) for numerator, denominator in ratios], unit


def _turn(quaternion):
    """Return the squared length of a quaternion, and its rotation matrix times that."""
    (a, b, c, d), _ = _integers(quaternion)
    return a * a + b * b + c * c + d * d, (
        (a * a - b * b - c * c + d * d, 2 * (a * b - c * d), 2 * (a * c + b * d)),
        (2 * (a * b + c * d), b * b - a * a - c * c + d * d, 2 * (b * c - a * d)),
        (2 * (a * c - b * d), 2 * (b * c + a * d), c * c - a * a - b * b + d * d))


def climb(name, chain, steps, rng):
    """Change a chain in place, one or two numbers per step; return the largest error / bound."""
    bits = chain.view(np.int64)
    best, kept = evaluate(name, chain), chain.copy()
    places = np.flatnonzero(chain).tolist()
    for _ in range(steps):
        for k in rng.choices(places, k=rng.randint(1, 2)):
            # A point has the precision of float32.
            lowest = 29 if k >= len(chain) - 2 else 0
            bits[k] += rng.choice((-1, 1)) << rng.randint(lowest, 50)
        usual = all(1e-30 < abs(chain[k]) < 1e30 for k in places)
        ratio = evaluate(name, chain) if usual else 0.0
        if ratio >= best:
            best = ratio
            kept[:] = chain
        else:
            chain[:] = kept
    return best


def largest_of_chains(name, evaluations, seed=1):
    """Return the largest error relative to its bound."""
    starts = starts_of(np.random.default_rng(seed), name, max(evaluations // STEPS, 1))
    rng = random.Random(seed)
    return max(climb(name, chain, evaluations // len(starts), rng) for chain in starts)


@pytest.mark.parametrize('name', CHAINS)
def test_error_of_a_chain_of_frames_is_within_lemma_24(name):
    """A short search, which would find half the bound wrong; `make adversary` runs a long one."""
    ratios = [largest_of_chains(name, 2000, seed) for seed in (1, 2)]
    assert max(ratios) <= 1.0 and ratios[0] > 0.3 and ratios[1] > 0.5


def test_oracle_of_rotations():
    """A quarter turn to the left by a quaternion of length 2, then 10 m along x."""
    (x, y, _), origin, w = moved(
        [(10.0, 0.0, 0.0, 0.0, 0.0, 2.0, 2.0)], [(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)],
        (3.0, 4.0))
    assert (Fraction(x, w), Fraction(y, w)) == (-6, -2)
    assert (Fraction(origin[0], w), Fraction(origin[1], w)) == (-10, 1)


@pytest.mark.parametrize('length', (1e-300, 1e-9, 0.3, 0.99, 1.0, 1.5, 7.0, 1e200))
def test_quaternions_are_normalised(length):
    """As in tf2; `static_transform_publisher --qz 0.7 --qw 0.7` sends such ones."""
    found = accepted((1.0, 2.0, 3.0, 0.0, 0.0, 0.7 * length, 0.7 * length))
    quarter = 0.0, -1.0, 1.0, 1.0, 0.0, 2.0
    assert affine_of(fixed(found)) == pytest.approx(quarter, abs=2.0 ** -60)
    assert rounded(fixed(found))[5:] == pytest.approx((0.5 ** 0.5, 0.5 ** 0.5))


@pytest.mark.parametrize('length', (1 + 4e-10, 1.3, 0.8))
def test_ten_thousand_frames_in_a_chain_do_not_scale(length):
    """With quaternions of length 1, nearly 1, or other lengths."""
    pose = step = fixed(accepted((0.0, 0.0, 0.0, 0.0, 0.0, 0.6 * length, 0.8 * length)))
    for _ in range(9_999):
        pose = composed(step, pose)
    a, b, _, d, e, _ = affine_of(pose)
    assert a * a + b * b == pytest.approx(1.0, abs=1e-15) and (a, b) == (e, -d)
    assert max(part.bit_length() for part in pose) <= 130
