"""Runs one node as a process: signals, errors and the exit code."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable, Sequence

import rclpy
from rclpy.exceptions import InvalidParameterValueException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from stiction_ros.nodes.managed import ManagedNode
from stiction_ros.orphans import DIE_WITH_PARENT, die_with_parent

HELP = """usage: {name} [--ros-args [-p NAME:=VALUE ...] [--params-file FILE] [-r FROM:=TO ...]]

{description}

Parameters with their descriptions: ros2 param describe /{name} NAME
"""


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
    stop: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: stop.append(received))
    if os.environ.get(DIE_WITH_PARENT):
        die_with_parent(signal.SIGTERM, int(os.environ[DIE_WITH_PARENT]))
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    node: ManagedNode | None = None
    try:
        try:
            node = make()
        except (ParameterException, InvalidParameterValueException) as error:
            print(f"{name}: {error}".replace("\n", " "), file=sys.stderr)
            return 2
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        if node.get_parameter("autostart").value:
            node.start()
        if node.failure:
            return 2
        gc.collect()
        gc.freeze()  # what was imported stays: collections need not look at it again
        try:
            while not stop and not node.finished:
                executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return 0
        node.finish()
        return 1 if node.failure else 0
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
