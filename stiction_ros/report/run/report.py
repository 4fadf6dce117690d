"""``report.html`` of a run: what was wrong, what the swap gained, then the evidence."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stiction_ros.pages.frame import framed, listed, text, words
from stiction_ros.pages.plot import SCRIPT
from stiction_ros.records.run.events import ModeChange
from stiction_ros.records.run.log import RunLog
from stiction_ros.report.page import Cell, folded, number, percent, table, write_page
from stiction_ros.report.run import figures, identified
from stiction_ros.report.run.scoring import PhaseStatus
from stiction_ros.report.run.story import Story, summary
from stiction_ros.texts import moment, spoken

_SCORES = (
    ("amplitude", "amplitude of the cycle", ""),
    ("offset", "offset", ""),
    ("iae_per_hour", "IAE per hour", "·h/h"),
)
_WORK = (("travel", "travel, %/h"), ("moves", "moves/h"), ("reversals", "reversals/h"))


def run_page(story: Story) -> str:
    """Return the report of a run as HTML."""
    record = story.record
    kicker = (
        f"{len(record)} samples of {record.sample_time:g} s, "
        f"{spoken(len(record) * record.sample_time)} of operation"
    )
    if story.seed is not None:
        kicker += f", seed {story.seed}"
    parts = [
        f"<h1>{text(headline(story))}</h1>",
        f'<p class="soft">Loop {text(story.name)}: {text(kicker)}</p>',
        _trouble(story),
        *[f'<p class="lead">{words(line)}</p>' for line in findings(story)],
        identified.valve_cards(story.identified.get("valves", []), story),
        _gain(story),
        figures.end_of_cycle(story),
        figures.whole_run(story),
        figures.estimates(story),
        figures.step_responses(story),
        monitor_section(story.log),
        identified.process_table(story.identified.get("outputs", []), record.sample_time),
        _configuration(story),
        _notes(story),
    ]
    return framed(f"{story.name}: {headline(story)}", parts, SCRIPT)


def headline(story: Story) -> str:
    """Return the answer in one line: which valve, and what became of it."""
    verdicts = story.identified.get("valves", [])
    line = identified.verdict_line(verdicts)
    if not any(map(identified.has_friction, verdicts)):
        return line
    if story.log.swap is None:
        return f"{line}; the controller was not swapped"
    return f"{line}; the swap ended the limit cycle" if _gone(story) else f"{line}; swapped"


def findings(story: Story) -> list[str]:
    """Return what the controller did, and what became of the cycle, in a few sentences."""
    lines, found = mode_lines(story), story.phases
    if found.cycle is not None and found.status is PhaseStatus.OK:
        period = spoken(found.cycle.period * story.record.sample_time)
        lines.append(f"Before, the loop cycled with a period of {period}. {_changes(story)}")
    return lines


def mode_lines(story: Story) -> list[str]:
    """Return how the mode of the controller changed, in a few sentences."""
    lines, swap = [], story.log.swap
    if swap is not None:
        known = [
            f"{valve} f_S = {percent(swap.frictions[key])} % and "
            f"f_D = {percent(swap.frictions.get(f'{valve}.f_d'))} %"
            for valve in story.record.valves
            if (key := f"{valve}.f_s") in swap.frictions
        ]
        with_known = f", on trusting for {'; for '.join(known)}" if known else ""
        lines.append(
            f"After {moment(story.swap_time)} the controller changed from unaware to "
            f"{swap.mode} between two samples{with_known}."
        )
        lines += _later_changes(story, swap)
    elif story.log.modes:
        lines.append(f"The controller stayed {story.log.modes[-1].mode} throughout.")
    return lines


def _later_changes(story: Story, swap: ModeChange) -> list[str]:
    """Tell of changes of mode after the swap, such as a roll-back."""
    lines, mode = [], swap.mode
    for change in story.log.modes:
        if change.stamp <= swap.stamp or change.mode == mode:
            continue
        at, mode = moment(story.log.seconds(change.stamp)), change.mode
        lines.append(f"After {at} it changed to {mode}: {change.reason}.")
    return lines


def _trouble(story: Story) -> str:
    found = story.phases
    stuck = any(map(identified.has_friction, story.identified.get("valves", [])))
    if found.status is PhaseStatus.OK or (story.log.swap is None and not stuck):
        return ""
    return f'<p class="note warn">No comparison of before and after: {text(found.reason)}.</p>'


def _gone(story: Story) -> bool:
    """Tell whether every output's cycle has fallen below a fifth of what it was."""
    ratios = _amplitudes(story).values()
    return bool(ratios) and all(ratio is not None and ratio < 0.2 for ratio in ratios)


def _amplitudes(story: Story) -> dict[str, float | None]:
    """Return the amplitude of each output after the swap over that before."""
    before, after = story.phases.before, story.phases.after
    if before is None or after is None:
        return {}
    return {
        name: _ratio(after.scores[name].amplitude, before.scores[name].amplitude)
        for name in story.record.outputs
    }


def _ratio(now: float | None, was: float | None) -> float | None:
    return None if was is None or now is None or was <= 0 else float(now / was)


def _changes(story: Story) -> str:
    told = [
        f"of {name} to {100 * ratio:.0f} %"
        for name, ratio in _amplitudes(story).items()
        if ratio is not None
    ]
    return f"The swap took the amplitude {' and '.join(told)} of what it was." if told else ""


