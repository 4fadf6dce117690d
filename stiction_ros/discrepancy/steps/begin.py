"""The first step: the data are judged, the model is driven by the recorded OP, rows kept back."""

import dataclasses
import time
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import toeplitz

from stiction_ros.discrepancy.data.controller_check import check_controller, unseen_of
from stiction_ros.discrepancy.data.gate import DataFinding, open_gate
from stiction_ros.discrepancy.decision.explanation import Explanation
from stiction_ros.discrepancy.decision.scores import Progress
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap_options import GapOptions
from stiction_ros.discrepancy.measures import MARGIN, NEARLY_ALL, SLIGHT, SURPRISE, TURNS
from stiction_ros.discrepancy.process.first_model import liveliest_parts
from stiction_ros.discrepancy.simulation.between import moves_on
from stiction_ros.discrepancy.simulation.free_run import PHASES, FreeRun, Runs
from stiction_ros.discrepancy.steps.state import State, Task
from stiction_ros.effects import FloatArray, TimeShift, Tuning
from stiction_ros.effects.behaviour import BoolArray
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record
from stiction_ros.signals.autoregression import whiten


def begin(
    model: LoopModel, records: Sequence[Record], options: GapOptions, progress: Progress | None
) -> tuple[Task, State]:
    """Return what the other steps are given, and what is believed before the first look.

    Raises:
        InputError: records that do not fit the model, or a model whose free run grows
            without bound.
    """
    begun = time.perf_counter()
    runs, gate = open_gate(model, liveliest_parts(records) if options.process_fitted else records)
    controller = check_controller(model, runs)
    found = controller.finding
    data = (*((found,) if found else ()), *gate.findings)
    runs = dataclasses.replace(
        corrected(runs, found),
        op=runs.op if controller.scans is None else controller.scans.op,
        scans=None if controller.scans is None else controller.scans.each(runs.op),
        unseen=unseen_of(runs, controller),
        between=() if options.process_fitted else _between(model),
    )
    base = with_surprises_fitted(without_spikes(Baseline.of(FreeRun(model, runs))))
    runs = base.run.runs
    bare = add_data_effects(model, data)
    task = Task(
        model=model,
        options=options,
        gate=gate,
        controller=controller,
        data=data,
        runs=runs,
        random=np.random.default_rng(options.seed),
        report=progress or (lambda share: None),
        begun=begun,
    )
    return task, State(given=bare, before=base, now=Explanation(bare, base))


def _between(model: LoopModel) -> tuple[bool, ...]:
    """Return per valve whether the model has nothing yet that moves its stem between samples.

    When within a sample that happens is then a matter of the effect that is found.
    """
    outputs = range(len(model.outputs))
    return tuple(not any(moves_on(model, i, j) for i in outputs) for j in range(len(model.valves)))


def corrected(runs: Runs, finding: DataFinding | None) -> Runs:
    """Return the records with a shift of PV against OP taken back; the last samples are lost."""
    if finding is None or not isinstance(finding.behaviour, TimeShift):
        return runs
    late = round(finding.behaviour.shift)
    pv, usable = runs.pv.copy(), runs.usable.copy()
    for rows in runs.slices:
        part = runs.pv[rows]
        pv[rows] = np.vstack([part[late:], np.tile(part[-1:], (late, 1))])
        usable[:, rows] = np.hstack(
            [runs.usable[:, rows][:, late:], np.zeros((len(usable), late), dtype=bool)]
        )
    return dataclasses.replace(runs, pv=pv, usable=usable)


def add_data_effects(model: LoopModel, findings: Sequence[DataFinding]) -> LoopModel:
    """Return the model with sensor effects and another tuning; a time shift is provenance alone."""
    for finding in findings:
        note = {
            "what": finding.effect,
            "at": finding.place,
            "by": "stiction gap",
            "delta_bic": round(finding.delta_bic, 2),
        }
        if finding.place != "data":
            model = model.with_effect(finding.place, finding.behaviour, **note)
            continue
        document = model.to_mapping()
        values = {key: v for key, v in finding.behaviour.to_mapping().items() if key != "effect"}
        if isinstance(finding.behaviour, Tuning):
            document["controller"] = {"kind": "pi", **values}
        document.setdefault("provenance", []).append(note | values)
        model = LoopModel.from_mapping(document, model.name)
    return model


