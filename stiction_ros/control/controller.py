"""One controller: observer, target, formulation, and the valve models it believes in."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from stiction_ros.control.embedding import EmbeddingMpc, EmbeddingTuning
from stiction_ros.control.horizon import HorizonLimits, HorizonWeights
from stiction_ros.control.inversion import InversionMpc
from stiction_ros.control.observer import Observer, ObserverTuning
from stiction_ros.control.paper_weights import PaperTuning
from stiction_ros.control.printed_embedding import PrintedEmbeddingMpc
from stiction_ros.control.printed_inversion import InvertedPlan, PrintedInversionMpc
from stiction_ros.control.result import ControlMode, Plan, StepResult, StepStatus
from stiction_ros.control.target import Target, TargetSelector
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.processes import LinearModel


class Formulation(Protocol):
    """One way to turn an estimate and a target into a plan."""

    mode: ControlMode

    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return a plan, or None when there is none."""
        ...


@dataclasses.dataclass(frozen=True)
class ControlDesign:
    """Everything a controller is built from, apart from the friction.

    Attributes:
        model: the process.
        limits: bounds; outputs are soft.
        unaware, embedding: weights of (19a) for either formulation.
        target_weights: Q_ss, shape (p,).
        observer: observer tuning.
        jumps: how sticky valves are moved.
        hand_over_samples: past samples replayed into the observer of a new controller.
        paper: the paper's own embedding and inversion; None for those of this package.
    """

    model: LinearModel
    limits: HorizonLimits
    unaware: HorizonWeights
    embedding: HorizonWeights
    target_weights: FloatArray
    observer: ObserverTuning
    jumps: EmbeddingTuning = EmbeddingTuning()
    hand_over_samples: int = 200
    paper: PaperTuning | None = None


@dataclasses.dataclass(frozen=True)
class History:
    """Past samples in order: OP (K, m), PV (K, p), measured disturbances (K, d)."""

    op: FloatArray
    pv: FloatArray
    dv: FloatArray


class MpcController:
    """Offset-free MPC in one mode; step it once per sample."""

    def __init__(
        self,
        design: ControlDesign,
        mode: ControlMode,
        frictions: Sequence[HeStiction | None] | None = None,
    ) -> None:
        """Build for ``frictions``, one entry per valve, None for a healthy one.

        The modes that do not know of friction take no notice of it.

        Raises:
            InputError: the model is not detectable, or embedding cannot be set up.
        """
        m = len(design.model.stem0)
        self.design, self.mode = design, mode
        aware = mode in (ControlMode.EMBEDDING, ControlMode.INVERSION) and frictions is not None
        self.frictions = tuple(frictions or ()) if aware else (None,) * m
        self.observer = Observer(design.model, design.observer)
        self.stem = np.array(design.model.stem0)
        self._target = TargetSelector(design.model, design.target_weights, design.limits.stem)
        self._formulation = self._build_formulation()
        self._started = False

    def _build_formulation(self) -> Formulation | None:
        design = self.design
        if self.mode is ControlMode.HOLD:
            return None
        if self.mode is ControlMode.EMBEDDING:
            if design.paper is not None:
                return PrintedEmbeddingMpc(
                    design.model, design.paper, design.limits, self.frictions
                )
            return EmbeddingMpc(
                design.model, design.embedding, design.limits, self.frictions, design.jumps
            )
        unaware = UnawareMpc(design.model, design.unaware, design.limits)
        if self.mode is ControlMode.INVERSION:
            inversion = InversionMpc if design.paper is None else PrintedInversionMpc
            return inversion(unaware, self.frictions)
        return unaware

    def start(self, op: FloatArray, pv: FloatArray) -> None:
        """Start from rest at the applied ``op`` (m,) and the outputs ``pv`` (p,)."""
        self.stem = np.array(op, dtype=float)
        self.observer.rest(self.stem, pv)
        self._started = True

    def take_over(self, history: History) -> None:
        """Take over from another controller of the same loop without a stop.

        The valve models are replayed over the whole past OP, which finds the stem exactly
        after one move that slips wherever the stem was before; the observer is restarted on
        the last ``hand_over_samples`` samples with these stems as input.
        """
        stems = np.array(history.op, dtype=float)
        for j, friction in enumerate(self.frictions):
            if friction is not None:
                stems[:, j] = friction.simulate(stems[:, j])
        first = max(len(stems) - self.design.hand_over_samples, 0)
        self.start(stems[first], history.pv[first])
        for k in range(first, len(stems)):
            self.observer.correct(history.pv[k])
            self.observer.predict(stems[k], history.dv[k])
        self.stem = stems[-1].copy()

    def step(
        self, pv: FloatArray, sp: FloatArray, dv: FloatArray, applied: FloatArray
    ) -> StepResult:
        """Return what to apply now.

        Args:
            pv, sp: measurement and set-points, shape (p,).
            dv: measured disturbances in deviations from nominal, shape (d,).
            applied: the OP applied last, shape (m,), held when nothing better is found.
        """
        begin = time.perf_counter()
        if not self._started and np.isfinite(pv).all():
            self.start(applied, pv)
        zero = np.zeros(len(sp))
        plan: Plan | None = None
        status, reason, miss = StepStatus.HELD, "", zero
        if not (np.isfinite(pv).all() and np.isfinite(sp).all() and np.isfinite(dv).all()):
            reason = "a measurement or set-point is not finite"
            dv = np.zeros(len(dv))
        else:
            self.observer.correct(pv)
            plan, status, reason, miss = self._plan(sp, dv)
        op = applied if plan is None else plan.op
        limits = self.design.limits.stem
        op = np.clip(op, limits[:, 0], limits[:, 1])
        if self._started:
            self._move_stems(op)
            if isinstance(plan, InvertedPlan):
                self.stem = plan.process_input
            self.observer.predict(self.stem, dv)
        seconds = time.perf_counter() - begin
        return StepResult(status, reason, self.mode, op, plan, miss, seconds)

    def _plan(
        self, sp: FloatArray, dv: FloatArray
    ) -> tuple[Plan | None, StepStatus, str, FloatArray]:
        zero = np.zeros(len(sp))
        if self._formulation is None:
            return None, StepStatus.HELD, "mode hold", zero
        target = self._target.select(sp, self.observer.disturbance, dv)
        if target is None:
            return None, StepStatus.HELD, "no steady state within the limits", zero
        plan = self._formulation.plan(self.observer.state, target, self.stem)
        if plan is None or not np.isfinite(plan.op).all():
            return None, StepStatus.HELD, "no plan found", target.miss
        if not target.reachable:
            reason = "set-point out of reach, the nearest reachable one is held"
            return plan, StepStatus.UNREACHABLE, reason, target.miss
        return plan, StepStatus.SOLVED, "", target.miss

    def _move_stems(self, op: FloatArray) -> None:
        stem = op.copy()
        for j, friction in enumerate(self.frictions):
            if friction is not None:
                stem[j] = friction.step(float(self.stem[j]), float(op[j]))[1]
        self.stem = stem
