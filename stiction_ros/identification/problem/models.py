"""A whole record with friction, delays and linear parts: scanned, fitted, delays improved.

Delays are chosen channel by channel, by the exact fit under the noise model.
"""

import dataclasses
import enum
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects import FloatArray, FrictionLaw
from stiction_ros.identification.friction import simulate
from stiction_ros.identification.kernels.scan import best_apart
from stiction_ros.identification.problem.output_error import Orders, OutputFit, fit_output
from stiction_ros.identification.problem.scan import OutputScan
from stiction_ros.identification.switching import StepSignals
from stiction_ros.signals.arx_fit import Delays

DELAY_MARGIN = 10.8
FEWEST_MOVES = 6  # of a stem, from which anything may be concluded
EQUAL = 3.84


class Criterion(enum.Enum):
    """Prefilter of a scan: which error of the current model counts."""

    ONE_STEP = enum.auto()
    FREE_RUN = enum.auto()
    INNOVATIONS = enum.auto()


@dataclasses.dataclass(frozen=True)
class Data:
    """One record prepared for the search."""

    y: FloatArray  # outputs about their mean in units of their standard deviation, shape (p, N)
    u: FloatArray  # OP about its mean, %, shape (m, N)
    law: type[FrictionLaw]  # friction law
    limit: FloatArray  # largest f_S per valve, %, shape (m,)
    delay: tuple[int, int]  # inclusive range of t_d

    def part(self, begin: int, end: int) -> "Data":
        """Return the samples from ``begin`` to before ``end``."""
        y, u = (np.ascontiguousarray(signal[:, begin:end]) for signal in (self.y, self.u))
        return dataclasses.replace(self, y=y, u=u)


@dataclasses.dataclass(frozen=True)
class Model:
    """Friction, stems, delays and fits of the whole record."""

    friction: FloatArray  # (f_S, f_D) per valve, shape (m, 2), %
    start: FloatArray  # stem before the first sample minus first OP, %, shape (m,)
    stems: FloatArray  # shape (m, N), about the mean of the OP
    delays: tuple[tuple[int, ...], ...]  # one tuple of m delays per output
    fits: tuple[OutputFit, ...]  # one fit per output

    def beginning(self, count: int) -> "Model":
        """Return the model with the first ``count`` samples of its stems."""
        return dataclasses.replace(self, stems=np.ascontiguousarray(self.stems[:, :count]))

    def with_stem(
        self, valve: int, stem: FloatArray, friction: FloatArray | float, start: float
    ) -> "Model":
        """Return the model with another stem of one valve; what was fitted stays."""
        stems, frictions, starts = self.stems.copy(), self.friction.copy(), self.start.copy()
        stems[valve], frictions[valve], starts[valve] = stem, friction, start
        return dataclasses.replace(self, stems=stems, friction=frictions, start=starts)

    @property
    def orders(self) -> Orders:
        return self.fits[0].orders

    @property
    def loss(self) -> float:
        """Sum over outputs of n log(mean squared innovation)."""
        return float(sum(fit.loss for fit in self.fits))

    @property
    def bic(self) -> float:
        """BIC of the linear parts and noise; friction is not counted here."""
        return float(sum(fit.bic for fit in self.fits))


@dataclasses.dataclass(frozen=True)
class ValveScan:
    """Result of one scan."""

    grid: FloatArray  # rows (f_S, f_D), shape (G, 2)
    starts: FloatArray  # stem before the first sample minus first OP, %, shape (G,)
    loss: FloatArray  # best over the delays, summed over outputs, shape (G,)
    delays: FloatArray  # the best delay per output, shape (G, p)
    moves: FloatArray  # shape (G,)

    def best(self, count: int, apart: float) -> list[int]:
        """Return up to ``count`` best rows at least ``apart`` from each other."""
        loss = np.where(self.moves < FEWEST_MOVES, np.inf, self.loss)
        return [int(index) for index in best_apart(self.grid, loss, count, apart)]


def stem_of(data: Data, valve: int, friction: FloatArray, start: float) -> FloatArray:
    """Return the stem of one valve, shape (N,)."""
    u = data.u[valve]
    stems = simulate(data.law, friction[None, :], u, float(u[0] + start))
    return np.ascontiguousarray(stems[:, 0])


def output_scans(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    criterion: Criterion,
    ranges: Sequence[tuple[int, int]],
    free: FloatArray | None = None,
) -> list[OutputScan]:
    """Return one scan per output, the other valves of ``model`` fixed."""
    others = [j for j in range(len(data.u)) if j != valve]
    one = np.ones(1)
    return [
        OutputScan(
            y,
            model.stems[others],
            tuple(delays[j] for j in others),
            orders,
            delay,
            model.fits[i].noise if criterion is Criterion.INNOVATIONS else one,
            one if criterion is Criterion.ONE_STEP else model.fits[i].a,
            free,
        )
        for i, (y, delays, delay) in enumerate(zip(data.y, model.delays, ranges, strict=True))
    ]


def with_delays(
    delays: tuple[tuple[int, ...], ...], valve: int, column: Sequence[int] | FloatArray
) -> tuple[tuple[int, ...], ...]:
    """Return the delays per output with those of one valve replaced by ``column``, (p,)."""
    return tuple(
        tuple(int(new) if j == valve else d for j, d in enumerate(row))
        for row, new in zip(delays, column, strict=True)
    )


