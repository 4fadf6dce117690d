"""The script that measures the house."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

import stiction_ros

ROOT = Path(__file__).resolve().parents[2]

STUB = '''"""A package."""
from stiction_ros.loop.model import Loop as Loop, hidden as alias, told as told
'''
MODEL = '''"""A module.

Two more lines.
"""
# a comment
x = 1  # another


def told(a, b):
    """Do.

    Args:
        a, b: numbers.
    """


def hidden(a):
    """Do with ``a``."""


def silent(a, *rest):
    """Do.

    Args:
        a: number.
    """


class Loop:
    """One."""

    def method(self, path):
        """Do."""

    def _own(self, path):
        pass

    @property
    def size(self):
        """No argument."""
'''


@pytest.fixture(scope="module")
def house() -> ModuleType:
    spec = importlib.util.spec_from_file_location("house", ROOT / "tools" / "house.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    folder = tmp_path / "stiction_ros" / "loop"
    folder.mkdir(parents=True)
    (folder.parent / "__init__.pyi").write_text(STUB)
    (folder / "__init__.py").write_text('"""Empty."""\n')
    (folder / "model.py").write_text(MODEL)
    return tmp_path


def test_lines_and_functions_are_counted(house: ModuleType, tree: Path) -> None:
    source = house.read(tree, tree / "stiction_ros" / "loop" / "model.py")
    assert source.lines == len(MODEL.splitlines())
    assert source.docstring == 4 + 5 + 1 + 5 + 1 + 1 + 1
    assert source.comment == 2
    assert source.functions == {"told": True, "hidden": True, "silent": False, "Loop.method": False}


def test_public_names_are_followed_home(house: ModuleType, tree: Path) -> None:
    model = house.read(tree, tree / "stiction_ros" / "loop" / "model.py")
    found = house.public_functions(tree, [model])
    assert found == {"told": True, "Loop.method": False, "alias": True}


def test_the_check_fails_where_an_aim_is_missed(
    house: ModuleType, tree: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert house.main(["--root", str(tree)]) == 0
    assert house.main(["--root", str(tree), "--check"]) == 1
    said = capsys.readouterr().out
    assert "examples                            0  ≥ 10: missed" in said


def test_the_house_keeps_its_aims(house: ModuleType) -> None:
    found = {row.what: row for row in house.rows(ROOT)}
    assert [row for row in found.values() if row.met is False] == []
    for what in ("arguments explained, public names", "public names", "examples", "documents"):
        assert found[what].met, found[what]
    homes = house.public_homes(ROOT)
    assert set(homes) == set(stiction_ros._HOMES)
