import json
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.cli.main import main
from stiction_ros.intake import IntakeOptions, loops
from stiction_studies.field import field_loop
from stiction_studies.field.exports.formats import Form
from stiction_studies.field.exports.plant import loop_seed
from stiction_studies.field.exports.table import Table

LOOPS, SEED = 20, 3


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "plant"
    arguments = ["--loops", str(LOOPS), "--seed", str(SEED), "--jobs", "1", "--out", str(folder)]
    assert main(["experiment", "plant", *arguments]) == 0
    return folder


def truth(plant: Path) -> list[dict[str, object]]:
    found = json.loads(plant.with_name("plant.truth.json").read_text())["loops"]
    assert isinstance(found, list)
    return found


@pytest.mark.trial
def test_the_truth_stands_beside_and_names_every_loop_once(plant: Path) -> None:
    told = truth(plant)
    assert len({loop["name"] for loop in told}) == LOOPS
    assert {loop["form"] for loop in told} == set(Form)
    assert [loop["field_seed"] for loop in told] == [loop_seed(SEED, k) for k in range(LOOPS)]
    assert all((plant / str(loop["file"])).is_file() for loop in told)
    assert not list(plant.rglob("*truth*"))


@pytest.mark.trial
def test_no_loop_is_lost_and_those_read_are_the_recorded_ones(plant: Path) -> None:
    found = {loop.name: loop for loop in loops([plant], IntakeOptions())}
    told = truth(plant)
    assert found.keys() == {loop["name"] for loop in told}
    read = [loop for loop in found.values() if loop.problem is None]
    assert len(read) >= LOOPS - 1
    exact = 0
    for one in told:
        loop = found[str(one["name"])]
        if loop.problem is not None:
            assert "--" in loop.problem
            continue
        kept = one["circumstances"]
        assert isinstance(kept, list)
        assert abs(loop.parts[0].sample_time - float(str(one["sample_time"]))) < 1e-6
        record = field_loop(int(str(one["field_seed"]))).record
        if {"exception", "gap", "op_0_to_1", "op_4_to_20"} & set(kept) or len(loop.parts) > 1:
            continue
        part = loop.parts[0]
        assert len(part) == len(record)
        same = np.abs(part.op - record.op) <= 1e-5 * np.abs(record.op).max()
        assert same.mean() > 0.99
        exact += 1
    assert exact >= LOOPS // 2


@pytest.mark.trial
def test_a_seed_makes_the_same_plant_again(plant: Path, tmp_path: Path) -> None:
    arguments = ["--loops", "5", "--seed", str(SEED), "--jobs", "1"]
    assert main(["experiment", "plant", *arguments, "--out", str(tmp_path / "again")]) == 0
    first = plant / "single" / Path(str(truth(plant)[0]["file"])).name
    assert (tmp_path / "again" / "single" / first.name).read_bytes() == first.read_bytes()


def test_a_folder_in_use_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.csv").write_text("")
    arguments = ["--loops", "1", "--jobs", "1", "--out", str(tmp_path)]
    assert main(["experiment", "plant", *arguments]) == 2
    assert "is not empty" in capsys.readouterr().err


@pytest.mark.parametrize("turned", [True, False])
def test_a_change_is_kept_where_it_happened(turned: bool) -> None:
    cells: dict[str, list[float | str | None]] = {"OP": [1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0]}
    faults = ("turned",) if turned else ()
    table = Table("F", np.arange(7.0), cells, {"OP": "%"}, 1.0, faults, True)
    rows = list(range(7))[:: -1 if turned else 1]
    kept = [(0.0, 1.0), (2.0, 2.0), (5.0, 3.0), (6.0, 3.0)]
    assert table.rows(rows).changes("OP") == (kept[::-1] if turned else kept)
