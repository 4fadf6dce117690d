"""The gap of one window of a running loop, held against that of a baseline."""

import dataclasses
import math

import numpy as np

from stiction_ros.discrepancy.likelihood.least_squares import left_by, projector
from stiction_ros.discrepancy.likelihood.noise import Blocks, fit_noise
from stiction_ros.discrepancy.simulation.free_run import FreeRun, join_records
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record
from stiction_ros.signals.autoregression import whiten

BATCHES = 24  # of the baseline, whose spread tells how much its mean square can be trusted
CLEARED = 0.05  # a healthy window exceeds the limit of the way back this often


@dataclasses.dataclass(frozen=True)
class OutputBaseline:
    """Noise of one output in the baseline, by which later windows are judged."""

    name: str  # tag
    ar: FloatArray  # φ of the AR noise of the free run's residual, shape (p,)
    std: float  # s₀, standard deviation of its innovations, units of the output
    # degrees of freedom that s₀² is worth, min(n₀ − q, 2 s₀⁴ / Var s₀²); the variance of the mean
    # square is taken from BATCHES batches, so that heavy tails and bursts widen the limit
    freedom: float
    rows: int  # n₀


@dataclasses.dataclass(frozen=True)
class OutputLook:
    """One output in one window, units of the output."""

    name: str  # tag
    gap: float  # standard deviation s₁ of the free run's innovations under that noise
    baseline: float  # the same in the baseline, s₀
    limit: float  # of s₁/s₀, for a healthy loop to exceed as seldom as asked
    back: float  # of s₁/s₀, below which a gap that had grown counts as gone

    @property
    def growth(self) -> float:
        """The gap over that of the baseline, s₁/s₀."""
        return self.gap / max(self.baseline, 1e-300)


def begun_at_stems(model: LoopModel, record: Record, count: int) -> Record:
    """Return the last ``count`` samples, the first OP replaced by the modelled stems.

    A free run takes a stem to be where OP is at its first sample. A sticky valve seldom is, so
    the valves' effects are run over all samples before. With ideal valves nothing is replaced.
    """
    first = max(len(record) - count, 0)
    part = record.part(first, len(record))
    op = part.op.copy()
    for valve, (low, high) in zip(model.valves, model.limits.tolist(), strict=True):
        if not valve.effects or valve.name not in record.valves:
            continue
        column = record.valves.index(valve.name)
        stem = np.clip(record.op[: first + 1, column], low, high)
        for effect in valve.effects:
            stem = effect.simulate(stem, float(stem[0]), record.sample_time)
        op[0, column] = min(max(float(stem[-1]), low), high)
    return dataclasses.replace(part, op=op)


def baseline_of(model: LoopModel, record: Record) -> tuple[OutputBaseline, ...]:
    """Return the noise of every output in the baseline.

    A record of another loop, and a model whose free run grows without bound, are refused.
    """
    run = FreeRun(model, join_records(model, [record]))
    return tuple(_output_baseline(run, i) for i in range(len(model.outputs)))


def look_at(
    model: LoopModel, record: Record, known: tuple[OutputBaseline, ...], chance: float
) -> tuple[OutputLook, ...]:
    r"""Measure the gap of one window and the limits that it is held against.

    With e the innovations of the window's free run under the noise of the baseline, their mean
    square over that of the baseline follows Fisher's distribution while nothing changes:

    .. math:: s_1^2 / s_0^2 \sim F(\nu_1, \nu_0), \quad \nu_1 = \nu_0 n_1 / n_0

    The ``chance`` is that a window of a healthy loop exceeds the limit of any output; ``known``
    is what :func:`baseline_of` gives for the same model, and so are its errors.
    """
    from scipy.stats import f as fisher

    run = FreeRun(model, join_records(model, [record]))
    looks = []
    for i, base in enumerate(known):
        rows = run.blocks(i).scored  # held-out ones included
        basis = projector(whiten(run.free[i], base.ar)[rows])  # start and level are left open
        left = left_by(basis, whiten(run.gap[:, i], base.ar)[rows])
        gap = math.sqrt(float(left @ left) / max(len(left) - basis.shape[1], 1))
        freedom = base.freedom * int(rows.sum()) / max(base.rows, 1)
        limit, back = (
            math.sqrt(float(fisher.isf(level / len(known), freedom, base.freedom)))
            for level in (chance, max(CLEARED, chance))
        )
        looks.append(OutputLook(base.name, gap, base.std, limit, back))
    return tuple(looks)


def _output_baseline(run: FreeRun, output: int) -> OutputBaseline:
    rows = run.blocks(output).scored  # held-out ones included
    noise = fit_noise(
        run.gap[:, output], run.free[output], Blocks(rows, np.zeros_like(rows, dtype=bool))
    )
    used = projector(run.free[output][rows]).shape[1] + len(noise.ar)
    count = max(int(rows.sum()) - used, 1)
    squares = noise.innovations[rows] ** 2
    variance = float(squares.sum()) / count
    means = np.array([batch.mean() for batch in np.array_split(squares, BATCHES) if len(batch)])
    spread = float(means.var(ddof=1)) / len(means) if len(means) > 1 else 0.0
    freedom = min(float(count), 2.0 * variance**2 / max(spread, 1e-300))
    return OutputBaseline(
        run.model.outputs[output], noise.ar, math.sqrt(variance), max(freedom, 2.0), int(rows.sum())
    )
