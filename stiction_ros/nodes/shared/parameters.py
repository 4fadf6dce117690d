"""ROS parameters from settings dataclasses: declared, described, checked."""

import dataclasses
import math
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from stiction_ros.errors import InputError
from stiction_ros.settings import Setting, from_mapping, settings_of

_TYPES = {
    "float": Parameter.Type.DOUBLE,
    "int": Parameter.Type.INTEGER,
    "bool": Parameter.Type.BOOL,
    "str": Parameter.Type.STRING,
    "floats": Parameter.Type.DOUBLE_ARRAY,
    "strings": Parameter.Type.STRING_ARRAY,
}


def declare(node: Node, cls: type[Any]) -> None:
    """Declare every setting of ``cls`` on ``node`` with its description and range."""
    for entry in settings_of(cls):
        given = list(entry.default) if isinstance(entry.default, tuple) else entry.default
        value = Parameter(entry.name, _TYPES[entry.kind], given).value if given != [] else [""]
        node.declare_parameter(entry.name, value, _descriptor(entry))


def read(node: Node, cls: type[Any]) -> Any:
    """Build ``cls`` from the node's parameters.

    Raises:
        InputError: a value out of range, which an array's range cannot refuse by itself.
    """
    told = {entry.name: node.get_parameter_or(entry.name).value for entry in settings_of(cls)}
    # An empty list in a parameter file has no type, and None for a value.
    given = {name: value for name, value in told.items() if value is not None}
    return from_mapping(cls, given, node.get_name())


def refuse_unknown(node: Node) -> None:
    """Raise InputError for a given parameter that the node does not have.

    rclpy itself passes over it without a word.
    """
    for name in node._parameter_overrides:  # there is no public way to these names
        if not name.startswith("qos_overrides."):
            check_known(node, name)


def check_known(node: Node, name: str) -> None:
    """Raise InputError where ``node`` has no parameter ``name``."""
    if not node.has_parameter(name):
        known = ", ".join(sorted(node.get_parameters_by_prefix("")))
        raise InputError(
            f"unknown parameter {name!r}", where=node.get_name(), fix=f"known: {known}"
        )


def answer(refusal: str = "") -> SetParametersResult:
    """Return the answer that takes the new values, or says why the old ones stay in force."""
    return SetParametersResult(successful=not refusal, reason=refusal)


def as_mapping(settings: Any) -> dict[str, Any]:
    """Return settings as plain YAML values."""
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in dataclasses.asdict(settings).items()
    }


def _descriptor(entry: Setting) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        name=entry.name,
        type=_TYPES[entry.kind].value,
        description=entry.description,
        additional_constraints=_constraint(entry),
    )
    bounded = math.isfinite(entry.low) or math.isfinite(entry.high)
    if entry.kind == "float" and bounded:
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=max(entry.low, -1e300), to_value=min(entry.high, 1e300), step=0.0
            )
        ]
    elif entry.kind == "int" and bounded:
        descriptor.integer_range = [
            IntegerRange(
                from_value=int(max(entry.low, -(2**62))),
                to_value=int(min(entry.high, 2**62)),
                step=1,
            )
        ]
    return descriptor


def _constraint(entry: Setting) -> str:
    said = []
    if entry.choices:
        said.append("one of " + ", ".join(entry.choices))
    if entry.kind == "floats" and (math.isfinite(entry.low) or math.isfinite(entry.high)):
        said.append(f"each in [{entry.low:g}, {entry.high:g}]")
    if entry.once or entry.fixed:
        said.append(f"read when the {'process starts' if entry.once else 'node is configured'}")
    if entry.beside[0]:
        said.append(f"in force with {entry.beside[0]}: {entry.beside[1]}")
    return "; ".join(said)
