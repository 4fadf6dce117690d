"""The floors of the package: who imports whom, as pyproject.toml says it."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
    "importlinter"
]["contracts"]
COMMAND = Path(sys.executable).with_name("lint-imports")


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(COMMAND), "--no-logo", "--no-cache"], cwd=folder, capture_output=True, text=True
    )


def test_the_floors_hold() -> None:
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout


def test_every_sub_package_stands_in_a_contract() -> None:
    named = str([contract.get("layers", contract.get("source_modules")) for contract in CONTRACTS])
    folders = [path.parent.name for path in (ROOT / "stiction_ros").glob("*/__init__.py")]
    assert not [name for name in folders if f"stiction_ros.{name}" not in named]


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("stiction_ros.loop", "from stiction_ros.control import MpcController"),
        ("stiction_ros.online", "import rclpy"),
        ("stiction_ros.gain", "import stiction_studies"),
        ("stiction_studies.field", "from stiction_ros.loop import LoopModel"),
    ],
)
def test_an_import_that_runs_up_is_noticed(tmp_path: Path, module: str, line: str) -> None:
    small_tree(tmp_path)
    assert lint(tmp_path).returncode == 0
    (tmp_path / module.replace(".", "/") / "wrong.py").write_text(line + "\n")
    done = lint(tmp_path)
    assert done.returncode == 1
    assert f"{module}.wrong" in done.stdout


def test_rooms_that_import_each_other_are_noticed(tmp_path: Path) -> None:
    small_tree(tmp_path)
    for room, other in (("state", "valves"), ("valves", "state")):
        folder = tmp_path / "stiction_ros" / "control" / room
        folder.mkdir()
        (folder / "__init__.py").write_text("")
        (folder / "one.py").write_text("")
        (folder / "two.py").write_text(f"from stiction_ros.control.{other} import one\n")
    done = lint(tmp_path)
    assert done.returncode == 1
    assert "No cycles are allowed in stiction_ros.control" in done.stdout


def small_tree(folder: Path) -> None:
    """Write a tree of the same names, in which nothing imports anything."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    # The imports that are left out of the contracts are not in this small tree.
    lines = [row for row in text.splitlines() if " -> stiction_ros" not in row]
    (folder / "pyproject.toml").write_text("\n".join(lines), encoding="utf-8")
    for package in (ROOT / "stiction_ros", ROOT / "studies" / "stiction_studies"):
        for path in (package / "__init__.py", *package.glob("*/__init__.py")):
            copy = folder / path.relative_to(package.parent)
            copy.parent.mkdir(parents=True)
            copy.write_text("")
        for path in package.glob("[!_]*.py"):
            (folder / package.name / path.name).write_text("")
    (folder / "stiction_ros" / "control" / "__init__.py").write_text("class MpcController: ...\n")
