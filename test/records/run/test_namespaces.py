"""A bag that holds two loops: every command names them, and reads the one that is chosen."""

from pathlib import Path

import pytest
from as_given import open_record
from bag_making import SECOND, Bag

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.intake import IntakeOptions, loops
from stiction_ros.records.run.log import read_run


def fill(bag: Bag, space: str, samples: int, mode: str) -> None:
    bag.loop(samples, space)
    bag.text(f"{space}/mode", mode, 5 * SECOND)
    bag.text(f"{space}/plant/config", f"node: {space}/plant\nseed: {samples}", 5 * SECOND)
    bag.text(f"{space}/loop_model", f"loop: {mode}", 6 * SECOND)
    values = {"mode": mode, f"published:{space}/op": str(samples)}
    bag.diagnostics(5 * SECOND, f"{space}/controller: mode"[1:], values)


@pytest.fixture
def two(bag: Bag) -> Path:
    fill(bag, "/a", 12, "hold")
    fill(bag, "/b/c", 15, "unaware")
    bag.writer.close()
    return bag.writer.directory


@pytest.mark.parametrize(
    ("space", "samples", "mode"), [("/a", 12, "hold"), ("b/c/", 15, "unaware")]
)
def test_a_run_has_only_what_its_loop_said(two: Path, space: str, samples: int, mode: str) -> None:
    run = read_run(two, namespace=space)
    assert len(run.record) == samples
    assert [change.mode for change in run.modes] == [mode]
    assert [item.text for item in run.loop_models] == [f"loop: {mode}"]
    assert [item.topic for item in run.configs] == [f"/{space.strip('/')}/plant/config"]
    assert run.published == {"/a/op": 12, "/b/c/op": 15}


def test_a_loop_without_a_namespace_beside_one_with(bag: Bag) -> None:
    fill(bag, "", 12, "hold")
    fill(bag, "/b", 15, "unaware")
    bag.writer.close()
    run = read_run(bag.writer.directory, namespace="/")
    assert (len(run.record), [change.mode for change in run.modes]) == (12, ["hold"])


def test_a_commanded_loop_comes_before_one_that_was_listened_to(bag: Bag) -> None:
    fill(bag, "", 12, "hold")
    for k in range(9):
        bag.joint("/second/pv", (5 + k) * SECOND, {"C": 7.0 + k})
        bag.joint("/second/op_applied", (5 + k) * SECOND, {"V1": 50.0 + k})
    bag.writer.close()
    assert len(read_run(bag.writer.directory).record) == 12
    assert len(read_run(bag.writer.directory, namespace="/second").record) == 9


def test_one_loop_in_a_namespace_needs_no_choice(bag: Bag) -> None:
    fill(bag, "/a", 12, "hold")
    bag.diagnostics(5 * SECOND, "old: mode", {"mode": "unaware"})  # named without its namespace
    bag.writer.close()
    run = read_run(bag.writer.directory)
    assert [change.mode for change in run.modes] == ["hold", "unaware"]


def test_of_many_files_every_loop_of_a_bag_is_read(two: Path) -> None:
    found = list(loops([two.parent], IntakeOptions()))
    assert [(loop.name, [len(part) for part in loop.parts]) for loop in found] == [
        (f"{two.stem}/a", [12]),
        (f"{two.stem}/b/c", [15]),
    ]
    (chosen,) = loops([two], IntakeOptions(namespace="/a"))
    assert (chosen.name, len(chosen.parts[0])) == (two.stem, 12)


@pytest.mark.parametrize("command", ["identify", "fit-linear", "report"])
def test_every_command_names_the_loops(
    command: str, two: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, str(two)]) == 2
    said = capsys.readouterr().err
    assert "holds 2 loops (/a, /b/c); choose one with --namespace" in said
    assert main([command, str(two), "--namespace", "/x"]) == 2
    assert "in the namespace /x; its loops are /a, /b/c" in capsys.readouterr().err


def test_a_chosen_loop_is_opened(two: Path) -> None:
    assert len(open_record(two, namespace="a")) == 12
    assert len(open_record(two, namespace="/b/c")) == 15


def test_a_csv_file_has_no_namespaces(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("t,OP,PV\n0,1,2\n1,1,2\n2,1,2\n")
    with pytest.raises(InputError, match="is a CSV file, which has no namespaces"):
        open_record(path, namespace="a")
