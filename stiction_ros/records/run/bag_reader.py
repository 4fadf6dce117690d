"""Reads the record of a loop from a bag."""

from __future__ import annotations

from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import BagMessage, read_messages, read_raw
from stiction_ros.records.parts import only_part
from stiction_ros.records.record import Record
from stiction_ros.records.run.loop_runs import LoopRun, loop_runs
from stiction_ros.records.run.loop_signals import JOINT_STATE, LoopSignals, is_signal
from stiction_ros.records.whole import Source

__all__ = [
    "JOINT_STATE",
    "BagMessage",
    "LoopRun",
    "LoopSignals",
    "bag_source",
    "is_signal",
    "read_bag",
    "read_bag_loops",
    "read_bag_parts",
    "read_messages",
    "read_raw",
]


def read_bag(path: str | Path, *, namespace: str | None = None) -> Record:
    """Read the record of a loop from ``pv``, ``sp``, ``op``, ``stem`` in a bag.

    Args:
        path: a rosbag2 directory, finished or not, or a ``.mcap`` file.
        namespace: of the loop's topics; needed when the bag holds several loops.

    Raises:
        InputError: as :func:`read_bag_parts`; gaps, several runs.
    """
    return only_part(read_bag_parts(path, namespace=namespace), str(path))


def read_bag_parts(path: str | Path, *, namespace: str | None = None) -> tuple[Record, ...]:
    """Read the records of a loop from a bag, one for each stretch without a gap.

    Bad messages are left out; short holes are held, which the mask says; runs are told apart
    where stamps fall back. The notes of each record say what was done.

    Args:
        path: a rosbag2 directory, finished or not, or a ``.mcap`` file.
        namespace: of the loop's topics; needed when the bag holds several loops.

    Raises:
        InputError: as :func:`read_messages`; no ``pv`` or ``op``; stamps that are irregular.
    """
    notes: list[str] = []
    signals = LoopSignals(str(path))
    for number, message in enumerate(read_messages(path, wanted=is_signal, notes=notes)):
        signals.add(message, number)
    runs = loop_runs(signals, bag_source(path), namespace, notes)
    return tuple(part for run in runs for part in run.parts)


def read_bag_loops(path: str | Path) -> dict[str, tuple[Record, ...] | InputError]:
    """Read the records of every loop in a bag.

    Args:
        path: a rosbag2 directory, finished or not, or a ``.mcap`` file.

    Returns:
        Namespace of each loop, such as ``/unit1``, to its records as :func:`read_bag_parts` has
        them, or to the reason why there are none.

    Raises:
        InputError: as :func:`read_messages`.
    """
    notes: list[str] = []
    signals = LoopSignals(str(path))
    for number, message in enumerate(read_messages(path, wanted=is_signal, notes=notes)):
        signals.add(message, number)
    found: dict[str, tuple[Record, ...] | InputError] = {}
    for space in signals.loops or ("",):
        chosen = (space or "/") if signals.loops else None
        try:
            runs = loop_runs(signals, bag_source(path), chosen, notes)
        except InputError as error:
            found[space] = error
            continue
        found[space] = tuple(part for run in runs for part in run.parts)
    return found


def bag_source(path: str | Path) -> Source:
    """Return how errors and records name a bag."""
    return Source(
        Path(path).name, str(path), lambda row: f"sample {row} of pv and op", cut_holes=True
    )
