"""A whole record with friction, delays and linear parts: scanned, fitted, delays improved.

Delays are chosen channel by channel, by the exact fit under the noise model.
"""

import dataclasses
import enum
from collections.abc import Sequence
from functools import partial

import numpy as np

from stiction_ros.effects import FloatArray, FrictionLaw
from stiction_ros.identification.friction import simulate
from stiction_ros.identification.kernels.scan import best_apart
from stiction_ros.identification.problem.output_error import Orders, OutputFit, fit_output
from stiction_ros.identification.problem.scan import BATCH, OutputScan
from stiction_ros.identification.side_by_side import together
from stiction_ros.identification.switching import StepSignals, stem_steps

DELAY_MARGIN = 10.8
EQUAL = 3.84
WORTHWHILE = 400_000  # samples of all stems or patterns, from which on two threads share them


DelayRanges = tuple[tuple[int, int], ...]
AllDelays = tuple[tuple[int, ...], ...]


class Criterion(enum.Enum):
    """Prefilter of a scan: which error of the current model counts."""

    ONE_STEP = enum.auto()
    FREE_RUN = enum.auto()
    INNOVATIONS = enum.auto()

    @property
    def filtered(self) -> bool:
        """Whether the data are filtered by the model's 1/A."""
        return self is not Criterion.ONE_STEP


@dataclasses.dataclass(frozen=True)
class Data:
    """One record prepared for the search."""

    y: FloatArray  # outputs about their mean in units of their standard deviation, shape (p, N)
    u: FloatArray  # OP about its mean, %, shape (m, N)
    law: type[FrictionLaw]  # friction law
    limit: FloatArray  # largest f_S per valve, %, shape (m,)
    delay: tuple[int, int]  # inclusive range of t_d
    min_moves: int  # fewest stem moves of an accepted candidate
    # per valve, values at which the law's parameters behind f_S and f_D are held; empty for a law
    # that has no others
    further: tuple[tuple[float, ...], ...] = ()

    def part(self, begin: int, end: int) -> "Data":
        """Return the samples from ``begin`` to before ``end``."""
        y, u = (np.ascontiguousarray(signal[:, begin:end]) for signal in (self.y, self.u))
        return dataclasses.replace(self, y=y, u=u)

    def further_of(self, valve: int) -> tuple[float, ...]:
        """The law's further parameters at a valve."""
        return self.further[valve] if self.further else ()

    @property
    def delays(self) -> DelayRanges:
        """The range of t_d for each output."""
        return (self.delay,) * len(self.y)


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

    def part(self, begin: int, end: int) -> "ValveScan":
        """Return the rows from ``begin`` to before ``end``."""
        columns = (getattr(self, field.name) for field in dataclasses.fields(self))
        return ValveScan(*(column[begin:end] for column in columns))

    def best(self, count: int, min_moves: int, apart: float) -> list[int]:
        """Return up to ``count`` best rows at least ``apart`` from each other."""
        loss = np.where(self.moves < min_moves, np.inf, self.loss)
        return [int(index) for index in best_apart(self.grid, loss, count, apart)]


def stem_of(data: Data, valve: int, friction: FloatArray, start: float) -> FloatArray:
    """Return the stem of one valve, shape (N,)."""
    u = data.u[valve]
    further = data.further_of(valve)
    stems = simulate(data.law, friction[None, :], u, float(u[0] + start), further)
    return np.ascontiguousarray(stems[:, 0])


def output_scans(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    criterion: Criterion,
    ranges: DelayRanges,
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
            model.fits[i].a if criterion.filtered else one,
            free,
        )
        for i, (y, delays, delay) in enumerate(zip(data.y, model.delays, ranges, strict=True))
    ]


def scan_valve(
    data: Data,
    model: Model,
    orders: Orders,
    valve: int,
    grid: FloatArray,
    starts: FloatArray | float,
    criterion: Criterion = Criterion.INNOVATIONS,
    ranges: DelayRanges | None = None,
) -> ValveScan:
    """Scan the friction of ``valve`` with the other valves of ``model`` fixed.

    Args:
        starts: stem before the first sample minus first OP, %, shape (G,) or one for all.
        criterion: filter by 1, 1/A or D/A of the model's fits.
        ranges: delays scanned, one range per output; None is that of the data for all.
    """
    ranges = ranges or data.delays
    scans = output_scans(data, model, orders, valve, criterion, ranges)
    return scan_stems(data, valve, grid, starts, scans, ranges)


