"""What a controller has been sent and has not used yet, by the stamp of its sample."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


@dataclasses.dataclass(frozen=True)
class SetPointPreview:
    """Set-points to come: ``stamps`` in ns, rising, each with a row of ``values`` (K, p)."""

    stamps: tuple[int, ...]
    values: FloatArray

    def ahead(self, sp: FloatArray, stamp: int, step: int, samples: int) -> FloatArray:
        """Return the set-points of the next samples, shape (samples, p).

        Each holds until the stamp of the next.

        Args:
            sp: set-points of now, shape (p,), which hold until the first stamp.
            stamp, step: of the present sample, and from one to the next, ns.
            samples: how many.
        """
        times = stamp + step * np.arange(1, samples + 1)
        # What a preview says of the past is over: sp of now is newer.
        coming = [i for i, at in enumerate(self.stamps) if at > stamp]
        rows = np.vstack([sp, self.values[coming]])
        picks = np.searchsorted([self.stamps[i] for i in coming], times, side="right")
        return np.asarray(rows[picks])


@dataclasses.dataclass(frozen=True)
class Sample:
    """All that one step needs: PV and SP (p,), DV (d,) or None, preview or None."""

    stamp: int
    pv: FloatArray
    sp: FloatArray
    dv: FloatArray | None


class Inbox:
    """Brings PV, SP and measured disturbances of one sample together."""

    def __init__(self, scheduled: bool, needs_dv: bool) -> None:
        """Start empty.

        Args:
            scheduled: every PV has an SP of its own stamp; otherwise the last SP holds.
            needs_dv: no sample is complete without its measured disturbances.
        """
        self._scheduled, self._needs_dv = scheduled, needs_dv
        self._pv: dict[int, FloatArray] = {}
        self._sp: dict[int, FloatArray] = {}
        self._dv: dict[int, FloatArray] = {}
        self._last_sp: FloatArray | None = None
        self.preview: SetPointPreview | None = None

    def add_pv(self, stamp: int, values: FloatArray) -> None:
        """Take in a measurement, shape (p,)."""
        self._pv[stamp] = values

    def add_sp(self, stamp: int, values: FloatArray) -> None:
        """Take in set-points, shape (p,)."""
        self._last_sp = values
        if self._scheduled:
            self._sp[stamp] = values

    def add_dv(self, stamp: int, values: FloatArray) -> None:
        """Take in measured disturbances, shape (d,)."""
        self._dv[stamp] = values

    def first(self) -> Sample | None:
        """Return the oldest sample that is not used yet, or None while something lacks."""
        if not self._pv:
            return None
        stamp = min(self._pv)
        sp = self._sp.get(stamp) if self._scheduled else self._last_sp
        dv = self._dv.get(stamp)
        if sp is None or (dv is None and self._needs_dv):
            return None
        return Sample(stamp, self._pv[stamp], sp, dv)

    def used(self, sample: Sample) -> None:
        """Forget ``sample`` and what is older."""
        for queue in (self._pv, self._sp, self._dv):
            for old in [stamp for stamp in queue if stamp <= sample.stamp]:
                del queue[old]
