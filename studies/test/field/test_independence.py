"""The field shares no model with what is judged by it."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "stiction_ros"
ALLOWED = {"records", "errors", "settings", "compiled", "field"}
JUDGED = {
    "blind",
    "control",
    "discrepancy",
    "effects",
    "examples",
    "identification",
    "loop",
    "online",
    "processes",
}


def imported(path: Path) -> dict[str, set[str]]:
    """Return the modules of the package that a file imports, with the names it takes."""
    found: dict[str, set[str]] = {}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.startswith("stiction_ros."):
                    found.setdefault(alias.name, set())
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, path
            assert node.module is not None
            if node.module == "stiction_ros":
                for alias in node.names:
                    found.setdefault(f"stiction_ros.{alias.name}", set())
            elif node.module.startswith("stiction_ros."):
                found.setdefault(node.module, set()).update(alias.name for alias in node.names)
    return found


def file_of(module: str) -> Path:
    path = PACKAGE.joinpath(*module.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def test_the_field_imports_nothing_that_is_judged() -> None:
    files = sorted((PACKAGE / "field").rglob("*.py"))
    assert files
    for path in files:
        for module in imported(path):
            assert module.split(".")[1] in ALLOWED, f"{path.name} imports {module}"


def test_nothing_that_it_imports_does_either_but_for_a_type() -> None:
    waiting = list((PACKAGE / "field").rglob("*.py"))
    seen: set[Path] = set()
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        for module, names in imported(path).items():
            if module.split(".")[1] in JUDGED:
                assert names == {"FloatArray"}, f"{path.name} imports {names} of {module}"
            else:
                waiting.append(file_of(module))
    assert len(seen) > 12


def test_the_folder_stays_small() -> None:
    for folder in (PACKAGE / "field", PACKAGE / "field" / "hidden"):
        assert 1 < len(list(folder.glob("*.py"))) <= 12
    files = list((PACKAGE / "field").rglob("*.py"))
    assert all(len(path.read_text(encoding="utf-8").splitlines()) <= 400 for path in files)
