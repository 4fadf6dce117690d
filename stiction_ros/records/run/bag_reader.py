"""Reads the record of a loop from a bag."""

from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_messages
from stiction_ros.records.record import Record
from stiction_ros.records.run.loop_runs import loop_runs
from stiction_ros.records.run.loop_signals import LoopSignals, is_signal
from stiction_ros.records.whole import Source


def read_bag_parts(path: str | Path, *, namespace: str | None = None) -> tuple[Record, ...]:
    """Read the records of a loop from a bag, one for each stretch without a gap.

    Bad messages are left out; short holes are held, which the mask says; runs are told apart
    where stamps fall back. The notes of each record say what was done. The ``namespace`` is that of
    the loop's topics, needed when the bag holds several loops.

    Raises:
        InputError: as :func:`read_messages`; no ``pv`` or ``op``; stamps that are irregular.
    """
    return _parts(path, *_signals(path), namespace)


def read_bag_loops(path: str | Path) -> dict[str, tuple[Record, ...] | InputError]:
    """Return the records of every loop by its namespace, as ``/unit1``, or why there are none."""
    signals, notes = _signals(path)
    found: dict[str, tuple[Record, ...] | InputError] = {}
    for space in signals.loops or ("",):
        try:
            chosen = (space or "/") if signals.loops else None
            found[space] = _parts(path, signals, notes, chosen)
        except InputError as error:
            found[space] = error
    return found


def bag_source(path: str | Path) -> Source:
    """Return how errors and records name a bag."""
    return Source(
        Path(path).name, str(path), lambda row: f"sample {row} of pv and op", cut_holes=True
    )


def _signals(path: str | Path) -> tuple[LoopSignals, list[str]]:
    """Return the signals of all loops in a bag, and what was left out while reading."""
    notes: list[str] = []
    signals = LoopSignals(str(path))
    for number, message in enumerate(read_messages(path, wanted=is_signal, notes=notes)):
        signals.add(message, number)
    return signals, notes


def _parts(
    path: str | Path, signals: LoopSignals, notes: list[str], namespace: str | None
) -> tuple[Record, ...]:
    runs = loop_runs(signals, bag_source(path), namespace, notes)
    return tuple(part for run in runs for part in run.parts)
