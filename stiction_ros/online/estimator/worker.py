"""A worker process for the fits, so that nothing else waits for them."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from stiction_ros.identification.warm_up import compile_loops
from stiction_ros.online.estimator.live import METHOD
from stiction_ros.orphans import die_with_parent

T = TypeVar("T")

POLITE = 10  # by which a fit stands back behind what has to be in time, as nice does


class FitWorker:
    """One process that runs one fit after the other, in order.

    It stands back behind the loop, whose samples cannot wait for a fit on a machine that is
    busy. It leaves interrupts to its parent and dies with it. When it dies alone, as for want of
    memory, the fits it had fail and the next one gets a new process.
    """

    def __init__(self, methods: Sequence[str] = (METHOD,)) -> None:
        """Start the process and let it load what fits by ``methods`` need."""
        self._methods = tuple(methods)
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        others = set(multiprocessing.active_children())
        self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_settle)
        # Before the first window is full.
        self._compiled = self._pool.submit(compile_loops, self._methods)
        self._processes = set(multiprocessing.active_children()) - others

    @property
    def compiled(self) -> bool:
        """Whether the process has all the machine code that a fit needs."""
        return self._compiled.done()

    def ready(self) -> bool:
        """Wait until the process has all that a fit needs; tell whether it lives to have it."""
        return self._compiled.exception() is None

    def ended(self) -> int | None:
        """Return how the process ended that has died; None where that cannot be told."""
        self._pool.shutdown()
        return next((process.exitcode for process in self._processes), None)

    def submit(self, work: Callable[..., T], *arguments: Any) -> Future[T]:
        """Queue a function of a module behind the fits; the future may hold what it raised."""
        try:
            return self._pool.submit(work, *arguments)
        except BrokenProcessPool:
            self._pool.shutdown()
            self._start()
            return self._pool.submit(work, *arguments)

    def close(self, *, at_once: bool = False) -> None:
        """Drop queued fits and end the process: after the running one, if it is a fit."""
        if at_once or not self._compiled.done():
            for process in self._processes:
                process.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)


def _settle() -> None:
    """Prepare the worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    stand_back()
    parent = multiprocessing.parent_process()
    if parent is not None and parent.pid is not None:
        die_with_parent(signal.SIGKILL, parent.pid)


def stand_back() -> None:
    """Let the loop go before this process.

    A real-time policy that was given to the node (``chrt``) is inherited and would let a fit of
    seconds stand before every sample of the loop; it is given back, and what is left is nice.
    """
    real_time = {getattr(os, name, None) for name in ("SCHED_FIFO", "SCHED_RR")} - {None}
    if real_time:  # known on Linux
        policy = os.sched_getscheduler(0) & ~getattr(os, "SCHED_RESET_ON_FORK", 0)
        if policy in real_time:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.nice(POLITE)
