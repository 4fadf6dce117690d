import os
import signal
import threading
from concurrent.futures.process import BrokenProcessPool

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions
from stiction_ros.online.estimator import worker as worker_module
from stiction_ros.online.estimator.live import fit
from stiction_ros.online.estimator.worker import POLITE, FitWorker, stand_back
from stiction_ros.records import Record

PATIENCE = 60.0  # s


@pytest.mark.trial
def test_a_process_that_died_is_replaced_for_the_next_fit() -> None:
    short = Record("short", 1.0, ("V1",), ("PV1",), np.eye(5)[:, :1], np.eye(5)[:, :1])
    worker = FitWorker()
    try:
        (first,) = worker._processes
        first.kill()
        with pytest.raises((BrokenProcessPool, InputError)):  # it may be noticed at once
            worker.submit(fit, short, IdentificationOptions()).result(300.0)
        with pytest.raises(InputError, match="too few"):
            worker.submit(fit, short, IdentificationOptions()).result(300.0)
        assert first not in worker._processes
    finally:
        worker.close()


def test_a_process_that_still_compiles_is_not_waited_for() -> None:
    worker = FitWorker()
    processes = list(worker._processes)
    assert processes
    try:
        for process in processes:  # it has not even loaded its modules, and never will
            os.kill(process.pid, signal.SIGSTOP)
        closing = threading.Thread(target=worker.close)
        closing.start()
        closing.join(PATIENCE)
        assert not closing.is_alive()
    finally:
        for process in processes:
            process.kill()


@pytest.mark.trial
def test_a_fit_stands_back_behind_the_loop() -> None:
    worker = FitWorker()
    try:
        assert os.getpriority(os.PRIO_PROCESS, worker.submit(os.getpid).result()) > os.getpriority(
            os.PRIO_PROCESS, 0
        )
    finally:
        worker.close()


@pytest.mark.parametrize("policy", ["SCHED_FIFO", "SCHED_RR"])
def test_a_real_time_policy_of_the_node_is_given_back(
    policy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The calls are looked at, not made: such a policy would slow whatever else runs here."""
    given: list[tuple[int, int, int]] = []
    niced: list[int] = []
    inherited = getattr(os, policy) | os.SCHED_RESET_ON_FORK
    monkeypatch.setattr(worker_module.os, "sched_getscheduler", lambda pid: inherited)
    monkeypatch.setattr(
        worker_module.os,
        "sched_setscheduler",
        lambda pid, new, parameter: given.append((pid, new, parameter.sched_priority)),
    )
    monkeypatch.setattr(worker_module.os, "nice", niced.append)
    stand_back()
    assert given == [(0, os.SCHED_OTHER, 0)]
    assert niced == [POLITE]


def test_a_plain_policy_is_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[int] = []
    monkeypatch.setattr(worker_module.os, "sched_getscheduler", lambda pid: os.SCHED_OTHER)
    monkeypatch.setattr(
        worker_module.os, "sched_setscheduler", lambda pid, new, parameter: given.append(new)
    )
    monkeypatch.setattr(worker_module.os, "nice", lambda by: None)
    stand_back()
    assert not given
