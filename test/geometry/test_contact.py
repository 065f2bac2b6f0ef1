# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Normals, points and depths of contacts, against rational arithmetic and shapely."""

from fractions import Fraction
import math

from bodies import as_shapely, U_SHAPE
import families
import numpy as np
import oracle
import pytest
from rationals import exact_depth, exact_distance
from sat_collision import closest_points, contact, intersects, Polygon, PolygonSet, separation
import shapely
import shapes

ULP = 2.0 ** -52
L_SHAPE = np.array([(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)], float)
# Found by `make adversary`: a vertex of A is equally deep behind two edges of B, up to rounding,
# and 3e-8 m beside one of them.
BESIDE = [
    (-1083309.499999999, 136588.49804687488), (-1083310.0, 136587.75), (-1083308.5, 140680.0),
    (-1083308.75, 136588.501953125)]
EDGES = [
    (-1083310.4999999925, 137102.49987792975), (-1083310.75, 136589.9999999907),
    (-1083567.0, 136589.74999976158), (-1083343.0, 136589.49999952363),
    (-1083311.1875, 136589.24999999907), (-1083311.1717529297, 136588.7499998808),
    (-1083567.0, 136587.9999961853), (-1083310.751953125, 136588.24999999977),
    (-1083310.75, 136588.0), (-1083310.5000000005, 136588.0), (-1083310.2499999981, 136588.0),
    (-1083310.0, 136588.001953125), (-1083309.75, 136588.25), (-1083309.5, 136588.5),
    (-1083309.5, 136588.875), (-1083309.5, 136589.25), (-1079213.531250015, 136589.25),
    (-1083309.75, 136589.75), (-1083309.9999999702, 136589.75), (-1083310.249998101, 136590.0)]
# The offset that separates these runs almost along an edge, behind which they reach ever further.
SLIDING = [
    (-651.3675619372643, 3012.2314410059917), (-522.3735344423476, 2765.24060619436),
    (-603.8119338871305, 2765.001267247352), (-536.7491766791798, 2666.846092681939),
    (-524.9996256872794, 2763.758563745062), (-524.0446770201816, 2763.276918605381),
    (-523.5000000000073, 2763.7490133250394), (-502.7575700962004, 2755.83522177644)]
ALONG = [
    (-523.4999999999998, 2762.468512475491), (-523.4999999999923, 2766.7636794225673),
    (-523.7973635271501, 2763.5000000000027), (-524.4746055714779, 2763.4999999999955),
    (-524.0170900226179, 2758.0483684539713), (-523.263423885337, 2756.1314890090725),
    (-499.8347625119201, 2638.5214748084536), (-522.8173784865139, 2765.0813031278103)]


def box(x, y, width=1.0, height=1.0):
    return [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]


def outside(polygon, point):
    """Return the exact distance of a point from a polygon, 0 if inside."""
    if oracle.intersects(polygon.vertices, [point]):
        return 0.0
    return float(exact_distance(polygon, [point]))


def overlap_once_moved(a, b, x, y):
    """Tell exactly whether the interiors of convex bodies overlap once a is moved."""
    moved = [(Fraction(px) + x, Fraction(py) + y) for px, py in a.vertices.tolist()]
    return exact_depth(moved, b) > 0


def reach_of(*bodies):
    return max(float(abs(body.vertices).max()) for body in bodies)


def check(a, b):
    """Check all promises of the contact of two bodies."""
    found = contact(a, b)
    ulp = math.ulp(reach_of(a, b))
    assert found.separation == separation(a, b)
    assert abs(np.hypot(*found.normal) - 1.0) <= 2 * ULP
    assert 1 <= len(found.points_a) == len(found.points_b) <= 2
    for body, points in ((a, found.points_a), (b, found.points_b)):
        assert max(outside(body, point) for point in points) <= 4 * ulp
    gaps = found.points_a - found.points_b
    if a.is_convex and b.is_convex:
        assert found.depth == max(-found.separation, 0.0)
        along = gaps @ found.normal
        across = gaps @ [-found.normal[1], found.normal[0]]
        assert abs(along.min() - found.separation) <= 16 * ulp
        assert abs(across).max() <= 16 * ulp + 1e-15 * abs(gaps).max()
    else:
        assert found.depth >= max(-found.separation, 0.0)
    return found


