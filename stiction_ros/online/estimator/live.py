"""The estimator of a running loop: window in, trusted friction and loop model out."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.effects import Stiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification import Identification, IdentificationOptions, OutputModel, identify
from stiction_ros.identification.friction import find_law
from stiction_ros.identification.identification_options import AUTO
from stiction_ros.loop import LoopModel
from stiction_ros.loop.member_loops import is_set_point
from stiction_ros.online.estimator.change_evidence import LEAST_ROWS, Course, Evidence, Reference
from stiction_ros.online.estimator.friction_change import (
    ChangeRule,
    ChangeStatus,
    FrictionChange,
    look_for_change,
    narrowed,
)
from stiction_ros.online.estimator.trust import TrustedFriction, TrustRule, ValveTrust, alike
from stiction_ros.online.plain_settings import FitSchedule
from stiction_ros.online.window import Window
from stiction_ros.processes import Noise, NoiseEntry
from stiction_ros.records import Record
from stiction_ros.settings import setting

LAW_METHOD = "evidence"  # search that tells a law which is left open

METHOD = "exact"  # search of the windows unless another is asked for, as it runs again and again

LAWS = ("he", "kano", "choudhury", "xch", "semi_physical", AUTO)


@dataclasses.dataclass(frozen=True)
class EstimatorSettings(FitSchedule, TrustRule, ChangeRule):
    """What the estimator looks at, when, and what it needs to be sure."""

    window: int = setting(2500, "samples in the sliding window", low=20)
    output_order: int = setting(0, "n_a of the ARX model; 0 chooses by BIC", low=0, high=20)
    input_order: int = setting(0, "n_b of the ARX model; 0 chooses by BIC", low=0, high=20)
    delay_low: int = setting(0, "smallest delay tried, samples", low=0)
    delay_high: int = setting(10, "largest delay tried, samples", low=0)
    method: str = setting(
        METHOD,
        "search of the windows: exact takes the process at its word; evidence takes several times "
        "as long and is not misled by what neighbours do to pv",
        choices=(METHOD, LAW_METHOD),
    )
    law: str = setting(
        "he",
        "friction law of the valves; auto asks each window, until friction is trusted, whether "
        "another law than he explains PV better, which takes several times as long",
        choices=LAWS,
    )

    @property
    def methods(self) -> tuple[str, ...]:
        """The searches that fits take."""
        return (LAW_METHOD, self.method) if self.law == AUTO else (self.method,)

    def options(self) -> IdentificationOptions:
        """Return the options of ``identify``; a law that has no steps is refused."""
        if self.law != AUTO and find_law(self.law).switching is None:
            raise InputError(
                f"{self.law} is not identified in a running loop: every slip hangs on the one "
                "before, so that a small error of f_S soon makes another stem",
                where="law",
                fix="identify a record by stiction identify, and give the valve to the controller",
            )
        return IdentificationOptions(
            output_order=self.output_order or None,
            input_order=self.input_order or None,
            delay=(self.delay_low, self.delay_high),
            method=self.method,
            law=self.law,
            check_columns=False,
        )


@dataclasses.dataclass(frozen=True)
class FitUpdate:
    """What one fit says and changes."""

    end: int  # last sample of the window
    identification: Identification  # the fit itself
    trusted: Mapping[str, TrustedFriction]  # trusted friction by valve after this fit
    # the loop with the trusted friction, only when it differs from before
    loop_model: LoopModel | None
    # what the window says of changes of the friction trusted before, by valve
    changes: tuple[FrictionChange, ...] = ()


@dataclasses.dataclass(frozen=True)
class _Change:
    """The last change of one valve: what it was, and the first sample behind it."""

    status: ChangeStatus
    first: int


def fit(record: Record, options: IdentificationOptions) -> Identification:
    """Run one fit; a plain function, so that a worker process can run it.

    Where the law is left open, the default search tells it, and the window is fitted by it. Where
    valves differ in their laws, what that search has found is kept.
    """
    if options.law == AUTO:
        found = identify(record, dataclasses.replace(options, method=LAW_METHOD))
        laws = {valve.law for valve in found.valves if valve.verdict.has_friction}
        if len(laws) > 1:
            return found
        options = dataclasses.replace(options, law=min(laws, default=options.first_law))
    return identify(record, options)


class LiveEstimator:
    """Keeps the window and the trust; the fit itself runs wherever its user wants.

    Per sample: :meth:`add`; when it returns a record, run :func:`fit` on it and hand the
    result to :meth:`conclude`.

    Attributes:
        settings: in force.
        loop, valves, outputs, sample_time: of the loop; seconds.
        window: the last samples.
    """

    def __init__(
        self,
        settings: EstimatorSettings,
        loop: str,
        valves: Sequence[str],
        outputs: Sequence[str],
        sample_time: float,
    ) -> None:
        """Start with an empty window; settings that no fit can use are refused."""
        settings.options()
        self.settings = settings
        self.loop, self.sample_time = loop, sample_time
        self.valves, self.outputs = tuple(valves), tuple(outputs)
        self._trust = {name: ValveTrust(settings) for name in self.valves}
        self.window = Window(loop, valves, outputs, sample_time, settings.window)
        self._published: Mapping[str, TrustedFriction] = {}
        self._last = -1
        self._reference: Reference | None = None
        self._since = 0  # first sample at which the frictions are as they are trusted
        self._course: Course | None = None  # up to that, or to the end of the last window
        self._changed: dict[str, _Change] = {}

    def retune(self, settings: EstimatorSettings) -> None:
        """Change settings from the next sample on; window and trust are kept, also when refused."""
        settings.options()
        self.settings = settings
        for trust in self._trust.values():
            trust.rule = settings
        self.window.resize(settings.window)

    @property
    def trusted(self) -> dict[str, TrustedFriction]:
        """The trusted friction of each valve that has one."""
        return {n: v.trusted for n, v in self._trust.items() if v.trusted is not None}

    def options(self) -> IdentificationOptions:
        """Return what the next fit is asked; a law that is trusted is kept."""
        laws = {friction.law for friction in self.trusted.values()}
        options = self.settings.options()
        if self.settings.law != AUTO or len(laws) != 1:
            return options
        return dataclasses.replace(self.settings, law=min(laws)).options()

    def add(self, sample: int, op: FloatArray, pv: FloatArray) -> Record | None:
        """Take in one sample, OP (m,) and PV (p,); return the window if a fit is due."""
        self._last = sample
        if not self.window.add(op, pv):
            self.restart()
        return self.window.record(sample) if self.settings.due(sample) else None

    def restart(self) -> None:
        """Empty the window, as after samples that were missed; trust is kept."""
        self.window.keep(0)
        self._since, self._course = 0, None

    def conclude(self, end: int, found: Identification, record: Record | None = None) -> FitUpdate:
        """Apply the rule of trust to the fit of the window ``record`` that ends at ``end``.

        First the window, where it is given, is asked whether a trusted friction has changed. If so,
        the new one is trusted, and the window begins anew at the change: no fit mixes the two.
        """
        known = self.trusted
        changes = () if record is None else self._look(end, record)
        happened = [c for c in changes if c.status is not ChangeStatus.UNCHANGED]
        if happened:
            self._begin_anew(end, max(happened, key=lambda c: c.samples))
        elif not self._young(end):
            self._judge(found, changes)
        trusted = self.trusted
        if record is not None and not known and trusted and self._reference is None:
            self._reference = Reference.of(found, record)
            if self._reference is not None:
                self._since, begin = end + 1, end + 1 - len(record)
                self._course = Course(begin, record.op, found.stem, record.pv)
        model = None
        if not alike(trusted, self._published):
            outputs = found.outputs
            if self._young(end) and self._reference is not None:
                outputs = tuple(output.model for output in self._reference.outputs)
            model = self.describe(FitUpdate(end, found, trusted, None), outputs)
            self._published = trusted
        return FitUpdate(end, found, trusted, model, changes)

    def _judge(self, found: Identification, changes: Sequence[FrictionChange]) -> None:
        """Let the rule of trust judge a window that speaks of no change.

        What is not settled, or doubted, stays as it is, as does the OP of an outer loop, whose
        valve shows the friction of an inner one. Where the trusted friction explains the window,
        the window only narrows it.
        """
        kept = {name for name, friction in self.trusted.items() if not friction.settled}
        kept |= {change.valve for change in changes if change.doubted}
        firm = {change.valve for change in changes if change.explained}
        for valve in found.valves:
            if valve.name not in kept and not is_set_point(valve.name):
                self._trust[valve.name].update(valve, valve.name in firm)

    def _young(self, end: int) -> bool:
        """Return whether too few samples follow the last change for a fit to count."""
        first = max((change.first for change in self._changed.values()), default=None)
        return first is not None and end + 1 - first < self.settings.fit_first

    def _look(self, end: int, record: Record) -> tuple[FrictionChange, ...]:
        """Return what the window says of changes; narrow what is not settled."""
        trusted = self.trusted
        if self._reference is None or not trusted or not self.settings.change_moves:
            return ()
        evidence = self._evidence(self._reference, end, record)
        if evidence is None:
            return ()
        changes = []
        for name, friction in trusted.items():
            j = self.valves.index(name)
            if friction.settled:
                changes.append(look_for_change(self.settings, evidence, j, friction))
            else:
                change = self._changed.get(name)
                since = change is not None and change.first >= end + 1 - len(record)
                whole = since and evidence.first > 0
                self._trust[name].renew(narrowed(evidence, j, friction, whole=whole))
        return tuple(changes)

    def _evidence(self, reference: Reference, end: int, record: Record) -> Evidence | None:
        """Return the evidence of a window, from where its stems are known; None if nowhere."""
        begin = end + 1 - len(record)
        first = max(self._since, begin)
        if first > end:
            return None
        record = record.part(first - begin, len(record))
        before = None if self._course is None else self._course.before(first)
        stem, sure = record.op.copy(), 0
        laws: dict[int, Stiction] = {}
        for name, friction in self.trusted.items():
            j = self.valves.index(name)
            u, law = record.op[:, j], laws.setdefault(j, friction.behaviour())
            if before is not None:
                stem[:, j] = law.simulate(u, float(before.stem[-1, j]))
                continue
            reach = friction.static_friction
            tried = [law.simulate(u, float(u[0]) + s * reach) for s in (-1.0, 0.0, 1.0)]
            apart = np.flatnonzero(np.ptp(tried, axis=0))
            stem[:, j] = tried[1]
            sure = max(sure, int(apart[-1]) + 1 if len(apart) else 0)
        if len(stem) - sure < LEAST_ROWS:
            return None
        course, lead = Course(first + sure, record.op[sure:], stem[sure:], record.pv[sure:]), 0
        if before is not None:
            joined = (np.vstack(pair) for pair in zip(before[1:], course[1:], strict=True))
            course, lead = Course(before.begin, *joined), len(before.op)
        self._course = course
        return Evidence(reference, course.op, course.stem, course.pv, laws, lead)

    def _begin_anew(self, end: int, change: FrictionChange) -> None:
        """Trust what a change has left, and let the window begin with it."""
        first = end + 1 - change.samples
        self._trust[change.valve].renew(change.friction)
        self._changed[change.valve] = _Change(change.status, first)
        self._since = first
        self._course = None if self._course is None else self._course.before(first)
        self.window.keep(self._last + 1 - first)

    def describe(
        self, update: FitUpdate, outputs: Sequence[OutputModel] | None = None
    ) -> LoopModel:
        """Return the loop as a fit found it, or with other outputs, and the trusted friction."""
        found, trusted = update.identification, update.trusted
        valves = []
        for name in self.valves:
            friction = trusted.get(name)
            effects = [] if friction is None else [friction.behaviour().to_mapping()]
            valves.append({"name": name, "effects": effects})
        models = found.outputs if outputs is None else outputs
        equations = (one.equation(Noise(one.noise_std, NoiseEntry.EQUATION)) for one in models)
        provenance = [
            self._provenance(name, update, found.samples)
            for name in self.valves
            if name in trusted or name in self._changed
        ]
        return LoopModel.from_mapping(
            {
                "loop": self.loop,
                "sample_time": self.sample_time,
                "valves": valves,
                "process": {"kind": "arx", "outputs": [one.to_mapping() for one in equations]},
                "provenance": provenance,
            },
            f"model identified for {self.loop}",
        )

    def _provenance(self, name: str, update: FitUpdate, samples: int) -> dict[str, Any]:
        """Return where the friction of one valve comes from."""
        entry: dict[str, Any] = {
            "valve": name,
            "effect": "stiction",
            "from": f"window of {samples} samples ending at sample {update.end}",
        }
        change, friction = self._changed.get(name), update.trusted.get(name)
        if change is not None:
            entry["change"] = change.status.value
            entry["last_samples"] = update.end + 1 - change.first
        if friction is None:
            return entry | {"f_s_interval": [0.0, 0.0], "f_d_interval": [0.0, 0.0]}
        entry["f_s_interval"] = list(friction.offered_interval)
        entry["f_d_interval"] = list(friction.dynamic_interval)
        if not friction.settled:
            entry["f_s_possible"] = list(friction.static_interval)
        return entry
