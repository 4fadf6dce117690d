import os
import subprocess
import sys
from pathlib import Path

import pytest

CALLEE = """
from stiction_ros.compiled import compiled
from taken.constants import OFFSET

@compiled
def doubled(value: float) -> float:
    return {factor} * value + OFFSET
"""

CALLER = """
from stiction_ros.compiled import compiled
from taken.callee import doubled

@compiled
def more(value: float) -> float:
    return doubled(value) + 1.0
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "taken"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "constants.py").write_text("OFFSET = 0.0\n")
    (folder / "callee.py").write_text(CALLEE.format(factor=2.0))
    (folder / "caller.py").write_text(CALLER)
    return folder


def result(package: Path, **environment: str) -> float:
    """Return more(3.0), by a process of its own."""
    code = "from taken.caller import more; print(more(3.0))"
    path = {"PYTHONPATH": os.pathsep.join((str(package.parent), *sys.path))}
    told = subprocess.run(
        [sys.executable, "-c", code],
        cwd=package.parent,
        env=os.environ | path | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return float(told.stdout)


def codes(folder: Path) -> list[str]:
    return sorted(path.parent.parent.name for path in folder.rglob("caller.more*.nbc"))


@pytest.mark.trial
def test_machine_code_is_made_anew_when_a_function_that_it_calls_changes(package: Path) -> None:
    assert result(package) == 7.0
    kept = codes(package)
    assert result(package) == 7.0
    assert codes(package) == kept
    (package / "callee.py").write_text(CALLEE.format(factor=3.0))
    assert result(package) == 10.0
    (package / "constants.py").write_text("OFFSET = 5.0\n")
    assert result(package) == 15.0
    assert len(codes(package)) == 1  # what was made of former content is gone


def test_machine_code_is_kept_where_the_environment_says(package: Path, tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    folder.mkdir()
    assert result(package, NUMBA_CACHE_DIR=str(folder)) == 7.0
    assert len(codes(folder)) == 1
    assert not codes(package)


@pytest.mark.trial
def test_where_nothing_can_be_kept_functions_are_compiled_all_the_same(
    package: Path, tmp_path: Path
) -> None:
    nowhere = tmp_path / "file"
    nowhere.write_text("")
    (package / "__pycache__").write_text("")  # a file in its place
    assert result(package, NUMBA_CACHE_DIR=str(nowhere), HOME=str(nowhere)) == 7.0


@pytest.mark.trial
def test_threads_that_import_at_once_keep_machine_code_where_the_next_process_looks(
    package: Path,
) -> None:
    names = [f"caller_{k}" for k in range(12)]
    for name in names:
        (package / f"{name}.py").write_text(CALLER)
    code = (
        "import importlib, sys, threading\n"
        "import stiction_ros.compiled\n"
        "sys.setswitchinterval(1e-5)\n"
        f"names = {names}\n"
        "start = threading.Barrier(len(names))\n"
        "def load(name):\n"
        "    start.wait()\n"
        "    importlib.import_module('taken.' + name)\n"
        "threads = [threading.Thread(target=load, args=(name,)) for name in names]\n"
        "[thread.start() for thread in threads]\n"
        "[thread.join() for thread in threads]\n"
        "[sys.modules['taken.' + name].more(3.0) for name in names]\n"
    )
    path = {"PYTHONPATH": os.pathsep.join((str(package.parent), *sys.path))}
    subprocess.run([sys.executable, "-c", code], env=os.environ | path, check=True)
    made = {file.relative_to(package).parts[1] for file in package.rglob("*.more-*.nbi")}
    assert sorted(folder.rpartition("-")[0] for folder in made) == sorted(names)
