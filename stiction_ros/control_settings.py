"""The tuning of a controller as its user writes it, and the design made from it."""

import dataclasses
import functools
import math

import numpy as np

from stiction_ros.control.design import ControlDesign
from stiction_ros.control.embedding import EmbeddingTuning
from stiction_ros.control.horizon import HorizonLimits, HorizonWeights
from stiction_ros.control.observer import Observer, ObserverKind, ObserverTuning
from stiction_ros.control.strategies import FallbackRule
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.paper.controllers.embedding import as_printed
from stiction_ros.paper.controllers.weights import (
    PaperTuning,
    ProgrammeCost,
    WarmStart,
    WeightPreset,
    augmented_weights,
    plain_weights,
    unaware_weights,
)
from stiction_ros.processes import LinearModel
from stiction_ros.settings import check_choices, setting

# weight of a move over that of what it does to the outputs, squared: as printed for Example 1,
# whose outputs move by 1 for a stem of 1 %
MOVE_SHARES = {"move_weights": 0.1, "embedding_move_weights": 0.01}
# stem move, %, by which a load is thought to wander in a sample, and below which no measurement is
# believed: as in the scenario of Example 1
FINEST = 0.01


@dataclasses.dataclass(frozen=True)
class ControlSettings:
    """Weights, bounds and observer of the MPC.

    Lists have one entry per output or per valve; a single entry stands for all.

    Raises:
        InputError: by :meth:`design`, a list that fits neither outputs nor valves.

    Examples:
        >>> from stiction_ros import ControlSettings, LoopModel, find_config
        >>> model = LoopModel.load(find_config("tank.loop.yaml"))
        >>> design = ControlSettings(horizon=40, move_weights=(0.1, 0.2)).design(model)
        >>> design.valve_names, design.limits.stem.tolist()
        (('V1', 'V2'), [[0.0, 100.0], [0.0, 100.0]])
    """

    horizon: int = setting(50, "prediction horizon N_H, samples", low=2, high=1000)
    output_weights: tuple[float, ...] = setting(
        (1.0,), "weight of each squared output error in Q", low=0.0
    )
    look_ahead: int = setting(
        100,
        "samples behind the horizon for which what a plan leaves is taken to last, "
        "stiction-embedding",
        low=0,
        high=100_000,
    )
    state_weight: float = setting(0.0, "weight added to Q on every state", low=0.0)
    terminal_weight: float = setting(0.0, "weight added to V_F on every state", low=0.0)
    move_weights: tuple[float, ...] = setting(
        (0.0,),
        "S: weight of each squared OP move, stiction-unaware; 0: a tenth of the weighed square of "
        "what a stem move of 1 % does to the outputs within the horizon",
        low=0.0,
    )
    embedding_move_weights: tuple[float, ...] = setting(
        (0.0,),
        "weight of each squared stem move, stiction-embedding; 0: a hundredth of that square. "
        "Each jump then also has a price: the cost of an offset as large as the standard "
        "deviation of its estimate",
        low=0.0,
    )
    move_worth: tuple[float, ...] = setting(
        (0.0,),
        "IAE that is given up rather than make a sticky valve jump once more, PV units of the "
        "first output × h; larger jumps count as their squares; 0: embedding_move_weights",
        low=0.0,
    )
    target_weights: tuple[float, ...] = setting(
        (1.0,), "Q_ss: weight of each output when set-points cannot all be reached", low=1e-9
    )
    op_rate_limits: tuple[float, ...] = setting(
        (math.inf,),
        "largest OP move, % per sample; a kick that moves a sticky valve must fit in",
        low=1e-6,
    )
    op_low: tuple[float, ...] = setting(
        (-math.inf,), "lower bound of each OP, %, where it is above that of the valve"
    )
    op_high: tuple[float, ...] = setting(
        (math.inf,), "upper bound of each OP, %, where it is below that of the valve"
    )
    pv_low: tuple[float, ...] = setting((-math.inf,), "soft lower bound of each output")
    pv_high: tuple[float, ...] = setting((math.inf,), "soft upper bound of each output")
    observer: str = setting(
        "kalman", "observer design", choices=tuple(kind.value for kind in ObserverKind)
    )
    state_noise: float = setting(0.01, "variance of stem-like process noise, %²", low=0.0)
    disturbance_noise: tuple[float, ...] = setting(
        (0.0,),
        "variance per sample of each output disturbance; 0: the square of what a stem "
        "move of 0.01 % does",
        low=0.0,
    )
    measurement_noise: tuple[float, ...] = setting(
        (0.0,),
        "variance of the noise of each measurement; 0: that of the loop model, but not less "
        "than the square of what a stem move of 0.01 % does",
        low=0.0,
    )
    outlier_gate: float = setting(
        20.0, "innovations beyond this many standard deviations are held back", low=3.0
    )
    outlier_samples: int = setting(
        3, "successive outliers of an output after which they are believed", low=1, high=1000
    )
    luenberger_gain: float = setting(0.2, "K_d of the Luenberger observer", low=1e-6, high=1.0)
    jump_price: float = setting(0.0, "cost added per jump of a sticky valve", low=0.0)
    kick_limits: tuple[float, ...] = setting(
        (math.inf,),
        "largest move of OP, %, in a sample at which a sticky valve jumps; op_rate_limits holds "
        "too. The smallest jump of the valve is always allowed",
        low=1e-6,
    )
    jump_margin: float = setting(
        0.3,
        "how far a jump exceeds the smallest one, as a share of f_S, without intervals",
        low=0.0,
        high=2.0,
    )
    least_jump_margin: float = setting(
        0.1, "the same where the intervals of the frictions are known, at least", low=0.0, high=2.0
    )
    slip_check: bool = setting(True, "watch every jump by an observer that assumes it failed")
    longest_wait: int = setting(
        0,
        "samples for which a stem at rest waits with its jump while innovations lean to one "
        "side, as the disturbance estimate is on its way then; 0: never",
        low=0,
        high=100_000,
    )
    gap_samples: int = setting(
        0, "samples free to jump in the optimality gap of each step; 0: none", low=0, high=16
    )
    iteration_limit: int = setting(2000, "most iterations of one quadratic programme", low=1)
    hold_after: int = setting(
        5,
        "samples for which the last plan is followed on when there is no other; then OP is held",
        low=0,
    )
    fallback_after: int = setting(
        0, "samples held until OP goes to fallback_op; 0 holds for ever", low=0
    )
    fallback_op: tuple[float, ...] = setting((0.0,), "where each OP goes then, %")
    fallback_rate: tuple[float, ...] = setting(
        (1.0,), "largest OP move on the way there, % per sample", low=1e-6
    )
    hand_over_samples: int = setting(
        200, "past samples replayed into a new observer", low=1, high=100_000
    )
    formulation: str = setting(
        "exact",
        "embedding and inversion of this package, or as the paper prints them",
        choices=("exact", "printed"),
    )
    preset: str = setting(
        WeightPreset.OWN.value,
        "weights of these settings, or those of the paper",
        choices=tuple(kind.value for kind in WeightPreset),
    )
    warm_start: str = setting(
        WarmStart.COMPENSATION.value,
        "start of the paper's embedding: its sequence (21), a small search, or none",
        choices=tuple(kind.value for kind in WarmStart),
    )
    programme_cost: str = setting(
        ProgrammeCost.REVISED.value,
        "cost of the paper's embedding: its revised one (22), or the plain (19a)",
        choices=tuple(kind.value for kind in ProgrammeCost),
    )
    first_move: float = setting(2.1, "a of (21), in multiples of f_S", low=1.0, high=10.0)

    def __post_init__(self) -> None:
        check_choices(self)

    def design(self, model: LoopModel) -> ControlDesign:
        """Return the controller design for ``model``.

        Raises:
            InputError: a list that fits neither outputs nor valves, or crossed bounds.
        """
        linear = model.process.linear(model.sample_time)
        p, m, n = len(model.outputs), len(model.valves), linear.order
        reached = _reached(linear, model, self.horizon)
        answer = self._list("output_weights", p) @ reached**2
        most = np.maximum(reached.max(axis=1), 1e-9) ** 2
        state = linear.c.T @ (self._list("output_weights", p)[:, None] * linear.c)
        stage = state + self.state_weight * np.eye(n)
        terminal = state + self.terminal_weight * np.eye(n)
        weights = {
            name: HorizonWeights(
                self.horizon,
                stage,
                np.diag(self._scaled(name, np.maximum(share * answer, 1e-9))),
                terminal,
            )
            for name, share in MOVE_SHARES.items()
        }
        noise = np.array([one.std**2 for one in model.process.noise])
        observer = ObserverTuning(
            ObserverKind(self.observer),
            self.state_noise,
            self._scaled("disturbance_noise", FINEST**2 * most),
            self._scaled("measurement_noise", np.maximum(noise, FINEST**2 * most)),
            self.luenberger_gain,
            self.outlier_gate,
            self.outlier_samples,
        )
        output = np.column_stack([self._list("pv_low", p), self._list("pv_high", p)])
        if np.any(output[:, 0] >= output[:, 1]):
            raise InputError("pv_low is not below pv_high", where="pv_low")
        design = ControlDesign(
            model=linear,
            limits=HorizonLimits(
                self._op_limits(model),
                self._list("op_rate_limits", m),
                output,
                self.iteration_limit,
            ),
            unaware=weights["move_weights"],
            embedding=dataclasses.replace(
                weights["embedding_move_weights"], look_ahead=self.look_ahead
            ),
            target_weights=self._list("target_weights", p),
            observer=observer,
            jumps=EmbeddingTuning(
                self.jump_price + self._unsure(linear, observer),
                self.jump_margin,
                self.least_jump_margin,
                self._list("kick_limits", m),
                self._move_prices(model),
            ),
            hand_over_samples=self.hand_over_samples,
            fallback=self._fallback(model),
            slip_check=self.slip_check,
            longest_wait=self.longest_wait,
            gap_samples=self.gap_samples,
            valve_names=model.valve_names,
            output_names=model.outputs,
        )
        return self._as_printed(self._with_preset(design))

    def _unsure(self, linear: LinearModel, observer: ObserverTuning) -> float:
        """Return the cost of an offset of one standard deviation of its estimate.

        The estimate of a disturbance by a filter of gain K has the variance K R, for noise of
        variance R. Jumps that correct a smaller offset would follow the noise.
        """
        m = len(linear.stem0)
        if np.all(self._list("embedding_move_weights", m) + self._list("move_worth", m) > 0.0):
            return 0.0
        gain = np.diag(Observer(linear, observer).gain[linear.order :])
        weights = self._list("output_weights", len(gain))
        lasts = self.horizon + self.look_ahead
        return float(lasts * weights @ (gain * observer.measurement_noise))

    def _move_prices(self, model: LoopModel) -> FloatArray:
        """Return what the smallest jump of each valve costs, 0 where its worth is not given.

        An offset e of the first output that lasts for the horizon and what is looked ahead, L
        samples, costs q e² L and an IAE of e L. The two jumps that mend it, of price p each, are
        made from where e L is what both are worth: p = 2 q W² / L.
        """
        m, p = len(model.valves), len(model.outputs)
        worth = self._list("move_worth", m) * 3600.0 / model.sample_time
        lasts = self.horizon + self.look_ahead
        return np.asarray(2.0 * self._list("output_weights", p)[0] * worth**2 / lasts)

    def _fallback(self, model: LoopModel) -> FallbackRule:
        m = len(model.valves)
        if not self.fallback_after:
            return FallbackRule(self.hold_after)
        limits, op = self._op_limits(model), self._list("fallback_op", m)
        if np.any(op < limits[:, 0]) or np.any(op > limits[:, 1]):
            raise InputError("lies outside the limits of OP", where="fallback_op")
        rate = self._list("fallback_rate", m)
        return FallbackRule(self.hold_after, self.fallback_after, op, rate)

    def _with_preset(self, design: ControlDesign) -> ControlDesign:
        """Return ``design`` with the paper's Q, S, V_F and Q_ss, and its observer as printed."""
        preset = WeightPreset(self.preset)
        if preset is WeightPreset.OWN:
            return design
        observer = design.observer
        if preset is WeightPreset.PRINTED:
            observer = dataclasses.replace(observer, kind=ObserverKind.LUENBERGER)
        return dataclasses.replace(
            design,
            unaware=unaware_weights(preset, design.model, self.horizon),
            target_weights=np.ones_like(design.target_weights),
            observer=observer,
        )

    def _as_printed(self, design: ControlDesign) -> ControlDesign:
        """Return ``design`` with the paper's own formulations where the settings ask for them."""
        if self.formulation == "exact":
            return design
        printed = self.preset == WeightPreset.PRINTED
        weights = augmented_weights(
            WeightPreset.PRINTED if printed else WeightPreset.CORRECTED, design.model, self.horizon
        )
        if ProgrammeCost(self.programme_cost) is ProgrammeCost.PLAIN:
            weights = plain_weights(design.unaware)
        tuning = PaperTuning(weights, WarmStart(self.warm_start), self.first_move)
        return dataclasses.replace(design, others=functools.partial(as_printed, tuning))

    def _op_limits(self, model: LoopModel) -> FloatArray:
        m = len(model.valves)
        low = np.maximum(model.limits[:, 0], self._list("op_low", m))
        high = np.minimum(model.limits[:, 1], self._list("op_high", m))
        if np.any(low >= high):
            raise InputError(
                "the bounds of OP leave nothing between them",
                where="op_low",
                fix="keep op_low below op_high and the limits of the valve",
            )
        return np.column_stack([low, high])

    def _scaled(self, name: str, otherwise: FloatArray) -> FloatArray:
        """Return the entries of a list, each 0 replaced by what follows from the loop."""
        values = self._list(name, len(otherwise))
        return np.where(values > 0.0, values, otherwise)

    def _list(self, name: str, count: int) -> FloatArray:
        values = getattr(self, name)
        if len(values) not in (1, count):
            raise InputError(
                f"has {len(values)} entries", where=name, fix=f"give 1 or {count} entries"
            )
        return np.array(np.broadcast_to(np.array(values, dtype=float), count))


def _reached(linear: LinearModel, model: LoopModel, horizon: int) -> FloatArray:
    """Return how far each output moves within the horizon after a stem step of 1 %, (p, m).

    Raises:
        InputError: a valve moves no output.
    """
    found: FloatArray = np.abs(linear.step_responses(horizon + 1)).max(axis=0)
    for name, reach in zip(model.valve_names, found.T, strict=True):
        if not reach.any():
            raise InputError(
                f"valve {name} moves no output within {horizon} samples",
                where="horizon",
                fix="make it longer than the dead time and the settling",
            )
    return found
