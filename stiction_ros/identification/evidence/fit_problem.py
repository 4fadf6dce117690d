"""One record made ready: the rows that every friction, noise and delay is judged on."""

import dataclasses
import functools
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects import FrictionLaw
from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.closed_loop.tuning import Tuning
from stiction_ros.identification.evidence.fit_kernels import Lines
from stiction_ros.identification.friction import find_law, first_values, simulate
from stiction_ros.identification.identification_options import IdentificationOptions, limited
from stiction_ros.identification.kernels.lags import in_rows
from stiction_ros.identification.linear.response_prior import Reach
from stiction_ros.records.record import Record
from stiction_ros.signals.spectral_lines import LEAST_PER_HARMONIC

TAPS = 60  # of an impulse response, at most
SHARE = 8  # rows per tap, at least
COARSER = 8
"""A tap i of a response is resolved to i / 8 samples: late taps are smooth, and a third of the
weights does."""
LIMIT = 1.0  # largest f_S of all: a valve that moves at all turns within the span of OP
DIGITS = 7
"""Of OP and PV in their own scale: no unit leaves a trace. PV times 0.001 and 7 loses the twelfth
digit, which turns the ninth of some sample in every record, and the seventh in one of fifty."""
LEFT_OUT = 0.05  # share of the rows at the begin, where a stem may not have found its place
NOISE_ORDER = 6
MOVES = 6  # of a stem over a whole record, fewest of a friction that is judged
FEW_MOVES = 2  # of a beginning


