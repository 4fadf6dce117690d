"""One record of a loop: what everything that looks at data takes."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError


@dataclasses.dataclass(frozen=True)
class Record:
    """Regularly sampled signals of one loop, arrays read-only.

    Attributes:
        name: where it came from, for messages and reports.
        sample_time: seconds between two samples.
        valves: tags of the m valves.
        outputs: tags of the p process variables.
        op: controller outputs, shape (N, m), %.
        pv: measured process variables, shape (N, p), engineering units.
        sp: set-points, shape (N, p), or None when not recorded.
        stem: true stem positions, shape (N, m), %, or None when not known.
        start: seconds of the first sample on the record's own clock.
        notes: what was repaired or ignored while reading, one sentence each.

    Raises:
        InputError: shapes that do not fit together, or a value that is not finite.
    """

    name: str
    sample_time: float
    valves: tuple[str, ...]
    outputs: tuple[str, ...]
    op: FloatArray
    pv: FloatArray
    sp: FloatArray | None = None
    stem: FloatArray | None = None
    start: float = 0.0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sample_time) and self.sample_time > 0):
            raise InputError(f"sample time {self.sample_time} is not positive", where=self.name)
        count = len(self.op)
        widths = {"op": self.valves, "pv": self.outputs, "sp": self.outputs, "stem": self.valves}
        for key, tags in widths.items():
            values = getattr(self, key)
            if values is None:
                continue
            values = np.array(values, dtype=float)
            if values.shape != (count, len(tags)):
                raise InputError(
                    f"{key} has shape {values.shape}, not {(count, len(tags))}", where=self.name
                )
            if not np.isfinite(values).all():
                row = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
                raise InputError(f"{key} is not finite at sample {row}", where=self.name)
            values.flags.writeable = False
            object.__setattr__(self, key, values)

    def __len__(self) -> int:
        return len(self.op)

    @property
    def time(self) -> FloatArray:
        """Seconds since the first sample, shape (N,)."""
        return np.arange(len(self), dtype=np.float64) * self.sample_time

    def part(self, first: int, last: int) -> Record:
        """Return samples ``first`` up to, not including, ``last``."""
        rows = slice(first, last)
        return dataclasses.replace(
            self,
            op=self.op[rows],
            pv=self.pv[rows],
            sp=None if self.sp is None else self.sp[rows],
            stem=None if self.stem is None else self.stem[rows],
            start=self.start + first * self.sample_time,
        )