def scan_stems(
    data: Data,
    valve: int,
    grid: FloatArray,
    starts: FloatArray | float,
    scans: Sequence[OutputScan],
    ranges: DelayRanges,
) -> ValveScan:
    """Scan as :func:`scan_valve` by a criterion that stands, one scan per output."""
    u = np.ascontiguousarray(data.u[valve])
    starts = np.broadcast_to(np.asarray(starts, dtype=float), (len(grid),))
    begins = u[0] + starts
    loss, moves = np.zeros(len(grid)), np.zeros(len(grid))
    best = np.zeros((len(grid), len(data.y)), dtype=int)

    def scanned(rows: slice) -> None:
        stems = stem_steps(data.law, grid[rows], u, begins[rows], data.further_of(valve))
        moves[rows] = stems.moves
        for i, scan in enumerate(scans):
            energy, delays = scan.least_energy(stems)
            best[rows, i] = delays + ranges[i][0]
            loss[rows] += scan.count * np.log(energy / scan.count)

    shared = len(grid) * len(u) >= WORTHWHILE
    batch = min(BATCH, (len(grid) + 1) // 2) if shared else BATCH
    batches = (slice(at, at + batch) for at in range(0, len(grid), batch))
    together(*(partial(scanned, rows) for rows in batches))
    return ValveScan(grid, starts, loss, best, moves)


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
    orders: Orders,
    valve: int,
    friction: FloatArray,
    first: float,
    delays: FloatArray,
    warm: bool = True,
) -> Model:
    """Return the exact model with one valve's friction, start and delays replaced."""
    stems = model.stems.copy()
    stems[valve] = stem_of(data, valve, friction, first)
    all_friction, start = model.friction.copy(), model.start.copy()
    all_friction[valve], start[valve] = friction, first
    return refit(
        data,
        dataclasses.replace(
            model,
            friction=all_friction,
            start=start,
            stems=stems,
            delays=with_delays(model.delays, valve, delays),
        ),
        orders,
        warm,
    )


def refit(data: Data, model: Model, orders: Orders, warm: bool = True) -> Model:
    """Return the model with all outputs fitted to its stems and delays."""

    def fitted(i: int) -> OutputFit:
        old = model.fits[i] if warm and i < len(model.fits) else None
        usable = old if old is not None and old.orders == orders else None
        return fit_output(data.y[i], model.stems, model.delays[i], orders, usable)

    fits = together(*(partial(fitted, i) for i in range(len(data.y))))
    return dataclasses.replace(model, fits=tuple(fits))


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
        model = improve_delays(data, model, orders, tried)
        if model.loss > before - 1e-3:
            break
    return model


def _best_delays(
    data: Data, model: Model, orders: Orders, valve: int, criterion: Criterion
) -> AllDelays:
    """Return the model's delays with those of one valve at the least SE."""
    scans = output_scans(data, model, orders, valve, criterion, data.delays)
    stem = StepSignals.of(model.stems[valve][:, None])
    best = [data.delay[0] + int(scan.energy(stem)[0].argmin()) for scan in scans]
    return with_delays(model.delays, valve, best)


def improve_delays(
    data: Data, model: Model, orders: Orders, tried: set[AllDelays] | None = None
) -> Model:
    """Scan all delays of every channel with the stems fixed; keep what the exact fit favours.

    Args:
        tried: delays whose fits are known to be no better; what is fitted here is added.
    """
    if data.delay[0] == data.delay[1]:
        return model
    tried = set() if tried is None else tried
    for valve in range(len(data.u)):
        for criterion in (Criterion.FREE_RUN, Criterion.INNOVATIONS):
            delays = _best_delays(data, model, orders, valve, criterion)
            if delays == model.delays or delays in tried:
                continue
            tried.add(delays)
            rival = refit(data, dataclasses.replace(model, delays=delays), orders, warm=False)
            model = min(model, rival, key=lambda candidate: candidate.loss)
    return model


def settle_delays(
    data: Data, model: Model, orders: Orders
) -> tuple[Model, list[list[tuple[int, ...]]]]:
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
            rivals = _neighbours(data, model, orders, i, j)
            best = min(rivals.values(), key=lambda fit: fit.loss)
            near = [d for d, fit in rivals.items() if fit.loss <= best.loss + DELAY_MARGIN]
            alike = [d for d, fit in rivals.items() if fit.loss <= best.loss + EQUAL]
            equal[i].append(tuple(sorted(alike)))
            chosen = rivals[max(near)]
            delays, fits = list(model.delays), list(model.fits)
            delays[i], fits[i] = chosen.delays, chosen
            model = dataclasses.replace(model, delays=tuple(delays), fits=tuple(fits))
    return model, equal


def _neighbours(data: Data, model: Model, orders: Orders, i: int, j: int) -> dict[int, OutputFit]:
    """Return fits by delay of channel (i, j), out from the present one until rejected."""
    now = model.delays[i][j]

    def outwards(shift: int) -> dict[int, OutputFit]:
        best, delay, met = model.fits[i].loss, now + shift, {}
        while data.delay[0] <= delay <= data.delay[1]:
            row = list(model.delays[i])
            row[j] = delay
            met[delay] = fit_output(data.y[i], model.stems, tuple(row), orders)
            if met[delay].loss > best + DELAY_MARGIN:
                break
            best, delay = min(best, met[delay].loss), delay + shift
        return met

    shorter, longer = together(partial(outwards, -1), partial(outwards, 1))
    return {now: model.fits[i]} | shorter | longer
