"""How large the package may be. The ceilings are lowered, never raised."""

import ast
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINES = 59_676
LINES_OF_STUDIES = 22_938
NUMERIC_CONSTANTS = 706

MODULE = """
PLAIN = 3
_SIGNED: float = -1.5e-3
FEW = (1, 2.0, -3)
FIRST, SECOND = 1, 2
SAME = AGAIN = 60 * 60
L2 = 2.0**0.5
MIXED, WORD = 1, "word"
NAMED = PLAIN + 1
TRUE = True
NONE = ()
WORDS = ("a", "b")
LATER: int
Half = 0.5
lower = 1


def inside():
    INSIDE = 1
"""


@pytest.fixture(scope="module")
def house() -> ModuleType:
    spec = importlib.util.spec_from_file_location("house", ROOT / "tools" / "house.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def held(what: str, found: int, ceiling: int) -> None:
    assert found <= ceiling, f"{what}: {found}, the ceiling is {ceiling}"


def test_lines_stay_below_their_ceiling(house: ModuleType) -> None:
    held("lines of stiction_ros", house.lines_of(ROOT / house.PACKAGE), LINES)


def test_lines_of_the_studies_stay_below_their_ceiling(house: ModuleType) -> None:
    held("lines of stiction_studies", house.lines_of(ROOT / house.STUDIES), LINES_OF_STUDIES)


def test_numeric_constants_stay_below_their_ceiling(house: ModuleType) -> None:
    found = house.numeric_constants(ROOT / house.PACKAGE)
    held("numeric constants of stiction_ros", found, NUMERIC_CONSTANTS)


def test_each_name_that_is_given_a_number_counts(house: ModuleType) -> None:
    assert house.constants(ast.parse(MODULE)) == [
        *("PLAIN", "_SIGNED", "FEW", "FIRST", "SECOND", "SAME", "AGAIN", "L2", "MIXED")
    ]


def test_lines_are_those_of_wc(house: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "one.py").write_text("a = 1\nb = 2\n")
    (tmp_path / "two.py").write_text("c = 3\nd = 4")
    (tmp_path / "other.txt").write_text("\n\n")
    assert house.lines_of(tmp_path) == 3
