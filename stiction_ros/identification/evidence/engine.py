"""Identification by evidence: friction first, under any smooth process, then the process."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.explanation import explained
from stiction_ros.identification.engine import order_row
from stiction_ros.identification.evidence.accepted import not_rejected
from stiction_ros.identification.evidence.candidate import Candidate
from stiction_ros.identification.evidence.echoes import echo
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.further import with_further
from stiction_ros.identification.evidence.laws import with_own_laws
from stiction_ros.identification.evidence.output_fit import OutputFit
from stiction_ros.identification.evidence.rates import (
    ALIKE,
    PRICE,
    Agreement,
    Look,
    agreement,
    liveliest,
    looks,
)
from stiction_ros.identification.evidence.response import responds
from stiction_ros.identification.evidence.sensor_hold import hold_notes
from stiction_ros.identification.evidence.unseen import Unseen
from stiction_ros.identification.evidence.verdict import (
    acquits,
    confirms,
    doubted,
    stem_is_wave,
    verdict_of,
)
from stiction_ros.identification.friction.grid import find_law
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.inference.conclusion import Findings, conclude
from stiction_ros.identification.inference.verdict import (
    half_gains,
    is_deadband,
)
from stiction_ros.identification.problem.models import (
    Data,
    Model,
    linear_model,
    refit,
    settle_delays,
    stem_of,
)
from stiction_ros.identification.problem.preparation import prepare, windows
from stiction_ros.identification.result.identification import (
    Identification,
    OrderRow,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.identification.result.stability import Look as View
from stiction_ros.identification.result.stability import Stability, halves
from stiction_ros.records.record import Record
from stiction_ros.signals.autoregression import innovations

Progress = Callable[[float], None]


def identify_by_evidence(
    record: Record,
    options: IdentificationOptions | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify friction by its evidence, and linear dynamics for the stems that it gives.

    Args:
        record: what was measured.
        options: None for the defaults; of ``delay`` the lower end alone plays a part in the
            search for friction, which needs no order either.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: a record that no model can be fitted to, or an unknown law.
    """
    begun = time.perf_counter()
    options = options or IdentificationOptions()
    report = progress or (lambda share: None)
    data = prepare(record, options)
    report(0.02)
    part = liveliest(record)
    seen, told = with_own_laws(looks(part, options), options)
    report(0.7)
    found = answered(record, data, part, seen, options)
    report(1.0)
    notes = [
        f"friction of {v}: {said}" for v, said in zip(record.valves, told, strict=True) if said
    ]
    found = dataclasses.replace(found, notes=(*found.notes, *hold_notes(part), *notes))
    return dataclasses.replace(found, seconds=time.perf_counter() - begun)


def answered(
    record: Record, data: Data, part: Record, seen: tuple[Look, ...], options: IdentificationOptions
) -> Identification:
    """Return what is concluded of what the rates show.

    Args:
        record, data: the whole, and made ready.
        part: of it that was looked at.
        seen: each rate of that.
        options: of the search.
    """
    valves = tuple(
        _judged(part, seen, j, options, agreement(seen, j)) for j in range(len(part.valves))
    )
    heard = _Heard(record, data, part, data if part is record else prepare(part, options), options)
    looped = heard.confirmed(seen, heard.without_waves(seen, valves))
    looped = heard.acquitted(seen, looped)
    judged = tuple(
        dataclasses.replace(doubted(valve), responds=responds(seen, j, options.confidence))
        for j, valve in enumerate(looped.valves)
    )
    surest = max(judged, key=lambda valve: valve.evidence["delta_bic"])
    return dataclasses.replace(
        looped,
        valves=judged,
        row_samples=round(surest.evidence["rate"]),
    )


