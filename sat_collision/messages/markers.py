# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The scene as visualization_msgs/MarkerArray."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice
import math
from operator import itemgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from sat_collision.geometry.body.polygon import Polygon
from sat_collision.geometry.overlap import contact_marks, Ring
from sat_collision.geometry.pair.contact import contact
from sat_collision.messages.interfaces import ColorRGBA, Duration, Marker, MarkerArray, Point
from sat_collision.messages.states import in_words
from sat_collision.scene.footprints import State, Status
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.path import PathCheck
from sat_collision.scene.prediction import Prediction
from sat_collision.scene.scene import Scene

_Colour: TypeAlias = tuple[float, ...]

_GREEN = (0.1, 0.7, 0.2)
_RED = (0.9, 0.1, 0.1)
_GREY = (0.6, 0.6, 0.6)
_SLATE = (0.3, 0.4, 0.55)
_AMBER = (0.95, 0.6, 0.0)
_MAROON = (0.45, 0.0, 0.1)
_COLOURS = {Status.CLEAR: _GREEN, Status.IMMINENT: _AMBER, Status.COLLISION: _RED,
            Status.UNKNOWN: _GREY}
_LINE = 0.03
_DOT = 0.1
_TEXT = 0.25
# How often a footprint is drawn on its way to a contact.
_PLACES_AHEAD = 8
# For how many periods markers are shown, so that a dead monitor leaves no green robot.
_PERIODS = 3
# The id of what is drawn of pairs, which no body has: bodies may be called contacts or nearest.
_OF_PAIRS = 2
# Drawing must not hold up the flags. Max obstacles whose contacts are drawn or published, and max
# pairs of a convex part of the footprint and one of the obstacle, unless it is only one obstacle.
MAX_CONTACTS = 50
_MAX_PAIRS = 500
# Max obstacles drawn, and max doubles reserved for their packed bodies, see `layout`.
MAX_DRAWN = 1_000
_MAX_ROOM = 40_000


class _Style(NamedTuple):
    """How points are drawn; by z lines lie above fills, and contacts and axes above these."""

    kind: int
    z: float
    size: float


_FILL = _Style(Marker.TRIANGLE_LIST, 0.0, 1.0)
_OUTLINE = _Style(Marker.LINE_LIST, 0.01, _LINE)
_DOTS = _Style(Marker.SPHERE_LIST, 0.01, _DOT)
_REGION = _Style(Marker.TRIANGLE_LIST, 0.02, 1.0)
_SEGMENTS = _Style(Marker.LINE_LIST, 0.02, 2.0 * _LINE)
_SPOTS = _Style(Marker.SPHERE_LIST, 0.02, 1.5 * _DOT)
_NORMALS = _Style(Marker.LINE_LIST, 0.03, _LINE)
_AXIS = _Style(Marker.LINE_LIST, 0.02, 0.5 * _LINE)
_CLOSEST = _Style(Marker.SPHERE_LIST, 0.02, _DOT)


class _Shape(NamedTuple):
    """The points of a body as messages, made once for each polygon."""

    polygon: Polygon
    triangles: list[Any]
    lines: list[Any]
    dots: list[Any]

    @classmethod
    def of(cls, polygon: Polygon) -> _Shape:
        points = _points(polygon.vertices)
        if len(points) == 1:
            return cls(polygon, [], [], points)
        edges = zip(points, points[1:] + points[:1]) if len(points) > 2 else [points]
        triangles = [_triangles(part.vertices) for part in polygon.parts]
        return cls(polygon, [*chain(*triangles)], [*chain(*edges)], [])


