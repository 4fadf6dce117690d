"""The same tree installs under pip and under colcon where `ros2 run` looks.

`ros2 run` finds the package through the ament index and its executables in lib/stiction_ros.
"""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest
from packaging.metadata import Metadata

from stiction_ros.cli.extensions import OF_STUDIES
from stiction_ros.nodes.__main__ import NODES

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("launchers", "resource", "config", "stiction_ros")
FILES = ("setup.py", "setup.cfg", "pyproject.toml", "package.xml", "LICENSE", "README.md")

pytest.importorskip("ament_index_python")
pytestmark = pytest.mark.slow


def run(*command: object, **environment: str) -> str:
    """Run a command that must succeed and return what it printed."""
    done = subprocess.run(
        [str(word) for word in command],
        env=os.environ | environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy the package, as building leaves files beside setup.py."""
    root = tmp_path_factory.mktemp("tree")
    for part in PARTS:
        if (ROOT / part).is_dir():
            skip = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / part, root / part, symlinks=True, ignore=skip)
    for name in FILES:
        shutil.copy(ROOT / name, root / name)
    return root


@pytest.fixture(scope="module")
def wheels(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Build the wheels of the package and of its studies."""
    where, studies = tmp_path_factory.mktemp("wheels"), tmp_path_factory.mktemp("of") / "studies"
    shutil.copytree(ROOT / "studies", studies, ignore=shutil.ignore_patterns("__pycache__"))
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", where]
    run(sys.executable, "-m", "pip", "wheel", *options, tree, studies)
    return sorted(where.glob("*.whl"))


@pytest.fixture(scope="module")
def pip_prefix(wheels: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into a new environment that sees what else this one has, but no studies."""
    prefix = tmp_path_factory.mktemp("pip") / "environment"
    shared = tmp_path_factory.mktemp("shared")
    for entry in Path(sysconfig.get_path("purelib")).iterdir():
        if not entry.name.startswith(("stiction", "__editable__")):
            (shared / entry.name).symlink_to(entry)
    run(sys.executable, "-m", "venv", "--without-pip", prefix)
    site = prefix / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
    (site / "shared.pth").write_text(f"{shared}\n")
    python = prefix / "bin" / "python"
    pip = (sys.executable, "-m", "pip", "--python", python)
    run(*pip, "install", "--no-deps", "--no-index", wheels[0])
    return prefix


def colcon(tree: Path, where: Path, *options: str) -> Path:
    """Build the workspace and return the prefix of the package."""
    program = Path(sys.executable).with_name("colcon")
    if not program.exists():
        pytest.skip("colcon is not installed")
    bases = ["--base-paths", tree, "--build-base", where / "build", "--install-base", where / "i"]
    log = ["--log-base", where / "log"]
    run(program, *log, "build", *bases, *options, COLCON_HOME=str(where / "home"))
    return where / "i" / "stiction_ros"


@pytest.fixture(scope="module")
def colcon_prefix(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return colcon(tree, tmp_path_factory.mktemp("colcon"))


@pytest.fixture(scope="module")
def symlink_prefix(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return colcon(tree, tmp_path_factory.mktemp("symlink"), "--symlink-install")


@pytest.fixture(params=["pip", "colcon", pytest.param("symlink", marks=pytest.mark.trial)])
def prefix(request: pytest.FixtureRequest) -> Path:
    return request.getfixturevalue(f"{request.param}_prefix")


def test_ament_index_knows_the_package(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ament_index_python import get_package_prefix, get_package_share_directory

    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))
    assert get_package_prefix("stiction_ros") == str(prefix)
    share = Path(get_package_share_directory("stiction_ros"))
    assert (share / "package.xml").read_text() == (ROOT / "package.xml").read_text()


def test_every_node_is_an_executable(prefix: Path) -> None:
    found = {path.name for path in (prefix / "lib" / "stiction_ros").iterdir() if path.is_file()}
    assert found == set(NODES)
    for name in found:
        assert os.access(prefix / "lib" / "stiction_ros" / name, os.X_OK)


def test_the_core_alone_lists_only_what_works(pip_prefix: Path, tmp_path: Path) -> None:
    assert not list(pip_prefix.rglob("stiction_studies*"))
    command = pip_prefix / "bin" / "stiction"
    listed = {line.split()[0] for line in run(command, "--help").splitlines() if line.strip()}
    assert {"identify", "simulate", "survey", "gap", "replay", "demo"} <= listed
    assert not listed & {name.partition(" ")[0] for name in OF_STUDIES} - {"demo"}
    history = tmp_path / "history.csv"
    run(command, "simulate", "flow.loop.yaml", "--samples", "600", "--out", history)
    assert history.stat().st_size > 0
    told = subprocess.run([str(command), "paper"], capture_output=True, text=True)
    assert told.returncode == 2
    assert "stiction-studies" in told.stderr


def test_wheels_would_stand_on_a_public_index(wheels: list[Path]) -> None:
    assert [wheel.name[:12] for wheel in wheels] == ["stiction_ros", "stiction_stu"]
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as content:
            names = content.namelist()
            (told,) = (name for name in names if name.endswith(".dist-info/METADATA"))
            metadata = Metadata.from_email(content.read(told))  # refuses what an index refuses
        assert metadata.summary
        assert metadata.description
        assert metadata.description_content_type == "text/markdown"
        assert metadata.license == "Apache-2.0"
        assert [name for name in names if name.endswith("LICENSE")]
        data = (".csv", ".mcap", ".db3", ".parquet", ".xlsx")
        assert not [name for name in names if "test" in name.split("/") or name.endswith(data)]


def test_the_wheel_holds_every_file_that_is_read_beside_the_modules(wheels: list[Path]) -> None:
    ends = ("css", "js", "json", "pyi", "typed", "yaml")
    files = (file for end in ends for file in (ROOT / "stiction_ros").rglob(f"*.{end}"))
    beside = {file.relative_to(ROOT).as_posix() for file in files}
    with zipfile.ZipFile(wheels[0]) as content:
        assert beside <= set(content.namelist())
    assert {"stiction_ros/pages/frame.css", "stiction_ros/pages/plot.js"} <= beside


@pytest.mark.trial
def test_the_first_program_of_the_readme_runs_with_the_core_alone(
    pip_prefix: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = (ROOT / "README.md").read_text(encoding="utf-8").partition("## Is it my valve?")[2]
    program = re.search(r"^```python\n(.*?)^```", part, re.MULTILINE | re.DOTALL)
    assert program is not None
    monkeypatch.chdir(tmp_path)
    run(pip_prefix / "bin" / "stiction", "simulate", "flow.loop.yaml", "--out", "history.csv")
    assert "V1 sticky" in run(pip_prefix / "bin" / "python", "-c", program[1])
    told = run(pip_prefix / "bin" / "stiction", "identify", "history.csv", "--out", "report")
    assert "Have V1 serviced" in " ".join(told.split())
    assert (tmp_path / "report" / "report.html").is_file()


def test_only_the_command_is_in_bin(prefix: Path) -> None:
    names = {path.name for path in (prefix / "bin").iterdir()}
    assert "stiction" in names
    assert not names & set(NODES)


def test_config_files_are_installed(prefix: Path) -> None:
    wanted = {
        path.name for kind in ("yaml", "xml", "json") for path in ROOT.glob(f"config/*.{kind}")
    }
    folder = prefix / "share" / "stiction_ros" / "config"
    assert {path.name for path in folder.glob("*")} == wanted


def test_type_checkers_are_told_that_the_package_is_typed(pip_prefix: Path) -> None:
    assert list(pip_prefix.glob("lib/python*/site-packages/stiction_ros/py.typed"))


@pytest.mark.parametrize("name", NODES)
def test_launcher_starts_its_node_of_this_installation(
    prefix: Path, name: str, tmp_path: Path
) -> None:
    # Modules of the current folder must not be found instead of the installed ones.
    (tmp_path / "stiction_ros.py").write_text("raise SystemExit('wrong module')")
    shell = f'cd "{tmp_path}"; [ ! -e "{prefix}/../local_setup.sh" ] || . "{prefix}/../setup.sh"; '
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    probe = "import stiction_ros.nodes as n; print(n.__path__[0])"
    python = prefix / "bin" / "python"
    python = python if python.exists() else Path(sys.executable)
    where = run("sh", "-c", f'{shell} "{python}" -P -c "{probe}"', PATH=path).strip()
    assert Path(where).resolve() != ROOT / "stiction_ros" / "nodes"

    if importlib.util.find_spec(f"stiction_ros.nodes.{name}") is None:
        pytest.skip(f"there is no node {name} yet")
    launcher = prefix / "lib" / "stiction_ros" / name
    out = run("sh", "-c", f'{shell} "{launcher}" --help', PATH=path)
    assert "usage" in out.lower()
