"""Ctrl-C that does not break off what must not be: the compiler, while it holds its locks."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

COMPILER = "llvmlite"
"""Package whose functions are not broken off.

Those that it calls back from machine code swallow what is raised in them, and keep its lock.
"""

AGAIN = 0.05  # s, until it is asked again


@contextlib.contextmanager
def waiting_for_compiler() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt as soon as the main thread has left the compiler."""
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    if not _compiles(frame):
        raise KeyboardInterrupt
    later = threading.Timer(AGAIN, signal.raise_signal, (number,))
    later.daemon = True
    later.start()


def _compiles(frame: FrameType | None) -> bool:
    while frame is not None:
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] == COMPILER:
            return True
        frame = frame.f_back
    return False
