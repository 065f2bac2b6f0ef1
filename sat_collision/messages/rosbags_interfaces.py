# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Message classes made from rosbags' definitions, for machines without ROS."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)


def serialize(message: Any) -> bytes:
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))


def octets(data: bytes) -> Any:
    """Return bytes as the value of a field of bytes."""
    return np.frombuffer(data, np.uint8)


@functools.cache
def message_class(name: str) -> type:
    """Return the class of a type such as std_msgs/msg/Bool, whose fields are all optional."""
    kind: Any = STORE.types[name]
    _, fields = STORE.fielddefs[name]

    def __init__(self: Any, **values: Any) -> None:
        kind.__init__(self, **values, **{field: _default(description)
                                         for field, description in fields if field not in values})
        if name == 'geometry_msgs/msg/Quaternion' and not (self.x or self.y or self.z):
            self.w = 1.0

    package, _, short = name.split('/')
    return type(short, (kind,), {'__init__': __init__, '__module__': f'{package}.msg'})


def message_classes(package: str, *names: str) -> list[Any]:
    """Return the classes of types of a package, such as Bool of std_msgs."""
    return [message_class(f'{package}/msg/{name}') for name in names]


def _default(description: Any) -> Any:
    """Return the default of a field, by rosbags' description of its type."""
    kind, detail = description
    if kind is Nodetype.NAME:
        return message_class(detail)()
    if kind is Nodetype.BASE:
        return {'string': '', 'bool': False, 'float32': 0.0, 'float64': 0.0}.get(detail[0], 0)
    element, count = detail
    if element[0] is Nodetype.BASE and element[1][0] != 'string':
        return np.zeros(count, element[1][0].replace('byte', 'uint8'))
    return [_default(element) for _ in range(count)]
