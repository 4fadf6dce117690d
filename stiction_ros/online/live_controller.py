"""The controller of a running loop: steps, swaps, watches, rolls back."""

from __future__ import annotations

import dataclasses
from collections import deque

import numpy as np

from stiction_ros.control import (
    ControlDesign,
    ControlMode,
    ControlSettings,
    History,
    MpcController,
    StepResult,
)
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.known_friction import frictions_of, spreads_of
from stiction_ros.online.offers import OfferRule, doubt
from stiction_ros.online.schedule import FitSchedule
from stiction_ros.online.watch import Watch, WatchRule
from stiction_ros.settings import setting

AUTO = "auto"
HISTORY_SAMPLES = 20_000


@dataclasses.dataclass(frozen=True)
class LiveControllerSettings(ControlSettings, FitSchedule, WatchRule, OfferRule):
    """Everything that can be set on the controller of a running loop."""

    mode: str = setting(
        AUTO,
        "auto: the estimator swaps it; otherwise fixed",
        choices=(AUTO, *(mode.value for mode in ControlMode)),
    )
    adopt_process: bool = setting(False, "also take the process from the estimator's loop model")


@dataclasses.dataclass(frozen=True)
class ModeChange:
    """A change of controller: the first sample of the new one, its mode, and why."""

    sample: int
    mode: ControlMode
    reason: str
    model: str


@dataclasses.dataclass(frozen=True)
class _Prepared:
    """A controller that takes over before sample ``at``, and the model whose valves it knows."""

    at: int
    controller: MpcController
    reason: str
    model: LoopModel


