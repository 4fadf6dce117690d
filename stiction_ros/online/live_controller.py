"""The controller of a running loop: steps, swaps, watches, rolls back."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Mapping

import numpy as np

from stiction_ros.control import (
    ControlDesign,
    ControlMode,
    ControlSettings,
    History,
    MpcController,
    StepResult,
    StepStatus,
)
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.schedule import FitSchedule
from stiction_ros.online.watch import Watch, WatchRule
from stiction_ros.settings import setting

AUTO = "auto"
HISTORY_SAMPLES = 20_000


@dataclasses.dataclass(frozen=True)
class LiveControllerSettings(ControlSettings, FitSchedule, WatchRule):
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


class LiveController:
    """One controller at a time, and a prepared one that takes over between two samples.

    A loop model offered by the estimator is *prepared* at once (a new controller is built,
    which may refuse), *committed* before the sample at which it takes effect (it takes over
    the history), then *watched*, and *rolled back* when it does worse than the one before.
    """

    def __init__(self, settings: LiveControllerSettings, model: LoopModel) -> None:
        """Build the first controller on ``model``, whose own valve effects are taken as known.

        Raises:
            InputError: settings that do not fit the model.
        """
        self.settings, self.model = settings, model
        self._design: ControlDesign = settings.design(model)
        self._known = model
        self._watch = Watch(settings)
        self._op: deque[FloatArray] = deque(maxlen=HISTORY_SAMPLES)
        self._pv: deque[FloatArray] = deque(maxlen=HISTORY_SAMPLES)
        self._dv: deque[FloatArray] = deque(maxlen=HISTORY_SAMPLES)
        self._prepared: tuple[int, MpcController, str, LoopModel] | None = None
        self._sample = 0
        self._controller = self._build(self._design, model, settings.mode)
        self._fallback = self._controller
        self.changes: list[ModeChange] = [ModeChange(0, self._controller.mode, "start", model.name)]

    @property
    def mode(self) -> ControlMode:
        """Mode of the controller in force."""
        return self._controller.mode

    @property
    def frictions(self) -> tuple[HeStiction | None, ...]:
        """Friction that the controller in force believes in, per valve."""
        return self._controller.frictions

    @property
    def observed(self) -> MpcController:
        """The controller in force, for its observer and its stem estimates."""
        return self._controller

    def offer(self, model: LoopModel, at: int) -> str:
        """Prepare a controller that knows the valves of ``model`` from sample ``at`` on.

        Returns:
            Why nothing was prepared, or an empty text.
        """
        self._known = model
        try:
            design = self._design
            if self.settings.adopt_process:
                design = self.settings.design(model)
            controller = self._build(design, model, self.settings.mode)
        except InputError as error:
            return str(error)
        self._prepared = (at, controller, "friction identified", model)
        return ""

    def retune(self, settings: LiveControllerSettings) -> None:
        """Change settings from the next sample on.

        Raises:
            InputError: settings that do not fit; the old ones stay in force.
        """
        design = settings.design(self.model)
        controller = self._build(design, self._known, settings.mode)
        self.settings, self._design = settings, design
        self._watch.rule = settings
        self._prepared = (self._sample, controller, "settings changed", self._known)

    def step(self, pv: FloatArray, sp: FloatArray, dv: FloatArray | None = None) -> StepResult:
        """Return what to apply at the present sample; PV and set-points of shape (p,)."""
        upset = np.zeros(self._design.model.e.shape[1]) if dv is None else dv
        self._commit(pv)
        applied = self._op[-1] if self._op else np.array(self.model.stem_start)
        result = self._controller.step(pv, sp, upset, applied)
        self._op.append(result.op)
        self._pv.append(np.where(np.isfinite(pv), pv, self._pv[-1] if self._pv else 0.0))
        self._dv.append(upset)
        self._sample += 1
        self._watch.add(pv, sp, result.status is StepStatus.HELD)
        reason = self._watch.verdict()
        if reason:
            self._roll_back(reason)
        return result

    def _commit(self, pv: FloatArray) -> None:
        if self._prepared is None or self._prepared[0] > self._sample:
            return
        _, controller, reason, model = self._prepared
        self._prepared = None
        before = self._controller
        if self._op:
            controller.take_over(self._history())
        self._controller = controller
        self.changes.append(ModeChange(self._sample, controller.mode, reason, model.name))
        if controller.mode is not before.mode:
            self._fallback = before
            self._watch.begin()

    def _roll_back(self, reason: str) -> None:
        """Return to the mode before, on the friction known then, from the next sample on."""
        before = self._fallback
        controller = MpcController(self._design, before.mode, before.frictions)
        self._prepared = (self._sample, controller, f"rolled back: {reason}", self._known)
        self._commit(self._pv[-1])
        self._watch.stop()

    def _history(self) -> History:
        return History(np.array(self._op), np.array(self._pv), np.array(self._dv))

    def _build(self, design: ControlDesign, model: LoopModel, mode: str) -> MpcController:
        frictions = frictions_of(model, self.model.valve_names)
        if mode == AUTO:
            sticky = any(friction is not None for friction in frictions)
            chosen = ControlMode.EMBEDDING if sticky else ControlMode.UNAWARE
        else:
            chosen = ControlMode(mode)
        if chosen is ControlMode.EMBEDDING and not any(frictions):
            chosen = ControlMode.UNAWARE  # without friction the two are the same problem
        return MpcController(design, chosen, frictions)


def frictions_of(model: LoopModel, valves: tuple[str, ...]) -> tuple[HeStiction | None, ...]:
    """Return the friction of each of ``valves`` that ``model`` knows, None for the others."""
    found: Mapping[str, HeStiction | None] = {
        valve.name: next((e for e in valve.effects if isinstance(e, HeStiction)), None)
        for valve in model.valves
    }
    return tuple(found.get(name) for name in valves)
