"""Whether the gap between loop and model has grown, and what the windows are that show it."""

import dataclasses
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.estimator.live import FitUpdate, LiveEstimator
from stiction_ros.online.handover.hand_over import AtOnce
from stiction_ros.online.monitor import gap_measure
from stiction_ros.online.monitor.gap_finding import GapFinding, find_in_window, standing
from stiction_ros.online.window import Window
from stiction_ros.records import Record
from stiction_ros.settings import setting

Submit = Callable[..., "Future[Any]"]

HISTORY_SAMPLES = 20_000  # from which the stems of sticky valves are known


@dataclasses.dataclass(frozen=True)
class MonitorRule:
    """How a running loop is held against its model.

    Every ``monitor_period`` samples the gap of the last ``monitor_window`` samples is held
    against that of ``monitor_baseline`` samples at the beginning. It has *grown* when it
    exceeds, on any output, what a loop that does not change exceeds with the chance
    ``monitor_false_alarm`` a window, and the baseline by ``monitor_growth``. It has *gone* when
    it is within what nineteen of twenty unchanged windows show.
    """

    monitor: bool = setting(False, "compare the loop with its model and look into a grown gap")
    monitor_window: int = setting(1000, "samples whose gap is measured", low=200)
    monitor_period: int = setting(250, "samples between two measurements", low=1)
    monitor_baseline: int = setting(
        1000, "samples at the beginning with which later gaps are compared", low=200
    )
    monitor_false_alarm: float = setting(
        0.001, "chance that a window of an unchanged loop counts as grown", low=1e-12, high=0.05
    )
    monitor_growth: float = setting(
        0.1, "smallest growth that matters, share of the baseline's gap", low=0.0, high=10.0
    )

    @property
    def lead(self) -> int:
        """Fewest samples before a window, over which the stems find their places."""
        return self.monitor_window // 2