@pytest.mark.parametrize('turned', [False, True])
def test_closest_points_of_overlapping_boxes_are_points_of_each(turned):
    """Of boxes side by side, a vertex of one may be beside the nearest edge of the other."""
    rng = np.random.default_rng(5)
    for _ in range(300):
        a = np.array(box(0, 0, *rng.uniform(1, 3, 2)))
        b = np.array(box(*rng.uniform(-1, 1, 2), *rng.uniform(1, 3, 2)))
        angle = rng.uniform(0, 7) if turned else 0.0
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        a, b = Polygon(a @ turn), Polygon(b @ turn)
        row = PolygonSet([a]).nearest(b)
        for p, q in (closest_points(a, b), row[2:]):
            assert outside(a, p) <= 8 * ULP and outside(b, q) <= 8 * ULP
            assert np.hypot(*np.subtract(q, p)) == pytest.approx(-separation(a, b), abs=8 * ULP)


def test_closest_points_of_touching_bodies_are_common():
    """Also edge on edge, where a vertex may be beside the other edge."""
    a = Polygon(box(0, 0))
    for b in (box(0.5, 1, 3, 3), box(-5, 1, 5.5, 1), box(1, 1), box(1, 0.25, 1, 0.5)):
        p, q = closest_points(a, b)
        assert p.tolist() == q.tolist()
        assert outside(a, p) == outside(Polygon(b), q) == 0


@pytest.mark.parametrize('a, b, normal, points', [
    (box(0, 0), box(0.5, 1), (0, -1), [(0.5, 1), (1, 1)]),
    (box(0, 0), box(-0.5, -1, 2), (0, 1), [(1, 0), (0, 0)]),
    (box(0, 0), [(0.5, 1), (1, 2), (0, 2)], (0, -1), [(0.5, 1)]),
    (box(0, 0), [(1, 0.5)], (-1, 0), [(1, 0.5)]),
    ([(0, 0), (2, 0)], [(1, 0)], (0, 1), [(1, 0)]),
    ([(0, 0), (2, 0)], [(1, 0), (1, 3)], (0, -1), [(1, 0)]),
    (L_SHAPE, box(1, 2), (-1, 0), [(1, 3), (1, 2)]),
    ([(3, 4)], [(3, 4)], (-1, 0), [(3, 4)]),
], ids=['edge on edge', 'the other way', 'vertex on edge', 'point on edge', 'point on segment',
        'T', 'in the corner of an L', 'same point'])
def test_touching_bodies_have_a_normal(a, b, normal, points):
    """The vector between the closest points is zero; the points are common to both."""
    found = check(Polygon(a), Polygon(b))
    assert found.normal.tolist() == list(normal)
    assert found.depth == found.separation == 0.0
    assert found.points_a.tolist() == found.points_b.tolist() == [list(p) for p in points]


@pytest.mark.parametrize('a, b', [(BESIDE, EDGES), (EDGES, BESIDE)])
def test_vertex_beside_an_edge_is_a_point_of_contact(a, b):
    """Two almost level edges are equally deep up to rounding."""
    found = check(Polygon(a), Polygon(b))
    assert found.separation == -2.0
    points = found.points_a if a is BESIDE else found.points_b
    assert points.tolist() == [list(BESIDE[1])]


