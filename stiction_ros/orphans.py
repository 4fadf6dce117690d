"""Processes that must not outlive the one that started them."""

from __future__ import annotations

import ctypes
import os
import sys

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
