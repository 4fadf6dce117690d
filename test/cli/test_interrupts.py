"""Ctrl-C waits until the compiler is left."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from stiction_ros.cli.interrupts import waiting_for_compiler

COMPILING = """
import os, signal, traceback, types
from stiction_ros.cli import interrupts

asked, compiles = [], interrupts._compiles

def noting(frame):
    asked.append(compiles(frame))
    return asked[-1]

def interrupted_and_asked_again():
    os.kill(os.getpid(), signal.SIGINT)
    while len(asked) < 3:
        pass

signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background ignores it
interrupts._compiles = noting
inside = types.ModuleType("llvmlite.inside")
exec("def called_back(told):\\n    told()\\n    print('went on')\\n", inside.__dict__)
try:
    with interrupts.waiting_for_compiler():
        inside.called_back(interrupted_and_asked_again)
        while True:
            pass
except KeyboardInterrupt as error:
    places = [frame.f_globals["__name__"] for frame, _ in traceback.walk_tb(error.__traceback__)]
    print("interrupted", "inside" if "llvmlite.inside" in places else "behind")
print(*asked[:3], asked[-1])
"""


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
