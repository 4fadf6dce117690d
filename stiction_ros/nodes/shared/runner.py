"""Runs one node as a process: signals, errors and the exit code."""

import gc
import os
import signal
import sys
from collections.abc import Callable, Sequence
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

from stiction_ros.errors import InputError
from stiction_ros.nodes.shared import parameter_files
from stiction_ros.nodes.shared.managed import ManagedNode
from stiction_ros.nodes.shared.typed import leave
from stiction_ros.orphans import DIE_WITH_PARENT, die_with_parent

HELP = """usage: {name} [--ros-args [-p NAME:=VALUE ...] [--params-file FILE] [-r FROM:=TO ...]]

{description}

Parameters with their descriptions: ros2 param describe /{name} NAME
"""
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


def run(
    name: str, description: str, make: Callable[[], ManagedNode], args: Sequence[str] | None = None
) -> int:
    """Spin the node that ``make`` builds until it has finished or a signal comes.

    Returns:
        0 after a clean end, 1 after a failure while running, 2 for unusable input.
    """
    arguments = list(sys.argv if args is None else args)
    if "-h" in arguments[1:] or "--help" in arguments[1:]:
        print(HELP.format(name=name, description=description), end="")
        return 0
    node: ManagedNode | None = None
    try:
        signals = _Signals()
        if os.environ.get(DIE_WITH_PARENT):
            die_with_parent(signal.SIGTERM, int(os.environ[DIE_WITH_PARENT]))
        try:
            for path in parameter_files.given(arguments):
                parameter_files.node_keys(path)
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            node = make()
        except _UNUSABLE as error:
            print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
            return 2
        for path in parameter_files.given(arguments):
            said = parameter_files.unused(path, node.get_fully_qualified_name())
            if said:
                node.log.warning(said)
        if _is_realtime(node):
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
        leave(node)
        for number in (signal.SIGINT, signal.SIGTERM):  # Python would die of one while it ends
            signal.signal(number, signal.SIG_IGN)


def _is_realtime(node: ManagedNode) -> bool:
    return bool(node.has_parameter("pace") and node.get_parameter("pace").value == "realtime")