def _gain(story: Story) -> str:
    """Return the table of scores and of the work of the valves, before, after and without."""
    before, after, free = story.phases.before, story.phases.after, story.stiction_free
    if before is None:
        return ""
    phases = [phase for phase in (before, after, free) if phase is not None]
    head = ["", "", "before"]
    head += ["after", "after / before"] if after is not None else []
    head += ["without friction", "after / without"] if free is not None else []
    told: list[tuple[str, str, list[float | None]]] = [
        (name, f"{label}, {unit}{per}", [getattr(phase.scores[name], key) for phase in phases])
        for name in story.record.outputs
        for unit in [story.units.get(name, "PV units")]
        for key, label, per in _SCORES
    ]
    told += [
        (valve, label, [getattr(phase.work.get(valve), key, None) for phase in phases])
        for valve in story.record.valves
        for key, label in _WORK
    ]
    told += [
        (valve, "largest OP step, %", [phase.op_step.get(valve) for phase in phases])
        for valve in story.record.valves
    ]
    rows: list[list[Cell]] = []
    for who, label, (was, *later) in told:
        row: list[Cell] = [who, label, number(was)]
        if later:
            ratio = _ratio(later[0], was)
            kind = ""
            if ratio is not None and who not in story.record.valves:
                kind = "good" if ratio < 1 else "bad"
            row += [number(later[0]), (kind, "–" if ratio is None else f"{100 * ratio:.0f} %")]
        for ideal in later[1:]:
            ratio = _ratio(later[0], ideal)
            row += [number(ideal), "–" if ratio is None else f"{ratio:.2f}"]
        rows.append(row)
    return (
        ("<h2>What the swap changed</h2>" if after is not None else "<h2>How the loop does</h2>")
        + table(head, rows, texts=2)
        + f'<p class="soft">{text(_spans(story))}</p>'
    )


def _spans(story: Story) -> str:
    """Return which samples were compared and how the scores are defined."""
    before, after = story.phases.before, story.phases.after
    step = story.record.sample_time
    said = []
    for name, phase in (("Before", before), ("after", after)):
        if phase is not None:
            first, last = moment(phase.first * step), moment(phase.last * step)
            said.append(f"{name}: {first if phase.first else 'start'} to {last}")
    text_ = "; ".join(said) + "."
    if after is not None and story.round_samples is None:
        text_ += " The set-points do not repeat, so the two saw different moves."
    if after is not None and story.round_samples is not None:
        text_ += " Both are one whole round of the same set-point moves."
    if story.stiction_free is not None:
        text_ += (
            " Without friction: the same plant with ideal valves under the controller of before,"
            " same seed, same moves."
        )
    return text_ + (
        " Amplitude: spectral line at the cycle's period inside the set-point holds. Offset:"
        " |mean error| at the end of the holds. IAE per hour: mean |error| less the share of"
        " known measurement noise. Travel: way of the stem. Moves: samples at which it moves;"
        " without friction it follows the noise. A dash: the stem is not known."
    )


def _configuration(story: Story) -> str:
    if not story.log.configs:
        return ""
    shown = [folded(config.topic, config.text) for config in story.log.configs]
    shown += [
        folded(f"{model.topic}, version {number}", model.text)
        for number, model in enumerate(story.log.loop_models, start=1)
    ]
    return "<h2>Configuration</h2>" + "".join(shown)


def _notes(story: Story) -> str:
    notes = [*story.log.notes, *story.identified.get("model", {}).get("notes", [])]
    return f"<h2>Notes</h2>{listed(notes)}" if notes else ""


def monitor_section(log: RunLog) -> str:
    """Return every measurement of the gap with what was found; empty without a monitor."""
    looks = log.gaps.looks
    if not looks:
        return ""
    rows: list[list[Cell]] = []
    for stamp, look in looks.items():
        found = log.gaps.findings.get(stamp, {})
        outputs = look.get("outputs", {})
        rows.append(
            [
                moment(log.seconds(stamp)),
                ("bad", "grown") if look.get("grown") else "as in the baseline",
                str(found.get("text", "")) or str(look.get("failure", "")),
                ", ".join(f"{name} {_growth(one)}" for name, one in outputs.items()),
            ]
        )
    grown = sum(bool(look.get("grown")) for look in looks.values())
    said = f"The gap between loop and model was measured {len(looks)} times; "
    said += f"in {grown} of them it had grown." if grown else "it never grew."
    head = ("window ends", "gap", "found", "times the baseline’s (limit)")
    return f"<h2>The monitor</h2><p>{words(said)}</p>" + table(head, rows, texts=3)


def _growth(look: Mapping[str, Any]) -> str:
    gap, baseline, limit = (look.get(key) for key in ("gap", "baseline", "limit"))
    share = gap / baseline if isinstance(gap, float) and baseline else None
    return f"{number(share)} ({number(limit)})"


def report_run(
    story: Story, out: str | Path, seconds: float | None = None
) -> tuple[Path, dict[str, Any]]:
    """Write ``report.html`` and ``summary.json`` of a run into a folder, or the page alone.

    Returned are the page and the mapping of the summary, with the wall time where it is known.
    """
    told = summary(story, seconds)
    return write_page(out, run_page(story), told), told