def test_offset_almost_along_an_edge_ends_all_overlaps():
    """Up to 2^-46 of the largest coordinate, for every pair of parts."""
    a, b = Polygon(SLIDING), Polygon(ALONG)
    found = check(a, b)
    moved = Polygon(a.vertices + found.depth * found.normal)
    left = max(-separation(p, q) for p in moved.parts for q in b.parts)
    assert left <= 2 ** -46 * reach_of(a, b)


def test_points_of_facing_edges_and_of_a_vertex():
    """Two points if edges face each other, otherwise one."""
    apart = check(Polygon(box(0, 0)), Polygon(box(1.5, 0.25)))
    assert apart.normal.tolist() == [-1, 0] and apart.separation == 0.5 and apart.depth == 0.0
    assert apart.points_a.tolist() == [[1, 1], [1, 0.25]]
    assert apart.points_b.tolist() == [[1.5, 1], [1.5, 0.25]]
    deep = check(Polygon(box(0, 0)), Polygon(box(0.75, 0.25)))
    assert deep.normal.tolist() == [-1, 0] and deep.depth == 0.25
    assert deep.points_b.tolist() == [[0.75, 1], [0.75, 0.25]]
    corner = check(Polygon(box(0, 0)), Polygon([(3, 4)]))
    assert corner.points_a.tolist() == [[1, 1]] and corner.points_b.tolist() == [[3, 4]]
    np.testing.assert_allclose(corner.normal, np.array([-2, -3]) / math.sqrt(13), rtol=4 * ULP)


@pytest.mark.parametrize('gap', [0.0, 0.25, -0.25])
@pytest.mark.parametrize('other', [
    box(0.5, 1, 1.25, 2), [(0.75, 1), (2, 2), (0.25, 2)], [(0.5, 1)], [(0.25, 1), (0.5, 1)],
], ids=['edge on edge', 'vertex on edge', 'point', 'segment'])
def test_contact_is_continuous(other, gap):
    """Changes of 1e-12 of bodies that touch, are apart or overlap, at any angle."""
    rng = np.random.default_rng(3)
    for angle in (0.0, *rng.uniform(0, 7, 9)):
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        a, b = np.array(box(0, 0, 2)) @ turn, (np.array(other) + [0, gap]) @ turn
        found = contact(a, b)
        for _ in range(50):
            moved = contact(a + rng.uniform(-1e-12, 1e-12, a.shape),
                            b + rng.uniform(-1e-12, 1e-12, b.shape))
            for one, another in zip(found, moved):
                np.testing.assert_allclose(another, one, rtol=0, atol=2e-11)


@pytest.mark.parametrize('name', families.ALL)
def test_promises_hold_for_every_family(name):
    for pair in families.ALL[name](np.random.default_rng(6), 40, 7):
        a, b = map(Polygon, pair)
        found, other = check(a, b), check(b, a)
        assert (found.separation, found.depth) == (other.separation, other.depth)
        if not np.array_equal(a.vertices, b.vertices):
            assert found.normal.tolist() == (-other.normal + 0.0).tolist()
            assert found.points_a.tolist() == other.points_b[::-1].tolist()
            assert found.points_b.tolist() == other.points_a[::-1].tolist()


@pytest.mark.parametrize('name', families.CONVEX)
def test_depth_of_convex_bodies_is_the_shortest_offset(name):
    """In rationals: moved by the depth they touch up to rounding, moved by less they overlap."""
    overlaps = 0
    for pair in families.CONVEX[name](np.random.default_rng(7), 60, 6):
        a, b = map(Polygon, pair)
        found = contact(a, b)
        slack = 16 * math.ulp(reach_of(a, b))
        x, y = map(Fraction, found.normal.tolist())
        if found.depth == 0.0:
            assert not overlap_once_moved(a, b, x * Fraction(slack), y * Fraction(slack))
            continue
        overlaps += found.depth > 100 * slack
        out, short = Fraction(found.depth + slack), Fraction(found.depth - slack)
        assert not overlap_once_moved(a, b, x * out, y * out)
        assert short <= 0 or overlap_once_moved(a, b, x * short, y * short)
        assert abs(found.depth - exact_depth(a, b)) <= slack
    assert overlaps or name not in ('near', 'deep', 'containment', 'slivers', 'many_sided')


