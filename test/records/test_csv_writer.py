"""Records that are written are read back digit by digit."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.records import Record
from stiction_ros.records.csv_file import read_csv
from stiction_ros.records.csv_writer import write_csv


def record(valves: tuple[str, ...], outputs: tuple[str, ...]) -> Record:
    random = np.random.default_rng(0)
    op, stem = random.random((2, 20, len(valves)))
    pv, sp = random.random((2, 20, len(outputs)))
    return Record("r", 0.5, valves, outputs, op, pv, sp, stem)


def options(pairs: tuple[str, ...]) -> dict[str, dict[str, str]]:
    chosen: dict[str, dict[str, str]] = {}
    for option, pair in zip(pairs[::2], pairs[1::2], strict=True):
        tag, _, column = pair.partition("=")
        chosen.setdefault(option.removeprefix("--"), {})[tag] = column
    return chosen


@pytest.mark.parametrize(
    ("valves", "outputs"), [(("V1",), ("PV1",)), (("V1", "V2"), ("C", "T")), (("A",), ("PV1",))]
)
def test_what_is_written_is_read_back(
    tmp_path: Path, valves: tuple[str, ...], outputs: tuple[str, ...]
) -> None:
    written = record(valves, outputs)
    path = tmp_path / "r.csv"
    found = read_csv(path, **options(write_csv(written, path)))
    assert (found.valves, found.outputs) == (valves, outputs)
    assert found.sample_time == 0.5
    for key in ("op", "pv", "sp", "stem"):
        assert np.array_equal(getattr(found, key), getattr(written, key))


def test_default_names_need_no_options(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    assert write_csv(record(("V1",), ("PV1",)), path) == ()
    assert path.read_text(encoding="utf-8").splitlines()[0] == "t,OP,PV,SP,STEM"


def test_what_is_not_known_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    write_csv(dataclasses.replace(record(("V1",), ("PV1",)), sp=None, stem=None), path)
    assert path.read_text(encoding="utf-8").splitlines()[0] == "t,OP,PV"


def test_start_of_the_record_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    write_csv(dataclasses.replace(record(("V1",), ("PV1",)), start=30.0), path)
    assert read_csv(path).start == 30.0


def test_folder_that_is_not_there_is_one_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_csv(record(("V1",), ("PV1",)), tmp_path / "no" / "r.csv")
