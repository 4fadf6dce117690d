"""Friction of valves and dynamics of processes from recorded OP and PV."""

from stiction_ros.identification.identification_options import METHODS, IdentificationOptions
from stiction_ros.identification.methods import identify
from stiction_ros.identification.result import (
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)

__all__ = [
    "METHODS",
    "FitStatus",
    "Identification",
    "IdentificationOptions",
    "OutputModel",
    "ValveEstimate",
    "VerdictKind",
    "identify",
]
