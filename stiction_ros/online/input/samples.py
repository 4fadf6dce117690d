"""Samples as a controller works through them, and the rules by which they come about."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import Instrument
from stiction_ros.online.input.applied_op import Given


@dataclasses.dataclass(frozen=True)
class PortRules:
    """What the rules depend on.

    Attributes:
        step: from one stamp to the next, ns.
        instruments: of the outputs (p).
        lockstep: one sample at a time, each with SP and DV of exactly its stamp.
        period: s of the receiver's clock between two samples in realtime.
        scheduled: in lockstep every PV has an SP of its own stamp; otherwise the last holds.
        needs_dv: in lockstep no sample is complete without its measured disturbances.
    """

    step: int
    instruments: tuple[Instrument, ...]
    lockstep: bool = True
    period: float = 1.0
    scheduled: bool = True
    needs_dv: bool = False


@dataclasses.dataclass(frozen=True)
class Sample:
    """One sample, in its turn.

    Attributes:
        number: counted from 0, each once, none left out.
        stamp: as it came, or that of the grid where none came, ns.
        pv: shape (p,), NaN for bad quality and for what is missing.
        sp: shape (p,).
        dv: shape (d,), or None.
        answered: whether it is stepped; otherwise it is passed over.
        begins: whether a run begins with it; ``given`` is then the OP in force, if known.
        given: what the valves were given at the sample before.
    """

    number: int
    stamp: int
    pv: FloatArray
    sp: FloatArray
    dv: FloatArray | None
    answered: bool
    begins: bool
    given: Given


@dataclasses.dataclass(frozen=True)
class PortState:
    """How fresh everything is.

    Attributes:
        ages: s since the last good message of ``pv``, ``sp``, ``op_applied``; what never came
            is left out.
        period: s that a sample takes by the receiver's clock; 0 in lockstep.
        behind: samples that had to be passed over for the newest at the last look.
        waiting: PVs that came while no run could begin.
        lacks: what a run lacks to begin: ``sp``, ``op_applied`` or nothing.
        counts: everything that was refused, late or missing, by reason.
    """

    ages: Mapping[str, float]
    period: float
    behind: int
    waiting: int
    lacks: str
    counts: Mapping[str, int]
