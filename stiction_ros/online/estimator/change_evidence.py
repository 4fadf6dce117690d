"""What a window says of frictions other than the trusted one: innovations and signatures."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.likelihood.noise import Blocks, fit_noise
from stiction_ros.effects import Stiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification, OutputModel
from stiction_ros.identification.friction import find_law, simulate
from stiction_ros.records import Record

FORGETTING = 0.97  # of the high-pass that takes slow disturbances out
EPISODE = 10  # samples: moves nearer to each other are no witnesses of their own
START_ROWS = 120  # samples, at least, on which the unknown start of a free run is fitted
LEAST_ROWS = 60  # samples that noise is fitted to
GAIN_ERROR = 0.2  # standard deviation of a gain's relative error, for likelihoods
MISMATCH = 0.08  # standard error of a share that no number of moves takes away


@dataclasses.dataclass(frozen=True)
class OutputReference:
    """One output as it was known when trust began."""

    model: OutputModel  # linear part
    ar: FloatArray  # φ of the AR noise of its free run, shape (p ≤ 6,)
    std: float  # of the innovations behind the high-pass, units of the output

    @property
    def reach(self) -> int:
        """Samples that the past before a window acts on its free run."""
        inputs = max(len(b) + self.model.delay[v] for v, b in self.model.b.items())
        return max(len(self.model.a), inputs)

    def innovations(self, values: FloatArray) -> FloatArray:
        """Return ``values``, of the output, whitened and high-passed along the first axis."""
        return np.asarray(lfilter(*self._whitening(), values, axis=0))

    def response(self, valve: str, stem: FloatArray) -> FloatArray:
        """Return what ``stem``, of ``valve`` in %, adds to the innovations, in their σ."""
        if valve not in self.model.b:
            return np.zeros_like(stem)
        b = [0.0] * (1 + self.model.delay[valve]) + list(self.model.b[valve])
        top, bottom = self._whitening()
        return np.asarray(
            lfilter(np.convolve(b, top), np.convolve(self._poles, bottom), stem, axis=0) / self.std
        )

    def starts(self, samples: int) -> FloatArray:
        """Return the innovations, in their σ, of unknown starts of a free run and its level."""
        impulses = np.eye(samples, min(self.reach, samples))
        top, bottom = self._whitening()
        free = lfilter(top, np.convolve(self._poles, bottom), impulses, axis=0)
        return np.column_stack([free, self.innovations(np.ones(samples))]) / self.std

    @property
    def _poles(self) -> FloatArray:
        return np.array([1.0, *self.model.a])

    def _whitening(self) -> tuple[FloatArray, FloatArray]:
        top = np.convolve(np.concatenate([[1.0], -self.ar]), [1.0, -1.0])
        return top, np.array([1.0, -FORGETTING])


@dataclasses.dataclass(frozen=True)
class Reference:
    """Process and noise of a loop as they were identified when trust began."""

    valves: tuple[str, ...]
    outputs: tuple[OutputReference, ...]

    @classmethod
    def of(cls, found: Identification, record: Record) -> "Reference | None":
        """Take process and noise from a fit of ``record``; None where it tells too little."""
        if found.stem.shape != record.op.shape or not found.outputs:
            return None
        outputs = []
        sticky = np.array([valve.static_friction > 0.0 for valve in found.valves], dtype=bool)
        moved = found.stem[:, sticky] != found.stem[0, sticky]
        # Every stem is known from its first move on.
        first = int(max((np.argmax(column) for column in moved.T if column.any()), default=0))
        for model in found.outputs:
            pv = record.pv[first:, record.outputs.index(model.name)]
            one = _noise_of(model, record.valves, found.stem[first:], pv)
            if one is None:
                return None
            outputs.append(one)
        return cls(record.valves, tuple(outputs))


def _noise_of(
    model: OutputModel, valves: Sequence[str], stem: FloatArray, pv: FloatArray
) -> OutputReference | None:
    plain = OutputReference(model, np.zeros(0), 1.0)
    rows = np.arange(len(pv)) >= plain.reach + 6
    if rows.sum() < LEAST_ROWS:
        return None
    poles = np.array([1.0, *model.a])
    gap = pv - pv[0]
    for j, valve in enumerate(valves):
        if valve in model.b:
            b = [0.0] * (1 + model.delay[valve]) + list(model.b[valve])
            gap = gap - lfilter(b, poles, stem[:, j] - stem[0, j])
    last = plain.reach - len(model.a)  # n_a impulses before the rows that are used: any state
    free = lfilter([1.0], poles, np.eye(len(pv), len(model.a), -last), axis=0)
    noise = fit_noise(
        gap, np.column_stack([free, np.ones(len(pv))]), Blocks(rows, np.zeros_like(rows))
    )
    used = noise.residual[rows]
    passed = OutputReference(model, noise.ar, 1.0).innovations(used - used[0])
    std = math.sqrt(float(np.mean(passed[min(START_ROWS, len(passed) // 2) :] ** 2)))
    return OutputReference(model, noise.ar, std) if 0.0 < std < math.inf else None


class Course(NamedTuple):
    """Samples in succession, and where the stems were."""

    begin: int  # number of the first one
    op: FloatArray  # op, stem: shape (n, m), %
    stem: FloatArray
    pv: FloatArray  # shape (n, p)

    def before(self, sample: int) -> "Course | None":
        """Return the last ones before a sample, as many as are of use; None if not known."""
        end = sample - self.begin
        if not 0 < end <= len(self.op):
            return None
        first = max(end - 2 * START_ROWS, 0)
        return Course(self.begin + first, *(signal[first:end].copy() for signal in self[1:]))


@dataclasses.dataclass(frozen=True)
class Share:
    """How much of a signature a stretch of samples shows: 0 nothing of it, 1 all."""

    value: float  # by weighted least squares
    error: float  # its standard error, from how the episodes of moves differ
    information: float  # squared length of the signature, in σ

    @property
    def margin(self) -> float:
        """Standard errors by which the share lies nearer to all than to nothing."""
        return (self.value - 0.5) / self.error


class Evidence:
    """Innovations of one window under the trusted frictions.

    Attributes:
        op, stem: OP and stems by the trusted frictions, shape (n, m), %.
        pv: outputs, shape (n, p).
        first: sample from which the trusted frictions hold; before it others did.
        innovations: per output, in their σ, shape (n,) each.
        moves: samples at which the stem of each valve moves, by valve index.
    """

    def __init__(
        self,
        reference: Reference,
        op: FloatArray,
        stem: FloatArray,
        pv: FloatArray,
        laws: Mapping[int, Stiction],
        first: int = 0,
    ) -> None:
        """Take a window; ``pv`` has shape (n, p), ``laws`` are the trusted ones by valve index."""
        self.reference, self.first, self._laws = reference, first, laws
        self.op, self.stem, self.pv = op, stem, pv
        moves = [np.flatnonzero(np.diff(column)) + 1 for column in stem.T]
        self.moves = [found[found >= first] for found in moves]
        self.innovations: list[FloatArray] = []
        self._gains: list[FloatArray] = []
        begin = min(first or len(op), START_ROWS)
        for i, output in enumerate(reference.outputs):
            seen = output.innovations(pv[:, i] - pv[0, i]) / output.std
            for j, valve in enumerate(reference.valves):
                seen = seen - output.response(valve, stem[:, j] - stem[0, j])
            starts = output.starts(len(op))
            begun = np.linalg.lstsq(starts[:begin], seen[:begin], rcond=None)[0]
            self.innovations.append(seen - starts @ begun)
            gains = [
                output.response(valve, stem[:, j] - stem[:, j].mean())
                for j, valve in enumerate(reference.valves)
            ]
            self._gains.append(np.column_stack(gains))

    def stems(self, valve: int, first: int, grid: FloatArray) -> FloatArray:
        """Return stems of ``valve`` by its law from ``first`` on, shape (n − first, G), %.

        There the stem rests where it is trusted to be; ``grid`` has rows (f_S, f_D), %, (G, 2).
        """
        law = self._laws[valve]
        further = [getattr(law, entry.attribute) for entry in law.parameters()[2:]]
        op = np.ascontiguousarray(self.op[first:, valve])
        start = float(self.stem[max(first - 1, 0), valve])
        return simulate(find_law(str(law.law)), grid, op, start, further)

    def signature(self, valve: int, first: int, stems: FloatArray) -> list[FloatArray]:
        """Return what other stems from ``first`` on, (n − first, G), %, change per output, σ."""
        moved = np.zeros((len(self.stem), stems.shape[1]))
        moved[first:] = stems - self.stem[first:, [valve]]
        name = self.reference.valves[valve]
        return [output.response(name, moved) for output in self.reference.outputs]

    def gains(
        self, valve: int, first: int, stems: FloatArray, begin: int | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return how well other stems from sample ``first`` on explain the samples from ``begin``.

        The gain of every valve may be off by :data:`GAIN_ERROR`, in all explanations alike. What
        changes from different samples on is to be compared over the same rows: the gain that is
        left open explains a little by itself, and more where there are more rows.

        The ``stems`` from ``first`` on are of shape (n − first, G), %; ``begin`` ≤ ``first``.
        Returned are log likelihoods over that of the trusted stems, (G,), and the mean squares of
        the innovations that are left, shape (G,).
        """
        whole = np.hstack([self.stem[first:, [valve]], stems])  # what is trusted comes first
        total = np.zeros(whole.shape[1])
        rows = slice(first if begin is None else begin, None)
        for seen, change, gains in zip(
            self.innovations, self.signature(valve, first, whole), self._gains, strict=True
        ):
            left = seen[rows, None] - change[rows]
            columns = np.repeat(gains[rows, None, :], whole.shape[1], axis=1)
            columns[:, :, valve] += change[rows]
            cross = np.einsum("ngm,ng->gm", columns, left)
            gram = np.einsum("ngm,ngk->gmk", columns, columns)
            gram += np.eye(len(self.reference.valves)) / GAIN_ERROR**2
            taken = np.einsum("gm,gm->g", cross, np.linalg.solve(gram, cross[:, :, None])[:, :, 0])
            total += np.sum(left * left, axis=0) - taken
        count = len(self.op[rows]) * len(self.innovations)
        return 0.5 * (total[0] - total[1:]), total[1:] / count

    @property
    def mean_square(self) -> float:
        """Mean square of the innovations; 1 where process and frictions are as they were."""
        return float(np.mean([np.mean(seen[self.first :] ** 2) for seen in self.innovations]))

    def share(self, valve: int, first: int, stems: FloatArray) -> Share:
        """Return how much of other ``stems`` from ``first`` on, (n − first,), %, the samples show.

        An error of the process's gain is allowed for: what the stems as they are would explain
        by another gain is left out on both sides.
        """
        begins = np.zeros(len(self.op) - first, dtype=int)
        moves = self.moves[valve][self.moves[valve] >= first] - first
        begins[moves[np.diff(moves, prepend=-EPISODE - 1) > EPISODE]] = 1
        episode = np.cumsum(begins)
        count = int(episode[-1]) + 1
        seen, length = np.zeros(count), np.zeros(count)
        signature = self.signature(valve, first, stems[:, None])
        for innovations, change, gains in zip(
            self.innovations, signature, self._gains, strict=True
        ):
            basis = np.linalg.qr(gains[first:])[0]
            wanted = change[first:, 0] - basis @ (basis.T @ change[first:, 0])
            shown = innovations[first:] - basis @ (basis.T @ innovations[first:])
            seen += np.bincount(episode, shown * wanted, count)
            length += np.bincount(episode, wanted * wanted, count)
        information = float(length.sum())
        if information <= 0.0:
            return Share(0.0, math.inf, 0.0)
        value = float(seen.sum()) / information
        spread = float(np.sum((seen - value * length) ** 2)) / information**2
        error = math.sqrt(max(spread, 1.0 / information) + MISMATCH**2)
        return Share(value, error, information)
