"""Independent parts of a search, at the same time on two cores.

The compiled loops let other threads run, so two threads share most of the work. What comes
back does not depend on how many there are: every part is computed as it would be alone.
"""

import functools
import multiprocessing
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar, cast

import numpy as np

Result = TypeVar("Result")
One = TypeVar("One")
Two = TypeVar("Two")

KEPT = 1 << 21  # numbers, 16 MB
CORES = os.cpu_count() or 1  # asked once: every part of a search would ask again

_free = threading.Lock()  # held as long as the helper has work


@functools.cache
def _helper() -> ThreadPoolExecutor:
    # The system's allocator hands large arrays back one by one, which stops both threads each
    # time, until it has seen a larger one freed; from then on it keeps up to twice as much.
    np.empty(KEPT)
    return ThreadPoolExecutor(1, thread_name_prefix="identification")


def may_help() -> bool:
    """Return whether there is a core for a second thread, or a process that helps.

    A process that another one started has none: such processes share the cores already.
    """
    return CORES > 1 and multiprocessing.parent_process() is None


def at_once(one: Callable[[], One], two: Callable[[], Two]) -> tuple[One, Two]:
    """Return both results, as :func:`together`, of parts that return different things."""
    first, second = together(one, two)
    return cast(One, first), cast(Two, second)


def together(*parts: Callable[[], Result]) -> list[Result]:
    """Return the results of all parts, in their order.

    The calling thread takes the parts from the first on, and that one in any case; the other
    thread takes them from the last on. Parts may call this as well: where no thread is free
    all run in the calling one.

    Raises:
        Exception: of the first part, in their order, that raised one.
    """
    if len(parts) < 2 or not may_help() or not _free.acquire(blocking=False):
        return [part() for part in parts]
    waiting = [_helper().submit(part) for part in reversed(parts[1:])][::-1]
    released = _helper().submit(_free.release)
    results = [parts[0]()]
    for part, future in zip(parts[1:], waiting, strict=True):
        results.append(part() if future.cancel() else future.result())
    released.result()  # so that the thread is free for the next call
    return results
