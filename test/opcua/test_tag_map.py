"""Tag maps are read whole or refused with the place and the fix."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.opcua.tag_map import TagMap, check_address

LOOP: dict[str, Any] = {
    "loop": "FIC101",
    "sample_time": 1.0,
    "outputs": [{"name": "F", "pv": "ns=2;s=FIC101.PV", "sp": "ns=2;s=FIC101.SP"}],
    "valves": [
        {
            "name": "V1",
            "op_read": "ns=2;s=FIC101.OUT",
            "op": "ns=2;s=FIC101.ROUT_IN",
            "mode": "ns=2;s=FIC101.MODE",
            "limits": [5.0, 95.0],
            "rate": 2.0,
        }
    ],
    "write": {
        "request": "nsu=urn:plant;s=FIC101.REQ",
        "granted": ["ROUT"],
        "heartbeat": "ns=2;s=FIC101.BEAT",
    },
}


def load(folder: Path, *loops: Any, **top: Any) -> TagMap:
    path = folder / "unit.tags.yaml"
    path.write_text(yaml.safe_dump({"loops": list(loops), **top}), encoding="utf-8")
    return TagMap.load(path)


def test_a_loop_is_read(tmp_path: Path) -> None:
    found = load(tmp_path, LOOP, server="opc.tcp://plant:4840/unit")
    (loop,) = found.loops
    assert found.server == "opc.tcp://plant:4840/unit"
    assert (loop.loop, loop.namespace, loop.sample_time) == ("FIC101", "FIC101", 1.0)
    assert loop.valves[0].limits == (5.0, 95.0)
    assert loop.grant is not None
    assert loop.grant.watchdog == 5.0
    assert "ns=2;s=FIC101.PV" in loop.read_tags()
    assert "ns=2;s=FIC101.ROUT_IN" not in loop.read_tags()
    assert dict(loop.uses()).keys() == {
        "nsu=urn:plant;s=FIC101.REQ",
        "ns=2;s=FIC101.BEAT",
        "ns=2;s=FIC101.ROUT_IN",
    }


def test_without_a_section_write_nothing_may_be_written(tmp_path: Path) -> None:
    loop = {key: value for key, value in LOOP.items() if key != "write"}
    assert list(load(tmp_path, loop).loops[0].uses()) == []


def changed(*path: Any, value: Any) -> dict[str, Any]:
    loop: Any = yaml.safe_load(yaml.safe_dump(LOOP))
    place = loop
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return dict(loop)


@pytest.mark.parametrize(
    ("loop", "where"),
    [
        (changed("outputs", 0, "pv", value="FIC101.PV"), "pv"),
        (changed("valves", 0, "limits", value=[95.0, 5.0]), "limits"),
        (changed("valves", 0, "rate", value=0.0), "rate"),
        (changed("write", "granted", value=[]), "granted"),
        (changed("write", "watchdog", value=0.0), "watchdog"),
        (changed("valves", 0, "mode", value=None), "mode"),
        (changed("valves", 0, "op", value="ns=2;s=FIC101.OUT"), "op_read of a valve as well"),
        (changed("sample_time", value=-1.0), "sample_time"),
        (changed("loop", value="FIC 101"), "loop"),
        (changed("colour", value="red"), "colour"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, loop: Any, where: str) -> None:
    with pytest.raises(InputError, match=where):
        load(tmp_path, loop)


def test_a_tag_that_is_written_has_one_writer(tmp_path: Path) -> None:
    other = changed("loop", value="FIC102")
    with pytest.raises(InputError, match="written tag"):
        load(tmp_path, LOOP, other)


@pytest.mark.parametrize("server", ["http://plant", "opc.tcp://me:sesame@plant:4840"])
def test_an_address_that_is_none_or_holds_a_password_is_refused(
    tmp_path: Path, server: str
) -> None:
    with pytest.raises(InputError) as raised:
        load(tmp_path, LOOP, server=server)
    assert "sesame" not in str(raised.value)


@pytest.mark.parametrize("port", ["65536", "99999", "0", "-1", "", "48a0", "9" * 40, "٤٨"])
def test_a_port_that_is_none_is_one_sentence(
    port: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    address = f"opc.tcp://127.0.0.1:{port}/unit"
    with pytest.raises(InputError, match="is no port; use 1 to 65535"):
        check_address(address, "URL")
    assert main(["certificates", "pin", address]) == 2
    out = ["--sample-time", "1", "--out", str(tmp_path / "found.tags.yaml"), "--security", "none"]
    assert main(["browse-tags", address, *out]) == 2
    path = tmp_path / "unit.tags.yaml"
    path.write_text(yaml.safe_dump({"server": address, "loops": [LOOP]}), encoding="utf-8")
    days = ["--from", "2026-01-01", "--to", "2026-01-02", "--out", str(tmp_path / "history")]
    fetch = ["fetch-history", address, "--tags", str(path), *days, "--security", "none"]
    assert main(fetch) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 3
    assert all("is no port" in line for line in told)


@pytest.mark.parametrize(
    "address",
    ["plant", "plant:1/unit", "plant:65535", "10.0.0.7:4840", "[::1]:4840/unit", "[fe80::1]"],
)
def test_addresses_that_are_well(address: str) -> None:
    check_address(f"opc.tcp://{address}", "URL")


@pytest.mark.parametrize("address", [":4840", "[::1:4840", "::1:4840", "[]:4840"])
def test_an_address_without_a_machine_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="is no address of a server"):
        check_address(f"opc.tcp://{address}", "URL")
