"""Model predictive control of loops whose valves may stick."""

from stiction_ros.control.controller import MpcController
from stiction_ros.control.design import ControlDesign, History
from stiction_ros.control.result import ControlMode, Plan, StepResult, StepStatus
from stiction_ros.effects.friction.stiction import FrictionSpread

__all__ = [
    "ControlDesign",
    "ControlMode",
    "FrictionSpread",
    "History",
    "MpcController",
    "Plan",
    "StepResult",
    "StepStatus",
]
