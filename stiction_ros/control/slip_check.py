"""Did the valve move? A parallel observer that assumes it did not."""

import dataclasses

from stiction_ros.control.belief import ValveBelief
from stiction_ros.control.observer import Observer
from stiction_ros.effects.behaviour import FloatArray

SAMPLES = 3  # that must fit better without the move
EVIDENCE = 6.0  # log likelihood ratio that settles a check, 400 to 1
PLAUSIBLE = 9.0  # largest mean square of innovations, in their expected deviations
LONGEST = 30  # samples after which an undecided check is given up


@dataclasses.dataclass(frozen=True)
class Stayed:
    """A planned jump that did not happen."""

    valve: int  # its index
    static_friction: float  # largest |OP − χ| at which the stem has stayed, %
    stem: float  # where it is, %
    observer: Observer  # the observer that has known so from the beginning


class _Rival:
    """The assumption that one valve stayed; a *stuck* one stays whatever OP does later."""

    def __init__(self, observer: Observer, belief: ValveBelief, op: float, stuck: bool) -> None:
        self.observer = observer.copy()
        self.stem = belief.stem
        self.static_friction = abs(op - belief.stem)
        self._belief: ValveBelief | None = None
        if not stuck:
            self._belief = ValveBelief(belief.form.raised(self.static_friction))
            self._belief.settle(belief.stem)
        self.evidence, self._misfit, self._better, self._samples = 0.0, 0.0, 0, 0

    def compare(self, main: Observer, pv: FloatArray) -> None:
        self.observer.correct(pv)
        own = self.observer.misfit
        self.evidence += 0.5 * (main.misfit - own)
        self._misfit += own / len(pv)
        self._better += main.misfit > own
        self._samples += 1

    def predict(self, op: float, valve: int, stems: FloatArray, dv: FloatArray) -> None:
        if self._belief is None:
            self.static_friction = max(self.static_friction, abs(op - self.stem))
        else:
            self.stem = self._belief.apply_op(op)
        other = stems.copy()
        other[valve] = self.stem
        self.observer.predict(other, dv)

    @property
    def stayed(self) -> bool:
        settled = self._better >= SAMPLES and self.evidence >= EVIDENCE
        return settled and self._misfit <= PLAUSIBLE * self._samples

    @property
    def over(self) -> bool:
        return self.evidence <= -EVIDENCE or self._samples >= LONGEST


class SlipCheck:
    """Watches every jump of a valve whose stem position is sure.

    From the jump on, a second observer runs on the assumption that the stem stayed. When at
    least three samples fit it better, and all together by a likelihood ratio of 400 to 1, the
    stem has stayed and f_S is larger than |OP − χ| was. It must also fit well by itself: with
    a wrong process neither does. Without a first sure slip an unknown start position would
    explain as much, so nothing is checked before.
    """

    def __init__(self, valves: int) -> None:
        """Start with nothing to check in any of ``valves``."""
        self._rivals: list[list[_Rival]] = [[] for _ in range(valves)]

    def drop(self) -> None:
        """Forget what is being checked."""
        self._rivals = [[] for _ in self._rivals]

    def correct(self, main: Observer, pv: FloatArray) -> Stayed | None:
        """Take in the measurement that ``main`` has just taken in; return what it settles."""
        for j, rivals in enumerate(self._rivals):
            for rival in rivals:
                rival.compare(main, pv)
            settled = [rival for rival in rivals if rival.stayed]
            if settled:
                best = max(settled, key=lambda rival: rival.evidence)
                self.drop()
                return Stayed(j, best.static_friction, best.stem, best.observer)
            self._rivals[j] = [rival for rival in rivals if not rival.over]
        return None

    def begin(self, valve: int, observer: Observer, belief: ValveBelief, op: float) -> None:
        """Begin when ``op``, %, is about to move ``valve`` from where ``belief`` has it."""
        slips = belief.form.slips(belief.stem, op) and belief.expected(op) != belief.stem
        if not self._rivals[valve] and belief.sure and slips:
            self._rivals[valve] = [_Rival(observer, belief, op, stuck) for stuck in (False, True)]

    def predict(self, op: FloatArray, stems: FloatArray, dv: FloatArray) -> None:
        """Apply ``op`` (m,), which moves the stems to ``stems`` (m,) if all is as believed."""
        for j, rivals in enumerate(self._rivals):
            for rival in rivals:
                rival.predict(float(op[j]), j, stems, dv)
