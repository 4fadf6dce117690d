import pytest
from as_given import run_metadata
from bag_making import Bag, text

from stiction_ros.records.bag.run_metadata import custom_data, mapping_of, merged, news, string_of
from stiction_ros.records.storage.mcap_scan import McapScan

STRING = "std_msgs/msg/String"


@pytest.mark.parametrize("said", ["", "seed: 7", "Füllstand %\n" * 50])
def test_the_text_of_a_message(said: str) -> None:
    assert string_of(text(said)) == said


@pytest.mark.parametrize(
    "data", [b"", b"\0\1\0\0", b"\0\1\0\0\xff\0\0\0ab", b"\0\1\0\0\2\0\0\0\xff\xff"]
)
def test_what_is_no_text_is_none(data: bytes) -> None:
    assert string_of(data) is None


def test_the_other_byte_order() -> None:
    assert string_of(b"\0\0\0\0\0\0\0\3ab\0") == "ab"


def test_configurations_tell_seed_and_version() -> None:
    said = "node: /u/plant\nseed: 5\nversion: '0.2'\n"
    assert news("/u/plant/config", STRING, text(said)) == {
        "config:/u/plant": said,
        "seed": "5",
        "version": "0.2",
    }


def test_other_topics_and_types_tell_nothing() -> None:
    assert news("/mode", STRING, text("hold")) == {}
    assert news("/plant/config", "std_msgs/msg/Header", text("seed: 1")) == {}


@pytest.mark.parametrize("said", ["seed: [", "- seed", "text"])
def test_a_configuration_that_is_no_mapping_is_kept_as_text(said: str) -> None:
    assert news("/plant/config", STRING, text(said)) == {"config:/plant": said}


@pytest.mark.parametrize("said", ["a: [", "2026-13-45", "[" * 2000, "- 1", "only words", ""])
def test_a_text_that_holds_no_mapping_is_an_empty_one(said: str) -> None:
    assert mapping_of(said) == {}


def test_the_last_text_of_a_key_counts() -> None:
    records = [
        ("stiction_run", {"a": "1", "b": "1"}),
        ("x", {"a": "9"}),
        ("stiction_run", {"a": "2"}),
    ]
    assert merged(records) == {"a": "2", "b": "1"}
    assert custom_data({"seed": "1", "config:/plant": "…"}) == {"seed": "1"}


def test_a_bag_tells_of_its_run_and_keeps_other_metadata(bag: Bag) -> None:
    bag.writer.add_metadata("site", {"unit": "12"})
    for number in range(3):
        bag.text("/loop_model", f"loop: {number}", number)
    bag.writer.close()
    found = run_metadata(bag.writer.directory)
    assert found["loop_model:/loop_model"] == "loop: 2"
    assert found["recorder"].startswith("stiction_ros ")
    scan = McapScan(bag.writer.directory / "run_0.mcap")
    assert list(scan.messages())
    assert ("site", {"unit": "12"}) in scan.metadata
    assert [name for name, _ in scan.metadata].count("stiction_run") == 1
