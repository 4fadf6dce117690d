"""Set-points to come."""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray


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
