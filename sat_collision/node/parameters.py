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

"""The node's parameters: declared, validated, and read as Settings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from sat_collision.scene.parameters import declare_parameters, ParameterError, read_settings
from sat_collision.scene.settings import Settings, Spec


class Parameters:
    """
    Declares the parameters of a node and keeps the Settings that they add up to.

    Parameters
    ----------
    node : rclpy.node.Node

    Attributes
    ----------
    settings : Settings
        As the parameters are now.

    Raises
    ------
    ParameterError
        If a value given at start has the wrong type or is out of place.

    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._specs: dict[str, Spec] = {}
        self._on_change: Callable[[Settings], None] | None = None
        node.add_on_set_parameters_callback(self._validate)
        self._footprints, self._obstacles = declare_parameters(self._declare)
        self.settings = self._read()
        node.add_post_set_parameters_callback(self._apply)

    def on_change(self, callback: Callable[[Settings], None]) -> None:
        """Call `callback(settings)` whenever a parameter has been changed."""
        self._on_change = callback

    def _declare(self, name: str, default: Any, spec: Spec) -> Any:
        self._specs[name] = spec
        try:
            value = self._node.declare_parameter(name, default, _descriptor(default, spec)).value
        except ParameterException as error:
            raise ParameterError(error) from error
        if value is None:
            raise ParameterError(f"parameter '{name}' has no value")
        return value

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            spec = self._specs.get(parameter.name)
            if spec and spec.choices and parameter.value not in spec.choices:
                return SetParametersResult(
                    successful=False, reason=f"{parameter.name}: '{parameter.value}' is not one "
                                             f'of {", ".join(spec.choices)}')
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        if self._on_change and any(parameter.name in self._specs for parameter in parameters):
            self.settings = self._read()
            self._on_change(self.settings)

    def _read(self) -> Settings:
        return read_settings(self._footprints, self._obstacles,
                             lambda name: self._node.get_parameter(name).value,
                             self._node.resolve_topic_name)


def _descriptor(default: Any, spec: Spec) -> ParameterDescriptor:
    constraints = f'one of {", ".join(spec.choices)}' if spec.choices else ''
    descriptor = ParameterDescriptor(description=spec.description, read_only=not spec.live,
                                     additional_constraints=constraints)
    if spec.limits:
        low, high = spec.limits
        if isinstance(default, float):
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        else:
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
    return descriptor
