from __future__ import annotations

from pathlib import Path

from stiction_ros.intake import IntakeOptions, loops


def test_a_loop_that_cannot_be_read_stops_no_other(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,OP,PV\n0,1,2\n1,1,3\n2,2,3\n")
    (tmp_path / "b.csv").write_text("t,OP\n0,1\n1,1\n")
    (tmp_path / "c.csv").write_text("t,OP,PV\n0,1,2\n1,1,3\n2,2,3\n")
    found = list(loops([tmp_path], IntakeOptions()))
    assert [loop.name for loop in found] == ["a", "b", "c"]
    assert found[1].problem is not None
    assert "has no column PV" in found[1].problem
    assert found[1].parts == ()
    assert [len(part) for part in found[2].parts] == [3]
    assert found[0].files == (tmp_path / "a.csv",)


def test_no_name_comes_twice(tmp_path: Path) -> None:
    for folder in ("north", "south", "x/south"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "FIC1.csv").write_text("t,OP,PV\n0,1,2\n1,1,3\n2,2,3\n")
    found = [loop.name for loop in loops([tmp_path], IntakeOptions())]
    assert found == ["FIC1", "FIC1 (south)", "FIC1 (south 2)"]
