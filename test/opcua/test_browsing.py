"""A tag map by browsing: what the server has, under its own names."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from plant_process import PlantProcess

from stiction_ros.cli.main import main
from stiction_ros.opcua.browsing import loops_of
from stiction_ros.opcua.tag_map import TagMap
from stiction_studies.control_system.tags import NAMESPACE


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PlantProcess]:
    process = PlantProcess(tmp_path_factory.mktemp("browsed") / "plant")
    process.start()
    yield process
    process.stop()


def call(plant: PlantProcess, out: Path, *more: str) -> int:
    told = plant.credentials("reader")
    options = ["--sample-time", "60", "--out", str(out), *more]
    options += ["--certificate", told.certificate, "--private-key", told.private_key]
    options += ["--server-certificate", told.server_certificate]
    options += ["--user", told.user, "--password-file", told.password_file]
    return main(["browse-tags", plant.url, *options])


def test_the_controllers_of_the_plant_are_found(plant: PlantProcess, tmp_path: Path) -> None:
    out = tmp_path / "found.tags.yaml"
    assert call(plant, out) == 0
    found = TagMap.load(out)
    assert [loop.loop for loop in found.loops] == ["CC", "TC"]
    first = found.loops[0]
    assert first.outputs[0].pv == f"nsu={NAMESPACE};s=CC.PV"
    assert first.valves[0].op_read == f"nsu={NAMESPACE};s=CC.OUT"
    assert first.valves[0].mode == f"nsu={NAMESPACE};s=CC.MODE"
    assert first.grant is None
    assert list(first.uses()) == []


def test_names_that_nothing_bears_are_said(
    plant: PlantProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(plant, tmp_path / "none.tags.yaml", "--pv", "MEAS") == 2
    assert "MEAS" in capsys.readouterr().err


def test_groups_become_names_that_topics_bear() -> None:
    found = {("10-FIC 7", "pv"): "i=1", ("10-FIC 7", "Out"): "i=2", ("X", "PV"): "i=3"}
    (loop,) = loops_of(found, {"pv": "PV", "op": "OUT"}, 1.0)
    assert loop["loop"] == "L10_FIC_7"


def test_a_map_that_is_there_is_not_written_over(
    plant: PlantProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found.tags.yaml"
    out.write_text("# by hand\n", encoding="utf-8")
    assert call(plant, out) == 2
    assert "found.tags.yaml: is there already; choose another file, or say --force" in (
        capsys.readouterr().err
    )
    assert out.read_text(encoding="utf-8") == "# by hand\n"
    assert call(plant, out, "--force") == 0
    assert len(TagMap.load(out).loops) == 2