class LiveController:
    """One controller at a time, and a prepared one that takes over between two samples.

    A loop model offered by the estimator is *prepared* at once (a new controller is built,
    which may refuse), held against the past before the sample at which it takes effect
    (:mod:`.offers`; a doubted one is looked at again every ``fit_every`` samples), *committed*
    (it takes over the history), then *watched*, and *rolled back* when it does worse than the
    one before.
    """

    def __init__(self, settings: LiveControllerSettings, model: LoopModel) -> None:
        """Build the first controller on ``model``, whose own valve effects are taken as known.

        Raises:
            InputError: settings that do not fit the model.
        """
        if settings.fit_every < settings.fit_latency:
            raise InputError(
                f"{settings.fit_every} is less than fit_latency = {settings.fit_latency}",
                where="fit_every",
                fix="a fit must take effect before the next window ends",
            )
        self.settings, self.model = settings, model
        self._design: ControlDesign = settings.design(model)
        self._known = model
        self._watch = Watch(settings)
        self._op: deque[FloatArray] = deque(maxlen=HISTORY_SAMPLES)
        self._pv: deque[FloatArray] = deque(maxlen=HISTORY_SAMPLES)
        self._dv: deque[FloatArray] = deque(maxlen=HISTORY_SAMPLES)
        self._retuned: _Prepared | None = None
        self._offered: _Prepared | None = None
        self._doubted: _Prepared | None = None
        self._raised: tuple[Behaviour | None, ...] | None = None  # by the slip check
        self._given_up = False
        self._sample = 0
        self._controller = self._build(self._design, model, settings.mode)
        self._fallback = self._controller, model
        self.doubts: list[tuple[int, str]] = []  # samples at which an offer was not taken, and why
        self.changes: list[ModeChange] = [ModeChange(0, self._controller.mode, "start", model.name)]

    @property
    def mode(self) -> ControlMode:
        """Mode of the controller in force."""
        return self._controller.mode

    @property
    def frictions(self) -> tuple[Behaviour | None, ...]:
        """Friction that the controller in force believes in, per valve."""
        return self._controller.frictions

    def known_friction(self) -> list[tuple[str, float]]:
        """Return the friction in force as pairs such as ``("V1.f_s", 8.0)``, in %."""
        return [
            (f"{name}.{entry.key}", getattr(friction, entry.attribute))
            for name, friction in zip(self.model.valve_names, self.frictions, strict=True)
            if friction is not None
            for entry in friction.parameters()
        ]

    @property
    def observed(self) -> MpcController:
        """The controller in force, for its observer and its stem estimates."""
        return self._controller

    def offer(self, model: LoopModel, at: int) -> str:
        """Prepare a controller that knows the valves of ``model`` from sample ``at`` on.

        Returns:
            Why nothing was prepared, or an empty text.
        """
        try:
            self._offered = self._prepare_offer(model, at, self.settings, self._design)
        except InputError as error:
            return str(error)
        self._doubted = None
        return ""

    def _doubt(self, offered: _Prepared) -> str:
        """Return why the past speaks against what is offered, or an empty text."""
        now, new = self._controller, offered.controller
        if now.frictions == new.frictions and now.design.model is new.design.model:
            return ""
        told = [e["last_samples"] for e in offered.model.provenance if "last_samples" in e]
        last = min(told) + self.settings.fit_latency if told else None
        return doubt(self.settings, (now, new), self._history(), last)

    def _prepare_offer(
        self, model: LoopModel, at: int, settings: LiveControllerSettings, design: ControlDesign
    ) -> _Prepared:
        for name in self.model.valve_names:
            if name not in model.valve_names:
                raise InputError(f"says nothing of valve {name}", where=model.name)
        if settings.adopt_process:
            if (model.valve_names, model.outputs) != (self.model.valve_names, self.model.outputs):
                raise InputError("is the process of another loop", where=model.name)
            adopted = settings.design(model)
            # What is identified knows no limits: those of the valves stay.
            limits = dataclasses.replace(adopted.limits, stem=design.limits.stem)
            design = dataclasses.replace(adopted, limits=limits)
        controller = self._build(design, model, settings.mode)
        return _Prepared(at, controller, "friction identified", model)

    def retune(self, settings: LiveControllerSettings) -> None:
        """Change settings from the next sample on.

        Raises:
            InputError: settings that do not fit; the old ones stay in force.
        """
        design = settings.design(self.model)
        controller = self._build(design, self._known, settings.mode, self._raised)
        waiting = self._offered
        if waiting is not None:
            self._offered = self._prepare_offer(waiting.model, waiting.at, settings, design)
        self._doubted = None
        self.settings, self._design = settings, design
        self._watch.rule = settings
        self._retuned = _Prepared(self._sample, controller, "settings changed", self._known)

    def step(
        self,
        pv: FloatArray,
        sp: FloatArray,
        dv: FloatArray | None = None,
        preview: FloatArray | None = None,
    ) -> StepResult:
        """Return what to apply at the present sample; arguments as for the controller's step."""
        upset = np.zeros(self._design.model.e.shape[1]) if dv is None else dv
        self._commit_what_is_due()
        applied = self._op[-1] if self._op else np.array(self.model.stem_start)
        result = self._controller.step(pv, sp, upset, applied, preview)
        if self._unknown:
            text = "; ".join(t for t in (result.reason, self._unknown) if t)
            result = dataclasses.replace(result, reason=text)
        self._op.append(result.op)
        self._pv.append(np.where(np.isfinite(pv), pv, self._pv[-1] if self._pv else self.model.pv0))
        self._dv.append(np.where(np.isfinite(upset), upset, 0.0))
        self._sample += 1
        self._tell(result)
        self._watch.add(pv, sp, result.status.failed)
        reason = self._watch.verdict()
        if reason:
            self._roll_back(reason)
        return result

    def _tell(self, result: StepResult) -> None:
        """Note what the step at the sample just passed changed by itself."""
        controller, sample = self._controller, self._sample - 1
        if controller.raised:
            self._raised = controller.frictions
            self._note(controller.raised, sample)
        given_up = result.mode is ControlMode.HOLD and controller.mode is not ControlMode.HOLD
        if given_up and not self._given_up:
            change = ModeChange(sample, ControlMode.HOLD, result.reason, self._known.name)
            self.changes.append(change)
        elif self._given_up and not given_up:
            self._note("a plan is found again", sample)
        self._given_up = given_up

    def _commit_what_is_due(self) -> None:
        if self._doubted is not None and self._sample % self.settings.fit_every == 0:
            self._offered, self._doubted = self._doubted, None
        if self._retuned is not None:
            prepared, self._retuned = self._retuned, None
            before = self._controller.mode
            self._commit(prepared)
            if self._controller.mode is not before:
                self._watch.stop()  # a mode that the user has chosen is not judged
        if self._offered is not None and self._offered.at <= self._sample:
            prepared, self._offered = self._offered, None
            speaks_against = self._doubt(prepared)
            if speaks_against:
                self._doubted = prepared
                self.doubts.append((self._sample, speaks_against))
                return
            before_offer = self._controller, self._known
            self._raised = None
            self._commit(prepared)
            self._fallback = before_offer
            self._watch.begin()

    def prediction(self, result: StepResult, points: int) -> tuple[FloatArray, FloatArray]:
        """Return the plan of the last step, thinned for a message.

        Returns:
            Rows (PV, stem), shape (K, p + m), and the samples ahead that they stand for,
            shape (K,). The first row is the present estimate; without a plan it is alone.
        """
        stem, plan = self._controller.stem, result.plan
        if plan is None:
            return np.concatenate([self._controller.observer.output, stem])[None], np.zeros(1)
        pv, stems = plan.pv[result.age :], plan.stem[result.age :]
        last = len(stems)
        picks = np.unique(np.linspace(0, last, min(points, last + 1)).round().astype(int))
        rows = np.hstack([pv[picks], stems[np.minimum(picks, last - 1)]])
        rows[0, pv.shape[1] :] = stem
        return rows, picks

    def _commit(self, prepared: _Prepared) -> None:
        controller = prepared.controller
        if self._op:
            controller.take_over(self._history())
        self._controller, self._known = controller, prepared.model
        self._note(prepared.reason, self._sample)

    def _note(self, reason: str, sample: int) -> None:
        mode = self._controller.mode
        self.changes.append(ModeChange(sample, mode, reason, self._known.name))

    def _roll_back(self, reason: str) -> None:
        """Return to the mode before, on the friction known then, from the next sample on."""
        before, known = self._fallback
        controller = MpcController(self._design, before.mode, before.frictions, before.spreads)
        self._raised = None
        self._commit(_Prepared(self._sample, controller, f"rolled back: {reason}", known))
        self._watch.stop()

    def _history(self) -> History:
        return History(np.array(self._op), np.array(self._pv), np.array(self._dv))

    def _build(
        self,
        design: ControlDesign,
        model: LoopModel,
        mode: str,
        raised: tuple[Behaviour | None, ...] | None = None,
    ) -> MpcController:
        frictions = raised or frictions_of(model, self.model.valve_names)
        spreads = None if raised else spreads_of(model, self.model.valve_names)
        sticky = any(friction is not None for friction in frictions)
        if mode == AUTO:
            chosen = ControlMode.EMBEDDING if sticky else ControlMode.UNAWARE
        else:
            chosen = ControlMode(mode)
        if chosen is ControlMode.EMBEDDING and not sticky:
            chosen = ControlMode.UNAWARE  # without friction the two are the same problem
        return MpcController(design, chosen, frictions, spreads)

    @property
    def _unknown(self) -> str:
        """Why another mode than the one asked for is in force, or an empty text."""
        asked = self.settings.mode
        if asked != ControlMode.EMBEDDING or self._controller.mode is not ControlMode.UNAWARE:
            return ""
        return "embedding is asked for, but no friction is known: unaware until it is"
