"""Had a jump better wait? Did the valve move? A parallel observer that assumes it did not."""

import dataclasses

import numpy as np

from stiction_ros.control.belief import ValveBelief
from stiction_ros.control.observer import Observer
from stiction_ros.effects.behaviour import FloatArray

SHARE = 0.2  # of each new innovation in the mean
DEVIATION = float(np.sqrt(SHARE / (2.0 - SHARE)))  # of the mean of white innovations
LEAN = 1.2  # of these
REST = 10  # samples after a jump, which may belong to a pair, and no pair is longer
FREE = 5  # samples after a set-point move
INNOVATION = 4.0  # standard deviations that one innovation counts for at most
SAMPLES = 3  # that must fit better without the move
EVIDENCE = 6.0  # log likelihood ratio that settles a check, 400 to 1
PLAUSIBLE = 9.0  # largest mean square of innovations, in their expected deviations
LONGEST = 30  # samples after which an undecided check is given up


class Passage:
    """A mean of the latest innovations, which leans while a disturbance is on its way.

    A plan takes the disturbance estimate for constant. While innovations lean, the estimate still
    moves towards the disturbance. A stem that jumps now has to jump again soon.
    A stem at rest then waits, ``longest`` samples at most.
    """

    def __init__(self, longest: int) -> None:
        """Begin with a mean of 0; ``longest`` 0 never waits."""
        self.longest = longest
        self._mean: FloatArray | None = None
        self._stem: FloatArray | None = None
        self._sp: FloatArray | None = None
        self._still = self._held = self._waited = 0

    def take_in(self, innovation: FloatArray) -> None:
        """Take in ``innovation``, shape (p,), in its standard deviations."""
        if not self.longest:
            return
        bounded = np.clip(innovation, -INNOVATION, INNOVATION)
        before = np.zeros_like(bounded) if self._mean is None else self._mean
        self._mean = (1.0 - SHARE) * before + SHARE * bounded

    def waits(self, stem: FloatArray, sp: FloatArray) -> bool:
        """Return whether a jump should wait now, by stems, (s,), %, and set-points, (p,)."""
        if not self.longest or not len(stem):
            return False
        rests = self._stem is not None and bool(np.abs(stem - self._stem).max() <= 1e-6)
        holds = self._sp is not None and np.array_equal(sp, self._sp)
        self._still = self._still + 1 if rests else 0
        self._held = self._held + 1 if holds else 0
        self._stem, self._sp = stem.copy(), sp.copy()
        leans = self._mean is not None and bool(np.abs(self._mean).max() > LEAN * DEVIATION)
        if not leans or self._still < REST:
            self._waited = 0
        elif self._waited < self.longest and self._held >= FREE:
            self._waited += 1
            return True
        return False


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