def star(n, inner):
    angle = np.arange(n) * 2 * np.pi / n
    return shapes.at_angles(angle, np.where(np.arange(n) % 2, 4.0, 4.0 * inner))


NOTCHED = [L_SHAPE, U_SHAPE, shapes.PLUS, np.array([(0, 0), (4, 0), (1, 1), (0, 4)]),
           star(8, 0.5), star(12, 0.5)]
SMALL = [np.array(body, float) for body in (
    [(0, 0)], [(0, 0), (1, 0)], [(0, 0), (0, 2)], [(0, 0), (1, 1)], box(0, 0, 2), box(0, 0))]


def pairs_of(on_lattice, rng, count):
    """Yield pairs of which one or both are not convex, near each other."""
    for _ in range(count):
        pair = [NOTCHED[rng.integers(len(NOTCHED))], (NOTCHED + SMALL)[rng.integers(12)]]
        rng.shuffle(pair)
        angle = 0.0 if on_lattice else rng.uniform(0, 7)
        turn = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        offset = rng.integers(-5, 6, 2) if on_lattice else rng.uniform(-4, 4, 2)
        yield tuple(Polygon(body + move) for body, move in zip(
            (np.rint(body) if on_lattice else body for body in (pair[0], pair[1] @ turn)),
            (0, offset)))


def pieces(body):
    """Return the triangles of a body by shapely, as point arrays."""
    if len(body.vertices) < 3:
        return [body.vertices]
    return [np.array(one.exterior.coords)[:3] for one in
            shapely.constrained_delaunay_triangles(as_shapely(body)).geoms]


def difference(a, b):
    """Return the union of all q - p as a polygon of shapely: a overlaps b moved back by one."""
    return shapely.union_all([shapely.convex_hull(shapely.MultiPoint(
        (q[:, None] - p[None]).reshape(-1, 2))) for p in pieces(a) for q in pieces(b)])


def overlap(a, b):
    """Return whether more than boundaries of bodies is common; exact on a lattice."""
    return as_shapely(a).relate(as_shapely(b))[0] != 'F'


def moved(a, way):
    return Polygon(a.vertices + way)


@pytest.mark.parametrize('count', [600, pytest.param(1500, marks=pytest.mark.long)])
@pytest.mark.parametrize('on_lattice', [False, True], ids=['turned', 'on a lattice'])
def test_way_out_is_the_shortest(on_lattice, count):
    """Compared with the distance from the boundary of the Minkowski difference, by shapely."""
    longer = on_cuts = 0
    for a, b in pairs_of(on_lattice, np.random.default_rng(8), count):
        if not overlap(a, b):
            continue
        found = check(a, b)
        area = difference(a, b)
        shortest = area.boundary.distance(shapely.Point(0, 0))
        assert found.depth == pytest.approx(shortest, rel=1e-9)
        extent = np.ptp(np.concatenate([a.vertices, b.vertices]), axis=0).max()
        assert not intersects(moved(a, (found.depth + 2 ** -45 * extent) * found.normal), b)
        longer += found.depth > 1e-9 - found.separation
        on_cuts += found.separation == 0.0
    assert longer > count // 15 and on_cuts >= count // 300 * on_lattice


def is_free(a, b, normal):
    return not overlap(moved(a, 2 ** -20 * normal), b)


def touched(a, b):
    """Return the outward normals of sides of b on which a vertex of a is."""
    ring = b.vertices
    for start, end in zip(ring, np.roll(ring, -1, axis=0)) if len(ring) > 1 else ():
        if any(oracle.intersects([start, end], [point]) for point in a.vertices):
            ex, ey = (end - start) / np.hypot(*(end - start))
            yield np.array([ey, -ex])