@dataclasses.dataclass(frozen=True)
class Problem:
    """Signals in their own scale, so that no unit of OP, PV or time changes an answer."""

    # about its mean over its span, shape (m, N): all frictions here are shares of the span
    op: FloatArray
    # means of ``rate`` samples, about their mean over their standard deviation, (p, n)
    pv: FloatArray
    rate: int  # samples of OP per row
    laws: tuple[type[FrictionLaw], ...]  # friction law of each valve
    span: FloatArray  # of OP per valve, %, shape (m,)
    limit: FloatArray  # largest f_S per valve, shape (m,)
    scale: FloatArray  # standard deviation of ``op`` per valve, shape (m,)
    skipped: int = 0  # smallest delay, rows
    least_moves: int = MOVES  # of a stem, fewest of a friction that is judged
    # per valve, values of the law's parameters behind f_S and f_D; empty where it has no others
    further: tuple[tuple[float, ...], ...] = ()
    # per output, frequencies of a wave from outside, turns per sample; empty for none
    lines: tuple[tuple[float, ...], ...] = ()
    # per output, the controller that reads it; empty where none is known
    tunings: tuple[Tuning | None, ...] = ()
    # per output, standard deviation of the rows over that of the samples, shape (p,)
    shrunk: FloatArray = dataclasses.field(default_factory=lambda: np.ones(1))

    @classmethod
    def of(
        cls,
        record: Record,
        options: IdentificationOptions | None = None,
        rate: int = 1,
        tunings: tuple[Tuning | None, ...] = (),
    ) -> "Problem":
        """Prepare a whole record.

        Args:
            record: without gaps.
            options: of which law, largest friction and smallest delay count.
            rate: samples that are averaged to a row.
            tunings: per output, the controller that reads it; empty where none is known.

        Raises:
            InputError: an unknown law, or limits that are not one or one for each valve.
        """
        options = options or IdentificationOptions()
        rows = len(record) // rate
        span = np.ptp(record.op, axis=0)
        op = ((record.op - record.op.mean(axis=0)) / span).round(DIGITS)[: rows * rate].T
        samples = ((record.pv - record.pv.mean(axis=0)) / record.pv.std(axis=0)).round(DIGITS)
        slow = samples[: rows * rate].T.reshape(-1, rows, rate).mean(axis=2)
        pv = (slow - slow.mean(axis=1, keepdims=True)) / slow.std(axis=1, keepdims=True)
        return cls(
            op=np.ascontiguousarray(op),
            pv=np.ascontiguousarray(pv.round(DIGITS)),
            rate=rate,
            laws=(find_law(options.first_law),) * len(span),
            span=span,
            limit=limited(span, options.friction_limit) / span,
            scale=op.std(axis=1),
            skipped=options.delay[0] // rate,
            tunings=tunings,
            shrunk=slow.std(axis=1),
        )

    def beginning(self, rows: int) -> "Problem":
        """Return the first ``rows`` of the record, in the scale of the whole; all are itself."""
        if rows == self.rows:
            return self
        return dataclasses.replace(
            self,
            op=np.ascontiguousarray(self.op[:, : rows * self.rate]),
            pv=np.ascontiguousarray(self.pv[:, :rows]),
            least_moves=FEW_MOVES,
        )

    def under(self, valve: int, law: type[FrictionLaw]) -> "Problem":
        """Return the problem with another law of one valve, what it has behind f_S and f_D held."""
        laws, further = list(self.laws), list(self.further or ((),) * len(self.laws))
        laws[valve], further[valve] = law, first_values(law)
        return dataclasses.replace(self, laws=tuple(laws), further=tuple(further))

    def with_waves(self, lines: Sequence[Sequence[float]]) -> "Problem":
        """Return the problem beside waves from outside.

        Args:
            lines: per output, frequencies in turns per sample; those too fast for the rows are
                left out.
        """
        seen = tuple(
            tuple(f for f in row if f * self.rate < 1.0 / LEAST_PER_HARMONIC) for row in lines
        )
        return dataclasses.replace(self, lines=seen)

    @property
    def rows(self) -> int:
        """Number of rows of the record."""
        return int(self.pv.shape[1])

    @property
    def first(self) -> int:
        """First row that counts."""
        return max(round(LEFT_OUT * self.rows), NOISE_ORDER + 2)

    @property
    def count(self) -> int:
        """Rows that count."""
        return self.rows - self.first

    @functools.cached_property
    def edges(self) -> IntArray:
        """Groups of taps of one height: g holds ``edges[g] + 1`` to ``edges[g + 1]``, (r + 1,)."""
        taps = max(min(TAPS, self.rows // SHARE), 2)
        edges = [0]
        while edges[-1] < taps:
            edges.append(min(edges[-1] + max(edges[-1] // COARSER, 1), taps))
        return np.array(edges)

    @property
    def taps(self) -> int:
        """M, length of an impulse response."""
        return int(self.edges[-1])

    def taps_of(self, levels: FloatArray) -> FloatArray:
        """Return the taps of a response, shape (M,), from the levels of their groups, (r,)."""
        return np.repeat(levels, np.diff(self.edges))

    @functools.cached_property
    def reaches(self) -> tuple[Reach | None, ...]:
        """Per output, how far a valve is expected to move it; None where that is not known."""
        told = self.tunings or (None,) * len(self.pv)
        return tuple(
            None if one is None else one.reach(self.rate, float(self.shrunk[i]), self.edges)
            for i, one in enumerate(told)
        )

    @property
    def told_to_end(self) -> bool:
        """Whether every output has a controller whose three reset times end by the last tap."""
        known = [one is not None and one.time <= self.taps * self.rate for one in self.tunings]
        return bool(known) and all(known)

    @functools.cached_property
    def waves(self) -> tuple[FloatArray, ...]:
        """Sine and cosine of the lines of each output, shape (2 H, n) each."""
        middle = self.rate * (np.arange(self.rows) + 0.5)
        told = self.lines or ((),) * len(self.pv)
        angles = [2.0 * np.pi * np.outer(lines, middle).reshape(-1, self.rows) for lines in told]
        return tuple(np.concatenate([np.sin(angle), np.cos(angle)]) for angle in angles)

    @functools.cached_property
    def known(self) -> tuple[Lines, ...]:
        """A constant and the waves of each output over the rows that count."""
        level = 1.0 / np.sqrt(self.count)
        found = []
        for i, waves in enumerate(self.waves):
            rows = np.vstack([np.full((1, self.count), level), waves[:, self.first :]])
            before = np.append(level, waves[:, self.first - 1])
            found.append(Lines(rows, before, self.turns(i), rows @ rows.T))
        return tuple(found)

    def turns(self, output: int) -> FloatArray:
        """Return the frequencies of the lines of an output, rad per row, shape (H,)."""
        lines = self.lines[output] if self.lines else ()
        return np.asarray(2.0 * np.pi * self.rate * np.array(lines, dtype=float))

    def ideal_stems(self) -> FloatArray:
        """Return the stems of valves without friction, scaled, shape (m, n)."""
        rows = [self._in_rows(op[:, None], j) for j, op in enumerate(self.op)]
        return np.concatenate(rows)

    def stems(self, valve: int, friction: FloatArray, starts: FloatArray | float) -> FloatArray:
        """Return stems of one valve, scaled, shape (G, n).

        Args:
            valve: index.
            friction: rows (f_S, f_D), shape (G, 2), or with all further parameters behind.
            starts: stem before the first sample minus the first OP, one or (G,).
        """
        op = self.op[valve]
        begin = op[0] + np.broadcast_to(np.asarray(starts, dtype=float), (len(friction),))
        further = self.further[valve] if self.further else ()
        law = self.laws[valve]
        if law.switching is None:  # it may know sizes in %, not J and S alone
            rows = friction.copy()
            rows[:, :2] *= self.span[valve]
            op, begin = self.span[valve] * op, self.span[valve] * begin
            stems = simulate(law, rows, op, begin, further) / self.span[valve]
        else:
            stems = simulate(law, friction, op, begin, further)
        return self._in_rows(stems, valve)

    def _in_rows(self, stems: FloatArray, valve: int) -> FloatArray:
        """Return stems of one valve, shares of the span, shape (N, G), as rows, scaled, (G, n)."""
        scale = float(self.scale[valve])
        return np.asarray(in_rows(stems, self.rate, self.skipped, scale))
