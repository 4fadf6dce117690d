"""Runs one node as a process: parameter files, signals, errors and the exit code."""

import gc
import itertools
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import rclpy
import yaml
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
KEY = "ros__parameters"


def parameter_files(arguments: Sequence[str]) -> list[str]:
    """Return the files behind ``--params-file``."""
    return [value for name, value in itertools.pairwise(arguments) if name == "--params-file"]


def node_keys(path: str) -> list[str]:
    """Return the patterns of node names in a parameter file, such as ``/**/plant``.

    Raises:
        InputError: the file cannot be read, or holds no parameters of a node.
    """
    try:
        document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=path) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"is not YAML ({said})", where=path) from None
    if not isinstance(document, Mapping):
        raise InputError(f"has no {KEY}", where=path, fix=f"write NODE: {{{KEY}: {{…}}}}")
    keys = list(_keys(document, ""))
    if not keys:
        raise InputError(f"has no {KEY}", where=path, fix=f"write NODE: {{{KEY}: {{…}}}}")
    return keys


def applies(key: str, node: str) -> bool:
    """Tell whether the parameters under ``key`` go to ``node``, such as ``/unit1/plant``.

    ``*`` stands for one part of the name, ``**`` for any number of parts; a key without a
    leading slash begins at the root.
    """
    pattern = ""
    for part in key.strip("/").split("/"):
        if part == "**":
            pattern += "(/[^/]+)*"
        else:
            pattern += "/" + "[^/]*".join(re.escape(piece) for piece in part.split("*"))
    return re.fullmatch(pattern, node) is not None


def unused(path: str, node: str) -> str:
    """Return a warning when nothing in the file goes to ``node``, else an empty text.

    Raises:
        InputError: as :func:`node_keys`.
    """
    keys = node_keys(path)
    if any(applies(key, node) for key in keys):
        return ""
    name = node.rpartition("/")[2]
    return (
        f"{path} holds nothing for {node}, only for {', '.join(keys)}; "
        f"name it {node} or /**/{name} there"
    )


def _keys(document: Mapping[Any, Any], above: str) -> Iterator[str]:
    for name, value in document.items():
        if not isinstance(value, Mapping):
            continue
        key = f"{above}/{str(name).strip('/')}" if above else str(name)
        if KEY in value:
            yield key
        yield from _keys({n: v for n, v in value.items() if n != KEY}, key)


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
            for path in parameter_files(arguments):
                node_keys(path)
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            node = make()
        except _UNUSABLE as error:
            print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
            return 2
        for path in parameter_files(arguments):
            said = unused(path, node.get_fully_qualified_name())
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
        if node is not None:
            node.destroy_node()
        try_shutdown()
        for number in (signal.SIGINT, signal.SIGTERM):  # Python would die of one while it ends
            signal.signal(number, signal.SIG_IGN)


def _is_realtime(node: ManagedNode) -> bool:
    return bool(node.has_parameter("pace") and node.get_parameter("pace").value == "realtime")
