"""History of a real server becomes the record that was lived through."""

import datetime
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from as_given import read_csv_parts
from plant_process import START, PlantProcess, wait_until
from small_maps import MODE, OP, PV, SP, loop_tags

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.opcua import history
from stiction_ros.opcua.history import Span, modes_of, record_of
from stiction_ros.opcua.sampling import TagQuality, TagReading
from stiction_ros.opcua.tag_map import ValveTags
from stiction_ros.records.csv_writer import write_csv
from stiction_ros.records.record import Quality

SCANS = 60


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PlantProcess]:
    process = PlantProcess(tmp_path_factory.mktemp("kept") / "plant", speed=2400.0, history=True)
    process.start()
    wait_until(lambda: len(process.events("out")) > SCANS, "scans")
    yield process
    process.stop()


def iso(sample: int) -> str:
    seconds = START // 1_000_000_000 + 60 * sample
    return datetime.datetime.fromtimestamp(seconds, datetime.UTC).isoformat()


def call(plant: PlantProcess, out: Path, **changes: str) -> int:
    told = plant.credentials("reader")
    options = {
        "--tags": str(plant.map_file),
        "--from": iso(5),
        "--to": iso(SCANS - 5),
        "--out": str(out),
        "--certificate": told.certificate,
        "--private-key": told.private_key,
        "--server-certificate": told.server_certificate,
        "--user": told.user,
        "--password-file": told.password_file,
        **changes,
    }
    pairs = [part for pair in options.items() for part in pair]
    return main(["fetch-history", plant.url, *pairs])


def test_pages_become_the_record(
    plant: PlantProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history, "PAGE", 7)
    assert call(plant, tmp_path) == 0
    (record,) = read_csv_parts(tmp_path / "tank.csv")
    assert (record.valves, record.outputs) == (("V1", "V2"), ("C", "T"))
    assert len(record) == SCANS - 9
    outs = {one["stamp"]: one["out"] for one in plant.events("out")}
    told = [outs[START + 60_000_000_000 * k] for k in range(5, SCANS - 4)]
    np.testing.assert_array_equal(record.op, told)
    assert record.sp is not None
    assert (record.quality == Quality.GOOD).all()
    assert len(np.unique(record.pv[:, 0])) == len(record)


def test_what_was_broken_off_goes_on(plant: PlantProcess, tmp_path: Path) -> None:
    assert call(plant, tmp_path) == 0
    whole = {path: path.read_text() for path in (tmp_path / "raw").glob("*.json")}
    assert len(whole) == 8
    for path, text in list(whole.items())[4:]:
        path.with_suffix(".part").write_text(text[: len(text) // 2])
        path.unlink()
    (tmp_path / "tank.csv").unlink()
    assert call(plant, tmp_path) == 0
    assert {path: path.read_text() for path in whole} == whole


def test_another_stretch_is_not_mixed_in(
    plant: PlantProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(plant, tmp_path) == 0
    assert call(plant, tmp_path, **{"--to": iso(30)}) == 2
    assert "other history" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"--to": "2001-01-01"}, "--from"),
        ({"--from": "yesterday"}, "no time"),
        ({"--password-file": ""}, "password_file"),
    ],
)
def test_what_cannot_be_fetched_is_said(
    plant: PlantProcess,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    changes: dict[str, str],
    said: str,
) -> None:
    assert call(plant, tmp_path, **changes) == 2
    assert said in capsys.readouterr().err


def test_bad_values_are_marked_and_op_belongs_to_most_of_its_sample() -> None:
    second = 1_000_000_000
    span = Span(0, 10 * second)
    told = {
        PV: [(float(k), TagQuality.BAD if k == 4 else TagQuality.GOOD, k) for k in range(1, 10)],
        SP: [(5.0, TagQuality.GOOD, 0)],
        OP: [
            (40.0, TagQuality.GOOD, 0),
            (41.0, TagQuality.GOOD, 2.4),
            (42.0, TagQuality.GOOD, 5.6),
        ],
    }
    found = {
        tag: [TagReading(v, q, round(at * second)) for v, q, at in values]
        for tag, values in told.items()
    }
    record = record_of(loop_tags(), found, span)
    assert record.op[:, 0].tolist() == [40.0, 41.0, 41.0, 41.0, 41.0, 42.0, 42.0, 42.0, 42.0]
    assert np.flatnonzero(record.quality == Quality.BAD).tolist() == [3]
    with pytest.raises(InputError, match="no history"):
        record_of(loop_tags(), found | {PV: []}, span)


def test_manual_stretches_are_a_column_and_cut_by_the_intake(tmp_path: Path) -> None:
    second = 1_000_000_000
    span = Span(0, 40 * second)
    good = TagQuality.GOOD
    told: dict[str, list[tuple[float | str, TagQuality, float]]] = {
        PV: [(7.0 + k % 3, good, k) for k in range(40)],
        SP: [(5.0, good, 0)],
        OP: [(40.0 + k % 5, good, k) for k in range(40)],
        MODE: [("AUTO", good, 0), ("MAN", good, 10), ("", TagQuality.BAD, 12), ("CAS", good, 20)],
    }
    found = {
        tag: [TagReading(v, q, round(at * second)) for v, q, at in values]
        for tag, values in told.items()
    }
    record = record_of(loop_tags(), found, span)
    modes = modes_of(loop_tags(), found, record)
    assert modes == ["AUTO"] * 10 + ["MAN"] * 10 + ["CAS"] * 20
    write_csv(record, tmp_path / "unit.csv", modes=modes)
    (read,) = read_csv_parts(tmp_path / "unit.csv")
    assert np.flatnonzero(read.quality == Quality.MANUAL).tolist() == list(range(10, 20))
    np.testing.assert_array_equal(read.pv, record.pv)


def test_of_several_valves_the_one_that_is_not_automatic_tells_the_mode(tmp_path: Path) -> None:
    second = 1_000_000_000
    valves = tuple(ValveTags(f"V{j}", f"s=OP{j}", mode=f"s=MODE{j}") for j in (1, 2))
    tags = loop_tags(valves=valves, grant=None)
    told: dict[str, list[tuple[float | str, int]]] = {
        PV: [(float(k), k) for k in range(6)],
        SP: [(5.0, 0)],
        "s=OP1": [(40.0, 0)],
        "s=OP2": [(40.0, 0)],
        "s=MODE1": [("CAS", 1)],
        "s=MODE2": [("AUTO", 0), ("MAN", 3), ("AUTO", 5)],
    }
    found = {
        tag: [TagReading(v, TagQuality.GOOD, at * second) for v, at in values]
        for tag, values in told.items()
    }
    record = record_of(tags, found, Span(0, 5 * second))
    assert modes_of(tags, found, record) == ["", "CAS", "CAS", "MAN", "MAN", "CAS"]
    write_csv(record, tmp_path / "two.csv", modes=modes_of(tags, found, record))
    (read,) = read_csv_parts(tmp_path / "two.csv")
    assert read.valves == ("V1", "V2")
    assert (read.quality == Quality.MANUAL).tolist() == [False, False, False, True, True, False]
