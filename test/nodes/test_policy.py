"""The access control file allows what the nodes do, and no second commander."""

import datetime
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml
from graph import Graph

from stiction_ros.cli.shared.scenarios import STARTED, find, loop_nodes
from stiction_ros.config_files import find_config
from stiction_ros.opcua.security import CLIENT_URI, Identity, make_certificate, write_secret

NODES = (*STARTED, "opcua")


def allowed(node: str, kind: str, right: str) -> set[str]:
    """Return the names (of topics or services) that ``node`` has a right to."""
    root = ElementTree.parse(find_config("sros2_policy.xml")).getroot()
    (enclave,) = root.findall(f"./enclaves/enclave[@path='/stiction_ros/{node}']")
    profile = enclave.find(f"./profiles/profile[@node='{node}']")
    assert profile is not None
    found = profile.findall(f"./{kind}s[@{right}='ALLOW']/{kind}")
    return {str(one.text) for one in found}


def bridged(folder: Path) -> dict[str, Any]:
    """Return the parameters of a bridge that may write one loop in its own namespace."""
    now = datetime.datetime.now(datetime.UTC)
    certificate, key, word = folder / "our.der", folder / "our.pem", folder / "word"
    make_certificate(Identity(CLIENT_URI, ("127.0.0.1",), False, now, 1), certificate, key)
    write_secret(word, b"sesame")
    tags = {
        name: f"ns=2;s={name}" for name in ("PV", "SP", "OUT", "IN", "MODE", "F", "REQ", "BEAT")
    }
    loop = {
        "loop": "unit",
        "namespace": "",
        "sample_time": 1.0,
        "outputs": [{"name": "PV1", "pv": tags["PV"], "sp": tags["SP"]}],
        "valves": [{"name": "V1", "op_read": tags["OUT"], "op": tags["IN"], "mode": tags["MODE"]}],
        "disturbances": [{"name": "F", "tag": tags["F"]}],
        "write": {"request": tags["REQ"], "granted": ["ROUT"], "heartbeat": tags["BEAT"]},
    }
    file = folder / "unit.tags.yaml"
    file.write_text(yaml.safe_dump({"server": "opc.tcp://127.0.0.1:1", "loops": [loop]}))
    return {
        "tags": str(file),
        "certificate": str(certificate),
        "private_key": str(key),
        "server_certificate": str(certificate),
        "user": "bridge",
        "password_file": str(word),
        "write": ["unit"],
    }


def test_op_comes_from_the_controller_alone() -> None:
    publishers = [node for node in NODES if "/op" in allowed(node, "topic", "publish")]
    assert publishers == ["controller"]


def test_the_nodes_may_do_what_they_do(graph: Graph, tmp_path: Path) -> None:
    values = loop_nodes(find("tank"), tmp_path)
    built: dict[str, Any] = {}
    values["opcua"] = bridged(tmp_path)
    for name in NODES:
        built[name] = graph.add(name, values[name] | {"wait_for": [""]})
        built[name].trigger_configure()
        assert built[name].failure == ""
    said: set[str] = {"/sp_preview"}
    for name, node in built.items():
        topics = {t for t, _ in node.get_publisher_names_and_types_by_node(name, "/")}
        topics.add(f"/{name}/config")  # announced when the node is ready
        topics |= {"/dv"} if name == "plant" else set()  # of models with measured disturbances
        said |= topics
        assert topics == allowed(name, "topic", "publish")
        services = {s for s, _ in node.get_service_names_and_types_by_node(name, "/")}
        assert services == allowed(name, "service", "reply")
    for name, node in built.items():
        heard = {t for t, _ in node.get_subscriber_names_and_types_by_node(name, "/")}
        may = allowed(name, "topic", "subscribe")
        assert heard <= may
        assert may <= said
    assert said == allowed("recorder", "topic", "subscribe")