@dataclasses.dataclass(frozen=True)
class GapLook:
    """One measurement of the gap."""

    begin: int  # begin, end: first and last sample of the window
    end: int
    outputs: tuple[gap_measure.OutputLook, ...]  # empty when the window could not be used
    grown: bool  # whether the gap counts as grown now
    alarm: bool = False  # whether it has grown with this window
    failure: str = ""  # why the window could not be used, or empty
    job: tuple[LoopModel, Record] | None = None  # model and window for the workflow, or None

    @property
    def worst(self) -> gap_measure.OutputLook | None:
        """The output whose gap has grown most against its limit."""
        return max(self.outputs, key=lambda look: look.growth / look.limit, default=None)

    @property
    def text(self) -> str:
        worst = self.worst
        if worst is None:
            return self.failure
        if self.grown:
            return f"gap of {worst.name} is {worst.growth:.3g} times the baseline's"
        return "gap as in the baseline"

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping that diagnostics carry."""
        return {
            "begin": self.begin,
            "end": self.end,
            "grown": self.grown,
            "alarm": self.alarm,
            "failure": self.failure,
            "outputs": {look.name: dataclasses.asdict(look) for look in self.outputs},
        }


class GapMonitor:
    """Keeps the window and the baseline, and has windows with a grown gap looked into.

    The model is the given one with the trusted friction of the estimator, or, where none was
    given, the loop as the first fit found it and then every loop model that is published. It
    changes ``fit_latency`` samples after the end of the window it was found in, as the
    controller does.

    The baseline is a stretch of signals: another model is measured on the same one. When as many
    samples have passed under another model, they become the baseline if their gap is smaller.

    The workflow looks into the window with which the gap has grown, and into one more every
    half window while it stays so, up to the first that lies wholly behind the alarm.

    Attributes:
        model: in force; None before there is one.
        looks, grown, runs: measurements so far, those with a grown gap, windows looked into.
        look: the last measurement, or None.
        finding: what stands of the last growth, or None.
    """

    def __init__(
        self,
        rule: MonitorRule,
        loop: str,
        valves: Sequence[str],
        outputs: Sequence[str],
        sample_time: float,
        given: LoopModel | None = None,
        submit: Submit | None = None,
    ) -> None:
        """Start with an empty window, without baseline.

        A ``given`` model of another loop fails each measurement; ``submit`` runs a function with
        arguments in another process, in order; without it they run here.
        """
        self.rule = rule
        self._of = (loop, valves, outputs, sample_time)
        self._given, self._submit = given, submit or AtOnce().submit
        self._coming: list[tuple[int, LoopModel]] = [] if given is None else [(0, given)]
        self._running: deque[tuple[GapLook, Future[GapFinding]]] = deque()
        self._refusal = ""
        self.model: LoopModel | None = None
        self.looks = self.grown = self.runs = 0
        self.look: GapLook | None = None
        self.finding: GapFinding | None = None
        self._begin_anew()

    def _begin_anew(self) -> None:
        longest = max(self.rule.monitor_window, self.rule.monitor_baseline) + self.rule.lead
        self._window = Window(*self._of, max(longest, HISTORY_SAMPLES))
        self._reference: Record | None = None
        self._changed: int | None = None
        self._forget()

    def _forget(self) -> None:
        """Drop what was measured by another model."""
        self._known: tuple[gap_measure.OutputBaseline, ...] = ()
        self._grown_since: int | None = None
        self._looked_into: int | None = None

    def retune(self, rule: MonitorRule) -> None:
        """Change the rule from the next sample on; turned on or with other lengths, begin anew."""
        if rule.monitor and not self.rule.monitor:
            self.look = self.finding = None
        old, new = ((r.monitor, r.monitor_window, r.monitor_baseline) for r in (self.rule, rule))
        self.rule = rule
        if old != new:
            self._begin_anew()

    @property
    def running(self) -> int:
        """How many windows are being looked into."""
        return len(self._running)

    @property
    def text(self) -> str:
        """One sentence on the present state."""
        if self.look is None:
            return "no measurement yet" if self._has_model else f"no loop model yet{self._refusal}"
        if not self.look.grown:
            return self.look.text
        if self._running or self.finding is None:
            return f"{self.look.text}; looking for the effect"
        return f"{self.finding.text}; {self.look.text}"

    # ---- the model -------------------------------------------------------------------------

    @property
    def _has_model(self) -> bool:
        return self.model is not None or bool(self._coming)

    def use(self, model: LoopModel, sample: int) -> None:
        """Compare with ``model`` from the window on that ends at ``sample`` or later."""
        self._coming.append((sample, model))

    def learn(self, live: LiveEstimator, update: FitUpdate) -> None:
        """Take in a fit of the estimator: its loop model comes into force after the latency."""
        model = update.loop_model
        if self._given is not None:
            model = None if model is None else with_friction_of(self._given, model)
        elif model is None and not self._has_model:
            try:
                model = live.describe(update)
            except InputError as error:  # a fit without a usable process
                self._refusal = f": {error}"
        if model is not None:
            self.use(model, update.end + live.settings.fit_latency)

    # ---- samples in, measurements and findings out -----------------------------------------

    def restart(self) -> None:
        """Empty the window, as after samples that were missed; the baseline is kept."""
        self._window.keep(0)

    def add(self, sample: int, op: FloatArray, pv: FloatArray) -> GapLook | None:
        """Take in one sample, OP (m,) and PV (p,); return a measurement when one is due.

        Nothing is kept while the rule's ``monitor`` is false.
        """
        look = self._measured(sample, op, pv)
        if look is not None:
            self.looks, self.look = self.looks + 1, look
            self.grown += look.grown
            if look.alarm:
                self.finding = None
            if look.job is not None:
                self._running.append((look, self._submit(find_in_window, *look.job)))
        return look

    def collect(self) -> list[GapFinding]:
        """Return what has been found since the last call, in order."""
        found = []
        while self._running and self._running[0][1].done():
            look, future = self._running.popleft()
            try:
                new: GapFinding = future.result()
            except CancelledError:
                continue
            except Exception as error:  # one window that fails must not end the estimator
                said = str(error) if isinstance(error, InputError) else repr(error)
                said = f"window not usable: {said}"
                new = GapFinding(look.begin, look.end, None, said, (), {})
            self.runs += 1
            self.finding = standing(self.finding, new)
            found.append(new)
        return found

    def _measured(self, sample: int, op: FloatArray, pv: FloatArray) -> GapLook | None:
        while self._coming and self._coming[0][0] <= sample:
            self.model = self._coming.pop(0)[1]
            self._changed = None if self._reference is None else sample
            self._forget()
        if not self.rule.monitor:
            return None
        if not self._window.add(op, pv) or (sample + 1) % self.rule.monitor_period:
            return None
        if self._reference is None:
            self._reference = self._last(self.rule.monitor_baseline, sample)
        window = self._last(self.rule.monitor_window, sample)
        if self.model is None or self._reference is None or window is None:
            return None
        try:
            return self._look(self.model, self._reference, window, sample)
        except InputError as error:
            begin = sample + 1 - self.rule.monitor_window
            return GapLook(begin, sample, (), self._grown_since is not None, failure=str(error))

    def _last(self, count: int, sample: int) -> Record | None:
        """Return all samples that are kept; None when too few for ``count`` and their lead."""
        enough = len(self._window) >= count + self.rule.lead
        return self._window.record(sample) if enough else None

    def _look(self, model: LoopModel, reference: Record, window: Record, sample: int) -> GapLook:
        count = self.rule.monitor_baseline
        if not self._known:
            self._known = gap_measure.baseline_of(
                model, gap_measure.begun_at_stems(model, reference, count)
            )
        self._replace_baseline(model, sample)
        record = gap_measure.begun_at_stems(model, window, self.rule.monitor_window)
        outputs = gap_measure.look_at(model, record, self._known, self.rule.monitor_false_alarm)
        least = 1.0 + self.rule.monitor_growth
        if self._grown_since is None:
            if any(look.growth > max(look.limit, least) for look in outputs):
                self._grown_since, self._looked_into = sample, None
        elif all(look.growth <= look.back for look in outputs):
            self._grown_since = None
        job = (model, record) if self._is_looked_into(sample) else None
        begin = sample + 1 - len(record)
        since = self._grown_since
        return GapLook(begin, sample, outputs, since is not None, since == sample, job=job)

    def _replace_baseline(self, model: LoopModel, sample: int) -> None:
        """Take the first stretch under a changed model for the baseline if its gap is smaller."""
        count = self.rule.monitor_baseline
        if self._changed is None or sample + 1 - self._changed < count:
            return
        stretch = self._last(count, sample)
        if stretch is None:
            return
        self._changed = None
        known = gap_measure.baseline_of(model, gap_measure.begun_at_stems(model, stretch, count))
        if _size(known) < _size(self._known):
            self._reference, self._known = stretch, known

    def _is_looked_into(self, sample: int) -> bool:
        if self._grown_since is None:
            return False
        window = self.rule.monitor_window
        if self._looked_into is not None:
            over = self._looked_into >= self._grown_since + window
            if over or sample < self._looked_into + window // 2:
                return False
        self._looked_into = sample
        return True


def with_friction_of(model: LoopModel, identified: LoopModel) -> LoopModel:
    """Return ``model`` with the stiction of its valves replaced by what was identified."""
    found = {valve.name: valve.effects for valve in identified.valves}
    effects: dict[str, tuple[Behaviour, ...]] = {}
    for valve in model.valves:
        kept = [effect for effect in valve.effects if effect.effect != "stiction"]
        sticky = [e for e in found.get(valve.name, ()) if e.effect == "stiction"]
        effects[valve.name] = (*kept, *sticky)
    return model.with_valve_effects(effects)


def _size(known: Sequence[gap_measure.OutputBaseline]) -> float:
    """Return the gap of all outputs as one figure, the mean logarithm."""
    return float(np.mean([np.log(max(base.std, 1e-300)) for base in known]))
