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

"""Settings without ROS, from what the node takes: its parameter files and single values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from itertools import chain
import math
from pathlib import Path
import re
from typing import Any

from sat_collision.replay.bag.unpacking import in_words
from sat_collision.replay.model.options import NODE
from sat_collision.scene.parameters import (
    check_names_given, declare_parameters, ParameterError, read_settings, type_problem)
from sat_collision.scene.settings import Settings, Spec
import yaml

_TOPIC = re.compile(r'(~/|/)?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)


class _Loader(yaml.SafeLoader):
    """YAML as rcl reads it: 1e3 is a number too, and there are no aliases."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError('it has an alias (*), which no parameter file can have')
        return super().compose_node(parent, index)


_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(r'[-+]?[0-9]+[eE][-+]?[0-9]+$'), list('-+0123456789'))


def parameters_of_file(path: str | Path, node: str = NODE) -> dict[str, Any]:
    """
    Return the parameters that a ROS 2 parameter file has for a node, by their dotted names.

    Raises
    ------
    ParameterError
        If the file is not a parameter file, or has nothing for this node.

    """
    try:
        with open(path, encoding='utf-8') as file:
            content = yaml.load(file, _Loader)
    except OSError as error:
        raise ParameterError(f'cannot read {path}: {error.strerror}') from error
    except Exception as error:  # whatever the constructors of YAML's types raise
        raise ParameterError(f'{path} is not a parameter file: {in_words(error)}') from error
    if not isinstance(content, dict):
        raise ParameterError(f'{path} is not a parameter file: it does not list nodes by name')
    found = dict(_sections(content, ''))
    if not found:
        raise ParameterError(f"{path} is not a parameter file: it has no 'ros__parameters'")
    parameters = {}
    for name, values in found.items():
        if not isinstance(values, dict):
            raise ParameterError(f"{path}: 'ros__parameters' of {name} has no parameters")
        if _matches(name, node):
            parameters.update(_flat(values))
    if not any(_matches(name, node) for name in found):
        nearest = get_close_matches(node, [name for name in found if '*' not in name], 1, 0.0)
        hint = f'; did you mean --node {nearest[0]}?' if nearest else ''
        raise ParameterError(
            f'{path} has no parameters for {node}, only for {", ".join(found)}{hint}')
    return parameters


def parameter_of_text(text: str) -> tuple[str, Any]:
    """Return name and value of a parameter written as NAME:=VALUE, the value in YAML."""
    name, given, value = text.partition(':=')
    if not (given and name):
        hint = '' if given or '=' not in text else f': {text.replace("=", ":=", 1)}'
        raise ParameterError(f"'{text}' does not have the form NAME:=VALUE{hint}")
    try:
        return name, yaml.load(value, _Loader)
    except Exception as error:  # as above
        raise ParameterError(f'{text}: {in_words(error)}') from error


def settings_of(parameters: Mapping[str, Any], node: str = NODE,
                is_complete: bool = True) -> Settings:
    """
    Return the Settings that parameters by dotted names make; what the node refuses is refused.

    Unless they are complete, parameters of sources that nobody has named yet are left out.

    Raises
    ------
    ParameterError
        If a value has the wrong type or is not allowed, or there is no such parameter.

    """
    values: dict[str, Any] = {}

    def declare(name: str, default: Any, spec: Spec) -> Any:
        values[name] = _checked(name, parameters.get(name, default), default, spec)
        return values[name]

    footprints, obstacles = declare_parameters(declare)
    check_names_given([name for name in parameters if is_complete or '.' not in name], values)
    return read_settings(footprints, obstacles, values.__getitem__,
                         lambda topic: _resolved(topic, node))


def _sections(content: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the name and parameters of every node, namespaces written out or nested."""
    for key, value in content.items():
        if key == 'ros__parameters':
            yield prefix or '/', value
        elif isinstance(value, dict):
            yield from _sections(value, f'{prefix}/{str(key).strip("/")}')


def _matches(pattern: str, node: str) -> bool:
    """Return whether a name with wildcards, * for one token and ** for any, is the node's."""
    expression = re.escape(pattern).replace(r'/\*\*', '(/[^/]+)*').replace(r'\*', '[^/]+')
    return re.fullmatch(expression, node) is not None


def _flat(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    return dict(chain.from_iterable(
        _flat(value, f'{prefix}{key}.').items() if isinstance(value, dict)
        else [(f'{prefix}{key}', value)] for key, value in values.items()))


def _checked(name: str, value: Any, default: Any, spec: Spec) -> Any:
    """Return a value that has the type of the default and is within limits, as the node would."""
    if value is None:
        raise ParameterError(f"parameter '{name}' has no value")
    if spec.is_any_type:
        return value
    if problem := type_problem(name, value, default):
        raise ParameterError(problem)
    if spec.choices and value not in spec.choices:
        raise ParameterError(f"{name}: '{value}' is not one of {', '.join(spec.choices)}")
    if spec.limits and not (spec.limits[0] <= value <= spec.limits[1] and math.isfinite(value)):
        least, greatest = spec.limits
        raise ParameterError(f'{name}: {value} is not between {least} and {greatest}')
    return value


def _resolved(topic: str, node: str) -> str:
    """Return the full name of a topic, given relative to a node, its namespace or to nothing."""
    if not _TOPIC.fullmatch(topic):
        raise ValueError(f"'{topic}' is not a valid topic name")
    if topic.startswith('/'):
        return topic
    if topic.startswith('~'):
        return node + topic[1:]
    return f'{node.rpartition("/")[0]}/{topic}'
