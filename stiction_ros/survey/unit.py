"""The report of several loops on one plant: whose valve it is, and what the swap did to all."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from stiction_ros.online.unit import UnitScenario
from stiction_ros.pages.frame import framed, text, words
from stiction_ros.pages.plot import SCRIPT
from stiction_ros.records.run.log import RunLog
from stiction_ros.report.page import Cell, number, table
from stiction_ros.report.run.figures import whole_run
from stiction_ros.report.run.identified import KINDS, valve_cards
from stiction_ros.report.run.report import mode_lines
from stiction_ros.report.run.scoring import Phase, PhaseStatus, errors, phases
from stiction_ros.report.run.story import Story, summary, tell
from stiction_ros.signals.oscillation import amplitude, pieces
from stiction_ros.survey.neighbours import Neighbours, is_outer, neighbours
from stiction_ros.texts import moment

UNIT_COLUMNS = (
    *("loop", "valve", "verdict", "cycles by", "period, s", "behind, s"),
    *("amplitude before", "after", "after / before"),
)


@dataclasses.dataclass(frozen=True)
class UnitReport:
    """The loops of one run, and what is said of them together."""

    name: str  # of the run
    # of the loops, by name; the phases of all are those of the first swap
    stories: Mapping[str, Story]
    swapped: str  # name of the loop whose controller was swapped first; empty where none was
    found: Neighbours  # which valve it is, from what was recorded before that swap

    @property
    def status(self) -> str:
        """``ok`` where a controller was swapped and its loop could be scored before and after."""
        if not self.swapped:
            return PhaseStatus.NO_SWAP.value
        return "ok" if (found := self.stories[self.swapped].phases).after else found.status.value


def unit_report(logs: Mapping[str, RunLog], scenario: UnitScenario) -> UnitReport:
    """Return what is said of the loops of a scenario, by their logs."""
    told = {one: tell(log, name=one) for one, log in logs.items()}
    swaps = {n: k for n, one in told.items() if (k := one.log.swap_sample) is not None}
    swapped = min(swaps, key=lambda n: swaps[n], default="")
    swap = swaps.get(swapped)
    truth = scenario.simulated.plant
    repeat = round(scenario.simulated.set_points.repeat / truth.sample_time)
    stories = {
        n: dataclasses.replace(
            one, phases=phases(one.record, swap, repeat), round_samples=repeat, truth=truth
        )
        for n, one in told.items()
    }
    found = neighbours(
        {n: one.record.part(0, swap or len(one.record)) for n, one in stories.items()}
    )
    return UnitReport(scenario.name, stories, swapped, found)


def unit_summary(report: UnitReport, seconds: float) -> dict[str, Any]:
    """Return the mapping of ``summary.json``; ``seconds`` is the wall time of the run."""
    return {
        "scenario": report.name,
        "status": report.status,
        "swapped": report.swapped,
        "neighbours": report.found.to_dict(),
        "loops": {name: summary(story, seconds) for name, story in report.stories.items()},
    }


def unit_page(report: UnitReport) -> str:
    """Return the report of several loops as HTML."""
    headline, *said = report.found.sentences
    if report.swapped:
        at = moment(report.stories[report.swapped].swap_time)
        said.append(f"After {at} the controller of {report.swapped} was swapped.")
    parts = [
        f"<h1>{text(headline)}</h1>",
        f'<p class="soft">{len(report.stories)} loops on one plant: {text(report.name)}</p>',
        *[f'<p class="lead">{words(line)}</p>' for line in said],
        table(UNIT_COLUMNS, unit_rows(report), texts=4),
        '<p class="soft">Verdict, cause and period: of what was recorded before the first swap. '
        "Amplitude: of PV − SP at this period, over pieces of a round before and one after.</p>",
    ]
    for name, story in report.stories.items():
        parts += [
            f"<h2>{text(name)}</h2>",
            *[f"<p>{words(line)}</p>" for line in mode_lines(story)],
            valve_cards(story.identified.get("valves", []), story)
            if name in report.found.sources
            else "",
            whole_run(story).replace("<h2>The whole run</h2>", ""),
        ]
    return framed(f"{report.name}: {headline}", parts, SCRIPT)


def cycle_of(story: Story, phase: Phase | None, period: float | None) -> float | None:
    """Return the amplitude of PV − SP at ``period`` (s) in a phase, engineering units.

    Moves of the set-point are within it: that of an inner loop moves all the time.
    """
    if phase is None or period is None:
        return None
    error = errors(story.record)[0][phase.first : phase.last, 0]
    samples = period / story.record.sample_time
    return amplitude(error, pieces([(0, len(error))], samples), samples)


def unit_rows(report: UnitReport) -> list[list[Cell]]:
    """Return a row for each loop: verdict, cause, period, phase behind the source, amplitudes."""
    behind = {one.name: one.behind for one in report.found.disturbed}
    by = {one.name: one.by for one in report.found.disturbed}
    rows: list[list[Cell]] = []
    for name, story in report.stories.items():
        entry, found = report.found.entries[name], story.phases
        period = None if entry.oscillation is None else entry.oscillation.period
        was, now = (cycle_of(story, phase, period) for phase in (found.before, found.after))
        verdict = "no valve" if is_outer(story.record) else entry.verdict or entry.reason
        cause = f"disturbed by {by[name]}" if name in by else entry.cause or "–"
        share = "–" if not was or now is None else f"{100 * now / was:.0f} %"
        valves = ", ".join(story.record.valves)
        cells: list[Cell] = [name, valves, (KINDS.get(verdict, ""), verdict), cause]
        rows.append([*cells, *map(number, (period, behind.get(name), was, now)), share])
    return rows