def without_spikes(base: Baseline) -> Baseline:
    """Return the baseline without readings, one or two in a row, that are off alone."""
    rows, asked = np.arange(len(base.run.runs)), [blocks.scored for blocks in base.blocks]
    for _ in range(TURNS):  # many of them hide each other
        runs, spikes = base.run.runs, np.zeros_like(base.run.runs.usable)
        for i, usable in enumerate(runs.usable):
            # spikes near each other make the noise another than the declared one
            noises = [base.noise[i], *([base.under_declared(i)] if base.declared[i] else [])]
            for noise in noises if usable.any() else []:
                left = np.interp(rows, rows[usable], noise.residual[usable])
                scale = max(noise.innovation_std, runs.quanta[i] / SURPRISE)  # a step is no spike
                shocks = whiten(left, noise.ar) / scale
                spikes[i] |= asked[i] & usable & _alone(shocks, noise.ar)
        if not spikes.any():
            break
        alone = tuple((runs.alone + spikes.sum(axis=1)).tolist())
        runs = dataclasses.replace(runs, usable=runs.usable & ~spikes, alone=alone)
        base = Baseline.of(FreeRun(base.run.model, runs))
    return base


def _alone(shocks: FloatArray, ar: FloatArray) -> BoolArray:
    """Return which readings are off where the process is not, by innovations over σ, shape (N,).

    One that is off by w leaves the innovations w, −φ₁ w, … behind. This has to explain more than is
    ever chance, as much as a shock of the process or a step of PV, and the margin more than these
    at any of the samples beside it.

    References:
        C. Chen, L.-M. Liu, J. Am. Stat. Assoc. 88 (1993) 284-297 (additive outliers, level shifts).
    """
    found, least, reach = np.zeros(len(shocks), dtype=bool), np.zeros(len(shocks) + 1), len(ar) + 1
    back, law = whiten(shocks[::-1], ar)[::-1], np.array([1.0, *-ar, 0.0])
    step = np.cumsum(law[:-1]) / np.linalg.norm(np.cumsum(law[:-1]))
    stepped = np.correlate(np.pad(shocks, (0, len(ar))), step, "valid")
    left = np.maximum(shocks**2, stepped**2)
    around = sliding_window_view(np.pad(left, reach), reach).max(axis=1)
    for count in (1, 2):
        parts, size = sliding_window_view(back, count), len(shocks) - count + 1
        each = toeplitz([law[: len(law) - k] @ law[k:] for k in range(count)])
        gained = np.einsum("ki,ij,kj->k", parts, np.linalg.inv(each), parts)
        own = sliding_window_view(left, count).max(axis=1)
        beside = np.maximum(around[:size], around[reach + count :][:size])
        due = np.maximum(least[:-1], least[1:]) + SURPRISE**2
        off = (gained > due) & (gained > beside + MARGIN) & (gained >= (1.0 - SLIGHT) * own)
        for k in range(count):
            found[k : k + size] |= off
        least = gained
    return found


def with_surprises_fitted(base: Baseline) -> Baseline:
    """Return the baseline, other blocks kept back where those hold all of what nothing foretells.

    Behind noise that forgets nothing, the step of a level is a single innovation. Kept back, it
    tells that something happened, but neither what nor how much.
    """
    runs, beyond, phases = base.run.runs, _beyond_chance(base), []
    for r, (rows, usual) in enumerate(zip(runs.slices, runs.phases, strict=True)):
        part = beyond[rows]
        kept = {phase: float(part[runs.kept_back(r, phase)].sum()) for phase in PHASES}
        most = kept[usual] > NEARLY_ALL * float(part.sum())
        phases.append(min(kept, key=kept.__getitem__) if most else usual)
    if tuple(phases) == runs.phases:
        return base
    return Baseline.of(FreeRun(base.run.model, dataclasses.replace(runs, phases=tuple(phases))))


def _beyond_chance(base: Baseline) -> FloatArray:
    """Return by how much squared innovations exceed what is never chance, shape (N,)."""
    beyond = np.zeros(len(base.run.runs))
    for noise, blocks in zip(base.noise, base.blocks, strict=True):
        squared = (noise.innovations / noise.innovation_std) ** 2 - SURPRISE**2
        beyond += np.where(blocks.scored, np.maximum(squared, 0.0), 0.0)
    return beyond
