"""The control system of a simulated plant: one PI a valve, modes, watchdog, alarms."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import LoopModel, PiTuning, Plant, SetPoints

AUTO, REMOTE = "AUTO", "ROUT"


@dataclasses.dataclass(frozen=True)
class Tunings:
    """How the control system is set.

    Attributes:
        pi: of each valve; that of valve j acts for output j.
        watchdog: s on the wall clock without a beat after which the PIs take over.
    """

    pi: tuple[PiTuning, ...]
    watchdog: float = 5.0


class ControlSystem:
    """Scans the plant at every sample; the wall clock, s, is handed in.

    Remote operation is asked for by the request, granted by the operator's target, and ends when
    the operator, the watchdog or the request says so. While it lasts OUT is what was written
    and the PIs track it: after it they go on from OUT, so that neither transfer moves a valve.
    """

    def __init__(
        self, model: LoopModel, set_points: SetPoints | None, tunings: Tunings, seed: int
    ) -> None:
        """Start in AUTO at the model's initial stems; without a schedule SP stays at PV."""
        self.model, self.tunings = model, tunings
        self._schedule = set_points
        self._plant = Plant(model, seed)
        self.out: FloatArray = np.array(model.stem_start, dtype=float)
        self._acting = self.out.copy()
        self.pv: FloatArray = self._plant.measure().pv
        self.sp: FloatArray = self._sp_at(0.0)
        self._error: FloatArray = self.sp - self.pv
        self.mode = AUTO
        self.alarm = ""
        self.request = False
        self._took_over = True
        self._beat: float | None = None
        self._beat_at = float("-inf")

    @property
    def sample(self) -> int:
        """Number of the present sample."""
        return self._plant.sample

    def scan(self, now: float) -> None:
        """End the present sample and work through the next: measure, watch, control."""
        self._plant.apply(self._acting)
        measured = self._plant.measure()
        self.pv, self.sp = measured.pv, self._sp_at(measured.time)
        self.watch(now)
        error = self.sp - self.pv
        if self.mode == AUTO:
            if self._took_over:  # the first scan integrates only
                self._error, self._took_over = error, False
            self.out = self._pi(error)
        self._error = error
        self._acting = self.out.copy()

    def half_over(self) -> None:
        """What is in force in the middle of a sample acts for the whole of it."""
        self._acting = self.out.copy()

    def watch(self, now: float) -> None:
        """Take over when no beat has come for the watchdog's time."""
        if self.mode == REMOTE and now - self._beat_at > self.tunings.watchdog:
            self._end("watchdog: no beat of the remote controller")

    def beat(self, value: float, now: float) -> None:
        """Take in a beat."""
        if value != self._beat:
            self._beat, self._beat_at = value, now

    def ask(self, asked: bool) -> None:
        """Take in the request; taking it back ends remote operation."""
        self.request = asked
        if not asked and self.mode == REMOTE:
            self._end("request taken back")

    def target(self, mode: str, now: float) -> str:
        """Let the operator choose a mode; return why not, empty when it is in force."""
        if mode == AUTO:
            if self.mode == REMOTE:
                self._end("taken back by the operator")
            return ""
        if mode != REMOTE:
            return f"unknown mode {mode}"
        if not self.request:
            return "nobody asks for it"
        if now - self._beat_at > self.tunings.watchdog:
            return "no beat of the remote controller"
        self.mode, self.alarm = REMOTE, ""
        return ""

    def write(self, valves: Sequence[int], values: Sequence[float]) -> bool:
        """Take remote OPs, %, of some valves; tell whether the mode lets it."""
        if self.mode != REMOTE:
            return False
        for valve, value in zip(valves, values, strict=True):
            low, high = self.model.limits[valve]
            self.out[valve] = min(max(value, low), high)
        return True

    def _end(self, alarm: str) -> None:
        self.mode, self.alarm, self._took_over = AUTO, alarm, True

    def _pi(self, error: FloatArray) -> FloatArray:
        step = self.model.sample_time
        gain = np.array([one.gain for one in self.tunings.pi])
        share = step / np.array([one.integral_time for one in self.tunings.pi])
        out = self.out + gain * (error - self._error + share * error)
        return np.clip(out, self.model.limits[:, 0], self.model.limits[:, 1])

    def _sp_at(self, time: float) -> FloatArray:
        if self._schedule is None:
            return np.array(self.model.pv_start, dtype=float)
        return np.array(self._schedule.at(time), dtype=float)
