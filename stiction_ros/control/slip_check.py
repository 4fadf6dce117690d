"""Did the valve move? A parallel observer that assumes it did not."""

from __future__ import annotations

import dataclasses

from stiction_ros.control.jump_form import JumpForm
from stiction_ros.control.observer import Observer
from stiction_ros.control.valve_belief import ValveBelief
from stiction_ros.effects.behaviour import FloatArray

SAMPLES = 3  # that must fit better without the move
EVIDENCE = 6.0  # log likelihood ratio that settles a check, 400 to 1
LONGEST = 30  # samples after which an undecided check is given up


@dataclasses.dataclass(frozen=True)
class Stayed:
    """A planned jump that did not happen.

    Attributes:
        valve: its index.
        static_friction: largest |OP − χ| at which the stem has stayed, %.
        stem: where it is, %.
        observer: the observer that has known so from the beginning.
    """

    valve: int
    static_friction: float
    stem: float
    observer: Observer


class _Rival:
    """The assumption that one valve stayed, followed sample by sample."""

    def __init__(self, observer: Observer, form: JumpForm, stem: float, error: float) -> None:
        self.observer = observer.copy()
        self.belief = ValveBelief(form.raised(error))
        self.belief.settle(stem)
        self.evidence, self.better, self.samples = 0.0, 0, 0

    def compare(self, main: Observer, pv: FloatArray) -> None:
        self.observer.correct(pv)
        gain = 0.5 * (main.misfit - self.observer.misfit)
        self.evidence += gain
        self.better += gain > 0.0
        self.samples += 1

    @property
    def stayed(self) -> bool:
        return self.better >= SAMPLES and self.evidence >= EVIDENCE

    @property
    def over(self) -> bool:
        return self.evidence <= -EVIDENCE or self.samples >= LONGEST


class SlipCheck:
    """Watches every jump of a valve whose stem position is sure.

    From the jump on, a second observer runs on the assumption that the stem stayed. When at
    least three samples fit it better, and all together by a likelihood ratio of 400 to 1, the
    stem has stayed and f_S is larger than |OP − χ| was. Without a first sure slip an unknown
    start position would explain as much, so nothing is checked before.
    """

    def __init__(self, valves: int) -> None:
        """Start with nothing to check in any of ``valves``."""
        self._rivals: list[_Rival | None] = [None] * valves

    def drop(self) -> None:
        """Forget what is being checked."""
        self._rivals = [None] * len(self._rivals)

    def correct(self, main: Observer, pv: FloatArray) -> Stayed | None:
        """Take in the measurement that ``main`` has just taken in; return what it settles."""
        for j, rival in enumerate(self._rivals):
            if rival is None:
                continue
            rival.compare(main, pv)
            if rival.stayed:
                self.drop()
                friction = rival.belief.form.static_friction
                return Stayed(j, friction, rival.belief.stem, rival.observer)
            if rival.over:
                self._rivals[j] = None
        return None

    def begin(self, valve: int, observer: Observer, belief: ValveBelief, op: float) -> None:
        """Begin when ``op``, %, is about to move ``valve`` from where ``belief`` has it."""
        if self._rivals[valve] is None and belief.sure and belief.form.slips(belief.stem, op):
            error = abs(op - belief.stem)
            self._rivals[valve] = _Rival(observer, belief.form, belief.stem, error)

    def predict(self, op: FloatArray, stems: FloatArray, dv: FloatArray) -> None:
        """Apply ``op`` (m,), which moves the stems to ``stems`` (m,) if all is as believed."""
        for j, rival in enumerate(self._rivals):
            if rival is not None:
                other = stems.copy()
                other[j] = rival.belief.step(float(op[j]))
                rival.observer.predict(other, dv)
