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

"""The scene as visualization_msgs/MarkerArray."""

from typing import NamedTuple

import numpy as np
from sat_collision.geometry.distance import closest_points
from sat_collision.geometry.polygon import Polygon
from sat_collision.messages.interfaces import ColorRGBA, Marker, MarkerArray, Point
from sat_collision.scene.footprints import Status

_GREEN = (0.1, 0.7, 0.2)
_RED = (0.9, 0.1, 0.1)
_GREY = (0.6, 0.6, 0.6)
_SLATE = (0.3, 0.4, 0.55)
_AMBER = (0.95, 0.6, 0.0)
_COLOURS = {Status.CLEAR: _GREEN, Status.COLLISION: _RED, Status.UNKNOWN: _GREY}
_LINE = 0.03
_DOT = 0.1
_TEXT = 0.25
# Height keeps lines above fills, and what explains above what it explains.
_FILL_Z, _LINE_Z, _PAIR_Z = 0.0, 0.01, 0.02


class _Shape(NamedTuple):
    """A body's points as markers want them, made once for each polygon."""

    polygon: Polygon
    triangles: list
    lines: list
    dots: list

    @classmethod
    def of(cls, polygon):
        points = _points(polygon.vertices)
        if len(points) == 1:
            return cls(polygon, [], [], points)
        edges = zip(points, points[1:] + points[:1]) if len(points) > 2 else [points]
        triangles = []
        if len(points) > 2:
            for part in polygon.parts:
                corners = _points(part.vertices)
                for b, c in zip(corners[1:], corners[2:]):
                    triangles += corners[0], b, c
        return cls(polygon, triangles, [point for edge in edges for point in edge], [])