def test_touching_bodies_have_the_normal_of_a_side():
    """With points on both boundaries; along it a does not overlap, if any touched side allows."""
    touching = free = 0
    for a, b in pairs_of(True, np.random.default_rng(9), 3000):
        if not intersects(a, b) or overlap(a, b):
            continue
        touching += 1
        found = check(a, b)
        assert found.separation == found.depth == 0.0
        normals = [*touched(a, b), *(-one for one in touched(b, a))]
        assert min(abs(one - found.normal).max() for one in normals) <= ULP
        for body in (a, b):
            outline = as_shapely(body)
            outline = outline.boundary if len(body.vertices) > 2 else outline
            assert all(outline.distance(shapely.Point(point)) <= 4 * ULP
                       for point in np.concatenate([found.points_a, found.points_b]))
        if is_free(a, b, found.normal):
            free += 1
        else:
            assert not any(is_free(a, b, one) for one in normals)
    assert touching > 250 and free > 0.97 * touching


def test_depth_in_a_corner_leaves_both_walls():
    """Either wall alone needs less."""
    found = check(Polygon(box(0.75, 0.75)), Polygon(L_SHAPE))
    assert found.separation == -0.25
    np.testing.assert_allclose(found.normal, [math.sqrt(0.5)] * 2, rtol=1e-12)
    assert found.depth == pytest.approx(math.sqrt(0.125), rel=1e-13)


@pytest.mark.parametrize('arm', [1.0, 10.0, 50.0])
def test_vertices_that_become_one_by_rounding_are_no_side(arm):
    """A circle whose last point almost is the first one, and a wall that is long beside that."""
    circle = shapes.at_angles(np.linspace(0.0, 2 * np.pi, 17))
    wall = [(-arm, -arm), (arm, -arm), (arm, -0.5), (-0.5, -0.5), (-0.5, arm), (-arm, arm)]
    a, b = Polygon(circle), Polygon(wall)
    assert len(a.vertices) == 17
    for pair in (a, b), (b, a):
        assert check(*pair).depth == pytest.approx(contact(circle[:-1], wall).depth, rel=1e-13)


def test_far_from_the_origin_the_way_out_is_as_exact():
    """It depends on the extent of the bodies, not on where they are."""
    offset = [2.0 ** 40, -2.0 ** 41]
    here = contact(box(0.75, 0.75), L_SHAPE)
    there = contact(np.add(box(0.75, 0.75), offset), L_SHAPE + offset)
    assert there.depth == here.depth and there.normal.tolist() == here.normal.tolist()


def test_bodies_of_many_vertices_leave_along_a_straight_line():
    """Each interlocks with the other, so that too many pairs of parts are near."""
    a, b = Polygon(star(1000, 0.5)), Polygon(star(1000, 0.25) + [0.5, 0.25])
    found = check(a, b)
    gone = moved(a, (found.depth + 1e-12) * found.normal)
    assert not as_shapely(gone).convex_hull.intersects(as_shapely(b).convex_hull)
    assert found.depth < 8.5
    near = contact(a, star(1000, 0.25) + [7.98, 0.0])
    assert near.depth < 0.1 and not intersects(moved(a, (near.depth + 1e-12) * near.normal),
                                               star(1000, 0.25) + [7.98, 0.0])


@pytest.mark.parametrize('exponent', [-1000, -300, 300, 1015])
def test_scale_does_not_matter(exponent):
    """Products of coordinates underflow or overflow."""
    for a, b in families.CONVEX['near'](np.random.default_rng(9), 20, 5):
        found, scaled = contact(a, b), contact(np.ldexp(a, exponent), np.ldexp(b, exponent))
        assert scaled.normal.tolist() == found.normal.tolist()
        assert scaled.depth == math.ldexp(found.depth, exponent)
        assert scaled.points_a.tolist() == np.ldexp(found.points_a, exponent).tolist()
