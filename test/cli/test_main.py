"""The command `stiction`: exit codes, one-line errors, results."""

import argparse
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.cli import extensions
from stiction_ros.cli.main import COMMANDS, GROUPS, main, parser, waiting_for_compiler
from stiction_ros.config_files import find_config
from stiction_ros.effects import HeStiction

ALL = (*COMMANDS, *extensions.commands())
COMPILING = """
import os, signal, traceback, types
from stiction_ros.cli import main

asked, compiles = [], main._compiles

def noting(frame):
    asked.append(compiles(frame))
    return asked[-1]

def interrupted_and_asked_again():
    os.kill(os.getpid(), signal.SIGINT)
    while len(asked) < 3:
        pass

signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background ignores it
main._compiles = noting
inside = types.ModuleType("llvmlite.inside")
exec("def called_back(told):\\n    told()\\n    print('went on')\\n", inside.__dict__)
try:
    with main.waiting_for_compiler():
        inside.called_back(interrupted_and_asked_again)
        while True:
            pass
except KeyboardInterrupt as error:
    places = [frame.f_globals["__name__"] for frame, _ in traceback.walk_tb(error.__traceback__)]
    print("interrupted", "inside" if "llvmlite.inside" in places else "behind")
print(*asked[:3], asked[-1])
"""


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short record of a sticky first-order loop under a sine of OP."""
    random = np.random.default_rng(3)
    time = np.arange(600)
    op = 50.0 + 8.0 * np.sin(time / 17.0) + 4.0 * np.sin(time / 41.0)
    stem = HeStiction(4.0, 1.0).simulate(op)
    pv = np.zeros(600)
    for k in range(1, 600):
        pv[k] = 0.8 * pv[k - 1] + 0.2 * (stem[k - 1] - 50.0)
    pv += 0.02 * random.standard_normal(600)
    path = tmp_path_factory.mktemp("record") / "loop.csv"
    rows = np.column_stack([time, op, pv])
    np.savetxt(path, rows, delimiter=",", header="t,OP,PV", comments="")
    return path


@pytest.mark.parametrize("name", ALL)
def test_every_command_explains_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        parser().parse_args([name, "--help"])
    assert end.value.code == 0
    assert "usage: stiction " + name in capsys.readouterr().out


def test_without_a_command_all_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    err = capsys.readouterr().err
    assert all(name in err for name in ALL)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["surwey", "x"], "there is no command surwey: did you mean survey?"),
        (["survey", "x", "--cots", "f"], "unknown option --cots: did you mean --cost"),
        (["survey", "x", "--dates", "dym"], "(choose from 'dmy', 'mdy')"),
        (["survey", "x", "--op-unit", "shar"], "invalid choice: 'shar' (choose from 'percent', "),
        (["identify", "a.csv", "b.csv"], "unexpected b.csv; it takes one record, stiction survey"),
    ],
)
def test_what_is_misspelt_is_told_with_what_may_be_meant(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    err = " ".join(capsys.readouterr().err.split())
    assert said in err
    assert "usage: stiction" in err
    assert "demo," not in err


def test_help_lists_each_command_once_in_short_lines(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        parser("").parse_args(["--help"])
    assert end.value.code == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 60
    assert sorted(line.split()[0] for line in lines if line.startswith("  ")) == sorted(ALL)
    groups = [line.partition(":")[0] for line in lines if ": " in line and line[0] != " "]
    assert groups == ["usage", "find", "decide", "act", "live", "plant", "makers"]
    grouped = [name for names in GROUPS.values() for name in names]
    assert sorted(grouped) == sorted(COMMANDS)


def test_every_option_says_what_it_is() -> None:
    below = [parser()]
    while below:
        one = below.pop()
        for action in one._actions:
            if isinstance(action, argparse._SubParsersAction):
                below += action.choices.values()
            else:
                said = (action.help or "").split(" (")[0]
                assert len(said) > 2, (one.prog, action.dest)
                assert not said.startswith(("of ", "(", "default")), (one.prog, action.dest)


def test_identify_lists_the_friction_laws(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parser().parse_args(["identify", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert "friction law: choudhury | he | kano | semi_physical | xch, or auto" in told


def test_identify_prints_the_contract_as_json(
    record: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["identify", str(record), "--na", "1", "--nb", "1", "--delay", "0:2", "--json", "-"]
    assert main(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["record"] == str(record)
    assert found["samples"] == 600
    (valve,) = found["valves"]
    assert valve["verdict"] == "sticky"
    assert valve["f_s"] == pytest.approx(4.0, abs=0.2)
    assert {"law", "f_s_interval", "f_d", "f_d_interval", "jump", "evidence"} <= valve.keys()
    (output,) = found["outputs"]
    wanted = {"name", "a", "b", "delay", "bias", "noise_std", "fit_one_step", "fit_free_run"}
    assert wanted <= output.keys()


@pytest.mark.parametrize("method", [["nlp", "--starts", "1"], ["grid", "--grid-step", "1"]])
def test_identify_by_the_paper_s_methods(
    method: list[str], record: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    orders = ["--na", "1", "--nb", "1", "--delay", "0"]
    assert main(["identify", str(record), *orders, "--json", "-", "--method", *method]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["model"]["method"] == method[0]
    assert found["model"]["search"]["squared_error"] > 0.0
    assert found["valves"][0]["f_s"] == pytest.approx(4.0, abs=0.5)


@pytest.mark.parametrize("method", ["exact", "grid"])
def test_the_largest_friction_can_be_chosen(
    method: str, record: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    orders = ["--na", "1", "--nb", "1", "--delay", "0", "--method", method, "--json", "-"]
    assert main(["identify", str(record), *orders, "--friction-limit", "2"]) == 0
    assert json.loads(capsys.readouterr().out)["valves"][0]["f_s"] <= 2.0
    assert main(["identify", str(record), *orders, "--friction-limit", "2,3"]) == 2
    assert "friction_limit: 2 limits for 1 valves" in capsys.readouterr().err


@pytest.mark.parametrize("option", [["--starts", "3"], ["--method", "nlp", "--grid-step", "1"]])
def test_options_of_another_method_are_refused(
    option: list[str], record: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(record), *option]) == 2
    assert "has no such option" in capsys.readouterr().err


def test_report_writes_one_page(record: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert main(["report", str(record), "--out", str(page)]) == 0
    assert "sticky" in page.read_text(encoding="utf-8")


WRONG_MODELS = {
    "unknown key": ("limits:", "limitz:"),
    "wrong shape": ("b: {V1: [0.002445, 0.007181, 0.001278]}", "b: {V1: 3}"),
    "f_d above f_s": ("f_d: 2.0", "f_d: 9.0"),
    "not finite": ("0.002445", ".nan"),
}


@pytest.mark.parametrize("case", WRONG_MODELS)
def test_a_wrong_model_is_one_line_and_exit_2(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = find_config("siso.scenario.yaml")
    for name in ("siso.set_points", "example1_process.loop", "siso.scenario"):
        text = (source.parent / f"{name}.yaml").read_text(encoding="utf-8")
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    text = (source.parent / "example1.loop.yaml").read_text(encoding="utf-8")
    before, after = WRONG_MODELS[case]
    assert before in text
    (tmp_path / "example1.loop.yaml").write_text(text.replace(before, after), encoding="utf-8")
    assert main(["demo", str(tmp_path / "siso.scenario.yaml")]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "example1.loop.yaml" in said


@pytest.mark.parametrize(
    "arguments",
    [["identify", "no.csv"], ["report", "no.csv"], ["demo", "nowhere"], ["study", "no.yaml"]],
)
def test_what_is_missing_is_one_line_and_exit_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_the_compiler_is_not_broken_off_and_what_follows_is() -> None:
    told = subprocess.run(
        [sys.executable, "-c", COMPILING], capture_output=True, text=True, check=True, timeout=60
    )
    assert told.stdout.splitlines() == ["went on", "interrupted behind", "True True True False"]


def interrupted() -> None:
    with waiting_for_compiler():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(60.0)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_elsewhere_it_comes_at_once_and_the_handler_goes_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_handler_of_somebody_else_stays() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with waiting_for_compiler():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_change_nothing() -> None:
    found: list[object] = []

    def look() -> None:
        with waiting_for_compiler():
            found.append(signal.getsignal(signal.SIGINT))

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert found == [before]
