"""The Foxglove layout names topics and fields that a recorded run has."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from stiction_ros.records.bag.playback import bag_content

ROOT = Path(__file__).resolve().parents[2]
LAYOUT = json.loads((ROOT / "config" / "foxglove_layout.json").read_text())
STORE = get_typestore(Stores.ROS2_JAZZY)


def paths(value: Any) -> list[str]:
    """Return every message path and topic in the settings of the panels."""
    if isinstance(value, dict):
        keys = ("value", "topicPath", "topicToRender")
        own = [value[key] for key in keys if value.get(key)]
        return own + [path for item in value.values() for path in paths(item)]
    return [path for item in value for path in paths(item)] if isinstance(value, list) else []


@pytest.fixture(scope="module")
def types() -> dict[str, str]:
    topics = bag_content(ROOT / "bags" / "sticky_tank").topics
    return {name: topic.type for name, topic in topics.items()}


@pytest.mark.parametrize("path", paths(LAYOUT["configById"]))
def test_every_path_leads_to_a_field_of_a_recorded_topic(path: str, types: dict[str, str]) -> None:
    topic, *fields = path.split(".")
    assert topic in types
    kind = types[topic]
    for field in fields:
        name, index = re.fullmatch(r"(\w+?)(\[\d+\])?", field).groups()  # type: ignore[union-attr]
        known = {entry[0]: entry[1] for entry in STORE.fielddefs[kind][1]}
        assert name in known, f"{kind} has no field {name}"
        node, what = known[name]
        assert (node in (Nodetype.ARRAY, Nodetype.SEQUENCE)) == (index is not None)
        if index is not None:
            node, what = what[0]
        kind = what if node is Nodetype.NAME else ""


@pytest.mark.parametrize("topic", ["/pv", "/sp", "/op", "/stem", "/stiction", "/mode"])
def test_every_signal_is_shown(topic: str) -> None:
    assert topic in {path.partition(".")[0] for path in paths(LAYOUT["configById"])}


def panels(layout: Any) -> list[str]:
    if isinstance(layout, str):
        return [layout]
    return [*panels(layout["first"]), *panels(layout["second"])]


def test_every_panel_is_placed_once() -> None:
    assert sorted(panels(LAYOUT["layout"])) == sorted(LAYOUT["configById"])
