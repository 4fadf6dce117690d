"""What a process loads before it does anything."""

import os
import subprocess
import sys

import pytest

from stiction_ros.cli import extensions
from stiction_ros.cli.main import COMMANDS

HEAVY = {"scipy", "numba", "casadi", "daqp", "matplotlib"}
ROS_FREE = {"rclpy"}
COMMAND = (
    "import sys; from stiction_ros.cli.main import main\n"
    "try: code = main({arguments!r})\n"
    "except SystemExit as end: code = end.code"
)
WRONG = (
    ["identify", "no.csv"],
    ["gap", "no.loop.yaml", "no.csv"],
    ["fit-linear", "no.csv"],
    ["report", "no.csv"],
    ["replay", "no_bag"],
    ["convert", "no.csv", "out"],
    ["repair", "no_bag"],
    ["simulate", "no.loop.yaml"],
    ["simulate", "no.loop.yaml", "--moves", "prbs"],
    ["demo", "nowhere"],
    ["study", "nowhere"],
    ["study-change", "nowhere"],
    ["study-control", "--cases", "none"],
    ["faults", "--only", "none"],
    ["soak"],
    ["example", "3"],
    ["bench", "nothing"],
)


def loaded(code: str) -> tuple[int, set[str]]:
    """Return the exit code that ``code`` leaves in ``code``, and the packages it has loaded."""
    tail = "\nprint(code, *sorted({name.partition('.')[0] for name in sys.modules}))"
    done = subprocess.run(
        [sys.executable, "-c", code + tail],
        check=True,
        capture_output=True,
        text=True,
        env=os.environ | {"COLUMNS": "80"},
    )
    end, *names = done.stdout.splitlines()[-1].split()
    return int(end), set(names)


def test_the_package_alone_loads_nothing_but_python() -> None:
    before = loaded("import sys; code = 0")[1]
    after = loaded("import sys, stiction_ros; code = 0")[1]
    third = {name for name in after - before if name not in sys.stdlib_module_names}
    assert third == {"stiction_ros"}


def test_help_loads_no_command() -> None:
    code, names = loaded(COMMAND.format(arguments=["--help"]))
    assert code == 0
    assert not names & (HEAVY | ROS_FREE | {"numpy", "rich"})


def test_what_is_wrong_is_told_without_loading_what_computes() -> None:
    """All of it in one process, as whatever one command loads is still there for the next."""
    commands = [*COMMANDS, *extensions.commands()]
    asked = [*([command, "--no-such-option"] for command in commands), *WRONG]
    code = (
        "import sys; from stiction_ros.cli.main import main\n"
        "for given in ASKED:\n"
        "    try: code = main(given)\n"
        "    except SystemExit as end: code = end.code\n"
        "    found = [name for name in HEAVY if name in sys.modules]\n"
        "    if code != 2 or found: sys.exit(f'{given} ended with {code} and had loaded {found}')"
    )
    heavy = sorted(HEAVY | ROS_FREE)
    done = subprocess.run(
        [sys.executable, "-c", code.replace("ASKED", repr(asked)).replace("HEAVY", repr(heavy))],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.trial
@pytest.mark.parametrize("node", ["recorder", "plant", "player"])
def test_nodes_load_nothing_that_they_do_not_use(node: str) -> None:
    pytest.importorskip("rclpy", reason="no ROS")
    code = f"import sys, stiction_ros.nodes.{node}; code = 0"
    tail = "; print([n for n in sys.modules if n.startswith('stiction_ros.')], file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", code + tail], check=True, capture_output=True, text=True
    )
    above = ("identification", "control", "discrepancy", "report")
    assert not [name for name in above if f"stiction_ros.{name}" in done.stderr]
    assert not loaded(code)[1] & HEAVY


@pytest.mark.trial
def test_an_identification_loads_no_slow_part_of_scipy() -> None:
    code = (
        "import sys\n"
        "from stiction_ros.identification.warm_up import compile_loops\n"
        "import stiction_ros.nodes.controller, stiction_ros.nodes.estimator\n"
        "import stiction_ros.survey.engines.local\n"
        "compile_loops(['exact'])\n"
        "print(*(f'scipy.{part}' for part in SLOW if f'scipy.{part}' in sys.modules))"
    )
    pytest.importorskip("rclpy", reason="no ROS")
    slow = ["signal", "stats", "interpolate", "optimize"]
    done = subprocess.run(
        [sys.executable, "-c", code.replace("SLOW", repr(slow))],
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout.split() == []
