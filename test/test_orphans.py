"""A process whose parent has died already ends at once."""

import os
import signal
import subprocess
import sys

import pytest

CHILD = """
import os, signal, sys, time
from stiction_ros.orphans import die_with_parent
die_with_parent(signal.SIGTERM, int(sys.argv[1]))
print("lives", flush=True)
"""


def run(parent: int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", CHILD, str(parent)], capture_output=True, text=True, check=False
    )


@pytest.mark.skipif(sys.platform != "linux", reason="the death signal is Linux's")
def test_child_of_a_dead_parent_gets_the_signal_at_once() -> None:
    ended = run(parent=os.getpid() + 1)
    assert ended.returncode == -signal.SIGTERM
    assert ended.stdout == ""


def test_child_of_a_living_parent_goes_on() -> None:
    assert run(parent=os.getpid()).stdout == "lives\n"
