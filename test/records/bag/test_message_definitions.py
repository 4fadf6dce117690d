import json
import os
from pathlib import Path

import pytest
from bag_making import STORE

from stiction_ros.errors import InputError
from stiction_ros.records.bag.message_definitions import default_prefixes, definition

SEPARATOR = "\n" + "=" * 80 + "\n"


def package(prefix: Path, name: str, messages: dict[str, str]) -> None:
    folder = prefix / "share" / name / "msg"
    folder.mkdir(parents=True)
    for key, text in messages.items():
        (folder / f"{key}.msg").write_text(text)
        hashes = [{"type_name": f"{name}/msg/{key}", "hash_string": f"RIHS01_{key}"}]
        (folder / f"{key}.json").write_text(json.dumps({"type_hashes": hashes}))


@pytest.fixture(autouse=True)
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path), prepend=os.pathsep)


def test_dependencies_follow_once_each(tmp_path: Path) -> None:
    package(
        tmp_path,
        "a",
        {
            "Top": "uint8 OK=0  # x/Y\nb/Low[] lows\nInner<=3 no\nInner[<=4] inner\nstring<=9 s\n",
            "Inner": "b/Low low\nfloat64[3] x\n",
        },
    )
    package(tmp_path, "b", {"Low": "int32 x\n"})
    text, type_hash = definition("a/msg/Top")
    parts = text.split(SEPARATOR)
    assert [part.split("\n")[0] for part in parts[1:]] == ["MSG: b/Low", "MSG: a/Inner"]
    assert type_hash == "RIHS01_Top"
    assert definition("a/Top")[0] == text


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
        pytest.skip(f"{name} is not installed under {default_prefixes()}")
    assert type_hash == STORE.hash_rihs01(name)
    assert text.count("MSG: ") == STORE.generate_msgdef(name, ros_version=2)[0].count("MSG: ")