class Markers:
    """
    Draws a scene: what it shows depends on the scene alone, so that nothing stale can stay.

    Every message deletes all and draws all. Namespaces: `<name>/fill`, `<name>/outline` and
    `<name>/points` for each footprint and source of obstacles, of which id 1 has those in contact
    and id 0 the rest; `contacts/...` and `nearest/...` explain them.
    """

    def __init__(self):
        self._shapes = {}

    def message(self, scene):
        """Return the markers of a scene, made anew only where a polygon is new."""
        self._frame_id = scene.frame_id
        self._markers = [Marker(action=Marker.DELETEALL)]
        self._markers[0].header.frame_id = scene.frame_id
        footprints = dict(scene.footprints)
        obstacles = dict(scene.obstacles)
        bodies = {**footprints, **obstacles}
        self._shapes = {body: self._shape(body, polygon) for body, polygon in bodies.items()}
        states = {name: scene.state(name) for name in footprints}
        contacts = [(name, obstacle) for name, state in states.items()
                    for obstacle in state.contacts if obstacle in obstacles]
        for name, state in states.items():
            self._draw(name, 0, _COLOURS[state.status], 0.6, [name])
        self._draw_obstacles(obstacles, {obstacle for _, obstacle in contacts})
        self._draw_contacts(contacts)
        known = [name for name, state in states.items() if state.status is not Status.UNKNOWN]
        self._draw_nearest(known, list(obstacles), contacts)
        return MarkerArray(markers=self._markers)

    def _shape(self, body, polygon):
        shape = self._shapes.get(body)
        return shape if shape and shape.polygon is polygon else _Shape.of(polygon)

    def _draw_obstacles(self, obstacles, touched):
        groups = {}
        for obstacle in obstacles:
            groups.setdefault((obstacle.source, obstacle in touched), []).append(obstacle)
        for (source, touching), group in groups.items():
            self._draw(source, int(touching), _RED if touching else _SLATE, 0.4, group)

    def _draw(self, name, number, colour, opacity, bodies):
        """Draw the bodies of one name and colour."""
        shapes = [self._shapes[body] for body in bodies]
        self._add(f'{name}/fill', number, Marker.TRIANGLE_LIST, (*colour, opacity), _FILL_Z, 1.0,
                  [point for shape in shapes for point in shape.triangles])
        self._add(f'{name}/outline', number, Marker.LINE_LIST, colour, _LINE_Z, _LINE,
                  [point for shape in shapes for point in shape.lines])
        self._add(f'{name}/points', number, Marker.SPHERE_LIST, colour, _LINE_Z, _DOT,
                  [point for shape in shapes for point in shape.dots])

    def _draw_contacts(self, contacts):
        pairs = []
        for number, (name, obstacle) in enumerate(contacts):
            ends = np.array([self._shapes[body].polygon.centroid for body in (name, obstacle)])
            pairs += _points(ends)
            self._write('contacts/names', number, _RED, ends.mean(axis=0), f'{name} - {obstacle}')
        self._add('contacts/pairs', 0, Marker.LINE_LIST, _RED, _PAIR_Z, _LINE, pairs)

    def _draw_nearest(self, names, obstacles, contacts):
        """Draw the closest points of the nearest pair apart, and the axis they are on."""
        pair = self._nearest(names, obstacles, set(contacts))
        if pair is None:
            return
        name, obstacle, ends = pair
        gap = ends[1] - ends[0]
        distance = np.hypot(*gap)
        min_x, min_y, max_x, max_y = self._shapes[name].polygon.bounds
        beyond = gap / distance * max(0.5 * np.hypot(max_x - min_x, max_y - min_y), _TEXT)
        axis = _points([ends[0] - beyond, ends[1] + beyond])
        self._add('nearest/axis', 0, Marker.LINE_LIST, _AMBER, _PAIR_Z, 0.5 * _LINE, axis)
        self._add('nearest/points', 0, Marker.SPHERE_LIST, _AMBER, _PAIR_Z, _DOT, _points(ends))
        self._write('nearest/distance', 0, _AMBER, ends.mean(axis=0),
                    f'{name} - {obstacle}: {distance:.3g} m')

    def _nearest(self, names, obstacles, contacts):
        """Return footprint, obstacle and closest points of the nearest pair that is apart."""
        best, least = None, np.inf
        boxes = np.array([self._shapes[body].polygon.bounds for body in obstacles]).reshape(-1, 4)
        for name in names:
            polygon = self._shapes[name].polygon
            min_x, min_y, max_x, max_y = polygon.bounds
            gap_x = np.maximum(boxes[:, 0] - max_x, min_x - boxes[:, 2]).clip(0.0)
            gap_y = np.maximum(boxes[:, 1] - max_y, min_y - boxes[:, 3]).clip(0.0)
            gaps = np.hypot(gap_x, gap_y)
            for row in gaps.argsort():
                if gaps[row] >= least:
                    break
                obstacle = obstacles[row]
                if (name, obstacle) in contacts:
                    continue
                ends = np.array(closest_points(polygon, self._shapes[obstacle].polygon))
                distance = np.hypot(*(ends[1] - ends[0]))
                if 0.0 < distance < least:
                    best, least = (name, obstacle, ends), distance
        return best

    def _add(self, ns, number, kind, colour, z, size, points):
        """Add a marker of many points, if there are any."""
        if not points:
            return
        marker = self._marker(ns, number, kind, colour)
        marker.pose.position.z = z
        marker.scale.x = marker.scale.y = marker.scale.z = size
        marker.points = points

    def _write(self, ns, number, colour, place, text):
        marker = self._marker(ns, number, Marker.TEXT_VIEW_FACING, colour)
        marker.pose.position = Point(x=float(place[0]), y=float(place[1]), z=_TEXT)
        marker.scale.z = _TEXT
        marker.text = text

    def _marker(self, ns, number, kind, colour):
        """Add an empty marker; its stamp of 0 has it drawn at the latest transform."""
        red, green, blue, *opacity = colour
        marker = Marker(ns=ns, id=number, type=kind, action=Marker.ADD, color=ColorRGBA(
            r=red, g=green, b=blue, a=opacity[0] if opacity else 1.0))
        marker.header.frame_id = self._frame_id
        self._markers.append(marker)
        return marker


def _points(vertices):
    return [Point(x=x, y=y) for x, y in np.asarray(vertices).tolist()]
