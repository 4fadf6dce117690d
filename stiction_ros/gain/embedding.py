"""The loop under the controller that knows the friction.

Horizon and weights are the defaults of :class:`.ControlSettings`, which scale with the loop. Beside
them

- the observer's variances of noise and of a wandering load are those of the load's own moves:
  white noise of variance r on a random walk of variance q makes moves of variance q + 2 r of
  which neighbours have the covariance −r;
- the jumps' margin is a share of the half-widths of the frictions' intervals: a jump that is too
  small costs a sample, one that is too large costs PV every time;
- stems are believed to move where they should: the slip check judges by the process, and an
  identified one leaves loads that look like stems that stayed, each of which would raise f_S;
- a valve with backlash alone has f_S = f_D, half its band, and so no least jump.

The controller answers faster than the loop ever has, and what the process does then is known less
well than what it did. So it is run on drawn loops, whose processes differ, too. And it lives by
the jump of the stem, which a record tells worse than the band: so their frictions are all that are
possible.
"""

import dataclasses
from typing import Any

import numpy as np

from stiction_ros.control import ControlMode, FrictionSpread, MpcController
from stiction_ros.control.belief import jump_form
from stiction_ros.control.design import ControlDesign, History
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.gain.draws import Draws
from stiction_ros.gain.measures import Measures
from stiction_ros.gain.recorded_loop import RecordedLoop
from stiction_ros.identification.friction import find_law
from stiction_ros.identification.result import ValveEstimate
from stiction_ros.loop import LoopModel

MARGIN = 0.3
"""Share of the half-widths of the frictions' intervals that a jump is larger than it must be."""

RUNS = 12
"""Drawn loops that it is run on, at most."""

PAST = 1000
"""Samples before a run that the controller takes over, at most."""

LEAST_NOISE = 0.02
"""Standard deviation of the noise that is taken at least, in those of PV."""

LEAST_WALK = 1e-4
"""Variance of the wandering load over that of the noise, at least."""

STEM_NOISE = 0.1
"""Standard deviation of the stem's own noise over f_S."""


@dataclasses.dataclass(frozen=True)
class EmbeddingDesign:
    """What the controller of one loop is built from."""

    model: LoopModel  # of the process, its valve without friction
    settings: ControlSettings  # weights and observer
    friction: Behaviour  # law of the valve
    spread: FrictionSpread | None  # half-widths of their intervals; None where they are known

    @classmethod
    def of(cls, loop: RecordedLoop) -> "EmbeddingDesign":
        """Return the design by the rule for a recorded loop, scaled.

        Raises:
            InputError: the process does not let a controller be designed.
        """
        i, j, process = loop.output, loop.valve, loop.process
        estimate, scale = loop.estimate, loop.op_scale
        limits = [float(end) for end in loop.law.limits]
        valve: dict[str, Any] = {"name": "V", "effects": []}
        if np.isfinite(limits).all():
            valve["limits"] = limits
        output = {
            "name": "Y",
            "a": process.a[i].tolist(),
            "b": {"V": process.b[i, j].tolist()},
            "delay": {"V": int(process.delay[i, j])},
            "bias": 0.0,
        }
        model = LoopModel.from_mapping(
            {
                "loop": "identified",
                "sample_time": loop.record.sample_time,
                "valves": [valve],
                "process": {"kind": "arx", "outputs": [output]},
            },
            loop.record.name,
        )
        static, dynamic = pair_of(estimate)
        percent = {one.key for one in find_law(estimate.law).parameters() if "%" in one.unit}
        further = {k: v / scale if k in percent else v for k, v in estimate.further.items()}
        estimate = dataclasses.replace(estimate, further=further)
        friction = estimate.with_frictions(static / scale, dynamic / scale).behaviour()
        assert friction is not None
        spread = FrictionSpread(
            0.5 * MARGIN * float(np.ptp(estimate.static_interval)) / scale,
            0.5 * MARGIN * float(np.ptp(estimate.dynamic_interval)) / scale,
        )
        noise, walk = _variances(loop.load[:, i])
        return cls.by_rule(model, friction, spread, (noise, walk))

    @classmethod
    def by_rule(
        cls,
        model: LoopModel,
        friction: Behaviour,
        spread: FrictionSpread | None,
        variances: tuple[float, float],
    ) -> "EmbeddingDesign":
        """Return the design by the rule; every unit is that of the model.

        Args:
            model: one valve and one output, the valve without friction.
            friction: law of the valve.
            spread: half-widths of the intervals of its frictions; None where they are known.
            variances: of the output's noise, and of a sample's move of its wandering load.

        Raises:
            InputError: a law by which no OP can be planned.
        """
        static = jump_form(friction).static_friction
        noise, walk = variances
        settings = ControlSettings(
            state_noise=(STEM_NOISE * static) ** 2,
            disturbance_noise=(walk,),
            measurement_noise=(noise,),
            slip_check=False,
        )
        return cls(model, settings, friction, spread)

    def built(self) -> ControlDesign:
        """Return the design with its weights, as controllers take it."""
        return self.settings.design(self.model)

    def controller(self) -> MpcController:
        """Return a new controller.

        Raises:
            InputError: it cannot be set up for this process.
        """
        return MpcController(self.built(), ControlMode.EMBEDDING, [self.friction], [self.spread])

    def weights(self, pv_scale: float = 1.0, op_scale: float = 1.0) -> dict[str, float]:
        """Return the weights as a controller node takes them, in engineering units and %.

        Args:
            pv_scale: engineering units of a PV of 1 of the model.
            op_scale: % of an OP of 1 of the model.
        """
        settings, design, pv, op = self.settings, self.built(), pv_scale**2, op_scale**2
        return {
            "horizon": float(settings.horizon),
            "look_ahead": float(settings.look_ahead),
            "output_weights": 1.0 / pv,
            "embedding_move_weights": float(design.embedding.move[0, 0]) / op,
            "jump_price": design.jumps.jump_price,
            "state_noise": settings.state_noise * op,
            "disturbance_noise": settings.disturbance_noise[0] * pv,
            "measurement_noise": settings.measurement_noise[0] * pv,
            "slip_check": settings.slip_check,
        }


