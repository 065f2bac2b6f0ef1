# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The node's parameters: declared, validated, and read as Settings."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from sat_collision.scene.parameters import (
    check_names_given, declare_parameters, ParameterError, read_settings, type_problem,
    without_value)
from sat_collision.scene.settings import Settings, Spec


# A parameter of every node; locked, too, as nothing expires while a simulated clock stands still.
_USE_SIM_TIME = 'use_sim_time'


class Parameters:
    """
    Declares the parameters of a node and keeps the Settings made from them.

    An initial value that is invalid, and an unknown name, raise a ParameterError.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._specs: dict[str, Spec] = {}
        self._on_change: Callable[[Settings], None] | None = None
        self._values: dict[str, Any] = {}
        # By the name of a parameter that was changed: from what to what, in words.
        self.changes: dict[str, str] = {}
        node.add_on_set_parameters_callback(self._validate)
        # Overrides for this node, from parameter files and the command line.
        self._given: dict[str, Parameter] = node._parameter_overrides
        self._footprints, self._obstacles = declare_parameters(self._declare)
        check_names_given(self._given, self._specs)
        self.settings = self._read()
        node.add_post_set_parameters_callback(self._apply)

    def on_change(self, callback: Callable[[Settings], None]) -> None:
        """Call `callback(settings)` whenever parameters have been changed."""
        self._on_change = callback
        self._values = {name: self._node.get_parameter(name).value
                        for name in (*self._specs, _USE_SIM_TIME)}

    def _declare(self, name: str, default: Any, spec: Spec) -> Any:
        self._specs[name] = spec
        try:
            value = self._node.declare_parameter(name, default, _descriptor(default, spec)).value
        except ParameterException as error:
            given = self._given.get(name)
            raise ParameterError(
                given and type_problem(name, given.value, default) or error) from error
        if value is None:
            raise ParameterError(without_value(name))
        return value

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        problem = self._problem({one.name: one.value for one in parameters})
        return SetParametersResult(successful=not problem, reason=problem)

    def _problem(self, changes: dict[str, Any]) -> str:
        """Return why changes are refused, empty if they are valid."""
        for name, value in changes.items():
            spec = self._specs.get(name)
            if self._on_change and self.settings.lock_parameters and (
                    name == _USE_SIM_TIME or spec and spec.safety):
                return f'{name} is locked: lock_parameters is true'
            if spec and spec.choices and value not in spec.choices:
                return f"{name}: '{value}' is not one of {', '.join(spec.choices)}"
        # At the start all values are read together.
        if not self._on_change or not self._specs.keys() & changes:
            return ''
        try:
            self._read(changes)
        except ParameterError as error:
            return str(error)
        return ''

    def _apply(self, parameters: list[Parameter]) -> None:
        if not self._on_change:
            return
        for parameter in parameters:
            name = parameter.name
            if name in self._values and parameter.value != self._values[name]:
                old, new = map(_plain, (self._values[name], parameter.value))
                self._values[name] = parameter.value
                self.changes[name] = change = f'from {old} to {new}'
                self._node.get_logger().warning(f'parameter {name} was changed {change}')
        if any(parameter.name in self._specs for parameter in parameters):
            self.settings = self._read()
            self._on_change(self.settings)

    def _read(self, changes: Mapping[str, Any] = {}) -> Settings:
        """Return the settings with the present values, or with `changes` to them."""
        def value(name: str) -> Any:
            return changes[name] if name in changes else self._node.get_parameter(name).value
        return read_settings(self._footprints, self._obstacles, value,
                             self._node.resolve_topic_name)


def _plain(value: Any) -> Any:
    """Return the value of a parameter as in a file: with a list for an array of rclpy."""
    return list(value) if isinstance(value, array) else value


def _descriptor(default: Any, spec: Spec) -> ParameterDescriptor:
    constraints = f'one of {", ".join(spec.choices)}' if spec.choices else ''
    descriptor = ParameterDescriptor(description=spec.description, read_only=not spec.live,
                                     additional_constraints=constraints,
                                     dynamic_typing=spec.is_any_type)
    if spec.limits:
        low, high = spec.limits
        if isinstance(default, float):
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        else:
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
    return descriptor