def with_valve(
    data: Data,
    model: Model,
    valve: int,
    friction: FloatArray,
    first: float,
    delays: FloatArray,
    warm: bool = True,
) -> Model:
    """Return the exact model with one valve's friction, start and delays replaced."""
    moved = model.with_stem(valve, stem_of(data, valve, friction, first), friction, first)
    moved = dataclasses.replace(moved, delays=with_delays(model.delays, valve, delays))
    return refit(data, moved, model.orders, warm)


def refit(data: Data, model: Model, orders: Orders, warm: bool = True) -> Model:
    """Return the model with all outputs fitted to its stems and delays."""

    def fitted(i: int) -> OutputFit:
        old = model.fits[i] if warm and i < len(model.fits) else None
        usable = old if old is not None and old.orders == orders else None
        return fit_output(data.y[i], model.stems, model.delays[i], orders, usable)

    return dataclasses.replace(model, fits=tuple(map(fitted, range(len(data.y)))))


def linear_model(data: Data, orders: Orders, base: Model | None = None) -> Model:
    """Return the best model with the stems of ``base``; friction-free when None."""
    m, p = len(data.u), len(data.y)
    if base is None:
        zero = np.zeros((m, 2))
        delays = tuple((data.delay[0],) * m for _ in range(p))
        base = Model(zero, np.zeros(m), data.u.copy(), delays, ())
    for j in range(m) if data.delay[0] < data.delay[1] else ():
        delays = _best_delays(data, base, orders, j, Criterion.ONE_STEP)
        base = dataclasses.replace(base, delays=delays)
    model = refit(data, base, orders, warm=False)
    tried = {model.delays}
    for _ in range(3):
        before = model.loss
        model = improve_delays(data, model, tried)
        if model.loss > before - 1e-3:
            break
    return model


def _best_delays(
    data: Data, model: Model, orders: Orders, valve: int, criterion: Criterion
) -> Delays:
    """Return the model's delays with those of one valve at the least SE."""
    ranges = (data.delay,) * len(data.y)
    scans = output_scans(data, model, orders, valve, criterion, ranges)
    stem = StepSignals.of(model.stems[valve][:, None])
    best = [data.delay[0] + int(scan.least_energy(stem)[1][0]) for scan in scans]
    return with_delays(model.delays, valve, best)


def improve_delays(data: Data, model: Model, tried: set[Delays] | None = None) -> Model:
    """Scan all delays of every channel with the stems fixed; keep what the exact fit favours.

    Args:
        tried: delays whose fits are known to be no better; what is fitted here is added.
    """
    if data.delay[0] == data.delay[1]:
        return model
    tried = set() if tried is None else tried
    for valve in range(len(data.u)):
        for criterion in (Criterion.FREE_RUN, Criterion.INNOVATIONS):
            delays = _best_delays(data, model, model.orders, valve, criterion)
            if delays == model.delays or delays in tried:
                continue
            tried.add(delays)
            moved = dataclasses.replace(model, delays=delays)
            rival = refit(data, moved, model.orders, warm=False)
            model = min(model, rival, key=lambda candidate: candidate.loss)
    return model


def settle_delays(data: Data, model: Model) -> tuple[Model, list[list[tuple[int, ...]]]]:
    """Choose each channel's delay by the exact fit: the longest that is not rejected.

    A leading coefficient that the record cannot tell from zero counts as delay: a shorter
    delay must lower −2 log likelihood by more than ``DELAY_MARGIN``, the 99.9 % point of its
    gain by one coefficient that is zero.

    Returns:
        The model, and per output and valve all delays within ``EQUAL`` of the best.
    """
    equal: list[list[tuple[int, ...]]] = []
    for i in range(len(data.y)):
        equal.append([])
        for j in range(len(data.u)):
            rivals = _neighbours(data, model, i, j)
            best = min(rivals.values(), key=lambda fit: fit.loss)
            near = [d for d, fit in rivals.items() if fit.loss <= best.loss + DELAY_MARGIN]
            alike = [d for d, fit in rivals.items() if fit.loss <= best.loss + EQUAL]
            equal[i].append(tuple(sorted(alike)))
            chosen = rivals[max(near)]
            delays, fits = list(model.delays), list(model.fits)
            delays[i], fits[i] = chosen.delays, chosen
            model = dataclasses.replace(model, delays=tuple(delays), fits=tuple(fits))
    return model, equal


def _neighbours(data: Data, model: Model, i: int, j: int) -> dict[int, OutputFit]:
    """Return fits by delay of channel (i, j), out from the present one until rejected."""
    now = model.delays[i][j]

    def outwards(shift: int) -> dict[int, OutputFit]:
        best, delay, met = model.fits[i].loss, now + shift, {}
        while data.delay[0] <= delay <= data.delay[1]:
            row = list(model.delays[i])
            row[j] = delay
            met[delay] = fit_output(data.y[i], model.stems, tuple(row), model.orders)
            if met[delay].loss > best + DELAY_MARGIN:
                break
            best, delay = min(best, met[delay].loss), delay + shift
        return met

    return {now: model.fits[i]} | outwards(-1) | outwards(1)