@dataclasses.dataclass(frozen=True)
class _Heard:
    """A record, and the part of it that is searched, which may be all of it.

    Attributes:
        record, data: the whole, and made ready.
        part, small: the part, and made ready.
        options: of the search.
    """

    record: Record
    data: Data
    part: Record
    small: Data
    options: IdentificationOptions

    def looped(self, valves: tuple[ValveEstimate, ...]) -> Identification:
        """Return the process for the stems of these valves, and their loops closed again."""
        model, table = _process(self.small, self.options, valves, self.part)
        if self.part is not self.record:
            valves, model = _over_all(self.record, self.data, valves, model)
        findings = Findings(model, valves, table, (), None)
        concluded = conclude(self.record, self.data, findings, 0.0)
        return explained(self.record, dataclasses.replace(concluded, method="evidence"))

    def without_waves(
        self, seen: tuple[Look, ...], valves: tuple[ValveEstimate, ...]
    ) -> Identification:
        """Return :meth:`looped`, by frictions behind which no wave is left where there are such.

        A wave that enters behind a valve is there whatever its friction is: one that another
        friction takes away, which the record does not reject, was left by the first.
        """
        best = self.looped(valves)
        for j, valve in enumerate(best.valves):
            if not (valve.verdict.has_friction and stem_is_wave(valve)):
                continue
            look = agreement(seen, j).look
            for other in not_rejected(look.found, j, self.options.confidence)[1:]:
                tried = list(valves)
                tried[j] = _at(valves[j], other, look, self.part)
                found = self.looped(tuple(tried))
                if not stem_is_wave(found.valves[j]):
                    valves, best = tuple(tried), found
                    break
        return best

    def confirmed(self, seen: tuple[Look, ...], found: Identification) -> Identification:
        """Return ``found``, with frictions that one rate shows alone and their loop confirms.

        A record that is slower than its controller shows nothing in means of samples. Then the
        loop is the second witness: closed again it moves as recorded, less without the friction,
        and nothing else explains that it moves. Beside a wave from outside it is none, as that
        moves with any stem.
        """
        if any(look.wave_gain is not None for look in seen):
            return found
        best = found
        for j, valve in enumerate(found.valves):
            if valve.verdict is not VerdictKind.UNDECIDED:
                continue
            shown = [one for look in seen if (one := Agreement.alone(look, j)).gain > 0.0]
            for one in sorted(shown, key=lambda agreed: -agreed.gain):
                if not (one.look.carries_news and one.held):
                    continue
                tried = list(best.valves)
                tried[j] = _judged(self.part, seen, j, self.options, one)
                if not tried[j].verdict.has_friction:
                    continue
                again = self.looped(_by_loop(tried, j))
                if confirms(again, j):
                    best = again
                    break
        return best

    def acquitted(self, seen: tuple[Look, ...], found: Identification) -> Identification:
        """Return ``found``, undecided valves healthy whose loop moves as recorded without friction.

        What else explains the movement has to do so beside valves that follow OP, too.
        """
        best = found
        for j, valve in enumerate(found.valves):
            if valve.verdict is not VerdictKind.UNDECIDED or not acquits(best, seen, j):
                continue
            tried, agreed = list(best.valves), agreement(seen, j)
            tried[j] = _judged(self.part, seen, j, self.options, agreed, VerdictKind.HEALTHY)
            again = self.looped(_by_loop(tried, j))
            if acquits(again, seen, j):
                best = again
        return best


def _by_loop(valves: Sequence[ValveEstimate], valve: int) -> tuple[ValveEstimate, ...]:
    """Return estimates, of which that of one valve says that its loop is a witness."""
    told = list(valves)
    told[valve] = dataclasses.replace(
        told[valve], evidence={**told[valve].evidence, "by_loop": 1.0}
    )
    return tuple(told)


def _at(valve: ValveEstimate, other: Candidate, look: Look, record: Record) -> ValveEstimate:
    """Return an estimate with the friction of another candidate, which its intervals hold."""
    j = record.valves.index(valve.name)
    span = float(look.problem.span[j])
    static, dynamic = (span * float(value) for value in other.friction[j])
    return dataclasses.replace(
        valve,
        static_friction=static,
        dynamic_friction=dynamic,
        stem_start=float(record.op[0, j]) + span * float(other.starts[j]),
        jump=0.0 if valve.jump == 0.0 else static - dynamic,
    )


def _judged(
    record: Record,
    seen: tuple[Look, ...],
    valve: int,
    options: IdentificationOptions,
    agreed: Agreement,
    verdict: VerdictKind | None = None,
) -> ValveEstimate:
    """Return the estimate of one valve at the rate of ``agreed``; its verdict may be known."""
    problem, found = agreed.look.problem, agreed.look.found
    span = float(problem.span[valve])
    held = agreed.look.accepted[valve].times(span)
    figures = evidence_of(agreed, valve)
    for look in seen:
        figures[f"gain_{look.problem.rate}"] = look.accepted[valve].gain
        if look.wave_gain is not None:
            figures[f"wave_{look.problem.rate}"] = look.wave_gain
        figures[f"band_high_{look.problem.rate}"] = span * look.accepted[valve].band[1]
    figures["echo"] = max(echo(look.problem, look.found.without[valve]) for look in seen)
    verdict = verdict or verdict_of(figures, agreed, seen, valve, options)
    healthy = verdict is VerdictKind.HEALTHY
    unseen = Unseen(0.0, 0.0) if healthy else Unseen.of(span * problem.op[valve])
    ends = [unseen.static(held.static), unseen.dynamic(held.dynamic), unseen.band(held.band)]
    if not verdict.has_friction:
        ends = [(0.0, high) for _, high in ends]
    chosen = found.without[valve] if healthy else found.best
    static, dynamic = (span * float(value) for value in chosen.friction[valve])
    deadband = is_deadband(held.deadband_loss, held.static, held.dynamic)
    estimate = ValveEstimate(
        name=record.valves[valve],
        verdict=verdict,
        law=str(problem.laws[valve].law),
        static_friction=static,
        static_interval=ends[0],
        dynamic_friction=dynamic,
        dynamic_interval=ends[1],
        band_interval=ends[2],
        jump=0.0 if deadband else static - dynamic,
        stem_start=float(record.op[0, valve]) + span * float(chosen.starts[valve]),
        moves=int(np.count_nonzero(np.diff(chosen.stems[valve]))),
        evidence=figures,
        profile=held.profile,
        stability=_stability(seen, agreed, valve, figures, (healthy, record.sample_time)),
    )
    return with_further(estimate, problem, found, valve, options.confidence)