class Markers:
    """
    Draws a scene. What is shown depends on the scene and its time alone.

    Every message deletes all and draws all. Namespaces: `<name>/fill`, `<name>/outline` and
    `<name>/points` for each footprint and source of obstacles, of which id 1 has those in contact
    and id 0 the rest; `<footprint>/name` says its name and state. `contacts/...` show where bodies
    meet, and which way the footprint would have to move; `nearest/...` the nearest pair apart;
    `<footprint>/ahead` its way to a contact that is predicted, and `<footprint>/time` when;
    `<footprint>/path` the path until its first contact, and the footprint there. Of
    very many obstacles only the nearest are drawn, as `limit/text` says.
    """

    def __init__(self) -> None:
        self._shapes: dict[int, _Shape] = {}  # by the id of the polygon
        self.moves = False  # whether time alone changes the last message

    def message(self, scene: Scene) -> Any:
        """Return the markers of a scene, made anew only where a polygon is new."""
        self._frame_id = scene.frame_id
        lifetime = round(_PERIODS * 1e9 / scene.settings.marker_rate)
        self._lifetime = Duration(sec=lifetime // 10**9, nanosec=lifetime % 10**9)
        self._markers = [Marker(action=Marker.DELETEALL)]
        self._markers[0].header.frame_id = scene.frame_id
        footprints = dict(scene.footprints)
        nearest, are_all = scene.nearest_obstacles(MAX_DRAWN, _MAX_ROOM)
        polygons = chain(footprints.values(), (polygon for _, polygon in nearest))
        self._shapes = {id(polygon): self._shape(polygon) for polygon in polygons}
        self._footprints = footprints
        states = {name: scene.state(name) for name in footprints}
        for name, state in states.items():
            self._draw(name, 0, _COLOURS[state.status], 0.6, [footprints[name]])
        contacts = [contact for name, state in states.items()
                    if state.status is Status.COLLISION for contact in scene.contacts(name)]
        self._draw_obstacles(nearest, {id(polygon) for _, _, polygon in contacts})
        known = [name for name, state in states.items() if state.status is not Status.UNKNOWN]
        self._draw_nearest(scene, known)
        predictions = {name: scene.prediction(name) for name in known}
        for name, prediction in predictions.items():
            self._draw_ahead(name, prediction)
        self.moves = any(one and one.velocity and (any(one.velocity.twist)
                                                   or 0.0 < one.seconds < math.inf)
                         for one in predictions.values())
        for name in footprints:
            self._draw_path(name, scene.path_checks.get(name))
        for name, state in states.items():
            self._name(name, state, scene.settings.margin)
        if not are_all:
            self._write('limit/text', _AMBER, next(iter(self._shapes.values())).polygon.vertices,
                        f'the {len(nearest)} nearest obstacles are drawn')
        self._draw_contacts(contacts)
        return MarkerArray(markers=self._markers)

    def _shape(self, polygon: Polygon) -> _Shape:
        shape = self._shapes.get(id(polygon))
        return shape if shape and shape.polygon is polygon else _Shape.of(polygon)

    def _draw_obstacles(self, obstacles: Iterable[tuple[ObstacleId, Polygon]],
                        touched: set[int]) -> None:
        groups: dict[tuple[str, bool], list[Polygon]] = {}
        for obstacle, polygon in obstacles:
            groups.setdefault((obstacle.source, id(polygon) in touched), []).append(polygon)
        for (source, touching), group in groups.items():
            self._draw(source, int(touching), _RED if touching else _SLATE, 0.4, group)

    def _draw(self, name: str, number: int, colour: _Colour, opacity: float,
              polygons: Iterable[Polygon]) -> None:
        """Draw the bodies of one name and colour."""
        shapes = [self._shapes[id(polygon)] for polygon in polygons]
        self._add(f'{name}/fill', number, _FILL, (*colour, opacity),
                  [point for shape in shapes for point in shape.triangles])
        self._add(f'{name}/outline', number, _OUTLINE, colour,
                  [point for shape in shapes for point in shape.lines])
        self._add(f'{name}/points', number, _DOTS, colour,
                  [point for shape in shapes for point in shape.dots])

    def _name(self, name: str, state: State, margin: float) -> None:
        """Write the name of a footprint beside it, and what it touches."""
        text = name
        if state.status is Status.COLLISION:
            text += f': {in_words(state, margin)}'
        elif state.status is not Status.CLEAR:
            text += f': {state.status.value}'
        self._write(f'{name}/name', _COLOURS[state.status], self._footprints[name].vertices, text)

    def _draw_contacts(self, contacts: Iterable[tuple[ObstacleId, Polygon, Polygon]]) -> None:
        pairs = [(own, other) for _, own, other in affordable(contacts)]
        marks = [mark for own, other in pairs for mark in contact_marks(own, other)]
        for ns, style, points in (
                ('regions', _REGION, [p for mark in marks for p in _triangles(mark)]),
                ('segments', _SEGMENTS, [p for mark in marks if len(mark) == 2
                                         for p in _points(mark)]),
                ('points', _SPOTS, [p for mark in marks if len(mark) == 1
                                    for p in _points(mark)])):
            self._add(f'contacts/{ns}', _OF_PAIRS, style, _MAROON, points)
        self._add('contacts/normals', _OF_PAIRS, _NORMALS, _AMBER, [
            end for own, other in pairs for end in _points(_normals(own, other))])

    def _draw_nearest(self, scene: Scene, names: list[str]) -> None:
        """Draw the closest points of the nearest pair apart, and the axis they are on."""
        pairs = [(name, *found) for name in names if (found := scene.nearest(name, apart=True))]
        if not pairs:
            return
        name, obstacle, distance, on_obstacle, on_footprint, _ = min(pairs, key=itemgetter(2))
        ends = np.array([on_footprint, on_obstacle])
        gap = ends[1] - ends[0]
        min_x, min_y, max_x, max_y = self._footprints[name].bounds
        length = np.hypot(*gap) or 1.0  # bodies apart by less than the points' rounding
        beyond = gap / length * max(0.5 * np.hypot(max_x - min_x, max_y - min_y), _TEXT)
        axis = np.array([ends[0] - beyond, ends[1] + beyond])
        self._add('nearest/axis', _OF_PAIRS, _AXIS, _AMBER, _points(axis))
        self._add('nearest/points', _OF_PAIRS, _CLOSEST, _AMBER, _points(ends))
        self._write('nearest/distance', _AMBER, ends, f'{name} - {obstacle}: {distance:.3g} m')

    def _draw_ahead(self, name: str, prediction: Prediction | None) -> None:
        """Draw a footprint on its way to a predicted contact, and the time until then."""
        if not (prediction and prediction.is_known and prediction.velocity
                and 0.0 < prediction.seconds < math.inf):
            return
        vertices = self._footprints[name].vertices
        rings = np.stack([
            prediction.velocity.carry(vertices, prediction.duration * k / _PLACES_AHEAD)
            for k in range(1, _PLACES_AHEAD + 1)])
        self._add(f'{name}/ahead', 0, _OUTLINE, _AMBER,
                  _points(np.stack([rings, np.roll(rings, -1, 1)], 2).reshape(-1, 2)))
        self._write(f'{name}/time', _AMBER, rings[-1],
                    f'{name} - {prediction.obstacle}: {prediction.seconds:.1f} s')

    def _draw_path(self, name: str, found: PathCheck | None) -> None:
        """Draw the path of a footprint up to its first contact, and the footprint there."""
        if found and found.way is not None and found.outline is not None:
            ring = np.stack([found.outline, np.roll(found.outline, -1, 0)], 1)
            way = np.stack([found.way[:-1], found.way[1:]], 1)
            self._add(f'{name}/path', 0, _OUTLINE, _MAROON,
                      _points(np.concatenate([ring, way]).reshape(-1, 2)))

    def _add(self, ns: str, number: int, style: _Style, colour: _Colour,
             points: list[Any]) -> None:
        """Add a marker of many points, if there are any."""
        if not points:
            return
        marker = self._marker(ns, number, style.kind, colour)
        marker.pose.position.z = style.z
        marker.scale.x = marker.scale.y = marker.scale.z = style.size
        marker.points = points

    def _write(self, ns: str, colour: _Colour, points: Ring, text: str) -> None:
        """Write a text above some points."""
        marker = self._marker(ns, 0, Marker.TEXT_VIEW_FACING, colour)
        min_x, _ = points.min(0).tolist()
        max_x, max_y = points.max(0).tolist()
        marker.pose.position = Point(x=0.5 * (min_x + max_x), y=max_y + 0.8 * _TEXT, z=_TEXT)
        marker.scale.z = _TEXT
        marker.text = text

    def _marker(self, ns: str, number: int, kind: int, colour: _Colour) -> Any:
        """Add an empty marker; its stamp of 0 has it drawn at the latest transform."""
        red, green, blue, opacity, *_ = *colour, 1.0
        marker = Marker(ns=ns, id=number, type=kind, action=Marker.ADD, lifetime=self._lifetime,
                        color=ColorRGBA(r=red, g=green, b=blue, a=opacity))
        marker.header.frame_id = self._frame_id
        self._markers.append(marker)
        return marker


def affordable(contacts: Iterable[tuple[ObstacleId, Polygon, Polygon]]
               ) -> Iterator[tuple[ObstacleId, Polygon, Polygon]]:
    """Yield the first of contacts (name, footprint, obstacle), as many as may be drawn."""
    pairs = 0
    for k, found in enumerate(islice(contacts, MAX_CONTACTS)):
        pairs += math.prod(max(1, -polygon.packed[1]) for polygon in found[1:])
        if k and pairs > _MAX_PAIRS:
            return
        yield found


def _normals(footprint: Polygon, obstacle: Polygon) -> Ring:
    """Return the ends of lines along the normal from the points of contact."""
    found = contact(footprint, obstacle)
    way = max(found.depth, _TEXT) * found.normal
    return np.stack([found.points_a, found.points_a + way], 1).reshape(-1, 2)


def _triangles(ring: Ring) -> list[Any]:
    """Return the corners of triangles that fill a convex ring, in threes."""
    first, *others = _points(ring)
    return [corner for pair in zip(others, others[1:]) for corner in (first, *pair)]


def _points(vertices: ArrayLike) -> list[Any]:
    return [Point(x=x, y=y) for x, y in np.asarray(vertices).tolist()]
