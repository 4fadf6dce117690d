"""Identification by evidence: friction first, under any smooth process, then the process."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.closed_loop.explanation import (
    ENDLESS,
    OPEN,
    SURE,
    explained,
    is_wave_itself,
)
from stiction_ros.identification.engine import order_row
from stiction_ros.identification.evidence.accepted import not_rejected
from stiction_ros.identification.evidence.candidate import Candidate
from stiction_ros.identification.evidence.fit.output_fit import OutputFit
from stiction_ros.identification.evidence.fit.problem import Problem
from stiction_ros.identification.evidence.further import with_further
from stiction_ros.identification.evidence.rates import (
    ALIKE,
    PRICE,
    Agreement,
    Look,
    agreement,
    liveliest,
    looks,
)
from stiction_ros.identification.evidence.unseen import Unseen
from stiction_ros.identification.inference.conclusion import Findings, conclude
from stiction_ros.identification.inference.verdict import (
    half_gains,
    is_deadband,
    kind_of,
)
from stiction_ros.identification.kernels.lags import whitened
from stiction_ros.identification.options import IdentificationOptions
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

Progress = Callable[[float], None]

LEAST_GONE = 0.08  # share of OP's recorded movement that must go away with a friction
WIDER = 2.0  # of OP's movement: a wider band is not what makes it
MATERIAL = 0.03  # of the range of OP: a band up to this is none to speak of
REJECTED = 6.0
"""−2 log likelihood that all bands that would matter must lose at two rates: a twentieth of the
likelihood of none each."""
REJECTING = 2  # rates that do
SURELY = 10.0  # what they must lose where one rate alone rejects them
NOTHING = 8.0
"""What they may gain at any rate with news: as much as the best of many frictions does on noise."""


def identify(
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
    seen = looks(part, options)
    report(0.7)
    found = answered(record, data, part, seen, options)
    report(1.0)
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
    valves = tuple(_judged(part, seen, j, options) for j in range(len(part.valves)))
    heard = _Heard(record, data, part, data if part is record else prepare(part, options), options)
    looped = heard.without_waves(seen, valves)
    judged = tuple(doubted(valve) for valve in looped.valves)
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
            if not (valve.verdict.has_friction and _is_wave(valve)):
                continue
            look = agreement(seen, j).look
            for other in not_rejected(look.found, j, self.options.confidence)[1:]:
                tried = list(valves)
                tried[j] = _at(valves[j], other, look, self.part)
                found = self.looped(tuple(tried))
                if not _is_wave(found.valves[j]):
                    valves, best = tuple(tried), found
                    break
        return best


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


def _is_wave(valve: ValveEstimate) -> bool:
    """Tell whether the stem of a valve is a wave itself."""
    band_share = valve.evidence["share"] * (1.0 + valve.dynamic_friction / valve.static_friction)
    return is_wave_itself(valve.evidence, band_share)


def doubted(valve: ValveEstimate) -> ValveEstimate:
    """Return the estimate, no longer with friction where its loop says otherwise.

    A friction without which OP would move all the same is not what moves it, where the controller
    is known and the evidence not overwhelming. A stem that is a wave itself cannot be told from one
    that comes from outside. And a band that is wider than OP moves about its mean moves with its
    large moves alone, as those in manual are.
    """
    if not valve.verdict.has_friction:
        return valve
    told = valve.evidence
    known = told.get("controller_fit", 0.0) > OPEN
    endless = told.get("moved_with", 0.0) >= ENDLESS
    gone = told.get("loop_gone", 1.0) * min(told.get("moved_with", 1.0), 1.0)
    idle = known and gone < LEAST_GONE
    idle = idle and (endless or told.get("delta_bic", 0.0) < SURE)
    wide = valve.band_share > WIDER
    if not (idle or wide or _is_wave(valve)):
        return valve
    return dataclasses.replace(
        valve,
        verdict=VerdictKind.UNDECIDED,
        static_interval=(0.0, valve.static_interval[1]),
        dynamic_interval=(0.0, valve.dynamic_interval[1]),
        band_interval=(0.0, valve.sum_interval[1]),
    )


def _judged(
    record: Record, seen: tuple[Look, ...], valve: int, options: IdentificationOptions
) -> ValveEstimate:
    agreed = agreement(seen, valve)
    problem, found = agreed.look.problem, agreed.look.found
    span = float(problem.span[valve])
    held = agreed.look.accepted[valve].times(span)
    figures = evidence_of(agreed, valve)
    for look in seen:
        figures[f"gain_{look.problem.rate}"] = look.accepted[valve].gain
        if look.wave_gain is not None:
            figures[f"wave_{look.problem.rate}"] = look.wave_gain
        figures[f"band_high_{look.problem.rate}"] = span * look.accepted[valve].band[1]
    verdict = _verdict(figures, agreed, seen, valve, options)
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
        law=options.law,
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
    return whitened(fit.noise, fit.rest, float(fit.rest[0]))[problem.first :]


def _free_run(problem: Problem, candidate: Candidate) -> float:
    return float(sum(np.sum(fit.rest[problem.first :] ** 2) for fit in candidate.fits))


def _verdict(
    figures: dict[str, float],
    agreed: Agreement,
    seen: tuple[Look, ...],
    valve: int,
    options: IdentificationOptions,
) -> VerdictKind:
    held = agreed.look.accepted[valve]
    slips = figures["moves"] >= options.min_moves
    if figures["delta_bic"] > 0.0 and agreed.alike and held.band[0] > MATERIAL:
        both = min(figures["half_1"], figures["half_2"]) > 0.0
        kind = kind_of(held.deadband_loss, held.static, held.dynamic)
        return kind if both and slips else VerdictKind.UNDECIDED
    return VerdictKind.HEALTHY if slips and _harmless(seen, valve) else VerdictKind.UNDECIDED


def _harmless(seen: tuple[Look, ...], valve: int) -> bool:
    """Tell whether the record rejects all bands that would matter: at two rates, or surely at one.

    A rate that takes something else for the process rejects nothing, as neither do rows that are
    drawn between reports; and what such rows say for friction is not believed before it is sure.
    """
    if any(look.accepted[valve].material_gain > look.price + SURE for look in seen):
        return False
    gains = [look.accepted[valve].material_gain for look in seen if look.carries_news]
    lost = [-look.accepted[valve].material_gain for look in seen if look.sees_process(valve)]
    twice = sum(one >= REJECTED for one in lost) >= REJECTING
    surely = max(lost, default=0.0) >= SURELY
    return max(gains, default=PRICE) < NOTHING and (twice or surely)


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
    stems = data.u.copy()
    for j in np.flatnonzero(found.friction[:, 0]):
        stems[j] = stem_of(data, int(j), found.friction[j], 0.0)
    nowhere = np.zeros(len(stems))
    model = dataclasses.replace(found, start=nowhere, stems=stems)
    return valves, refit(data, model, found.fits[0].orders, warm=False)


def _process(
    data: Data,
    options: IdentificationOptions,
    valves: tuple[ValveEstimate, ...],
    record: Record,
) -> tuple[Model, tuple[OrderRow, ...]]:
    """Return orders, delays and linear parts for the stems, and all orders that were tried."""
    friction = np.array([[v.static_friction, v.dynamic_friction] for v in valves])
    starts = np.array([v.stem_start for v in valves]) - record.op[0]
    if data.further:
        told = zip(valves, data.further, strict=True)
        held = tuple(tuple(valve.further.values()) or first for valve, first in told)
        data = dataclasses.replace(data, further=held)
    stems = data.u.copy()
    for j in np.flatnonzero(friction[:, 0]):
        stems[j] = stem_of(data, int(j), friction[j], float(starts[j]))
    delays = ((data.delay[0],) * len(valves),) * len(data.y)
    base = Model(friction, starts, stems, delays, ())
    rivals = [(orders, linear_model(data, orders, base)) for orders in windows(options)]
    orders, best = min(rivals, key=lambda rival: rival[1].bic)
    model, _ = settle_delays(data, best, orders)
    return model, tuple(order_row(*rival) for rival in rivals)
