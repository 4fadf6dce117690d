"""A process whose parent has died already ends at once."""

import os
import signal
import subprocess
import sys
from pathlib import Path

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


SPARING = """
import multiprocessing, os, signal, sys
from stiction_ros.orphans import spared

def told(pipe):
    pipe.send(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))

if __name__ == "__main__":
    found = []
    for method in ("spawn", "forkserver"):
        context = multiprocessing.get_context(method)
        ours, theirs = context.Pipe()
        process = context.Process(target=told, args=(theirs,))
        with spared():
            process.start()
        found.append(ours.recv())
        process.join()
    found.append(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))
    print(found)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_processes_are_spared_ctrl_c_and_who_starts_them_is_not(tmp_path: Path) -> None:
    script = tmp_path / "sparing.py"
    script.write_text(SPARING)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout == "[True, True, False]\n"
