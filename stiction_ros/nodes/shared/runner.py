"""Runs one node as a process: signals, errors and the exit code."""

import gc
import os
import signal
import sys
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidParameterValueException,
    ParameterException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from stiction_ros.errors import InputError
from stiction_ros.nodes.shared.managed import ManagedNode
from stiction_ros.orphans import DIE_WITH_PARENT, die_with_parent

SWITCH = 0.0005  # s until a thread beside the loop must let go, in realtime

_UNUSABLE = (
    InputError,
    ParameterException,
    InvalidParameterValueException,
    InvalidNamespaceException,
    InvalidNodeNameException,
    RCLError,
    UnknownROSArgsError,
)


class _Interrupted(BaseException):
    """A signal came while the node was being built."""


class _Signals:
    """Notes SIGINT and SIGTERM; while ``at_once``, they break off what is being done."""

    def __init__(self) -> None:
        self.came = False
        self.at_once = True
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, _number: int, _frame: Any) -> None:
        self.came = True
        if self.at_once:
            self.at_once = False
            raise _Interrupted


def run(name: str, make: Callable[[], ManagedNode]) -> int:
    """Spin the node that ``make`` builds until it has finished or a signal comes.

    Returns:
        0 after a clean end, 1 after a failure while running, 2 for unusable input.
    """
    node: ManagedNode | None = None
    try:
        signals = _Signals()
        if os.environ.get(DIE_WITH_PARENT):
            die_with_parent(signal.SIGTERM, int(os.environ[DIE_WITH_PARENT]))
        try:
            rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
            node = make()
        except _UNUSABLE as error:
            print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
            return 2
        if node.has_parameter("pace") and node.get_parameter("pace").value == "realtime":
            sys.setswitchinterval(SWITCH)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        if node.get_parameter("autostart").value:
            node.start()
        if node.failure:
            return 2
        gc.collect()
        gc.freeze()  # what was imported stays: collections need not look at it again
        signals.at_once = False
        try:
            while not signals.came and not node.finished:
                executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return 0
        node.finish()
        return 1 if node.failure else 0
    except _Interrupted:
        if node is not None:
            node.finish()
        return 0
    finally:
        if node is not None:
            node.destroy_node()
        try_shutdown()
        for number in (signal.SIGINT, signal.SIGTERM):  # Python would die of one while it ends
            signal.signal(number, signal.SIG_IGN)
