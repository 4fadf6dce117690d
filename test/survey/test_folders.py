"""Folders as plants have them: nothing ends a survey, is lost or comes twice."""

import csv
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from made import entry

from stiction_ros.intake import IntakeOptions, Loop, loops, one_loop
from stiction_ros.intake.intake import is_bag
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.survey.listing.tables import row_of, write_csv

sys.path.insert(0, str(Path(__file__).parents[1] / "records"))
from bag_making import Bag


def export(path: Path) -> Path:
    rows = (f"{k},{50 + k % 5},{40 + k % 7},40\n" for k in range(30))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("t,OP,PV,SP\n" + "".join(rows))
    return path


def bag(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with BagWriter(path) as writer:
        Bag(writer).loop(12)
    return path


def bare(path: Path) -> Path:
    """Write one ``.mcap`` file and nothing beside it."""
    (file,) = bag(path.parent / "made").glob("*.mcap")
    shutil.move(file, path)
    shutil.rmtree(path.parent / "made")
    return path


def read(*paths: Path) -> list[Loop]:
    return list(loops(paths, IntakeOptions()))


def names(*paths: Path) -> list[str]:
    found = read(*paths)
    assert [loop.problem for loop in found] == [None] * len(found)
    return sorted(loop.name for loop in found)


def test_exports_beside_a_bare_file_are_read(tmp_path: Path) -> None:
    export(tmp_path / "a.csv"), export(tmp_path / "b.csv"), bare(tmp_path / "x.mcap")
    assert names(tmp_path) == ["a", "b", "x"]


def test_exports_beside_a_stray_listing_are_read(tmp_path: Path) -> None:
    export(tmp_path / "a.csv")
    (tmp_path / "metadata.yaml").write_text("title: plant 3\n")
    assert names(tmp_path) == ["a"]


def test_exports_and_folders_in_a_bag_are_read_as_well(tmp_path: Path) -> None:
    folder = bag(tmp_path / "run")
    export(folder / "a.csv"), export(folder / "inner" / "b.csv")
    assert names(tmp_path) == ["a", "b", "run"]
    assert one_loop(folder, IntakeOptions()).name == "run"


def test_files_of_several_bags_in_a_folder_are_several(tmp_path: Path) -> None:
    bare(tmp_path / "FIC_101.mcap"), bare(tmp_path / "FIC_102.mcap")
    assert names(tmp_path) == ["FIC_101", "FIC_102"]


@pytest.mark.parametrize("files", [["x.mcap"], ["run_0.mcap", "run_1.mcap"]])
def test_a_folder_of_the_files_of_one_bag_is_a_bag(tmp_path: Path, files: Sequence[str]) -> None:
    for name in files:
        (tmp_path / name).touch()
    assert is_bag(tmp_path)


def test_a_folder_that_links_to_itself_and_its_parent_is_read_once(tmp_path: Path) -> None:
    export(tmp_path / "unit" / "a.csv")
    (tmp_path / "unit" / "self").symlink_to(".")
    (tmp_path / "unit" / "up").symlink_to("..")
    assert names(tmp_path) == ["a"]


def test_a_file_that_is_reached_by_several_ways_is_read_once(tmp_path: Path) -> None:
    file, folder = export(tmp_path / "b.csv"), bag(tmp_path / "run")
    (tmp_path / "a.csv").symlink_to(file)
    (storage,) = folder.glob("*.mcap")
    assert names(tmp_path, file, folder, storage) == ["b", "run"]


def test_every_bad_file_is_a_row_with_its_reason(tmp_path: Path) -> None:
    export(tmp_path / "good.csv")
    (tmp_path / "bad.mcap").write_bytes(b"\x00garbage")
    (tmp_path / "bad.db3").write_bytes(b"SQLite format 3\0")
    (tmp_path / "bad.parquet").write_bytes(b"PAR1garbage")
    (tmp_path / "gone.csv").symlink_to("nowhere.csv")
    (tmp_path / "self.csv").symlink_to("self.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.csv")).touch()
    found = {loop.name: loop.problem for loop in read(tmp_path)}
    assert len(found) == 8
    assert [name for name, problem in found.items() if problem is None] == ["good"]
    assert "is a pipe" in (found["pipe"] or "")
    assert "not in UTF-8" in (found["\\udcff"] or "")


@pytest.mark.parametrize("place", ["open_sheets", "plan_of", "blocks_of", "loop_of"])
def test_whatever_a_reader_raises_is_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    def broken(*_: object) -> None:
        raise TypeError("of a package\nthat others wrote")

    export(tmp_path / "a.csv")
    monkeypatch.setattr(f"stiction_ros.intake.intake.{place}", broken)
    (loop,) = read(tmp_path)
    assert loop.problem is not None
    assert "a.csv: cannot be read (TypeError: of a package that others wrote)" in loop.problem


def test_a_folder_that_cannot_be_listed_is_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def locked(folder: Path) -> None:
        raise PermissionError(13, "Permission denied", str(folder))

    monkeypatch.setattr(Path, "iterdir", locked)
    (loop,) = read(tmp_path)
    assert "cannot be read" in (loop.problem or "")


@pytest.mark.parametrize("first", ["=", "+", "-", "@", "\t", "\r"])
def test_no_text_of_the_list_is_a_formula(tmp_path: Path, first: str) -> None:
    row = entry(f"{first}1+1", verdict="healthy", reason=f"{first}A1", f_s=-1.5)
    found = row_of(row)
    assert (found["loop"], found["reason"]) == (f"'{first}1+1", f"'{first}A1")
    assert found["f_S"] == -1.5
    write_csv(tmp_path / "list.csv", [row])
    with (tmp_path / "list.csv").open(encoding="utf-8-sig", newline="") as file:
        (read,) = csv.DictReader(file)
    assert (read["loop"], read["f_S"]) == (f"'{first}1+1", "-1.5")
