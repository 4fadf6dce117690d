import json
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
import yaml
from as_given import run_metadata
from bag_making import SECOND, Bag
from rosbags.rosbag2 import Reader

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.bag.repair import RepairStatus, repair_bag


def killed(bag: Bag) -> Path:
    """Return a bag as a killed recorder leaves it."""
    bag.text("/plant/config", "seed: 3\nversion: '0.1'", 4 * SECOND)
    bag.loop(20)
    return bag.writer.directory


def raw(path: Path) -> list[tuple[str, int, bytes]]:
    return [(m.topic.name, m.log_time, m.data) for m in read_raw(path)]


def test_a_whole_bag_is_left_alone(bag: Bag) -> None:
    path = killed(bag)
    bag.writer.close()
    before = {file.name: (file.read_bytes(), file.stat().st_mtime_ns) for file in path.iterdir()}
    assert repair_bag(path).status is RepairStatus.WHOLE
    after = {file.name: (file.read_bytes(), file.stat().st_mtime_ns) for file in path.iterdir()}
    assert after == before


def test_a_killed_recorders_bag_is_finished_and_keeps_its_run(bag: Bag) -> None:
    path = killed(bag)
    told = run_metadata(path)
    done = repair_bag(path)
    assert done.status is RepairStatus.FINISHED
    assert done.messages == bag.writer.counts
    assert raw(path) == bag.written
    assert run_metadata(path) == told
    assert told["seed"] == "3"
    assert [file.name for file in sorted(path.iterdir())] == ["metadata.yaml", "run_0.mcap"]


def test_one_file_is_repaired_without_a_listing(bag: Bag, tmp_path: Path) -> None:
    shutil.copy(killed(bag) / "run_0.mcap", tmp_path / "lone.mcap")
    assert repair_bag(tmp_path / "lone.mcap").status is RepairStatus.FINISHED
    assert raw(tmp_path / "lone.mcap") == bag.written
    assert not (tmp_path / "metadata.yaml").exists()
    assert repair_bag(tmp_path / "lone.mcap").status is RepairStatus.WHOLE


@pytest.mark.parametrize("text", [None, "{", "rosbag2_bagfile_information: 3", "a: [1"])
def test_a_lost_or_broken_listing_is_made_anew(text: str | None, bag: Bag) -> None:
    path = killed(bag)
    bag.writer.close()
    listing = path / "metadata.yaml"
    whole = listing.read_text()
    listing.unlink()
    if text is not None:
        listing.write_text(text)
        with pytest.raises(InputError, match=r"metadata\.yaml: cannot be read.*stiction repair"):
            raw(path)
    done = repair_bag(path)
    assert done.status is RepairStatus.FINISHED
    assert yaml.safe_load(listing.read_text()) == yaml.safe_load(whole)
    with Reader(path) as reader:
        assert sum(1 for _ in reader.messages()) == len(bag.written)


def test_errors(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such bag"):
        repair_bag(tmp_path / "nowhere")
    (tmp_path / "void").mkdir()
    with pytest.raises(InputError, match=r"holds no \.mcap file"):
        repair_bag(tmp_path / "void")
    (tmp_path / "x.mcap").write_bytes(b"t,OP,PV\n")
    with pytest.raises(InputError, match="is not an MCAP file"):
        repair_bag(tmp_path / "x.mcap")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("version", 12, "has version 12, newer than 9"),
        ("storage_identifier", "sqlite3", "the storage is sqlite3"),
        ("compression_mode", "MESSAGE", "the storage is mcap MESSAGE; convert it"),
    ],
)
def test_a_bag_of_another_kind_is_left_alone(key: str, value: object, said: str, bag: Bag) -> None:
    path = killed(bag)
    bag.writer.close()
    listing = path / "metadata.yaml"
    document = yaml.safe_load(listing.read_text())
    document["rosbag2_bagfile_information"][key] = value
    listing.write_text(yaml.safe_dump(document))
    before = listing.read_bytes()
    for use in (repair_bag, raw):
        with pytest.raises(InputError, match=said):
            use(path)
    assert listing.read_bytes() == before


def test_the_command(bag: Bag, capsys: pytest.CaptureFixture[str]) -> None:
    path = killed(bag)
    assert main(["repair", str(path), "--json", "-"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["status"] == "finished"
    assert document["notes"] == [
        "run_0.mcap was not closed by its writer",
        "metadata.yaml is missing",
    ]
    assert main(["repair", str(path)]) == 0
    said = capsys.readouterr().out
    assert said == f"{path}: nothing to repair; {len(bag.written)} messages on 5 topics\n"
    assert main(["repair", str(path / "none")]) == 2


REFUSED = """
    import resource, signal, sys
    from pathlib import Path
    from stiction_ros.records.bag.messages import read_raw
    from stiction_ros.records.bag.writer import BagWriter

    writer = BagWriter(sys.argv[1])
    writer.add_topic("/mode", "std_msgs/msg/String", "string data\\n", "")
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    written = refused = 0
    for k in range(300):
        limit = 8000 if 100 <= k < 200 else hard  # the storage is full for a while
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        try:
            writer.write("/mode", k.to_bytes(4, "little") * 20, k, k)
            written += 1
        except OSError:
            refused += 1
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        writer.close()
        print("closed")
    except OSError:
        print(written, refused, len(list(read_raw(sys.argv[1]))))
"""


def test_a_full_storage_leaves_whole_messages_and_a_journal(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    command = [sys.executable, "-c", textwrap.dedent(REFUSED), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    written, refused, read = map(int, done.stdout.split())
    assert 0 < refused <= 100
    assert written == read == 300 - refused
    assert [file.name for file in path.iterdir()] == ["bag_0.mcap"]
    assert repair_bag(path).messages == {"/mode": written}
