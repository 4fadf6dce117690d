"""What reports are made of: boxes, tables, and figures in words."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from stiction_ros.pages.frame import SCROLLED, text, words
from stiction_ros.texts import json_text

Cell = str | tuple[str, str]  # text of a table cell, or its class and its text


def write_page(out: str | Path, page: str, figures: Mapping[str, Any] | None = None) -> Path:
    """Write ``report.html`` and ``summary.json`` into a folder, or a lone ``.html`` file.

    Folders are made where need be. The page is returned, without ``figures`` it is alone.
    """
    out = Path(out)
    alone = out.suffix.lower() == ".html"
    target = out if alone else out / "report.html"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page, encoding="utf-8")
    if figures is not None and not alone:
        (out / "summary.json").write_text(json_text(figures) + "\n", encoding="utf-8")
    return target


def card(kind: str, what: str, big: str, more: str = "") -> str:
    """Return a box with one result; ``kind`` is bad, good, open or nothing."""
    return (
        f'<div class="card {kind}"><div class="what">{text(what)}</div>'
        f'<div class="big">{text(big)}</div><div class="more">{words(more)}</div></div>'
    )


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]], texts: int = 1) -> str:
    """Return a table; the first ``texts`` columns hold words, the others figures."""
    titles = "".join(
        f"<th{_kind('t' if column < texts else '')} scope='col'>{words(title)}</th>"
        if title
        else "<td></td>"
        for column, title in enumerate(head)
    )
    lines = []
    for row in rows:
        lines.append("<tr>")
        for column, cell in enumerate(row):
            kind, value = cell if isinstance(cell, tuple) else ("", cell)
            if column < texts:
                kind = f"t {kind}".strip()
            lines.append(f"<td{_kind(kind)}>{words(value)}</td>")
        lines.append("</tr>")
    return (
        f"{SCROLLED}<table><thead><tr>{titles}</tr></thead>"
        f"<tbody>{''.join(lines)}</tbody></table></div>"
    )


def folded(title: str, content: str) -> str:
    """Return preformatted text that opens on a click."""
    shown = f'<pre tabindex="0">{text(content.rstrip())}</pre>'
    return f"<details><summary>{text(title)}</summary>{shown}</details>"


def number(value: object, digits: int = 3) -> str:
    """Return a figure with ``digits`` significant digits, whole ones whole; else a dash."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    if value == round(value) and abs(value) < 1e6:
        return f"{value:.0f}".replace("-", "−")
    if not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{decimals}f}".replace("-", "−")


def percent(value: object) -> str:
    """Return a friction in % of travel with two decimals; a dash when there is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    return f"{value:.2f}"


def interval(ends: object) -> str:
    """Return ``7.88 … 7.93`` in one piece; a dash when there is none."""
    if not isinstance(ends, list | tuple) or len(ends) != 2:
        return "–"
    return f"{percent(ends[0])}\u00a0…\u00a0{percent(ends[1])}"


def _kind(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
