"""Readers that nobody here wrote find the same in our bags, and we the same in others'."""

from pathlib import Path

import numpy as np
import pytest
from bag_making import JOINT_STATE, SECOND, STORE, Bag, joint_state, read_bag
from foreign_readers import by_us, check, checker, differences
from mcap.writer import CompressionType, Writer

from stiction_ros.records.bag.repair import repair_bag
from stiction_ros.records.bag.writer import BagWriter


def fill(bag: Bag) -> None:
    bag.text("/plant/config", "seed: 1", 5 * SECOND)
    bag.loop(60)
    for second in range(5, 65):
        bag.diagnostics(second * SECOND, "controller: mode", {"mode": "hold", "µ": "1"})
        bag.prediction(second * SECOND, ["V1"], [float(second)])
    bag.joint("/pv", 70 * SECOND, {"C": float("nan"), "T": float("inf")})


CASES = {
    "zstd": ("zstd", 0, 0, 1 << 18),
    "lz4": ("lz4", 0, 0, 1 << 18),
    "none": ("none", 0, 0, 4096),
    "split": ("zstd", 20000, 0, 4096),
}


@pytest.fixture(params=[*CASES, "repaired"])
def path(request, tmp_path: Path) -> Path:
    bag = Bag(BagWriter(tmp_path / "run", *CASES.get(request.param, CASES["split"])))
    fill(bag)
    if request.param == "repaired":
        repair_bag(tmp_path / "run")
    else:
        bag.writer.close()
    return tmp_path / "run"


def test_rosbags_and_mcap_ros2_support_decode_the_same_values(path: Path) -> None:
    assert differences(path) == []
    assert sum(len(values) for values in by_us(path).values()) == 1 + 4 * 60 + 2 * 60 + 1


@pytest.mark.parametrize("path", ["none"], indirect=True)
def test_a_difference_would_be_found(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = by_us(path)
    whole["/op"][3] = (whole["/op"][3][0], ("altered",))
    monkeypatch.setattr("foreign_readers.by_us", lambda _bag: whole)
    assert differences(path) == [
        "rosbags has other values on /op",
        "mcap-ros2-support has other values on /op",
    ]


@pytest.mark.skipif(checker() is None, reason="pymcap-cli is not installed")
def test_the_checker_finds_no_error(path: Path) -> None:
    files = sorted(path.glob("*.mcap"))
    for file in {files[0], files[-1]}:
        done = check(file)
        assert done.returncode == 0, done.stdout
        assert "passed MCAP doctor checks" in " ".join(done.stdout.split())


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_files_of_the_mcap_package(
    compression: CompressionType, chunked: bool, tmp_path: Path
) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2000, compression=compression, use_chunking=chunked)
        writer.start("ros2", "test")
        definition, _ = STORE.generate_msgdef(JOINT_STATE, ros_version=2)
        schema = writer.register_schema(JOINT_STATE, "ros2msg", definition.encode())
        odd = writer.register_schema("odd", "jsonschema", b"{}")
        channels = {t: writer.register_channel(t, "cdr", schema, {}) for t in ("/pv", "/op")}
        other = writer.register_channel("/camera", "json", odd, {})
        for k in range(100):
            data = joint_state(k * SECOND, ["X"], [float(k)])
            for channel in channels.values():
                writer.add_message(channel, k, data, k)
            writer.add_message(other, k, b"{}", k)
        writer.add_attachment(1, 1, "photo", "image/png", b"\x89PNG")
        writer.add_metadata("site", {"unit": "7"})
        writer.finish()
    record = read_bag(path)
    np.testing.assert_array_equal(record.pv[:, 0], np.arange(100.0))
    assert record.notes == ()
