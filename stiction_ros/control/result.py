"""What a control step returns: always a value, never an exception, never an invalid OP."""

import dataclasses
import enum

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


class ControlMode(enum.StrEnum):
    """Which formulation moves the valves.

    Examples:
        >>> from stiction_ros import ControlMode
        >>> ControlMode("embedding") is ControlMode.EMBEDDING
        True
    """

    UNAWARE = "unaware"
    EMBEDDING = "embedding"
    INVERSION = "inversion"
    HOLD = "hold"
    VALVE_TEST = "valve_test"


class StepStatus(enum.StrEnum):
    """How a step ended."""

    SOLVED = "solved"
    UNREACHABLE = "unreachable"  # solved for the nearest reachable set-point
    LIMIT = "limit"  # patterns out of iterations; the cheapest of the others is applied
    SHIFTED = "shifted"  # the rest of an earlier plan is applied
    SUBSTITUTED = "substituted"  # the unaware controller stands in
    FALLBACK = "fallback"  # OP goes to the safe value
    HELD = "held"  # the last applied OP is held

    @property
    def failed(self) -> bool:
        """Whether the formulation that is in force gave nothing usable."""
        return self not in (StepStatus.SOLVED, StepStatus.UNREACHABLE, StepStatus.LIMIT)


@dataclasses.dataclass(frozen=True)
class Plan:
    """What a formulation wants."""

    op: FloatArray  # the first controller output, shape (m,), %
    stem: FloatArray  # stem positions over the horizon, shape (N, m), %
    pv: FloatArray  # outputs at samples 0 … N, shape (N + 1, p)
    slack: FloatArray  # violation of the soft output bounds, shape (p,)
    jumps: int = 0  # number of valve jumps planned over the horizon
    converged: bool = True  # whether no pattern ran out of iterations
    cost: float = float("nan")  # value of (19a) with prices of jumps and slacks, NaN if unknown
    # what the observer takes for the stem at the first sample, shape (m,), %; None for the stem
    # that the valve models expect of ``op``
    process_input: FloatArray | None = None


@dataclasses.dataclass(frozen=True)
class StepResult:
    """One control step.

    Attributes:
        status, reason: how it ended, and why in words (empty when there is nothing to say).
        mode: the formulation used; ``hold`` when it was given up for the time being.
        op: controller outputs to apply, shape (m,), %, within the limits.
        plan: the plan behind it, or None when held.
        miss: SP minus the steady output aimed at, shape (p,).
        solve_time: seconds, wall clock.
        strategy: name of the strategy that gave ``op``, see :mod:`.strategies`.
        age: samples since ``plan`` was made; 0 for a plan of this step.
        optimality_gap: cost above the mixed-integer optimum as a share of it; None where it
            was not asked for or not found, see :mod:`.certificate`.

    Examples:
        >>> import numpy as np
        >>> from stiction_ros import ControlMode, ControlSettings, LoopModel
        >>> from stiction_ros import MpcController, find_config
        >>> model = LoopModel.load(find_config("example1_process.loop.yaml"))
        >>> design = ControlSettings(horizon=30).design(model)
        >>> controller = MpcController(design, ControlMode.UNAWARE)
        >>> controller.start(model.stem_start, model.pv_start)
        >>> step = controller.step(model.pv0, model.pv0 + 2.0, np.zeros(0), model.op0)
        >>> step.status.value, step.status.failed, step.op.shape
        ('solved', False, (1,))
    """

    status: StepStatus
    reason: str
    mode: ControlMode
    op: FloatArray
    plan: Plan | None
    miss: FloatArray
    solve_time: float
    strategy: str = ""
    age: int = 0
    optimality_gap: float | None = None

    def __repr__(self) -> str:
        op = ", ".join(f"{value:.4g}" for value in self.op.tolist())
        said = f": {self.reason}" if self.reason else ""
        return f"<StepResult {self.status}, OP {op} %, {self.mode}{said}>"

    @property
    def slack(self) -> FloatArray:
        """Violation of the soft output bounds that the plan accepts, shape (p,)."""
        return np.zeros(len(self.miss)) if self.plan is None else self.plan.slack
