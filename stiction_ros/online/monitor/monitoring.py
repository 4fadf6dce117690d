"""The monitor with its model and its work, wherever that runs: in a node, a session, a replay."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from typing import Any

from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.estimator.live import FitUpdate, LiveEstimator
from stiction_ros.online.handover.hand_over import AtOnce
from stiction_ros.online.monitor.gap_finding import GapFinding, find_in_window, standing
from stiction_ros.online.monitor.gap_monitor import GapLook, GapMonitor, MonitorRule

Submit = Callable[..., "Future[Any]"]


def with_friction_of(model: LoopModel, identified: LoopModel) -> LoopModel:
    """Return ``model`` with the stiction of its valves replaced by what was identified."""
    found = {valve.name: valve.effects for valve in identified.valves}
    effects: dict[str, tuple[Behaviour, ...]] = {}
    for valve in model.valves:
        kept = [effect for effect in valve.effects if effect.effect != "stiction"]
        sticky = [e for e in found.get(valve.name, ()) if e.effect == "stiction"]
        effects[valve.name] = (*kept, *sticky)
    return model.with_valve_effects(effects)


class Monitoring:
    """A :class:`GapMonitor` that knows which model is in force and has windows looked into.

    The model is the given one with the trusted friction of the estimator, or, where none was
    given, the loop as the first fit found it and then every loop model that is published. It
    changes ``fit_latency`` samples after the end of the window it was found in, as the
    controller does.

    Attributes:
        monitor: keeps the window.
        looks, grown, runs: measurements so far, those with a grown gap, windows looked into.
        look: the last measurement, or None.
        finding: what stands of the last growth, or None.
    """

    def __init__(
        self,
        rule: MonitorRule,
        live: LiveEstimator,
        given: LoopModel | None = None,
        submit: Submit | None = None,
    ) -> None:
        """Start with the given model, or with none; that of another loop fails each measurement.

        The estimator ``live`` shares samples and fits; ``submit`` runs a function with arguments
        in another process, in order; without it they run here.
        """
        self._live, self._given, self._submit = live, given, submit or AtOnce().submit
        self.monitor = GapMonitor(rule, live.loop, live.valves, live.outputs, live.sample_time)
        self._running: deque[tuple[GapLook, Future[GapFinding]]] = deque()
        self._refusal = ""
        self.looks = self.grown = self.runs = 0
        self.look: GapLook | None = None
        self.finding: GapFinding | None = None
        if given is not None:
            self.monitor.use(given, 0)

    @property
    def running(self) -> int:
        """How many windows are being looked into."""
        return len(self._running)

    @property
    def text(self) -> str:
        """One sentence on the present state."""
        if self.look is None:
            waiting = f"no loop model yet{self._refusal}"
            return "no measurement yet" if self.monitor.has_model else waiting
        if not self.look.grown:
            return self.look.text
        found = self.finding
        if self._running or found is None:
            return f"{self.look.text}; looking for the effect"
        return f"{found.text}; {self.look.text}"

    def retune(self, rule: MonitorRule) -> None:
        """Change the rule from the next sample on; turned on again, it begins anew."""
        if rule.monitor and not self.monitor.rule.monitor:
            self.look = self.finding = None
        self.monitor.retune(rule)

    def learn(self, update: FitUpdate) -> None:
        """Take in a fit: its loop model is in force ``fit_latency`` samples after its window."""
        model = update.loop_model
        if self._given is not None:
            model = None if model is None else with_friction_of(self._given, model)
        elif model is None and not self.monitor.has_model:
            model = self._first_model(update)
        if model is not None:
            self.monitor.use(model, update.end + self._live.settings.fit_latency)

    def _first_model(self, update: FitUpdate) -> LoopModel | None:
        try:
            return self._live.describe(update)
        except InputError as error:  # a fit without a usable process
            self._refusal = f": {error}"
            return None

    def restart(self) -> None:
        """Begin a new window, as after samples that were missed."""
        self.monitor.restart()

    def add(self, sample: int, op: FloatArray, pv: FloatArray) -> GapLook | None:
        """Take in one sample, OP (m,) and PV (p,); return a measurement when one is due."""
        look = self.monitor.add(sample, op, pv)
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
