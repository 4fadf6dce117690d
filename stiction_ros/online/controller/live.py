"""The controller of a running loop: steps, swaps, watches, rolls back."""

import dataclasses
import functools
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor

import numpy as np

from stiction_ros.control import ControlDesign, ControlMode, MpcController, StepResult
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.making import controller_of, design_for
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.handover.hand_over import AtOnce, HandOver, Past
from stiction_ros.online.handover.known_friction import alike, frictions_of
from stiction_ros.online.handover.offers import Judge, last_samples
from stiction_ros.online.handover.watch import Approach, Watch
from stiction_ros.online.input.op_port import Given
from stiction_ros.online.input.samples import Sample

HISTORY_SAMPLES = 20_000
FIRST_MOVE = 0.9  # %; largest move of the first OP after a start or a hold
REMEMBERED = 20  # frictions that were rolled back


@dataclasses.dataclass(frozen=True)
class ModeChange:
    """A change of controller: the first sample of the new one, its mode, and why."""

    sample: int
    mode: ControlMode
    reason: str
    model: str


class LiveController:
    """One controller at a time, and a prepared one that takes over between two samples.

    A loop model offered by the estimator is *prepared* (a new controller is built, which may
    refuse, held against the past by :class:`stiction_ros.online.handover.offers.Judge`, and takes
    the past in), beside the loop where there is a thread for it; a doubted one is looked at again
    every ``fit_every`` samples. It is *committed* between two samples, then *watched*, and *rolled
    back* to the last controller that was not on trial when it does worse than the one before.
    """

    def __init__(
        self, settings: LiveControllerSettings, model: LoopModel, background: Executor | None = None
    ) -> None:
        """Build the first controller on ``model``, whose own valve effects are taken as known.

        Args:
            settings: of controller, trust and watch.
            model: the loop.
            background: does what would make a step long; None does it at once.

        Raises:
            InputError: settings that do not fit the model.
        """
        settings.check_latency()
        self.settings, self.model = settings, model
        self._design: ControlDesign = settings.design(model)
        self._build = functools.partial(controller_of, model.valve_names)
        self._background: Executor = background or AtOnce()
        self._known = model
        self._watch = Watch(settings)
        upsets = self._design.model.e.shape[1]
        self._past = Past(HISTORY_SAMPLES, len(model.valves), len(model.outputs), upsets)
        self._latest: tuple[FloatArray, FloatArray, FloatArray] | None = None  # OP, PV, DV
        self._told: Given | None = None  # what the valves were given
        self._in_force, self._sure = np.array(model.stem_start), True
        self.own_op = self._in_force  # of the last step
        self._first = True
        self._approach: Approach | None = None
        self._retuned: HandOver | None = None
        self._offered: HandOver | None = None
        self._returning: HandOver | None = None
        self._raised: tuple[Behaviour | None, ...] | None = None  # by the slip check
        self._rolled_back: deque[tuple[Behaviour | None, ...]] = deque(maxlen=REMEMBERED)
        self._given_up = False
        self._sample = 0
        self._controller = self._build(self._design, model, settings.mode)
        self._proven = self._controller, self._known
        self.doubts: list[tuple[int, str]] = []  # samples at which an offer was not taken, and why
        self.changes: list[ModeChange] = [ModeChange(0, self._controller.mode, "start", model.name)]

    def close(self) -> None:
        """End the work in the background."""
        self._background.shutdown(cancel_futures=True)

    @property
    def mode(self) -> ControlMode:
        return self._controller.mode

    @property
    def frictions(self) -> tuple[Behaviour | None, ...]:
        """Friction that the controller in force believes in, per valve."""
        return self._controller.frictions

    def known_friction(self) -> list[tuple[str, float]]:
        """Return the parameters of the laws in force as pairs such as ``("V1.f_s", 8.0)``, %."""
        forms = self._controller.valves.forms
        return [
            (f"{name}.{key}", value)
            for name, form in zip(self.model.valve_names, forms, strict=True)
            if form is not None
            for key, value in form.law.figures().items()
        ]

    @property
    def observed(self) -> MpcController:
        """The controller in force, for its observer and its stem estimates."""
        return self._controller

    def begin(self, op: FloatArray) -> None:
        """Begin a run, or begin anew, with ``op`` (m,), %, in force.

        The past is forgotten, what is known of the friction stays. The first OP is within
        ``FIRST_MOVE`` of ``op``; where the plan goes further, the set-point is approached from PV.
        """
        self._in_force, self._sure = np.array(op, dtype=float), True
        self._latest = self._told = None
        self._past.clear()
        self._first, self._approach = True, None
        self._controller.forget()
        self._watch.disturb()
        for change in (self._retuned, self._offered, self._returning):
            if change is not None:
                change.put_off(change.at)

    def applied(self, op: FloatArray, known: bool = True, ours: bool = True) -> None:
        """Tell what the valves were given at the last sample, (m,), %.

        Without it the OP of the last step counts. ``known`` is false where nobody can tell:
        no slip is judged on such a sample. ``ours`` is false where someone else has the valves,
        as the plant's own controller: such a sample counts neither for nor against a swap.
        """
        self._told = Given(np.array(op, dtype=float), known, ours)

    def take(self, sample: Sample, preview: FloatArray | None = None) -> StepResult | None:
        """Do what a sample asks for; return the step where it is answered.

        Where nobody tells what the valves were given, it is taken to be our own last OP.
        """
        given = sample.given
        op = self.own_op if given.op is None else given.op
        if sample.begins:
            self.begin(op)
        elif given.op is not None or not given.known:
            self.applied(op, given.known, given.ours)
        if not sample.answered:
            self.pass_over(sample.pv, sample.dv)
            return None
        result = self.step(sample.pv, sample.sp, sample.dv, preview)
        self.own_op = result.op
        return result

    def offer(self, model: LoopModel, at: int) -> None:
        """Prepare a controller that knows the valves of ``model`` from sample ``at`` on.

        What is not taken, at ``at`` or later, is told in :attr:`doubts`.
        """
        self._offered = self._offer_of(model, at, self.settings, self._design)
        self._prepare_ahead()

    def _prepare_ahead(self) -> None:
        """Begin with what is offered before it is due, where that costs no time here."""
        if self._offered is not None and not isinstance(self._background, AtOnce):
            self._offered.judge = self._judge(self._offered.model)
            self._offered.prepare(self._background, self._past)

    def _offer_of(
        self, model: LoopModel, at: int, settings: LiveControllerSettings, design: ControlDesign
    ) -> HandOver:
        def make() -> MpcController:
            return self._build(
                design_for(model, self.model, settings, design), model, settings.mode
            )

        return HandOver(at, "friction identified", model, make)

    def _judge(self, model: LoopModel) -> Judge:
        """Return what holds an offer of ``model`` against the controller in force now."""
        now = self._controller
        in_force = functools.partial(
            MpcController, now.design.without_rates(), now.mode, now.frictions, now.spreads
        )
        offered = frictions_of(model, self.model.valve_names)
        before = any(alike(offered, one) for one in self._rolled_back)
        return Judge(self.settings, in_force, before, last_samples(model))

    def retune(self, settings: LiveControllerSettings) -> None:
        """Change settings from the next sample on.

        Raises:
            InputError: settings that do not fit; the old ones stay in force.
        """
        settings.check_latency()
        design = settings.design(self.model)
        self._build(design, self._known, settings.mode, self._raised)  # may refuse
        waiting = self._offered
        if waiting is not None:
            self._offered = self._offer_of(waiting.model, waiting.at, settings, design)
        self.settings, self._design = settings, design
        if self._returning is not None:
            self._returning.put_off(self._returning.at)
        self._prepare_ahead()
        self._watch.rule = settings
        self._retuned = self._settings_change()

    def _settings_change(self) -> HandOver:
        make = functools.partial(
            self._build, self._design, self._known, self.settings.mode, self._raised
        )
        return HandOver(self._sample, "settings changed", self._known, make)

    def pass_over(self, pv: FloatArray, dv: FloatArray | None = None) -> None:
        """Take in a sample that is not answered: OP stays, the observer goes on.

        PV (p,) may be NaN, which is missing; DV (d,) as for :meth:`step`.
        """
        self._settle()  # OP in force is then that of the last sample
        self._observe(self._in_force, pv, dv)

    def _observe(self, op: FloatArray, pv: FloatArray, dv: FloatArray | None) -> None:
        """Take in a sample at which another than the controller gives ``op``, shape (m,), %."""
        self._settle()
        upset = self._upset(dv)
        self._controller.pass_over(pv, upset, self._in_force, known=self._sure)
        self._latest = op, np.array(pv, dtype=float), upset
        self._watch.disturb()
        self._sample += 1

    def step(
        self,
        pv: FloatArray,
        sp: FloatArray,
        dv: FloatArray | None = None,
        preview: FloatArray | None = None,
    ) -> StepResult:
        """Return what to apply at the present sample; arguments as for the controller's step."""
        self._settle()
        upset = self._upset(dv)
        self._commit_what_is_due()
        if self._approach is not None and self._approach.over:
            self._approach = None
        result = self._controller.step(
            pv,
            sp if self._approach is None else self._approach.aim(sp),
            upset,
            self._in_force,
            preview if self._approach is None else None,
            known=self._sure,
            reach=FIRST_MOVE if self._first else np.inf,
        )
        self._approach_if_far(result, pv, sp)
        if self._unknown:
            text = "; ".join(t for t in (result.reason, self._unknown) if t)
            result = dataclasses.replace(result, reason=text)
        self._latest = result.op, np.array(pv, dtype=float), upset
        self._sample += 1
        self._tell(result)
        self._watch.add(pv, sp, result.status.failed)
        reason = self._watch.verdict()
        if reason:
            self._roll_back(reason)
        return result

    def _approach_if_far(self, result: StepResult, pv: FloatArray, sp: FloatArray) -> None:
        """Approach the set-points from PV where the first plan after a start or hold goes far."""
        if result.mode is ControlMode.HOLD or not self._first:
            self._first = result.mode is ControlMode.HOLD
            return
        if result.plan is None or not np.isfinite(pv).all():
            return
        self._first = False
        if np.any(np.abs(result.plan.op - self._in_force) > FIRST_MOVE):
            seen = self._controller.observer
            begin = np.where(seen.held_back, seen.output, pv)  # an outlier is no place to begin
            self._approach = Approach(begin, sp, self.settings.approach_samples)

    def _upset(self, dv: FloatArray | None) -> FloatArray:
        return np.zeros(self._design.model.e.shape[1]) if dv is None else dv

    def _settle(self) -> None:
        """Remember the last sample, whose OP is known now."""
        if self._latest is None:
            return
        own, pv, dv = self._latest
        told = self._told or Given()
        self._in_force, self._sure = own if told.op is None else told.op, told.known
        self._latest = self._told = None
        if not told.ours:
            self._watch.disturb()
        self._past.add(self._in_force, pv, np.where(np.isfinite(dv), dv, 0.0))

    def _tell(self, result: StepResult) -> None:
        """Note what the step at the sample just passed changed by itself."""
        controller, sample = self._controller, self._sample - 1
        if controller.raised:
            self._raised = controller.frictions
            if self._retuned is not None:
                self._retuned = self._settings_change()
            self._note(controller.raised, sample)
        given_up = result.mode is ControlMode.HOLD and controller.mode is not ControlMode.HOLD
        if given_up and not self._given_up:
            self._note(result.reason, sample, ControlMode.HOLD)
        elif self._given_up and not given_up:
            self._note("a plan is found again", sample)
        self._given_up = given_up

    def _commit_what_is_due(self) -> None:
        """Commit one after the other: what comes later was not prepared for what comes before."""
        self._retuned = self._commit(self._retuned, self._commit_settings)
        if self._retuned is None:
            self._returning = self._commit(self._returning, self._commit_return)
        if self._retuned is None and self._returning is None:
            self._offered = self._commit(self._offered, self._commit_offer)

    def _commit(
        self, change: HandOver | None, take: Callable[[HandOver, MpcController], None]
    ) -> HandOver | None:
        """Commit ``change`` if it is due, ready and not doubted; return what is left to do."""
        if change is None or change.at > self._sample:
            return change
        if not change.begun:
            if change is self._offered:
                change.judge = self._judge(change.model)
            change.prepare(self._background, self._past)
        if not change.ready:
            return change
        try:
            found = change.take(self._past)
        except Exception as error:  # whatever an offer holds, it must not end the loop
            said = str(error) if isinstance(error, InputError) else type(error).__name__
            self.doubts.append((self._sample, f"it cannot be prepared: {said}"))
            return None
        if isinstance(found, str):
            self.doubts.append((self._sample, found))
            every = self.settings.fit_every
            change.put_off((self._sample // every + 1) * every)
            return change
        take(change, found)
        return None

    def _commit_settings(self, change: HandOver, controller: MpcController) -> None:
        before = self._controller.mode
        self._take(change, controller)
        if self._controller.mode is not before:
            self._watch.stop()  # a mode that the user has chosen is not judged
            self._returning = None

    def _commit_return(self, change: HandOver, controller: MpcController) -> None:
        self._take(change, controller)
        if self._offered is not None:
            self._offered.put_off(self._offered.at)  # it was judged beside what has gone

    def _commit_offer(self, change: HandOver, controller: MpcController) -> None:
        if not self._watch.active:  # what is on trial itself is nothing to go back to
            self._proven = self._controller, self._known
        self._raised = None
        self._take(change, controller)
        self._watch.begin(last_samples(change.model))

    def _take(self, change: HandOver, controller: MpcController) -> None:
        """Let ``controller``, which has taken in the past, be the one in force."""
        self._controller, self._known = controller, change.model
        self._note(change.reason, self._sample)

    def _note(self, reason: str, sample: int, mode: ControlMode | None = None) -> ModeChange:
        change = ModeChange(sample, mode or self._controller.mode, reason, self._known.name)
        self.changes.append(change)
        return change

    def _roll_back(self, reason: str) -> None:
        """Return to the controller that was in force before the trial, on what it knew."""
        before, known = self._proven
        frictions, spreads = before.frictions, before.spreads
        self._rolled_back.append(self._controller.frictions)
        self._rolled_back.append(frictions_of(self._known, self.model.valve_names))
        self._raised = None

        def make() -> MpcController:
            return MpcController(self._design, before.mode, frictions, spreads)

        self._returning = HandOver(self._sample, f"rolled back: {reason}", known, make)
        self._watch.stop()

    @property
    def _unknown(self) -> str:
        """Why another mode than the one asked for is in force, or an empty text."""
        asked = self.settings.mode
        if asked != ControlMode.EMBEDDING or self._controller.mode is not ControlMode.UNAWARE:
            return ""
        return "embedding is asked for, but no friction is known: unaware until it is"
