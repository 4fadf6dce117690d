"""The controller of a running loop that may also test its valve."""

import dataclasses
from concurrent.futures import Executor, Future
from typing import TYPE_CHECKING

import numpy as np

from stiction_ros.control import ControlMode, StepResult, StepStatus
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.answer.step_answer import StepAnswer
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.live import LiveController, ModeChange
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.processes import LinearModel

if TYPE_CHECKING:
    from stiction_ros.online.controller.valve_test import ValveTest

LONGEST = 5000  # samples of the step response that are looked at


class ValveTestingController(LiveController):
    """A live controller whose mode ``valve_test`` moves OP by the plan of a test, once.

    The controller in force goes on observing, and takes over again where the test ends: OP is back
    where the test began, and the first move is limited as after a hold. Friction that was found is
    offered to it as a fit of the estimator is, where it is known to :attr:`jump_margin` of f_S.

    Attributes:
        test: the one that runs or was the last; None where there was none.
        tested: how the last one ended.
    """

    def __init__(
        self, settings: LiveControllerSettings, model: LoopModel, background: Executor | None = None
    ) -> None:
        super().__init__(settings, model, background)
        self.test: ValveTest | None = None
        self.tested: ModeChange | None = None
        self._answers: Future[FloatArray]
        self._sp, self._valve, self._output = np.empty(0), 0, 0
        self._want()

    @property
    def mode(self) -> ControlMode:
        return super().mode if self._running is None else ControlMode.VALVE_TEST

    @property
    def _running(self) -> "ValveTest | None":
        return None if self.test is None or self.test.over else self.test

    @property
    def _ours(self) -> bool:
        return self._told is None or self._told.ours

    def _want(self) -> None:
        """Make ready for a test, where the settings ask for one: it begins when that is done."""
        self._wanted = self.settings.mode == ControlMode.VALVE_TEST
        if self._wanted:
            self._answers = self._background.submit(_answers, self._design.model)

    def begin(self, op: FloatArray) -> None:
        self._stop("a run began")
        super().begin(op)

    def retune(self, settings: LiveControllerSettings) -> None:
        before = self.settings.mode
        super().retune(settings)
        if settings.mode != before:
            self._want()
            self._stop("the mode was set")

    def pass_over(self, pv: FloatArray, dv: FloatArray | None = None) -> None:
        self._stop("a sample was late or bad")
        super().pass_over(pv, dv)

    def step(
        self,
        pv: FloatArray,
        sp: FloatArray,
        dv: FloatArray | None = None,
        preview: FloatArray | None = None,
    ) -> StepResult:
        due = self._wanted and self._sample >= self.settings.valve_test_at and self._ours
        if due and self._answers.done():
            self._wanted = False
            self._begin_test(pv, sp)
        test = self._running
        if test is None:
            return super().step(pv, sp, dv, preview)
        if not self._ours or not np.array_equal(sp, self._sp):
            self._stop("the set-point moved" if self._ours else "someone else has OP")
            return super().step(pv, sp, dv, preview)
        moved = self._in_force.copy()
        moved[self._valve] = test.next_op(float(pv[self._output]))
        self._observe(moved, pv, dv)
        if test.over:
            self._finish()
        mode, nothing = ControlMode.VALVE_TEST, np.zeros(len(pv))
        return StepResult(StepStatus.SOLVED, "", mode, moved, None, nothing, 0.0, "valve test")

    def _begin_test(self, pv: FloatArray, sp: FloatArray) -> None:
        """Begin a test with OP in force, or say why not; the other valves rest."""
        self._settle()
        names, name = self.model.valve_names, self.settings.valve_test_valve
        shows = self.settings.valve_test_output
        for tag, known in ((name, names), (shows, self.model.outputs)):
            if tag and tag not in known:
                self._note(f"no valve test: the loop has no {tag}", self._sample)
                return
        self._valve = names.index(name) if name else 0
        from stiction_ros.identification.valve_test.facts import facts_of_answer
        from stiction_ros.online.controller.valve_test import ValveTest

        step, values = self.model.sample_time, self._answers.result()
        noise = self._noise()
        clear = np.abs(values[:, :, self._valve]).max(axis=0) / np.maximum(noise, 1e-300)
        out = self.model.outputs.index(shows) if shows else int(np.argmax(clear))
        self._output = out
        answer = StepAnswer.of_values(
            self.model.outputs[out], values[:, out, self._valve], float(noise[out]), step
        )
        begins = float(self._in_force[self._valve]), float(sp[out])
        facts = facts_of_answer(answer, names[self._valve], *begins)
        reach, room = self.settings.valve_test_op, self.settings.valve_test_pv
        room = room or abs(facts.gain or 0.0) * reach + float(np.abs(pv - sp)[out])
        margin, hold = self.settings.jump_margin, round(facts.hold / step)
        self.test = ValveTest(facts.within(reach, room), hold, self._background, margin)
        self._sp = sp
        self._note("a valve test begins", self._sample, ControlMode.VALVE_TEST)

    def _noise(self) -> FloatArray:
        """Return the standard deviation of the noise of each PV, shape (p,)."""
        past = self._past.history().pv
        news = np.diff(past[np.isfinite(past).all(axis=1)], axis=0)
        return np.asarray(news.std(axis=0) / np.sqrt(2.0) if len(news) else np.zeros(past.shape[1]))

    def _stop(self, reason: str) -> None:
        if (test := self._running) is not None:
            test.stop(reason)
            self._finish()

    def _finish(self) -> None:
        """Give OP back to the controller in force, and offer it the friction that was found."""
        assert self.test is not None
        self._first, self._approach = True, None
        self._watch.disturb()
        self.tested = self._note(f"valve test: {self.test.over}", self._sample)
        found = self.test.judgement
        if found is None or not found.verdict.has_friction:
            return
        if found.known_to > self.settings.jump_margin:
            return  # jumps would be much larger than need be; the estimator will know better
        name = self.test.facts.valve
        model = self.model.with_valve_effects(
            {name: [HeStiction(found.f_s, min(max(found.f_d, 0.0), found.f_s))]}
        )
        told = {
            "valve": name,
            "effect": "stiction",
            "f_s_interval": list(found.f_s_interval),
            "f_d_interval": list(found.f_d_interval),
            "by": "valve test",
        }
        model = dataclasses.replace(model, provenance=(*model.provenance, told))
        self.offer(model, self._sample + 1)


def _answers(model: LinearModel) -> FloatArray:
    """Return the answers to steps; import what judges a test, whose compiled code takes a second.

    A controller that tests nothing does not wait for it, and one that does is not late.
    """
    import stiction_ros.online.controller.valve_test  # noqa: F401

    return model.step_responses(LONGEST)
