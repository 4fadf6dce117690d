"""The workflow: gate, measure, where, score, decide, say, add, look again."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.discrepancy.candidates import Candidate, figures_of
from stiction_ros.discrepancy.catalogue_scores import (
    Progress,
    Scores,
    all_candidates,
    score_candidates,
)
from stiction_ros.discrepancy.chance import stored_threshold
from stiction_ros.discrepancy.controller_check import ControllerCheck, check_controller
from stiction_ros.discrepancy.data_effects import add_data_effects, corrected
from stiction_ros.discrepancy.decide import (
    FRICTION,
    Decision,
    GapVerdict,
    decide,
    friction_kind,
)
from stiction_ros.discrepancy.extend import (
    AddedEffect,
    Extension,
    base_beside,
    extend,
    left_open,
    moved_away,
    run_with,
)
from stiction_ros.discrepancy.free_intervals import with_free_process
from stiction_ros.discrepancy.free_process import in_doubt_of_place, score_with_free_process
from stiction_ros.discrepancy.free_run import FreeRun, Runs
from stiction_ros.discrepancy.gate import DataFinding, open_gate
from stiction_ros.discrepancy.long_records import liveliest_parts
from stiction_ros.discrepancy.measure import closed_share, measure_gap
from stiction_ros.discrepancy.measured_stem import not_contradicted
from stiction_ros.discrepancy.options import GapOptions
from stiction_ros.discrepancy.process_refit import (
    longest_delay,
    refit_process,
    with_common_rows,
)
from stiction_ros.discrepancy.results import Discrepancy, FoundEffect, Look
from stiction_ros.discrepancy.say import experiment_for, overall
from stiction_ros.discrepancy.search import Baseline, CandidateFit, fit_candidate
from stiction_ros.discrepancy.testable import Testable, testable_effects
from stiction_ros.discrepancy.uncertainty import (
    Intervals,
    bootstrap_intervals,
    chance_threshold,
    likelihood_intervals,
)
from stiction_ros.discrepancy.valve_candidates import departures
from stiction_ros.discrepancy.where import locate
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record


def find_discrepancy(
    model: LoopModel,
    records: Sequence[Record],
    options: GapOptions | None = None,
    progress: Progress | None = None,
) -> Discrepancy:
    """Find what the simulation of a loop misses, add it to the model and measure the gap again.

    The model is driven by the recorded OP, one change is tried at a time, and what is said is
    checked on samples that nothing was fitted to; see docs/discrepancy.md.

    Args:
        model: the loop as it is simulated now.
        records: of this loop, one or more; OP and PV at least.
        options: None for the defaults.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: records that do not fit the model, or a model whose free run grows
            without bound.

    Returns:
        The effects that the simulation lacks, their sizes, and the model with them added.

    Public as ``stiction_ros.find_gap``.

    Examples:
        >>> from stiction_ros import GapOptions, LoopModel, SetPoints
        >>> from stiction_ros import find_config, find_gap, simulate
        >>> truth = LoopModel.load(find_config("flow.loop.yaml"))
        >>> schedule = SetPoints.load(find_config("flow.set_points.yaml"), truth.outputs)
        >>> record = simulate(truth, schedule, samples=800)
        >>> found = find_gap(truth.with_ideal_valves(), [record], GapOptions(quick=True))
        >>> print(found.verdict, *[effect.effect for effect in found.effects])
        named stiction
    """
    return _Workflow(model, records, options or GapOptions(), progress).run()


class _Workflow:
    """One pass over the steps; every step leaves its result here."""

    def __init__(
        self,
        model: LoopModel,
        records: Sequence[Record],
        options: GapOptions,
        progress: Progress | None,
    ) -> None:
        self.model, self.options = model, options
        self.report = progress or (lambda share: None)
        self.begun = time.perf_counter()
        self.random = np.random.default_rng(options.seed)
        kept = liveliest_parts(records) if options.free_process else records
        runs, self.gate = open_gate(model, kept)
        self.controller: ControllerCheck = check_controller(model, runs)
        found = self.controller.finding
        self.data: list[DataFinding] = [*([found] if found else []), *self.gate.findings]
        self.runs: Runs = corrected(runs, found)
        self.bare = add_data_effects(model, self.data)
        self.longest = 0
        if options.free_process:
            self.longest = longest_delay(model)
            self.runs = with_common_rows(self.runs, model)
            self.bare = refit_process(self.bare, self.runs, self.longest)
        first = self.bare if options.free_process else model
        self.base_before = Baseline.of(FreeRun(first, self.runs))
        self.earlier: list[LoopModel] = []  # without effects, before each that was added
        self.gains: dict[tuple[str, str], float] = {}  # with the process refitted
        self.looks: list[Look] = []
        self.added: tuple[AddedEffect, ...] = ()
        self.base = self.base_before

    def run(self) -> Discrepancy:
        """Look until nothing more is found, then put the answer together."""
        testable: tuple[Testable, ...] = ()
        for k in range(self.options.most_effects):
            look, testable = self._look(k)
            self.looks.append(look)
            if not look.kept:
                break
        while self.added and moved_away(self.base_before, self.base):
            self._withdraw()
        if len(self.added) > 1 and not self.options.free_process:
            self._tell_friction_again()
        return self._result(testable)

    def _withdraw(self) -> None:
        """Take the last effect back: with it the free run is farther from PV than before."""
        self.added, self.bare = self.added[:-1], self.earlier.pop()
        self.base = Baseline.of(run_with(self.bare, self.runs, self.added))
        last = max(k for k, look in enumerate(self.looks) if look.kept)
        reason = "the free run of the held-out rows moves away from PV"
        withdrawn = dataclasses.replace(self.looks[last], kept=False, reason=reason)
        self.looks = [*self.looks[:last], withdrawn]

    def _tell_friction_again(self) -> None:
        """Test for the jump of sticky valves again, with what was found later in the model."""
        for k, effect in enumerate(self.added):
            if effect.effect not in FRICTION:
                continue
            base = self._beside(k)
            run = base.run
            rivals = [
                candidate
                for candidate in all_candidates(base)
                if candidate.place == effect.place and candidate.effect in FRICTION
            ]
            fits = sorted(
                (fit_candidate(base, run.gap, each) for each in rivals),
                key=lambda fit: -fit.evidence,
            )
            best, doubts = friction_kind(fits[0], fits, functools.partial(_departures, run))
            behaviour = best.behaviour(run)
            assert behaviour is not None
            told = AddedEffect(best, behaviour, doubts)
            self.added = (*self.added[:k], told, *self.added[k + 1 :])
        self.base = Baseline.of(run_with(self.bare, self.runs, self.added))

    def _beside(self, k: int) -> Baseline:
        """Return the baseline with all added effects but one."""
        return base_beside(self.bare, self.runs, [*self.added[:k], *self.added[k + 1 :]])

    def _look(self, k: int) -> tuple[Look, tuple[Testable, ...]]:
        share = 1.0 / (self.options.most_effects + 1)
        base = self.base if self.options.free_process else left_open(self.base, self.added)
        candidates = all_candidates(base, self.controller.clock_known)
        scores, models = self._score(
            base, candidates, lambda done: self.report((k + 0.8 * done) * share)
        )
        base = scores.base
        if self.options.quick:
            chance = stored_threshold(sum(each.inside for each in candidates))
        else:
            chance = chance_threshold(base, candidates, self.random)
        threshold = max(self.options.margin, chance)
        run = base.run
        allowed = not_contradicted(run, scores.fits)
        decision = decide(
            allowed,
            self.options.margin,
            threshold,
            functools.partial(_departures, run),
        )
        if self.options.free_process:
            decision = in_doubt_of_place(base, decision)
        testable = testable_effects(base, list(candidates), self.options.margin)
        where = locate(base)
        kept, reason = False, decision.reason
        if decision.chosen is not None and decision.inseparable:
            key = decision.chosen.candidate.key
            bare = models.get(key, self.bare)
            step = self._extend(decision, bare)
            kept, reason = step.kept, step.reason
            if step.kept:
                self.earlier.append(self.bare)
                self.added, self.base, self.bare = step.added, step.base, bare
                if models:
                    self.gains[key] = decision.chosen.delta_bic
        return Look(scores, decision, where, kept, reason), testable

    def _score(
        self, base: Baseline, candidates: tuple[Candidate, ...], report: Progress
    ) -> tuple[Scores, Mapping[tuple[str, str], LoopModel]]:
        """Return the scores, and the model behind each candidate where the process is free."""
        if not self.options.free_process:
            return score_candidates(base, candidates, report), {}
        found = score_with_free_process(base, candidates, self.longest, report)
        self.base = found.scores.base
        if not self.added:
            self.base_before = self.base
            self.bare = _with_process(self.bare, self.base.run.model)
        return found.scores, {
            name: _with_process(self.bare, refitted) for name, refitted in found.models.items()
        }

    def _extend(self, decision: Decision, bare: LoopModel) -> Extension:
        chosen = decision.chosen
        assert chosen is not None
        behaviour = chosen.behaviour(self.base.run)
        assert behaviour is not None
        new = AddedEffect(chosen, behaviour, decision.alternatives)
        return extend(bare, self.runs, self.added, new, self.base)

    def _intervals(self, k: int, effect: AddedEffect) -> Intervals:
        base = self._beside(k)
        found = self._given_process(k, effect, base)
        if not self.options.free_process:
            return found
        return with_free_process(found, base, effect.fit, self.longest)

    def _given_process(self, k: int, effect: AddedEffect, base: Baseline) -> Intervals:
        if self.options.quick:
            return likelihood_intervals(base, effect.fit)
        done = self.options.most_effects / (self.options.most_effects + 1)
        part = (1.0 - done) / len(self.added)
        return bootstrap_intervals(
            base,
            effect.fit,
            self.options.resamples,
            self.random,
            lambda share: self.report(done + (k + share) * part),
        )

    def _result(self, testable: tuple[Testable, ...]) -> Discrepancy:
        before, after = measure_gap(self.base_before), measure_gap(self.base)
        effects = [_data_effect(finding) for finding in self.data]
        effects += [self._effect(k, effect) for k, effect in enumerate(self.added)]
        verdict, alternatives = overall(effects, self.looks, testable)
        model = self.bare
        for shown, added in zip(effects[len(self.data) :], self.added, strict=True):
            model = model.with_effect(added.place, added.behaviour, **self._provenance(shown))
        where = [sentence for look in self.looks[:1] for sentence in look.where.sentences]
        where += [
            look.decision.reason
            for look in self.looks[-1:]
            if look.decision.verdict is GapVerdict.UNKNOWN
        ]
        self.report(1.0)
        return Discrepancy(
            verdict=verdict,
            effects=tuple(effects),
            alternatives=alternatives,
            experiment=experiment_for(verdict, effects, alternatives, testable),
            where=tuple(where),
            untestable=tuple(t for t in testable if not t.testable),
            before=before,
            after=after,
            closed=closed_share(before, after) if self.added else 0.0,
            model_before=self.model,
            model_after=model,
            looks=tuple(self.looks),
            gate=self.gate,
            controller=self.controller,
            runs=self.runs,
            base_before=self.base_before,
            base_after=self.base,
            seconds=time.perf_counter() - self.begun,
            notes=(*self.gate.notes, *(n for r in self.runs.records for n in r.notes)),
        )

    def _effect(self, k: int, effect: AddedEffect) -> FoundEffect:
        verdict = GapVerdict.AMBIGUOUS if effect.alternatives else GapVerdict.NAMED
        return FoundEffect(
            effect.place,
            effect.effect,
            figures_of(effect.behaviour),
            self._intervals(k, effect),
            self.gains.get((effect.place, effect.effect), effect.fit.delta_bic),
            verdict,
            effect.alternatives,
        )

    def _provenance(self, effect: FoundEffect) -> dict[str, object]:
        return {
            "what": effect.effect,
            "at": effect.place,
            "by": "stiction gap",
            "records": [record.name for record in self.runs.records],
            "delta_bic": round(effect.delta_bic, 2),
            "verdict": effect.verdict.value,
            "alternatives": [f"{place} {name}" for place, name in effect.alternatives],
        }


def _departures(run: FreeRun, fit: CandidateFit) -> int:
    return departures(run, fit.candidate, fit.point)


def _with_process(model: LoopModel, other: LoopModel) -> LoopModel:
    """Return ``model`` with the process of ``other``."""
    document = model.to_mapping()
    document["process"] = other.to_mapping()["process"]
    return LoopModel.from_mapping(document, model.name)


def _data_effect(finding: DataFinding) -> FoundEffect:
    values = figures_of(finding.behaviour)
    return FoundEffect(
        finding.place, finding.effect, values, {}, finding.delta_bic, GapVerdict.NAMED
    )
