import json
import os
from collections.abc import Sequence
from pathlib import Path

import pytest
from bag_making import STORE

from stiction_ros.config_files import installation_prefixes
from stiction_ros.errors import InputError
from stiction_ros.records.bag.message_definitions import definition

SEPARATOR = "\n" + "=" * 80 + "\n"


def package(prefix: Path, name: str, messages: dict[str, str], needed: Sequence[str] = ()) -> None:
    """Write messages that all need some others, as the file of hashes beside each tells."""
    folder = prefix / "share" / name / "msg"
    folder.mkdir(parents=True)
    for key, text in messages.items():
        (folder / f"{key}.msg").write_text(text)
        every = [f"{name}/msg/{key}", *needed]
        hashes = [{"type_name": n, "hash_string": f"RIHS01_{n.split('/')[-1]}"} for n in every]
        (folder / f"{key}.json").write_text(json.dumps({"type_hashes": hashes}))


@pytest.fixture(autouse=True)
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path), prepend=os.pathsep)


def test_dependencies_follow_once_each(tmp_path: Path) -> None:
    package(tmp_path, "a", {"Top": "b/Low[] lows\n"}, ["a/msg/Inner", "b/msg/Low"])
    (tmp_path / "share/a/msg/Inner.msg").write_text("b/Low low\n")
    package(tmp_path, "b", {"Low": "int32 x\n"})
    text, type_hash = definition("a/msg/Top")
    assert text.split(SEPARATOR) == [
        "b/Low[] lows\n", "MSG: a/Inner\nb/Low low\n", "MSG: b/Low\nint32 x\n"
    ]  # fmt: skip
    assert type_hash == "RIHS01_Top"


def test_errors_name_the_type_and_the_fix(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no definition of no_msgs/msg/Thing.*AMENT_PREFIX_PATH"):
        definition("no_msgs/msg/Thing")
    with pytest.raises(InputError, match="no message type"):
        definition("JointState")
    package(tmp_path, "c", {"Bare": "int8 x\n"})
    (tmp_path / "share/c/msg/Bare.json").unlink()
    with pytest.raises(InputError, match="no type hash"):
        definition("c/msg/Bare")


@pytest.mark.parametrize(
    "name",
    [
        "sensor_msgs/msg/JointState",
        "std_msgs/msg/String",
        "diagnostic_msgs/msg/DiagnosticArray",
        "trajectory_msgs/msg/JointTrajectory",
        "rosgraph_msgs/msg/Clock",
        "rcl_interfaces/msg/Log",
    ],
)
def test_installed_messages_have_the_hash_of_their_definition(name: str) -> None:
    try:
        text, type_hash = definition(name)
    except InputError:
        pytest.skip(f"{name} is not installed under {installation_prefixes()}")
    assert type_hash == STORE.hash_rihs01(name)
    assert text.count("MSG: ") == STORE.generate_msgdef(name, ros_version=2)[0].count("MSG: ")
