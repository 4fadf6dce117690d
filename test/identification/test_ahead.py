"""The end of a search, compiled by another process."""

import os
import subprocess
import sys
import time

import pytest

from stiction_ros.identification import warm_up

PATIENCE = 60.0  # s

NEEDED = """
from stiction_ros.identification.ahead import compile_end
from stiction_ros.loop.linear_loops import run_loops
from stiction_ros.identification.kernels import descent, output_error
from stiction_ros.identification.warm_up import compile_loops

asked = (descent.cold_starts, descent.descend, run_loops)
compile_end()
print(*(len(each.signatures) for each in asked))
compile_loops(["evidence"])
print(*(len(each.signatures) for each in asked))
"""

LEFT = """
from stiction_ros.identification import ahead

ahead.CODE = "import time, sys; print(%d); time.sleep(3600)"
popen = ahead.subprocess.Popen

def started(*arguments, **options):
    helper = popen(*arguments, **options)
    print(helper.pid, flush=True)
    return helper

ahead.subprocess.Popen = started
ahead._begin()
"""


def told_by(code: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout


@pytest.mark.trial
def test_another_process_compiles_what_an_identification_needs() -> None:
    assert told_by(NEEDED).split() == ["1", "1", "1", "1", "1", "1"]


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")
def test_the_process_ends_with_the_one_that_it_helps() -> None:
    pid, ends = int(told_by(LEFT)), time.monotonic() + PATIENCE
    while os.path.exists(f"/proc/{pid}"):
        assert time.monotonic() < ends


NO_PROCESS = """
import sys
from stiction_ros.identification import ahead

sys.executable = "/nowhere"
ahead._begin()
print("goes on")
"""


@pytest.mark.trial
def test_without_a_process_the_search_goes_on() -> None:
    assert told_by(NO_PROCESS) == "goes on\n"


@pytest.mark.parametrize("helped", [True, False])
def test_a_process_that_compiles_for_another_asks_for_help_where_it_is_told_to(
    monkeypatch: pytest.MonkeyPatch, helped: bool
) -> None:
    asked: list[bool] = []
    monkeypatch.setattr(warm_up, "ask", lambda: asked.append(True))
    monkeypatch.setattr(warm_up, "identify", lambda record, options: None)
    warm_up.compile_loops(["exact"], helped=helped)
    assert asked == [True] * helped
