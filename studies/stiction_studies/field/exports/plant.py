"""A made plant: loops of the field by their seeds, exported in five forms, and the truth."""

import dataclasses
import json
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.errors import InputError, storing
from stiction_studies.field.exports.formats import (
    STYLES,
    Form,
    write_long,
    write_parquet,
    write_single,
    write_wide,
    write_workbook,
)
from stiction_studies.field.exports.stamps import StampStyle
from stiction_studies.field.exports.table import Table, table_of
from stiction_studies.field.field_loop import FieldLoop

# first letter of the tags of a kind of loop
LETTERS = {"flow": "F", "pressure": "P", "level": "L", "temperature": "T", "analyser": "A"}
SPACING = 1_000_000  # seeds that lie between the loops of two plants, at least
BEGIN = 1_731_542_400  # the 14th of November 2024, whose day cannot be taken for a month
TOGETHER = 20  # loops in one file, at most


@dataclasses.dataclass(frozen=True)
class PlantLoop:
    """A loop of a plant.

    Attributes:
        tag: its name.
        form: of its export.
        loop: of the field.
        table: as the export shows it.
    """

    tag: str
    form: Form
    loop: FieldLoop
    table: Table


def loop_seed(seed: int, number: int) -> int:
    """Return the seed of loop ``number`` of a plant; those of two plants have none in common."""
    return (seed + 1) * SPACING + number


def plant_loop(loop: FieldLoop, seed: int, number: int) -> PlantLoop:
    """Return a loop with its tag, its form and what is wrong with it."""
    random = np.random.default_rng([seed, number])
    form = list(Form)[number % len(Form)]
    tag = f"{LETTERS[loop.kind]}IC{101 + number}"
    table = table_of(random, loop, tag, float(BEGIN + 3600 * (number % 7)))
    return PlantLoop(tag, form, loop, table)


def export_plant(loops: Sequence[PlantLoop], seed: int, folder: Path) -> Path:
    """Write the exports of a plant into a new folder, and the truth beside it.

    Args:
        loops: of the plant.
        seed: of the plant.
        folder: new or empty.

    Returns:
        The file with the truth, ``FOLDER.truth.json``.

    Raises:
        InputError: the folder is not empty, cannot be made, or a package is missing.
    """
    with storing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise InputError("is not empty", where=str(folder), fix="choose another --out")
        files = _written(loops, folder)
        truth = folder.with_name(f"{folder.name}.truth.json")
        told = [_truth(one, files[one.tag], folder) for one in loops]
        text = json.dumps({"seed": seed, "loops": told}, indent=1, allow_nan=False)
        truth.write_text(text + "\n", encoding="utf-8")
    return truth


def _written(loops: Sequence[PlantLoop], folder: Path) -> dict[str, Path]:
    files: dict[str, Path] = {}
    together: dict[tuple[Form, float, float], list[Table]] = defaultdict(list)
    for number, one in enumerate(loops):
        table = one.table
        if one.form is Form.SINGLE:
            style = STYLES[number // len(Form) % len(STYLES)]
            files[one.tag] = write_single(table, style, _folder(folder, one.form))
        elif one.form in (Form.WIDE, Form.PARQUET):
            together[one.form, table.step, float(table.time.min()) % table.step].append(table)
        else:
            together[one.form, 0.0, 0.0].append(table)
    numbers: dict[Form, int] = defaultdict(int)
    for (form, _, _), tables in together.items():
        for first in range(0, len(tables), TOGETHER):
            part = tables[first : first + TOGETHER]
            path = _group(form, part, numbers[form], _folder(folder, form))
            numbers[form] += 1
            files.update(dict.fromkeys((table.tag for table in part), path))
    return files


def _group(form: Form, tables: list[Table], number: int, folder: Path) -> Path:
    """Write one file of several loops."""
    path = folder / f"{form.value}_{number + 1:03d}"
    dated = [style for style in STYLES if style.stamps is not StampStyle.SECONDS]
    style = dated[number % len(dated)]
    if form is Form.WIDE:
        return write_wide(tables, style, path)
    if form is Form.LONG:
        return write_long(tables, style, path)
    if form is Form.PARQUET:
        return write_parquet(tables, path)
    return write_workbook(tables, path)


def _folder(folder: Path, form: Form) -> Path:
    inner = folder / form.value
    inner.mkdir(exist_ok=True)
    return inner


def _truth(one: PlantLoop, file: Path, folder: Path) -> dict[str, Any]:
    truth, loop = one.loop.truth, one.loop
    return {
        "name": one.tag,
        "file": str(file.relative_to(folder)),
        "form": one.form.value,
        "faults": list(one.table.faults),
        "field_seed": loop.seed,
        "kind": loop.kind,
        "plant": loop.plant,
        "circumstances": list(loop.circumstances),
        "samples": len(loop.record),
        "sample_time": loop.sample_time,
        "valve": truth.valve.value,
        "law": truth.law,
        "band": truth.band,
        "jump": truth.jump,
        "f_s": truth.f_s,
        "f_d": truth.f_d,
        "band_share": truth.band_share,
        "slips": truth.slips,
        "slips_in_automatic": loop.judged_slips,
        "reversals": truth.reversals,
        "causes": sorted(cause.value for cause in truth.causes),
    }
