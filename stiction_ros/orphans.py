"""Processes that must not outlive the one that started them, and that it alone ends."""

import contextlib
import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from multiprocessing import resource_tracker

DIE_WITH_PARENT = "STICTION_ROS_DIE_WITH_PARENT"
"""Environment variable that makes a node end when the process that started it dies.

Its value is the number of that process.
"""

_PR_SET_PDEATHSIG = 1


def die_with_parent(number: int, parent: int) -> None:
    """Ask the kernel to send signal ``number`` to this process when its parent dies.

    When the parent has died already, while this process was starting, the signal comes at once.
    Linux only; elsewhere nothing happens and a parent must end its children itself.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)
        if os.getppid() != parent:
            os.kill(os.getpid(), number)


@contextlib.contextmanager
def spared() -> Iterator[None]:
    """Let Ctrl-C pass by the processes that are started inside, from their first moment on.

    It goes to all processes of a terminal, and an interpreter that is just starting would tell
    where it was. The one that started them takes it, when this ends, and ends them.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which would unblock the signal if it began inside
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
