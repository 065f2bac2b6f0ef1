# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Exact collision checks between robot footprints and obstacles, for ROS 2.

A body is a `Polygon`, or points or a geometry such as shapely's that make one. Coordinates are
metres in one frame, and touching counts as contact.

=============================================  =====================================
Do bodies share a point?                       intersects, intersects_many,
                                               intersects_pairs
How far apart are they, or how deep?           separation, separations
Where are they nearest?                        closest_points
What are contact normal, points and depth?     contact
When do moving bodies meet?                    time_of_contact
When does a robot meet an obstacle?            time_to_contact
Where does a path meet an obstacle?            first_contact_along
One body against a set that changes            PolygonSet
=============================================  =====================================

With numba everything is compiled, which takes about 25 s once after an installation; the command
prepare_kernels does this in advance.
"""

# Names are imported on first use: that takes a second, before which the node must be ready for
# signals.
from __future__ import annotations

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from sat_collision.geometry.body.polygon import Polygon, PolygonError, Reason
    from sat_collision.geometry.compiled.jit import KERNEL
    from sat_collision.geometry.motion.sweep import time_of_contact
    from sat_collision.geometry.pair.contact import Contact, contact
    from sat_collision.geometry.path import first_contact_along, PathContact
    from sat_collision.geometry.query import (
        closest_points, intersects, intersects_many, intersects_pairs, separation, separations,
        time_to_contact)
    from sat_collision.geometry.sets.polygon_set import PolygonSet

__all__ = [
    'Contact',
    'KERNEL',
    'PathContact',
    'Polygon',
    'PolygonError',
    'PolygonSet',
    'Reason',
    'closest_points',
    'contact',
    'first_contact_along',
    'intersects',
    'intersects_many',
    'intersects_pairs',
    'separation',
    'separations',
    'time_of_contact',
    'time_to_contact',
]

# The modules in geometry of the names that are not in query.
_HOMES = {'Contact': 'pair.contact', 'contact': 'pair.contact', 'first_contact_along': 'path',
          'KERNEL': 'compiled.jit', 'PathContact': 'path', 'Polygon': 'body.polygon',
          'PolygonError': 'body.polygon', 'PolygonSet': 'sets.polygon_set',
          'Reason': 'body.polygon', 'time_of_contact': 'motion.sweep'}


def __dir__() -> list[str]:
    """Return the public names, for completion and help."""
    return sorted([*__all__, '__version__', *(one for one in globals() if one[:2] == '__')])


def __getattr__(name: str) -> Any:
    """Return the public object of that name, imported on first use, or the version."""
    if name == '__version__':
        return _version()
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.geometry.{_HOMES.get(name, "query")}'), name)


def _version() -> str:
    """Return the version that is installed, that of setup.py and package.xml."""
    from importlib.metadata import PackageNotFoundError, version
    try:
        return version(__name__)
    except PackageNotFoundError:
        return 'unknown: not installed'
