"""The workflow: gate, measure, where, score, decide, say, add, look again."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.discrepancy.answer.closing import Ended, closing
from stiction_ros.discrepancy.answer.results import Discrepancy, Look
from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.candidate.valve import departures
from stiction_ros.discrepancy.data.controller_check import ControllerCheck, check_controller
from stiction_ros.discrepancy.data.effects import add_data_effects, corrected
from stiction_ros.discrepancy.data.gate import DataFinding, open_gate
from stiction_ros.discrepancy.data.long_records import liveliest_parts
from stiction_ros.discrepancy.decision.chance import stored_threshold
from stiction_ros.discrepancy.decision.decide import (
    FRICTION,
    Decision,
    confirmed,
    decide,
    friction_kind,
    large_enough,
)
from stiction_ros.discrepancy.decision.extend import (
    AddedEffect,
    Extension,
    base_beside,
    extend,
    has_friction,
    left_open,
    moved_away,
    refit_together,
    run_with,
)
from stiction_ros.discrepancy.decision.measured_stem import not_contradicted, told_by_stem
from stiction_ros.discrepancy.decision.scores import (
    Progress,
    Scores,
    all_candidates,
    score_candidates,
)
from stiction_ros.discrepancy.decision.testable import Testable, testable_effects
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.search import CandidateFit, fit_candidate
from stiction_ros.discrepancy.fit.uncertainty import chance_threshold
from stiction_ros.discrepancy.gap.where import locate
from stiction_ros.discrepancy.options import GapOptions
from stiction_ros.discrepancy.process.change import ProcessChange
from stiction_ros.discrepancy.process.free_process import in_doubt_of_place, score_with_free_process
from stiction_ros.discrepancy.process.refit import (
    longest_delay,
    refit_process,
    with_common_rows,
    without_noise,
)
from stiction_ros.discrepancy.simulation.free_run import FreeRun, Runs
from stiction_ros.discrepancy.wholes import (
    Mended,
    Whole,
    best_whole,
    best_with_process,
    price_of,
    same_thing,
    suspicious,
    whole,
    with_process,
    without_outliers,
)
from stiction_ros.effects import about
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record

BEHIND = 3  # effects that are tried behind another process where none was found


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
            self.bare = without_noise(self.bare)
            self.bare = refit_process(self.bare, self.runs, self.longest)
        first = self.bare if options.free_process else model
        self.base_before = Baseline.of(FreeRun(first, self.runs))
        self.earlier: list[LoopModel] = []  # without effects, before each that was added
        self.gains: dict[tuple[str, str], float] = {}  # with the process refitted
        self.looks: list[Look] = []
        self.added: tuple[AddedEffect, ...] = ()
        self.base = self.base_before
        self.given = self.bare  # its process as it was given
        self.changes: tuple[ProcessChange, ...] = ()
        self.opened = 0  # the first look at the process as it is now

    def run(self) -> Discrepancy:
        """Look until nothing more is found, then put the answer together."""
        testable = self._look_on()
        if not self.options.free_process:
            self._compare_wholes()
            if self._mend_process():
                testable = self._look_on()
                self._compare_wholes()
            if len(self.added) > 1 or self.changes:
                self._tell_friction_again()
        return closing(self._ended(testable))

    def _look_on(self) -> tuple[Testable, ...]:
        """Look until nothing more is found; return what the last look could have seen."""
        testable: tuple[Testable, ...] = ()
        for k in range(len(self.added), self.options.most_effects):
            look, testable = self._look(k)
            self.looks.append(look)
            if not look.kept:
                break
        while self.added and self.earlier and moved_away(self.base_before, self.base):
            self._withdraw()
        return testable

    def _mend_process(self) -> bool:
        """Change the given process where that, beside fewer effects, explains more.

        A model that was fitted to another record is never exact: what its errors leave looks
        like effects. Effects that have a name give way to it by the margin only.
        """
        if not suspicious(self.base):
            return False
        margin = self.options.margin
        now = whole(self.bare, self.runs, self.added)
        behind = [] if self.added else self._singles()[:BEHIND]
        found = best_with_process(self.given, self.runs, self.added, behind, margin)
        due = margin if self.added else 0.0
        if found is None or found.worth >= now.worth(margin) + self._price(now) - due:
            return False
        if same_thing(found.changed.changes, [each.effect for each in self.added]):
            return False
        self.bare, self.changes = found.changed.model, found.changed.changes
        self.added = found.whole.effects if self.added else ()  # else the looks have to find it
        self.base = Baseline.of(run_with(self.bare, self.runs, self.added))
        self.earlier, self.opened = [], len(self.looks)
        return True

    def _process_first(self, scores: Scores) -> bool:
        """Change the process before an effect is added that explains less than that.

        The larger of two is found first, whichever it is: what a model that is off leaves
        behind every move looks like steps.
        """
        if self.options.free_process or not suspicious(self.base):
            return False
        margin = self.options.margin
        now = whole(self.bare, self.runs, self.added)
        found = with_process(self.given, self.runs, self.added, margin)
        inside = [fit for fit in scores.fits if fit.candidate.inside and fit.evidence > 0.0]
        best = max(inside, key=lambda fit: fit.evidence, default=None)
        gained = 0.0 if best is None else best.evidence
        if found is None or found.worth >= now.worth(margin) - gained:
            return False
        if best is not None and same_thing(found.changed.changes, [best.candidate.effect]):
            return False
        self._take(found)
        return True

    def _change_again(self) -> None:
        """Fit the changes of the process again beside what was found since."""
        margin = self.options.margin
        now = whole(self.bare, self.runs, self.added)
        found = with_process(self.given, self.runs, self.added, margin)
        if found is not None and found.worth < now.worth(margin) + self._price(now):
            self._take(found)

    def _take(self, found: Mended) -> None:
        self.bare, self.changes = found.changed.model, found.changed.changes
        self.added, self.base = found.whole.effects, found.whole.base
        self.earlier = []

    def _price(self, now: Whole) -> float:
        """Return what the changes of the process cost an explanation."""
        rows = max(fit.rows for fit in now.base.noise)
        return price_of(self.changes, rows, self.options.margin)

    def _singles(self) -> list[AddedEffect]:
        """Return the effects that explain most alone, the process as it is now."""
        look = self.looks[min(self.opened, len(self.looks) - 1)]
        found = []
        for fit in sorted(look.scores.fits, key=lambda fit: -fit.evidence):
            behaviour = fit.behaviour(look.scores.base.run)
            if behaviour is not None and fit.evidence > 0.0 and large_enough(fit):
                found.append(AddedEffect(fit, behaviour, fit.candidate.twins))
        return found

    def _compare_wholes(self) -> None:
        """Keep the best whole explanation: a part of what was found, or one effect alone."""
        singles = [each for each in self._singles() if confirmed(each.fit)]
        best = best_whole(self.bare, self.runs, self.added, singles, self.options.margin)
        self.added, self.base = best.effects, best.base
        kept = without_outliers(self.added, self.runs.sample_time)
        if len(kept) < len(self.added):
            self.added = tuple(refit_together(self.bare, self.runs, kept))
            self.base = Baseline.of(run_with(self.bare, self.runs, self.added))

    def _ended(self, testable: tuple[Testable, ...]) -> Ended:
        return Ended(
            model=self.model,
            options=self.options,
            gate=self.gate,
            controller=self.controller,
            data=tuple(self.data),
            runs=self.runs,
            bare=self.bare,
            changes=self.changes,
            longest=self.longest,
            before=self.base_before,
            base=self.base,
            added=self.added,
            gains=self.gains,
            looks=tuple(self.looks),
            testable=testable,
            random=self.random,
            report=self.report,
            begun=self.begun,
        )

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
            if about(effect.effect).family != FRICTION:
                continue
            base = self._beside(k)
            run = base.run
            rivals = [
                candidate
                for candidate in all_candidates(base)
                if candidate.place == effect.place and candidate.about.family == FRICTION
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
        if not self.changes and self._process_first(scores):
            return self._look(k)
        if self.options.quick:
            chance = stored_threshold(sum(each.inside for each in candidates))
        else:
            chance = chance_threshold(base, candidates, self.random)
        threshold = max(self.options.margin, chance)
        run = base.run
        allowed = [
            fit for fit in not_contradicted(run, scores.fits) if not has_friction(self.added, fit)
        ]
        decision = decide(
            allowed,
            self.options.margin,
            threshold,
            functools.partial(_departures, run),
        )
        if self.options.free_process:
            decision = in_doubt_of_place(base, decision)
        decision = told_by_stem(run, decision, allowed)
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
                if self.changes:
                    self._change_again()
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


def _departures(run: FreeRun, fit: CandidateFit) -> int:
    return departures(run, fit.candidate, fit.point)


def _with_process(model: LoopModel, other: LoopModel) -> LoopModel:
    """Return ``model`` with the process of ``other``."""
    document = model.to_mapping()
    document["process"] = other.to_mapping()["process"]
    return LoopModel.from_mapping(document, model.name)
