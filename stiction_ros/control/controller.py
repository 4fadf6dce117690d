"""One controller: observer, target, formulation, and the valves that it believes in."""

import functools
import time
from collections.abc import Sequence

import numpy as np

from stiction_ros.checks import of_kind, one_of
from stiction_ros.control.belief import ValveBeliefs
from stiction_ros.control.design import ControlDesign, History, formulation_of
from stiction_ros.control.observer import Observer
from stiction_ros.control.result import ControlMode, Plan, StepResult, StepStatus
from stiction_ros.control.slip_check import Passage, SlipCheck
from stiction_ros.control.strategies import Proposal, Situation, Strategies
from stiction_ros.control.target import Target, TargetSelector
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.effects.friction.stiction import FrictionSpread

CUT = 1e-6  # %; what a rate limit takes off a move is told from here on


class MpcController:
    """Offset-free MPC in one mode; step it once per sample.

    Attributes:
        design, mode: as given.
        observer: state and disturbance estimate.
        valves: belief in each sticky valve, None for those taken to be healthy.
        stem: stem estimates χ̂, shape (m,), %; after a step those that its OP will bring about.
        raised: what the slip check found at the last step, empty for nothing.

    Equations (19) to (22); the observer is offset-free by one disturbance per output.

    Args:
        design: process, weights and bounds, by :meth:`ControlSettings.design`.
        mode: a :class:`ControlMode` or its text: ``unaware`` takes no notice of the friction,
            ``inversion`` and ``embedding`` do, ``hold`` keeps OP.
        frictions: of the m valves, None for a healthy one.
        spreads: half-widths of the intervals of their parameters, where known.

    Raises:
        InputError: the model is not detectable, or embedding cannot be set up.

    Examples:
        >>> import numpy as np
        >>> from stiction_ros import ControlMode, ControlSettings, HeStiction, LoopModel
        >>> from stiction_ros import MpcController, find_config
        >>> model = LoopModel.load(find_config("example1_process.loop.yaml"))
        >>> design = ControlSettings(horizon=30).design(model)
        >>> controller = MpcController(design, ControlMode.EMBEDDING, [HeStiction(5.0, 2.0)])
        >>> controller.start(model.stem_start, model.pv_start)
        >>> step = controller.step(model.pv0, model.pv0 + 2.0, np.zeros(0), model.op0)
        >>> bool(step.op[0] > model.op0[0] + 5.0)  # far enough for the valve to slip
        True
    """

    def __init__(
        self,
        design: ControlDesign,
        mode: ControlMode | str,
        frictions: Sequence[Behaviour | None] | None = None,
        spreads: Sequence[FrictionSpread | None] | None = None,
    ) -> None:
        """Build for ``frictions``; the modes that know of none take no notice of them."""
        of_kind(design, ControlDesign, "design", "give ControlSettings(…).design(model)")
        m, mode = len(design.model.stem0), one_of(mode, ControlMode, "mode")
        self.design, self.mode = design, mode
        aware = mode in (ControlMode.EMBEDDING, ControlMode.INVERSION) and frictions is not None
        known = tuple(frictions or ()) if aware else (None,) * m
        widths = tuple(spreads or (None,) * m)
        self.valves = ValveBeliefs(known, widths, design.limits.stem)
        self.observer = Observer(design.model, design.observer)
        self.stem: FloatArray = np.array(design.model.stem0)
        self.raised = ""
        self._target = TargetSelector(design.model, design.target_weights, design.limits.stem)
        unaware = UnawareMpc(design.model, design.unaware, design.limits)
        self._formulation = formulation_of(mode, design, unaware, self.valves)
        stand_in = None if self._formulation is unaware else unaware
        self._new_strategies = functools.partial(
            Strategies, self._formulation, stand_in, design.fallback
        )
        self._strategies = self._new_strategies()
        self._check = SlipCheck(m) if design.slip_check else None
        self._passage = Passage(design.longest_wait)
        self._dv: FloatArray = np.zeros(design.model.e.shape[1])
        self._started = False
        self._decided: tuple[FloatArray, Plan | None] | None = None  # applied in this sample
        self._ways: list[list[float]] = [[] for _ in range(m)]  # OP of slips that are under way

    @property
    def frictions(self) -> tuple[Behaviour | None, ...]:
        """Friction believed in now, per valve; None for those taken to be healthy."""
        return self.valves.frictions

    @property
    def spreads(self) -> tuple[FrictionSpread | None, ...]:
        """Half-widths of the intervals of the frictions, per valve, None where unknown."""
        return self.valves.spreads

    def start(self, op: FloatArray, pv: FloatArray) -> None:
        """Start from rest at the applied ``op`` (m,) and the outputs ``pv`` (p,).

        The stem of a sticky valve may then be anywhere within f_S of OP.
        """
        self.stem = np.array(op, dtype=float)
        self.valves.start(op)
        self.observer.rest(self.stem, pv)
        self._started, self._decided = True, None

    def forget(self) -> None:
        """Forget the past; the next measurement starts from rest, frictions stay known."""
        self._started, self._decided = False, None
        self._ways = [[] for _ in self._ways]
        self._strategies = self._new_strategies()  # no plan of the past is followed on
        self._passage = Passage(self.design.longest_wait)
        if self._check is not None:
            self._check.drop()

    def take_over(self, history: History, samples: int | None = None, skip: int = 0) -> float:
        """Take over from another controller of the same loop without a stop.

        The valve models are replayed over the whole past OP, which finds the stem exactly
        after one move that slips wherever the stem was before; the observer is restarted on
        the last samples with these stems as its input.

        Args:
            history: what was applied and measured, one sample at least.
            samples: how many the observer takes; None for ``hand_over_samples``.
            skip: how many of these are left out of what is returned, while the observer settles.

        Returns:
            How badly valves and process explain these samples: the mean square of the
            innovations, each in standard deviations of the measurement noise.
        """
        count = self.design.hand_over_samples if samples is None else samples
        first = max(len(history.op) - count, 0)
        stem = history.op[0]
        self.valves.start(stem)
        for row in history.op[: first + 1]:
            stem = self.valves.apply_op(row)
        known = history.pv[first:][np.isfinite(history.pv[first:]).all(axis=1)]
        self.observer.rest(stem, known[0] if len(known) else self.design.model.pv0)
        misfit = self._follow(history, first, stem, first + skip)
        self._started, self._decided = True, None
        return misfit

    def follow(self, history: History) -> None:
        """Go on behind :meth:`take_over` over the samples of ``history``, all of them answered."""
        if len(history.op):
            self._follow(history, 0, self.valves.apply_op(history.op[0]))

    def _follow(self, history: History, first: int, stem: FloatArray, count_from: int = 0) -> float:
        """Take in the samples from ``first`` on, whose stems are ``stem``; as take_over."""
        total, counted = 0.0, 0
        for k in range(first, len(history.op)):
            if k > first:
                stem = self.valves.apply_op(history.op[k])
            if np.isfinite(history.pv[k]).all():
                self.observer.correct(history.pv[k])
                if k >= count_from:
                    scaled = self.observer.innovation**2 / self.design.observer.measurement_noise
                    total, counted = total + float(scaled.mean()), counted + 1
            self.observer.predict(stem, history.dv[k])
        self.stem = stem
        return total / max(counted, 1)

    @np.errstate(over="ignore", invalid="ignore")
    def step(
        self,
        pv: FloatArray,
        sp: FloatArray,
        dv: FloatArray,
        applied: FloatArray,
        preview: FloatArray | None = None,
        *,
        known: bool = True,
        reach: float = np.inf,
    ) -> StepResult:
        """Return what to apply now.

        Args:
            pv, sp: measurement and set-points, shape (p,).
            dv: measured disturbances in deviations from nominal, shape (d,); taken to stay.
            applied: the OP that the valves were given last, shape (m,), whatever this
                controller wanted; held when nothing better is found.
            preview: set-points of the samples 1, 2, … ahead, shape (K, p), the last of which
                holds on; None when ``sp`` holds on.
            known: whether ``applied`` is surely what the valves were given; where it is not, no
                slip is judged.
            reach: how far OP may be from ``applied`` whatever is planned, %, as at the first
                sample of a run.
        """
        begin = time.perf_counter()
        given = {"a measurement": pv, "a set-point": sp, "a measured disturbance": dv}
        bad = [name for name, values in given.items() if not np.isfinite(values).all()]
        trouble = f"{bad[0]} is not finite" if bad else ""
        applied = self._take_in(pv, dv, applied, known)
        target: Target | None = None
        if not trouble and self._formulation is not None:
            self._formulation.learn(self.valves, self.stem)
            sticky = [j for j, _ in self.valves.sticky]
            self._formulation.waits = self._passage.waits(self.stem[sticky], sp)
            limits, idle = self.design.limits.stem.copy(), list(self._formulation.immobile)
            limits[idle] = self.stem[idle, None]
            self._target.limits = limits
            target = self._select(sp, preview)
            trouble = "" if target is not None else "no steady state within the limits"
        situation = Situation(
            self.observer.state, target, self.stem, applied, self.valves.forms, trouble
        )
        proposal = self._strategies.choose(situation)
        op = self._valid(self._on_its_way(proposal, applied), applied)
        cut: list[int] = []
        if proposal.status is not StepStatus.FALLBACK:  # which has a rate of its own
            wanted, rate = np.clip(op, applied - reach, applied + reach), self.design.limits.move
            op = np.clip(wanted, applied - rate, applied + rate)
            cut = np.flatnonzero(np.abs(wanted - op) > CUT).tolist()
        self._decide(op, proposal.plan)
        seconds = time.perf_counter() - begin
        miss = np.zeros(len(sp)) if target is None else target.miss
        return StepResult(
            proposal.status,
            "; ".join([text for text in (proposal.reason, *self._remarks(cut)) if text]),
            proposal.mode or self.mode,
            op,
            proposal.plan,
            miss,
            seconds,
            proposal.strategy,
            proposal.age,
            self._gap(situation, proposal),
        )

    @np.errstate(over="ignore", invalid="ignore")
    def pass_over(
        self, pv: FloatArray, dv: FloatArray, applied: FloatArray, *, known: bool = True
    ) -> None:
        """Take in a sample that is not answered: OP stays where it is.

        Args:
            pv: measurement, shape (p,); what is not finite is missing.
            dv, applied, known: as :meth:`step`.
        """
        applied = self._take_in(pv, dv, applied, known)
        self._strategies.hold()
        self._decide(applied, None)

    def _take_in(
        self, pv: FloatArray, dv: FloatArray, applied: FloatArray, known: bool
    ) -> FloatArray:
        """Move on by what was applied, take in what is measured; return the valid ``applied``."""
        self.raised = ""
        applied = self._valid(applied, self.stem)
        self._advance(applied, known)
        if np.isfinite(dv).all():
            self._dv = dv
        if np.isfinite(pv).all():
            self._measure(pv, applied)
        return applied

    def _measure(self, pv: FloatArray, applied: FloatArray) -> None:
        if not self._started:
            self.start(applied, pv)
        self.observer.correct(pv)
        stayed = None if self._check is None else self._check.correct(self.observer, pv)
        if stayed is not None:
            belief = self.valves[stayed.valve]
            assert belief is not None
            belief.raise_static(stayed.static_friction, stayed.stem)
            self.stem = self.stem.copy()
            self.stem[stayed.valve] = stayed.stem
            self._ways[stayed.valve] = []
            self.observer = stayed.observer
            name = _name(self.design.valve_names, stayed.valve, "valve")
            self.raised = f"{name} stayed where it should have moved: f_S is at least "
            self.raised += f"{stayed.static_friction:.3g} %"
        self._passage.take_in(self.observer.standard_innovation)
        if not np.isfinite(self.observer.state).all():
            self.observer = Observer(self.design.model, self.design.observer)
            self.observer.rest(self.stem, pv)

    def _select(self, sp: FloatArray, preview: FloatArray | None) -> Target | None:
        disturbance = self.observer.disturbance
        if preview is None or not len(preview) or not np.isfinite(preview).all():
            return self._target.select(sp, disturbance, self._dv)
        horizon = max(self.design.embedding.horizon, self.design.unaware.horizon)
        rows = np.vstack([sp, preview[:horizon]])
        rows = np.vstack([rows, np.repeat(rows[-1:], max(horizon + 1 - len(rows), 0), axis=0)])
        return self._target.follow(rows, disturbance, self._dv)

    def _on_its_way(self, proposal: Proposal, applied: FloatArray) -> FloatArray:
        """Return the OP (m,), %, of this sample; a slip that takes several ends as it began."""
        op = np.array(proposal.op)
        for j, belief in self.valves.sticky if proposal.plan is not None else ():
            at = float(applied[j]), belief.stem, float(op[j])
            op[j], *self._ways[j] = belief.form.way(*at, self._ways[j])
        return op

    def _valid(self, op: FloatArray, otherwise: FloatArray) -> FloatArray:
        """Return ``op`` within the limits, with ``otherwise`` where it is no number."""
        limits = self.design.limits.stem
        usable = np.where(np.isfinite(op), op, otherwise)
        return np.minimum(np.maximum(usable, limits[:, 0]), limits[:, 1])

    def _decide(self, op: FloatArray, plan: Plan | None) -> None:
        """Note what is to be applied in this sample, and where that should bring the stems."""
        if plan is None:
            self._ways = [[] for _ in self._ways]
        if not self._started:
            return
        self._decided = op, plan
        told = None if plan is None else plan.process_input
        self.stem = self.valves.expected(op) if told is None else told

    def _advance(self, applied: FloatArray, known: bool) -> None:
        """Move valves and observer over the sample that has passed, by what was ``applied``."""
        if self._decided is None:
            return
        decided, plan = self._decided
        self._decided = None
        if not np.array_equal(applied, decided):
            self._ways = [[] for _ in self._ways]
        check = self._check
        if check is not None:
            if not known:
                check.drop()
            for j, belief in self.valves.sticky if known else ():
                check.begin(j, self.observer, belief, float(applied[j]))
        stem = self.valves.apply_op(applied)
        told = None if plan is None else plan.process_input
        if told is not None and np.array_equal(applied, decided):
            stem = told
        self.stem = stem
        self.observer.predict(stem, self._dv)
        if check is not None:
            check.predict(applied, stem, self._dv)

    def _remarks(self, cut: list[int]) -> list[str]:
        remarks = [self.raised]
        for j in cut:
            name = _name(self.design.valve_names, j, "valve")
            remarks.append(f"the move of {name} is cut to its rate limit")
        held_back = np.flatnonzero(self.observer.held_back).tolist()
        if held_back:
            names = ", ".join(_name(self.design.output_names, i, "output") for i in held_back)
            remarks.append(f"the measurement of {names} is held back as an outlier")
        for j in () if self._formulation is None else self._formulation.immobile:
            name = _name(self.design.valve_names, j, "valve")
            remarks.append(f"{name} cannot be moved: its smallest jump exceeds its travel")
        return remarks

    def _gap(self, situation: Situation, proposal: Proposal) -> float | None:
        formulation, plan, target = self._formulation, proposal.plan, situation.target
        samples = self.design.gap_samples
        if not samples or formulation is None or plan is None or target is None:
            return None
        if proposal.status.failed:
            return None
        return formulation.optimality_gap(situation.state, target, situation.last, plan, samples)


def _name(names: tuple[str, ...], number: int, kind: str) -> str:
    return names[number] if names else f"{kind} {number + 1}"
