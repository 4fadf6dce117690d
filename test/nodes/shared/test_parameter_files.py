from pathlib import Path

import pytest

from stiction_ros.errors import InputError
from stiction_ros.nodes.shared.parameter_files import applies, given, node_keys, unused


@pytest.mark.parametrize(
    ("key", "node", "expected"),
    [
        ("plant", "/plant", True),
        ("/plant", "/plant", True),
        ("plant", "/unit1/plant", False),
        ("/unit1/plant", "/unit1/plant", True),
        ("unit1/plant", "/unit1/plant", True),
        ("/unit1/plant", "/plant", False),
        ("/**", "/unit1/plant", True),
        ("/**", "/plant", True),
        ("/**/plant", "/plant", True),
        ("/**/plant", "/a/b/plant", True),
        ("/**/plant", "/a/b/plants", False),
        ("/*/plant", "/unit1/plant", True),
        ("/*/plant", "/plant", False),
        ("/*/plant", "/a/b/plant", False),
        ("/unit*/plant", "/unit7/plant", True),
        ("p.ant", "/plant", False),
    ],
)
def test_which_keys_go_to_which_node(key: str, node: str, expected: bool) -> None:
    assert applies(key, node) is expected


def test_nested_keys_are_one_name(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("unit1:\n  plant: {ros__parameters: {seed: 1}}\nctl: {ros__parameters: {}}\n")
    assert node_keys(str(path)) == ["unit1/plant", "ctl"]


def test_a_file_for_others_is_named_with_its_keys(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("plant: {ros__parameters: {seed: 1}}\n")
    said = unused(str(path), "/unit1/plant")
    assert all(part in said for part in (str(path), "/unit1/plant", "only for plant", "/**/plant"))
    assert unused(str(path), "/plant") == ""


@pytest.mark.parametrize(
    "text", [None, "plant: [", "- 1", "", "plant: 3", "\x00", "plant: {parameters: {seed: 1}}"]
)
def test_a_file_that_is_none_is_one_line(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "p.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=r"p\.yaml") as found:
        node_keys(str(path))
    assert "\n" not in str(found.value)


def test_files_are_found_on_the_command_line() -> None:
    line = ["plant", "--ros-args", "--params-file", "a", "-p", "seed:=1", "--params-file", "b"]
    assert given(line) == ["a", "b"]
