"""All figures and tables of the paper as one page."""

import dataclasses
import functools
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from stiction_ros.errors import InputError, storing
from stiction_ros.pages.frame import framed, text
from stiction_ros.pages.plot import SCRIPT
from stiction_ros.report.page import table
from stiction_studies.paper.exhibit import Exhibit
from stiction_studies.paper.figures import controllers, responses, trends
from stiction_studies.paper.sources import Sources
from stiction_studies.paper.tables import constants, laws, methods, models, wells
from stiction_studies.paper.tables import controllers as control_tables

PAGE = "paper.html"
HEAD = ("", "printed", "ours", "remark")
# Name: what makes its exhibits, in the order of the page.
MAKERS: dict[str, tuple[Callable[[Sources], Exhibit], ...]] = {
    "figure2": (responses.figure2,),
    "figure3": (trends.figure3,),
    "figure5": (responses.figure5,),
    "figure6": tuple(
        functools.partial(controllers.figure6, plant=plant) for plant in ("linear", "tank")
    ),
    "table1": (models.table1,),
    "table2": (models.table2,),
    "tableA.3": (constants.table_a3,),
    "tabletimes": (methods.table_of_times,),
    "tablewells": (wells.table_of_wells,),
    "tablesuccess": (methods.table_of_success,),
    "tablelaws": (laws.table_of_laws,),
    "tableretuning": (control_tables.table_of_retuning,),
    "tableablation": (control_tables.table_of_ablation,),
    "tableidentified": (control_tables.table_of_identified,),
}


def chosen(figures: Iterable[int], tables: Iterable[str], everything: bool) -> tuple[str, ...]:
    """Return names of :data:`MAKERS` in the order of the page."""
    if everything:
        return tuple(MAKERS)
    wanted = {f"figure{number}" for number in figures} | {f"table{name}" for name in tables}
    return tuple(name for name in MAKERS if name in wanted)


def draw(
    names: Sequence[str], seed: int, directory: Path, show: Callable[[float, str], None]
) -> tuple[Path, tuple[Exhibit, ...]]:
    """Make exhibits, and write the page and ``paper.json``.

    Args:
        names: of :data:`MAKERS`.
        seed: of all noise, 0 or more.
        directory: that exists.
        show: called with the share done, 0 to 1, and what is being made.

    Raises:
        InputError: a negative seed, or a directory that cannot be written.
    """
    if seed < 0:
        raise InputError(f"{seed} is negative", where="--seed", fix="use 0 or more")
    sources, made = Sources(seed), []
    for place, name in enumerate(names):
        show(place / len(names), name)
        made += [maker(sources) for maker in MAKERS[name]]
    show(1.0, "writing")
    with storing(directory, fix="choose another"):
        return _write(made, directory), tuple(made)


def _write(made: Sequence[Exhibit], directory: Path) -> Path:
    parts = [
        "<h1>The paper, printed beside ours</h1>",
        '<p class="soft">Enhancing MPC formulations by identification and estimation of valve '
        "stiction. What stands behind each row: docs/paper.md.</p>",
    ]
    for exhibit in made:
        parts.append(f"<h2>{text(exhibit.title)}</h2>")
        parts.append(exhibit.figures)
        if exhibit.rows:
            rows = [(row.what, row.printed, row.ours, row.remark) for row in exhibit.rows]
            parts.append(table(HEAD, rows, texts=4))
        if exhibit.remark:
            parts.append(f'<p class="soft">{text(exhibit.remark)}</p>')
    target = directory / PAGE
    target.write_text(framed("The paper", parts, SCRIPT), encoding="utf-8")
    document = [
        {
            "name": exhibit.name,
            "title": exhibit.title,
            "rows": [dataclasses.asdict(row) for row in exhibit.rows],
            "remark": exhibit.remark,
        }
        for exhibit in made
    ]
    text_json = json.dumps(document, indent=1, ensure_ascii=False)
    (directory / "paper.json").write_text(text_json + "\n", encoding="utf-8")
    return target
