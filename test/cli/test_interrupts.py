"""Ctrl-C waits until the compiler is left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from stiction_ros.cli.interrupts import waiting_for_compiler

COMPILING = """
import os, signal, sys, types
from stiction_ros.cli.interrupts import waiting_for_compiler

inside = types.ModuleType("llvmlite.inside")
exec("def called_back(told):\\n    told()\\n    print('went on')\\n", inside.__dict__)
try:
    with waiting_for_compiler():
        inside.called_back(lambda: os.kill(os.getpid(), signal.SIGINT))
        print("left")
        while True:
            pass
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_the_compiler_is_not_broken_off_and_what_follows_is() -> None:
    told = subprocess.run(
        [sys.executable, "-c", COMPILING], capture_output=True, text=True, check=True, timeout=60
    )
    assert told.stdout.split("\n")[:3] == ["went on", "left", "interrupted"]


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
