"""The field shares no model with what is judged by it."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = {"stiction_ros": ROOT, "stiction_studies": ROOT / "studies"}
FIELD = ROOT / "studies" / "stiction_studies" / "field"
ALLOWED = {"records", "errors", "settings", "compiled", "field"}
TYPES = {"BoolArray", "FloatArray", "IntArray"}
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
                if alias.name.partition(".")[0] in PACKAGES:
                    found.setdefault(alias.name, set())
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, path
            assert node.module is not None
            if node.module in PACKAGES:
                for alias in node.names:
                    found.setdefault(f"{node.module}.{alias.name}", set())
            elif node.module.partition(".")[0] in PACKAGES:
                found.setdefault(node.module, set()).update(alias.name for alias in node.names)
    return found


def file_of(module: str) -> Path:
    package = module.partition(".")[0]
    path = PACKAGES[package].joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def test_the_field_imports_nothing_that_is_judged() -> None:
    files = sorted((FIELD).rglob("*.py"))
    assert files
    for path in files:
        for module in imported(path):
            assert module.split(".")[1] in ALLOWED, f"{path.name} imports {module}"


def test_nothing_that_it_imports_does_either_but_for_a_type() -> None:
    waiting = list((FIELD).rglob("*.py"))
    seen: set[Path] = set()
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        for module, names in imported(path).items():
            if module.split(".")[1] in JUDGED:
                assert names <= TYPES, f"{path.name} imports {names} of {module}"
            else:
                waiting.append(file_of(module))
    assert len(seen) > 12


def test_the_files_stay_small() -> None:
    files = list(FIELD.rglob("*.py"))
    assert all(len(path.read_text(encoding="utf-8").splitlines()) <= 400 for path in files)
