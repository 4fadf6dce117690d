"""What a control step returns: always a value, never an exception, never an invalid OP."""

from __future__ import annotations

import dataclasses
import enum

from stiction_ros.effects.behaviour import FloatArray


class ControlMode(enum.StrEnum):
    """Which formulation moves the valves."""

    UNAWARE = "unaware"
    EMBEDDING = "embedding"
    INVERSION = "inversion"
    HOLD = "hold"


class StepStatus(enum.StrEnum):
    """How a step ended."""

    SOLVED = "solved"
    UNREACHABLE = "unreachable"  # solved for the nearest reachable set-point
    HELD = "held"  # nothing usable: the last applied OP is held


@dataclasses.dataclass(frozen=True)
class Plan:
    """What a formulation wants.

    Attributes:
        op: the first controller output, shape (m,), %.
        stem: stem positions over the horizon, shape (N, m), %.
        pv: outputs at samples 0 … N, shape (N + 1, p).
        slack: violation of the soft output bounds, shape (p,).
        jumps: number of valve jumps planned over the horizon.
    """

    op: FloatArray
    stem: FloatArray
    pv: FloatArray
    slack: FloatArray
    jumps: int = 0


@dataclasses.dataclass(frozen=True)
class StepResult:
    """One control step.

    Attributes:
        status, reason: how it ended, and why in words (empty when simply solved).
        mode: the formulation used.
        op: controller outputs to apply, shape (m,), %, within the limits.
        plan: the plan behind it, or None when held.
        miss: SP minus the steady output aimed at, shape (p,).
        solve_time: seconds, wall clock.
    """

    status: StepStatus
    reason: str
    mode: ControlMode
    op: FloatArray
    plan: Plan | None
    miss: FloatArray
    solve_time: float