class EmbeddingRun:
    """One run of a controller that answers sample by sample, scaled."""

    def __init__(self, design: EmbeddingDesign, pv: FloatArray, op: FloatArray) -> None:
        """Take over from the controller that is there, as the live loop does.

        Without the past the observer would learn its state and the stem's from its own kicks, and
        its slip check would believe in frictions that are none.

        Args:
            design: of the controller.
            pv, op: of the samples before the first, shape (K,) each.
        """
        self.controller = design.controller()
        self._no_dv = np.zeros(self.controller.design.model.e.shape[1])
        if len(op):
            past = History(op[:, None], pv[:, None], np.zeros((len(op), 0)))
            self.controller.take_over(past)

    def __call__(self, pv: float, sp: float, op: float) -> float:
        """Return OP for PV and SP; ``op`` is what was applied before."""
        step = self.controller.step(np.array([pv]), np.array([sp]), self._no_dv, np.array([op]))
        return float(step.op[0])


def pair_of(estimate: ValveEstimate) -> tuple[float, float]:
    """Return f_S and f_D of a valve as the controller takes them, %."""
    static, dynamic = estimate.static_friction, estimate.dynamic_friction
    if estimate.jump > 0.0:
        return static, dynamic
    return 0.5 * (static + dynamic), 0.5 * (static + dynamic)


def embedded(loop: RecordedLoop, design: EmbeddingDesign, draws: Draws) -> list[Measures | None]:
    """Return the measures under the controller, on loops that may be the recorded one.

    Args:
        loop: whose rows are run.
        design: of the controller, which keeps its friction and its process.
        draws: loops; no more than :data:`RUNS` of them are run.

    Returns:
        None for a run that grows without end.
    """
    i, j, begin = loop.output, loop.valve, loop.begin
    draws = draws.taken(list(range(min(RUNS, len(draws)))))
    past = slice(max(loop.loop.longest[0], loop.rows[0] - PAST), loop.rows[0])
    pvs, ops, sp = loop.loop.pv[past, i], loop.loop.op[past, j], loop.set_points[begin:, i]
    runs = [EmbeddingRun(design, pvs, ops) for _ in range(len(draws))]

    def control(k: int, pv: FloatArray, op: FloatArray) -> None:
        for r, run in enumerate(runs):
            op[r, k, j] = run(float(pv[r, k, i]), float(sp[k]), float(op[r, k - 1, j]))

    return loop.under(control, draws)


def _variances(load: FloatArray) -> tuple[float, float]:
    """Return the variances of white noise and of a random walk that make such a load."""
    moves = np.diff(load)
    moves = moves - moves.mean()
    total = float(moves @ moves) / len(moves)
    neighbours = float(moves[1:] @ moves[:-1]) / len(moves)
    noise = max(-neighbours, 0.05 * total, LEAST_NOISE**2)
    return noise, max(total - 2.0 * noise, LEAST_WALK * noise)
