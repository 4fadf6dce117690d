"""Where stems are recorded, they speak against effects that move them elsewhere."""

from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.candidate.valve import ValveCandidate
from stiction_ros.discrepancy.decision.decide import Decision, GapVerdict
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import FloatArray

CONFIRMED = 0.5  # of the squared distance that may be left


def not_contradicted(run: FreeRun, fits: Sequence[CandidateFit]) -> list[CandidateFit]:
    """Return the fits but for those whose stem is further from the measured one than now."""
    kept = []
    for fit in fits:
        if isinstance(fit.candidate, ValveCandidate):
            valve = fit.candidate.valve
            stems = fit.candidate.stems(run, fit.point[None, :], from_measured=True)[:, 0]
            if stem_misfit(run, valve, stems) > stem_misfit(run, valve, run.stems[:, valve]):
                continue
        kept.append(fit)
    return kept


def confirmed(run: FreeRun, fit: CandidateFit) -> bool:
    """Tell whether every record has a stem, and most of its distance from OP is that effect.

    A stem that is merely late, or smoother than OP, comes a little nearer by any bend.
    """
    candidate = fit.candidate
    if not isinstance(candidate, ValveCandidate):
        return False
    if any(record.stem is None for record in run.runs.records):
        return False
    stems = candidate.stems(run, fit.point[None, :], from_measured=True)[:, 0]
    now = stem_misfit(run, candidate.valve, run.stems[:, candidate.valve])
    return stem_misfit(run, candidate.valve, stems) < CONFIRMED * now


def told_by_stem(run: FreeRun, decision: Decision, fits: Sequence[CandidateFit]) -> Decision:
    """Return what holds of a decision where recorded stems take part in it.

    A lag is of the valve where its stem comes as late, and of nothing behind the valve; where the
    stem does not, it is none of the valve's. So with all other effects of a valve that are left in
    doubt with what lies behind it.
    """
    chosen = decision.chosen
    if chosen is None or not decision.alternatives:
        return decision
    if any(record.stem is None for record in run.runs.records):
        return decision
    names = {chosen.candidate.key, *decision.alternatives}
    at_valve = {name for name in names if name[0].startswith("valve:")}
    by_name = {fit.candidate.key: fit for fit in sorted(fits, key=lambda fit: fit.evidence)}
    borne = {name for name in at_valve if name in by_name and confirmed(run, by_name[name])}
    kept = borne or names - at_valve
    if not kept:
        return decision
    first = max((by_name[name] for name in kept if name in by_name), key=_evidence, default=None)
    if first is None:
        return decision
    others = tuple(n for n in decision.alternatives if n in kept and n != first.candidate.key)
    if chosen.candidate.key in kept and chosen is not first:
        others = (*others, chosen.candidate.key)
    verdict = GapVerdict.AMBIGUOUS if others else GapVerdict.NAMED
    reason = decision.reason if others else "the recorded stem tells it from its rivals"
    inseparable = decision.inseparable or not others
    return Decision(verdict, first, others, inseparable, reason)


def _evidence(fit: CandidateFit) -> float:
    return fit.evidence


def stem_misfit(run: FreeRun, valve: int, stems: FloatArray) -> float:
    """Return the sum of squared distances from the measured stems; 0 where none is recorded."""
    name, total = run.model.valve_names[valve], 0.0
    for record, rows in zip(run.runs.records, run.runs.slices, strict=True):
        if record.stem is not None:
            measured = record.stem[:, record.valves.index(name)]
            total += float(np.sum((stems[rows] - measured) ** 2))
    return total
