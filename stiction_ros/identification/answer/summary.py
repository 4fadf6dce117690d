"""An identification for people: as text, as a table of HTML, as a table of rich."""

import html
import math
import textwrap
from collections.abc import Iterator
from typing import Any

from stiction_ros.identification.answer.words import cycle, materiality, next_step, why
from stiction_ros.identification.result.identification import (
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.texts import plural, probability, spoken

WIDTH = 80
"""Columns of a terminal."""

NOTES = 3
"""Notes that a summary shows."""

HEAD = ("valve", "verdict", "P", "f_S, %", "interval", "f_D, %", "interval")


def summary(found: Identification) -> str:
    """Return what was found in plain sentences, lines of 80 columns."""
    lines = [f"{_size(found)}, {spoken(found.samples * found.sample_time)} of operation"]
    if found.reason:
        lines += _wrapped(f"The fit is not to be trusted: {found.reason}", indent="")
    for j, valve in enumerate(found.valves):
        chance = probability(valve.probability)
        sure = f", probability of friction {chance}" if chance else ""
        lines += ["", *_wrapped(f"{valve.name}: {valve.verdict}{sure}{_frictions(valve)}", "")]
        said = (why(found, j), materiality(valve))
        lines += _wrapped(" ".join(filter(None, said)))
        lines += _wrapped(f"What to do next: {next_step(found, j)}")
    for output in found.outputs:
        lines += ["", *_wrapped(_process(found, output), indent="")]
        if output.cause is not None:
            lines += _wrapped(cycle(output))
    if found.notes:
        lines.append("")
    for note in found.notes[:NOTES]:
        lines += textwrap.wrap(f"- {note}", WIDTH, subsequent_indent="  ")
    if len(found.notes) > NOTES:
        lines.append(f"- {plural(len(found.notes) - NOTES, 'more note')} in the attribute notes")
    return "\n".join(lines)


def rows(found: Identification) -> Iterator[tuple[str, ...]]:
    """Yield the cells of each valve below :data:`HEAD`."""
    for valve in found.valves:
        yield (
            valve.name,
            str(valve.verdict),
            probability(valve.probability),
            f"{valve.static_friction:.2f}",
            "{:.2f} to {:.2f}".format(*valve.static_interval),
            f"{valve.dynamic_friction:.2f}",
            "{:.2f} to {:.2f}".format(*valve.dynamic_interval),
        )


def as_html(found: Identification) -> str:
    """Return a table of the valves for notebooks."""

    def row(cells: tuple[str, ...], kind: str) -> str:
        inside = "".join(f"<{kind}>{html.escape(cell)}</{kind}>" for cell in cells)
        return f"<tr>{inside}</tr>"

    told = html.escape(f"{found.status}: {found.reason}" if found.reason else _size(found))
    body = "".join(row(cells, "td") for cells in rows(found))
    return f"<table><caption>{told}</caption><thead>{row(HEAD, 'th')}</thead>{body}</table>"


def as_table(found: Identification) -> Any:
    """Return a table of the valves for a console of rich."""
    from rich.table import Table
    from rich.text import Text

    table = Table(*HEAD, title=Text(found.reason or _size(found)), title_justify="left")
    for cells in rows(found):
        table.add_row(*map(Text, cells))
    return table


def _size(found: Identification) -> str:
    return f"{plural(found.samples, 'sample')} of {found.sample_time:g} s"


def _frictions(valve: ValveEstimate) -> str:
    if valve.verdict is VerdictKind.HEALTHY:
        return ""
    static, dynamic = valve.static_interval, valve.dynamic_interval
    return (
        f"; f_S {valve.static_friction:.2f} % ({static[0]:.2f} to {static[1]:.2f} %), "
        f"f_D {valve.dynamic_friction:.2f} % ({dynamic[0]:.2f} to {dynamic[1]:.2f} %), "
        f"law {valve.law}"
    )


def _process(found: Identification, output: OutputModel) -> str:
    """Return gain and delay of an output, and how well its free run fits."""
    told = []
    for valve, taps in output.b.items():
        level = math.isclose(sum(output.a), -1.0)
        gain = "integrates" if level else f"gain {sum(taps) / (1.0 + sum(output.a)):.3g} per % of"
        delay = output.delay.get(valve, 0) * found.sample_time
        told.append(f"{gain} {valve}, delay {delay:g} s")
    fit = f"fit of PV computed from OP alone (free run) {output.fit_free_run:.0f} %"
    return f"{output.name}: {'; '.join([*told, fit])}"


def _wrapped(text: str, indent: str = "  ") -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent="  ")
