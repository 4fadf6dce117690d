"""The page of one loop: verdict, what helps, the signals, the notes."""

from collections.abc import Mapping, Sequence
from typing import Any

from stiction_ros.gain.advice import advice
from stiction_ros.identification import Identification
from stiction_ros.identification.answer.summary import materiality, next_step, why
from stiction_ros.pages.frame import card, framed, listed, text, words
from stiction_ros.pages.plot import SCRIPT
from stiction_ros.pages.signals import Units, all_signals, close_look
from stiction_ros.records.record import Record
from stiction_ros.survey.entry import Entry
from stiction_ros.survey.pages import words as say
from stiction_ros.texts import probability

HEADLINES = {
    "sticky": "The valve sticks",
    "backlash": "The valve has backlash",
    "healthy": "The valve is healthy",
    "undecided": "The record does not decide",
}

OPTIONS = {
    "service": "service the valve",
    "embedding": "controller that knows the friction",
    "retune": "retune",
    "leave": "leave it",
}

LIST = "../survey.html"
NO_UNIT = "PV units"  # what stands where no unit was given


def loop_page(
    entry: Entry,
    record: Record,
    found: Identification,
    gain: Mapping[str, Any] | None,
    unit: str = "",
) -> str:
    """Return the page of a loop; ``gain`` is that of ``gain --json``, ``unit`` that of PV."""
    unit = text(unit or NO_UNIT)
    headline = HEADLINES.get(entry.verdict or "", "Not judged")
    op_unit = "% of travel" if entry.op_unit == say.PERCENT else "OP's own unit"
    cycle = entry.oscillation
    cards = [
        card(words(f"friction f_S, {op_unit}"), say.figure(entry.f_s) or "–"),
        card("f<sub>S</sub> lies between", say.interval(entry.f_s_interval) or "–"),
        card(words(f"sliding friction f_D, {op_unit}"), say.figure(entry.f_d) or "–"),
        card("share of OP's movement lost to it", say.percent(entry.band_share) or "–"),
        card("probability of friction", probability(entry.probability) or "–"),
        card("the loop cycles by", text(say.cause_words(entry.cause or "none"))),
    ]
    if cycle is not None and cycle.period is not None:
        cards.append(card("period of the cycle", say.period(cycle.period)))
        cards.append(card("amplitude of the cycle", f"{say.figure(cycle.amplitude)} {unit}"))
    known = found.stem.shape == record.op.shape
    units = Units(unit, text(op_unit))
    sentence = next((o.cause.sentence for o in found.outputs if o.cause is not None), "")
    reason = found.reason
    parts = [
        f'<p><a href="{LIST}">All loops</a></p>',
        f"<h1>{text(entry.name)}: {text(headline)}</h1>",
        f'<p class="soft">{text(_span(record))}</p>',
        f'<p class="note warn">The fit is not to be trusted: {text(reason)}</p>' if reason else "",
        f"<p>{text(sentence)}</p>" if sentence else "",
        *[f"<p>{words(said)}</p>" for said in _answers(found, entry.op_unit)],
        f'<div class="cards">{"".join(cards)}</div>',
        gain_table(gain, unit, op_unit),
        close_look(record, found, units),
        all_signals(record, found.stem if known else None, units),
        _notes(entry),
    ]
    return framed(f"{entry.name}: {headline}", parts, SCRIPT)


def _answers(found: Identification, op_unit: str) -> list[str]:
    """Return what ``identify`` says of each valve: why, how much it matters, what to do next."""
    told = []
    for j, valve in enumerate(found.valves):
        said = (why(found, j), materiality(valve), f"Next: {next_step(found, j)}")
        told.append(say.in_op_unit(" ".join(filter(None, said)), op_unit))
    return told


def gain_table(gain: Mapping[str, Any] | None, unit: str, op_unit: str) -> str:
    """Return what would help as a table; nothing where it was not simulated."""
    if gain is None:
        return ""
    head = (
        *("what is done", "amplitude", "period, s", "mean |PV−SP|"),
        *("travel/h", "moves/h", "reversals/h", "how it was found"),
    )
    keys = ["amplitude", "period", "iae_per_hour"]
    keys += ["travel_per_hour", "moves_per_hour", "reversals_per_hour"]
    rows = [_gain_row("now", gain["now"], head, keys, "")]
    for option in gain["options"]:
        ends = option["interval"].get("iae_per_hour")
        between = f" Mean |PV−SP| {say.interval((ends[0], ends[1]))}." if ends else ""
        name = OPTIONS[option["what"]]
        rows.append(_gain_row(name, option, head, keys, option["note"] + between))
    titles = "".join(f"<th scope='col'>{text(title)}</th>" for title in head)
    return (
        f"<h2>What would help</h2><p>{text(advice(gain))}</p>"
        f"<p class='soft'>Amplitude and mean |PV−SP| in {unit}, travel in "
        f"{text(op_unit)}.</p><table class='list'><thead><tr>"
        f"{titles}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


def _gain_row(
    name: str, measures: Mapping[str, Any], head: Sequence[str], keys: Sequence[str], note: str
) -> str:
    cells = "".join(
        f"<td data-label='{text(label)}'>{say.figure(measures[key]) or '–'}</td>"
        for label, key in zip(head[1:], keys, strict=False)
    )
    return (
        f"<tr><th scope='row' class='t name'>{text(name)}</th>{cells}"
        f"<td class='t wordy'>{text(note)}</td></tr>"
    )


def _span(record: Record) -> str:
    whole = say.period(len(record) * record.sample_time)
    return (
        f"{len(record)} samples of {record.sample_time:g} s, {whole} of operation, were looked at."
    )


def _notes(entry: Entry) -> str:
    files = ", ".join(entry.files)
    notes = listed(entry.notes) if entry.notes else ""
    return f"<h2>Notes</h2><p class='soft'>Read from {text(files)}.</p>{notes}"