def _stability(
    seen: tuple[Look, ...],
    agreed: Agreement,
    valve: int,
    figures: dict[str, float],
    told: tuple[bool, float],
) -> Stability:
    """Return what every rate and both halves say; ``told`` is (healthy, s between samples)."""
    healthy, sample_time = told
    band = agreed.look.accepted[valve].band
    views = []
    for look in seen:
        held = look.accepted[valve]
        near = max(band[0], held.band[0]) <= ALIKE * min(band[1], held.band[1])
        finds = look.beyond_price(valve) > 0.0
        agrees = not finds if healthy else finds and near
        name = f"rows of {look.problem.rate * sample_time:g} s"
        shown = held.times(float(look.problem.span[valve]))
        views.append(View(name, held.gain, agrees, shown.band))
    gains = figures["half_1"], figures["half_2"]
    return Stability((*views, *halves(gains, PRICE if healthy else None)))


def evidence_of(agreed: Agreement, valve: int) -> dict[str, float]:
    """Return the named figures behind the verdict on one valve."""
    problem, found = agreed.look.problem, agreed.look.found
    best, without = found.best, found.without[valve]
    equals = [agreed.look] if agreed.tied is None else [agreed.look, agreed.tied]
    halves = np.min([_half_gains(look, valve) for look in equals], axis=0)
    return {
        "delta_bic": agreed.gain,
        "free_run_ratio": _free_run(problem, without) / _free_run(problem, best),
        "half_1": float(halves[0]),
        "half_2": float(halves[1]),
        "share": float(best.friction[valve, 0]),
        "moves": float(np.count_nonzero(np.diff(best.stems[valve]))),
        "rate": float(problem.rate),
        "alike": float(agreed.alike),
        "held": float(agreed.held),
        "deadband_loss": agreed.look.accepted[valve].deadband_loss,
    }


def _half_gains(look: Look, valve: int) -> tuple[float, float]:
    """Return what the friction of a valve gains in either half of the rows of a rate."""
    best, without = look.found.best, look.found.without[valve]
    return half_gains(
        (_innovations(look.problem, one), _innovations(look.problem, other))
        for one, other in zip(best.fits, without.fits, strict=True)
    )


def _innovations(problem: Problem, fit: OutputFit) -> FloatArray:
    return innovations(fit.noise, fit.rest)[problem.first :]


def _free_run(problem: Problem, candidate: Candidate) -> float:
    return float(sum(np.sum(fit.rest[problem.first :] ** 2) for fit in candidate.fits))


def _over_all(
    record: Record, data: Data, valves: tuple[ValveEstimate, ...], found: Model
) -> tuple[tuple[ValveEstimate, ...], Model]:
    """Return what a part of a record has shown for all of it, the process fitted anew.

    Where the stems were before the part is not known: they begin at OP.
    """
    first = (float(op) for op in record.op[0])
    valves = tuple(
        dataclasses.replace(valve, stem_start=op) for valve, op in zip(valves, first, strict=True)
    )
    nowhere = np.zeros(len(valves))
    model = dataclasses.replace(found, start=nowhere, stems=_stems(data, valves, nowhere))
    return valves, refit(data, model, found.fits[0].orders, warm=False)


def _stems(data: Data, valves: tuple[ValveEstimate, ...], starts: FloatArray) -> FloatArray:
    """Return the stems of valves, each by its own law, shape (m, N)."""
    stems = data.u.copy()
    for j, valve in enumerate(valves):
        if valve.static_friction > 0.0:
            further = (valve.further_values,) * len(stems)
            own = dataclasses.replace(data, law=find_law(valve.law), further=further)
            friction = np.array([valve.static_friction, valve.dynamic_friction])
            stems[j] = stem_of(own, j, friction, float(starts[j]))
    return stems


def _process(
    data: Data,
    options: IdentificationOptions,
    valves: tuple[ValveEstimate, ...],
    record: Record,
) -> tuple[Model, tuple[OrderRow, ...]]:
    """Return orders, delays and linear parts for the stems, and all orders that were tried."""
    friction = np.array([[v.static_friction, v.dynamic_friction] for v in valves])
    starts = np.array([v.stem_start for v in valves]) - record.op[0]
    stems = _stems(data, valves, starts)
    delays = ((data.delay[0],) * len(valves),) * len(data.y)
    base = Model(friction, starts, stems, delays, ())
    rivals = [(orders, linear_model(data, orders, base)) for orders in windows(options)]
    orders, best = min(rivals, key=lambda rival: rival[1].bic)
    model, _ = settle_delays(data, best, orders)
    return model, tuple(order_row(*rival) for rival in rivals)
