"""Samples as a controller works through them, and the rules by which they come about."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import Instrument
from stiction_ros.online.input.op_port import Given


@dataclasses.dataclass(frozen=True)
class SetPointPreview:
    """Set-points to come: ``stamps`` in ns, rising, each with a row of ``values`` (K, p)."""

    stamps: tuple[int, ...]
    values: FloatArray

    def ahead(self, sp: FloatArray, stamp: int, step: int, samples: int) -> FloatArray:
        """Return the set-points of the next samples, shape (samples, p), from one ``step``, ns, on.

        Each holds until the stamp of the next; those of now, ``sp``, hold until the first.
        """
        times = stamp + step * np.arange(1, samples + 1)
        # What a preview says of the past is over: sp of now is newer.
        coming = [i for i, at in enumerate(self.stamps) if at > stamp]
        rows = np.vstack([sp, self.values[coming]])
        picks = np.searchsorted([self.stamps[i] for i in coming], times, side="right")
        return np.asarray(rows[picks])


@dataclasses.dataclass(frozen=True)
class PortRules:
    """What the rules depend on."""

    step: int  # from one stamp to the next, ns
    instruments: tuple[Instrument, ...]  # of the outputs (p)
    lockstep: bool = True  # one sample at a time, each with SP and DV of exactly its stamp
    period: float = 1.0  # s of the receiver's clock between two samples in realtime
    scheduled: bool = True  # in lockstep every PV has an SP of its stamp; else the last holds
    needs_dv: bool = False  # in lockstep no sample is complete without its measured disturbances


@dataclasses.dataclass(frozen=True)
class Sample:
    """One sample, in its turn."""

    number: int  # counted from 0, each once, none left out
    stamp: int  # as it came, or that of the grid where none came, ns
    pv: FloatArray  # shape (p,), NaN for bad quality and for what is missing
    sp: FloatArray  # shape (p,)
    dv: FloatArray | None  # shape (d,), or None
    answered: bool  # whether it is stepped; otherwise it is passed over
    begins: bool  # whether a run begins with it; ``given`` is then the OP in force, if known
    given: Given  # what the valves were given at the sample before


def picked(
    tags: Sequence[str], values: Sequence[float], names: Sequence[str], *, partly: bool = False
) -> FloatArray | None:
    """Return the values of ``names`` in their order, shape (len(names),).

    None when one of them is not among the ``tags`` of a message, or the message has another number
    of ``values`` than tags. ``partly``: NaN for those, and None when no name is there.
    """
    found = dict(zip(tags, values, strict=False))
    lacks = len(tags) != len(values) or any(name not in found for name in names)
    if lacks and not (partly and set(names).intersection(tags)):
        return None
    return np.array([found.get(name, np.nan) for name in names], dtype=float)
