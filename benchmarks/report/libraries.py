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
The libraries of PyPI that are asked pair by pair from Python, as their users ask them.

Each makes a body of convex vertices and answers whether two meet, and some how far apart they are
or when they meet on their way. Box2D computes in float32, gives polygons a skin of 1 cm, welds
vertices nearer than 2.5 mm and takes at most 16 of them.
"""

from typing import Callable, NamedTuple

from sat_collision import intersects, Polygon, separation, time_of_contact
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


class Library(NamedTuple):
    """What is asked of a library; None where it has no answer."""

    make: Callable  # makes a body of an (n, 2) array
    meets: Callable  # of two bodies
    distance: Callable | None = None  # of two bodies
    # When an array first meets another one that moves by a vector from time 0 to 1, None if never.
    time: Callable | None = None
    max_vertices: int = 10**6
    is_fragile: bool = False  # whether hard pairs may end the process


def shapely_shape(body):
    if len(body) > 2:
        return shapely.Polygon(body)
    return shapely.LineString(body) if len(body) == 2 else shapely.Point(body[0])


def _chipmunk_shape(body):
    place = Body(body_type=Body.STATIC)
    points = body.tolist()
    shape = Poly(place, points) if len(body) > 2 else Segment(place, points[0], points[-1], 0)
    shape.cache_bb()
    return shape


def _sampled_time(body, other, move):
    """Ask shapely at equal steps, as many programs do."""
    a, b = shapely_shape(body), shapely_shape(other)
    for k in range(SAMPLES + 1):
        x, y = k / SAMPLES * move
        if a.intersects(shapely.affinity.translate(b, x, y)):
            return k / SAMPLES
    return None


def _box2d_time(body, other, move):
    ways = Box2D.b2Sweep(), Box2D.b2Sweep()
    for way in ways:
        way.localCenter = way.c0 = way.c = (0, 0)
        way.a0 = way.a = way.alpha0 = 0
    ways[1].c = tuple(move.tolist())
    state, time = Box2D.b2TimeOfImpact(
        shapeA=_box2d_shape(body), shapeB=_box2d_shape(other), sweepA=ways[0], sweepB=ways[1],
        tMax=1.0)
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
