"""The end of a search, compiled by another process while this one compiles its beginning."""

import atexit
import functools
import logging
import os
import signal
import subprocess
import sys
import threading

import numpy as np

from stiction_ros.compiled import at_next_compilation
from stiction_ros.identification.problem.output_error import Orders, fit_output
from stiction_ros.identification.side_by_side import CORES, may_help
from stiction_ros.loop.linear_loops import Controllers, Process, Runs, run_loops
from stiction_ros.orphans import die_with_parent

SAMPLES = 120
CODE = f"from {__name__} import in_this_process; in_this_process(%d)"


@functools.cache
def offer() -> None:
    """Let another process help, as :func:`ask`, unless this is one of many that may compile."""
    if may_help():
        ask()


def ask() -> None:
    """Let another process help if anything has to be compiled and there is a core for it.

    Its machine code is found where any is kept; what is not yet there when it is needed is compiled
    here as well. The process ends with this one.
    """
    if CORES > 1:
        at_next_compilation(_begin)


def in_this_process(parent: int) -> None:
    """Compile the end of a search, for the process ``parent``."""
    die_with_parent(signal.SIGKILL, parent)
    compile_end()


def compile_end() -> None:
    """Compile the fit of an output and the runs of a loop, with a signal that is made up."""
    stem = np.random.default_rng(0).standard_normal(SAMPLES)
    pv = 0.5 * np.concatenate([np.zeros(2), stem[:-2]])
    fit_output(pv, stem[None], (1,), Orders(output=1, input=1, noise=1, first=10))
    one, none = np.zeros(1), np.zeros(1, dtype=np.int64)
    process = Process(np.zeros((1, 1)), np.zeros((1, 1, 1)), none[None], one)
    controllers = Controllers(none, none, one, one, one)
    past = np.zeros((1, 3, 1))
    law = np.array([[0.0, 0.0, 1.0]])
    runs = Runs(np.zeros((1, 1, 2)), np.zeros((1, 1, 3)), past, past, np.zeros((1, 1)), law)
    run_loops(process, controllers, runs, np.zeros((1, 4, 1)), np.zeros((1, 4, 1)))


def _begin() -> None:
    try:
        helper = subprocess.Popen(
            [sys.executable, "-P", "-c", CODE % os.getpid()],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(path or "." for path in sys.path)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError as error:
        logging.getLogger(__name__).info("nothing helps with compiling: %s", error)
        return
    threading.Thread(target=helper.wait, daemon=True).start()  # so that it is gone when it ends
    atexit.register(_end, helper)


def _end(helper: subprocess.Popen[bytes]) -> None:
    helper.kill()
    helper.wait()
