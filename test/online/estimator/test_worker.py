from __future__ import annotations

import os
import signal
import time
from concurrent.futures.process import BrokenProcessPool

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions
from stiction_ros.online.estimator.worker import FitWorker
from stiction_ros.records import Record


def test_a_process_that_died_is_replaced_for_the_next_fit() -> None:
    short = Record("short", 1.0, ("V1",), ("PV1",), np.eye(5)[:, :1], np.eye(5)[:, :1])
    worker = FitWorker()
    try:
        first = worker.pid
        os.kill(first, signal.SIGKILL)
        with pytest.raises((BrokenProcessPool, InputError)):  # it may be noticed at once
            worker.submit(short, IdentificationOptions()).result(300.0)
        with pytest.raises(InputError, match="too few"):
            worker.submit(short, IdentificationOptions()).result(300.0)
        assert worker.pid != first
    finally:
        worker.close()


def test_a_process_that_still_compiles_is_not_waited_for() -> None:
    worker = FitWorker()
    begin = time.monotonic()
    worker.close()  # at once: the process has not even loaded its modules
    assert time.monotonic() - begin < 1.0


def test_a_fit_stands_back_behind_the_loop() -> None:
    worker = FitWorker()
    try:
        assert os.getpriority(os.PRIO_PROCESS, worker.pid) > os.getpriority(os.PRIO_PROCESS, 0)
    finally:
        worker.close()
