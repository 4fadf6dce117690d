"""ARX equations (9) of one output from given stems, by the one-step error.

Orders and delays are chosen by AIC or BIC of the free run, with every rival shown.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearStatus,
    OrderCriterion,
    information,
    nrmse_fit,
)
from stiction_ros.processes import ArxOutput, Noise, NoiseEntry
from stiction_ros.signals.arx_fit import ArxOrders, fit_arx, stable_arx
from stiction_ros.signals.free_run import driven, fitted_free_run

MAX_RADIUS = 0.9995
"""Largest root of A: the pole of an integrator that is fitted lies as near to 1 as this."""
LARGEST = 20  # order
DELAY_MARGIN = 2.0
"""Of delays whose criteria differ by less, the longest is kept."""


@dataclasses.dataclass(frozen=True)
class EquationOrders:
    """n_a and n_b, 1 or more; n_b is the same for every valve."""

    output: int
    input: int


@dataclasses.dataclass(frozen=True)
class EquationFit:
    """One output's equation in deviations from the means of the record."""

    name: str  # tag of the output
    status: LinearStatus  # ``OK``; ``CONSTRAINED`` where A had to be kept stable
    reason: str  # one sentence; empty when ok
    orders: EquationOrders  # n_a, n_b
    delays: tuple[int, ...]  # t_d per valve, samples
    a: FloatArray  # a_1 … a_na, shape (n_a,), sign as in (8a)
    b: FloatArray  # shape (m, n_b), engineering units per %
    constant: float  # engineering units, for deviations from ``stem0`` and ``pv0``
    # stem0, pv0: operating point, shape (m,) in % and a number in engineering units
    stem0: FloatArray
    pv0: float
    noise_std: float  # standard deviation of the one-step error, engineering units
    count: int  # samples of the criterion
    # fit_one_step, fit_free_run: NRMSE fit, %; −inf for a free run that diverges
    fit_one_step: float
    fit_free_run: float
    # aic, bic: of the free-run error, y in units of its standard deviation: where noise is added to
    # PV, the one-step error of ARX misleads
    aic: float
    bic: float

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Roots of A, largest first, shape (n_a,)."""
        poles = np.roots(np.concatenate([[1.0], self.a])).astype(complex)
        return poles[np.argsort(-np.abs(poles), kind="stable")]

    @property
    def gain(self) -> FloatArray:
        """DC gain B_j(1) / A(1), shape (m,), engineering units per %."""
        return np.asarray(self.b.sum(axis=1) / (1.0 + self.a.sum()))

    def equation(self, valves: tuple[str, ...]) -> ArxOutput:
        """Return the equation as an ARX process takes it, in deviations."""
        return ArxOutput(
            self.name,
            tuple(map(float, self.a)),
            {v: tuple(map(float, row)) for v, row in zip(valves, self.b, strict=True)},
            dict(zip(valves, self.delays, strict=True)),
            self.constant,
            Noise(self.noise_std, NoiseEntry.EQUATION),
        )


def fit_equation(
    data: LinearData,
    output: int,
    orders: EquationOrders,
    delays: tuple[int, ...],
    first: int | None = None,
) -> EquationFit:
    """Fit the equation of one output.

    Args:
        data: inputs (stems, or OP for a valve without friction) and outputs.
        output: index of the output.
        orders: n_a and n_b.
        delays: t_d per valve, samples.
        first: first sample of the criterion, one for all rivals of a comparison; None takes
            the least that the orders and delays allow.

    Raises:
        InputError: orders or delays out of range, or a record too short for them.
    """
    reach = check(data, orders, delays)
    first = reach if first is None else first
    parameters = orders.output + len(delays) * orders.input + 1
    if first < reach:
        raise InputError(f"{first} is before sample {reach}", where="first")
    if data.samples - first < 3 * parameters + 10:
        raise InputError(
            f"{data.samples} samples are too few for {parameters} coefficients",
            where=data.name,
            fix="take a longer record, lower orders or shorter delays",
        )
    y, scale = data.y[output], float(data.y_scale[output])
    common = ArxOrders(orders.output, orders.input, first)
    plain = fit_arx(y, data.u, delays, common)
    constrained = plain.largest_root >= 1.0
    fit = stable_arx(y, data.u, delays, common, radius=MAX_RADIUS) if constrained else plain
    target, count = y[first:], data.samples - first
    run = fitted_free_run(fit.a, driven(fit.b, delays, data.u, fit.constant)[first:], target)
    with np.errstate(invalid="ignore", over="ignore"):
        missed = float(np.mean((target - run) ** 2))
    aic, bic = information(missed, count, parameters)
    return EquationFit(
        name=data.outputs[output],
        status=LinearStatus.CONSTRAINED if constrained else LinearStatus.OK,
        reason="the best equation is unstable; A is held inside" if constrained else "",
        orders=orders,
        delays=delays,
        a=fit.a,
        b=fit.b * scale / data.u_scale[:, None],
        constant=fit.constant * scale,
        stem0=data.u_mean,
        pv0=float(data.y_mean[output]),
        noise_std=float(np.sqrt(fit.squared_error / max(count - parameters, 1))) * scale,
        count=count,
        fit_one_step=nrmse_fit(target, target - fit.residuals),
        fit_free_run=nrmse_fit(target, run),
        aic=aic,
        bic=bic,
    )


def check(data: LinearData, orders: EquationOrders, delays: tuple[int, ...]) -> int:
    """Return the first sample that orders and delays reach; raise :class:`InputError`."""
    for key, value in (("na", orders.output), ("nb", orders.input)):
        if not 1 <= value <= LARGEST:
            raise InputError(f"order {value} lies outside 1 to {LARGEST}", where=key)
    if len(delays) != len(data.valves):
        raise InputError(f"{len(delays)} delays for {len(data.valves)} valves", where="delay")
    if min(delays) < 0:
        raise InputError("a delay is negative", where="delay")
    return max(orders.output, orders.input + max(delays))


@dataclasses.dataclass(frozen=True)
class OrderOptions:
    """What :func:`choose_orders` may choose from.

    Raises:
        InputError: no order, or a range that holds no delay.
    """

    output: tuple[int, ...] = (1, 2, 3)  # n_a to try
    input: tuple[int, ...] = ()  # n_b to try; empty takes n_b = n_a
    delay: tuple[int, int] = (0, 10)  # inclusive range of t_d, samples, for every valve
    criterion: OrderCriterion = OrderCriterion.BIC  # AIC or BIC

    def __post_init__(self) -> None:
        if not self.output:
            raise InputError("no order to try", where="na")
        low, high = self.delay
        if not 0 <= low <= high:
            raise InputError(
                f"{low}:{high} is no delay range", where="delay", fix="use LO:HI, 0 <= LO <= HI"
            )

    def orders(self) -> list[EquationOrders]:
        """Return all orders to try, in rising order."""
        return [
            EquationOrders(na, nb)
            for na in sorted(set(self.output))
            for nb in sorted(set(self.input)) or [na]
        ]


@dataclasses.dataclass(frozen=True)
class OrderChoice:
    """The equation taken, and all that were tried."""

    fit: EquationFit  # the equation taken
    # every equation, by orders and delays, all scored on the same samples
    rivals: tuple[EquationFit, ...]
    criterion: OrderCriterion  # what chose

    def best_of_each_order(self) -> list[EquationFit]:
        """Return for each (n_a, n_b) the rival with the delays that do best; the one taken."""
        best: dict[EquationOrders, EquationFit] = {self.fit.orders: self.fit}
        for rival in self.rivals:
            now = best.get(rival.orders)
            if now is None or (now is not self.fit and self.value(rival) < self.value(now)):
                best[rival.orders] = rival
        return sorted(best.values(), key=lambda fit: dataclasses.astuple(fit.orders))

    def value(self, fit: EquationFit) -> float:
        """Return the value of the criterion that chooses."""
        return fit.aic if self.criterion is OrderCriterion.AIC else fit.bic


class _Search:
    """Fits rivals on one common window and remembers them."""

    def __init__(self, data: LinearData, output: int, options: OrderOptions) -> None:
        self.data, self.output, self.options = data, output, options
        longest = (options.delay[1],) * len(data.valves)
        self.first = max(check(data, orders, longest) for orders in options.orders())
        self.fits: dict[tuple[EquationOrders, tuple[int, ...]], EquationFit] = {}

    def value(self, orders: EquationOrders, delays: tuple[int, ...]) -> float:
        key = orders, delays
        if key not in self.fits:
            self.fits[key] = fit_equation(self.data, self.output, orders, delays, self.first)
        fit = self.fits[key]
        return fit.aic if self.options.criterion is OrderCriterion.AIC else fit.bic

    def scan(self, orders: EquationOrders, delays: tuple[int, ...], reach: int) -> tuple[int, ...]:
        """Improve one delay after the other within ``reach`` of itself until none improves."""
        low, high = self.options.delay
        for _ in range(high - low + 2):
            before = delays
            for j in range(len(delays)):
                near = range(max(low, delays[j] - reach), min(high, delays[j] + reach) + 1)
                rivals = [(*delays[:j], d, *delays[j + 1 :]) for d in near]
                delays = min(rivals, key=lambda rival: (self.value(orders, rival), rival))
            if delays == before:
                break
        return delays

    def lengthened(self, orders: EquationOrders, delays: tuple[int, ...]) -> tuple[int, ...]:
        """Return longer delays that do as well: a leading b near zero counts as delay."""
        limit = self.value(orders, delays) + DELAY_MARGIN
        for j in range(len(delays)):
            while delays[j] < self.options.delay[1]:
                longer = (*delays[:j], delays[j] + 1, *delays[j + 1 :])
                if not self.value(orders, longer) <= limit:
                    break
                delays = longer
        return delays


def choose_orders(
    data: LinearData, output: int, options: OrderOptions | None = None
) -> OrderChoice:
    """Choose n_a, n_b and the delays of one output.

    All delays of the middle order are scanned, one valve after the other; the other orders
    start from what it found and move from there. All rivals are scored on the same samples.

    Raises:
        InputError: as :func:`fit_equation`.
    """
    options = options or OrderOptions()
    search, tried = _Search(data, output, options), options.orders()
    middle = tried[len(tried) // 2]
    low, high = options.delay
    found = {middle: search.scan(middle, (low,) * len(data.valves), high - low)}
    for orders in tried:
        if orders != middle:
            found[orders] = search.scan(orders, found[middle], 1)
    best = min(tried, key=lambda orders: search.value(orders, found[orders]))
    delays = search.lengthened(best, found[best])
    rivals = sorted(
        search.fits.values(), key=lambda fit: (dataclasses.astuple(fit.orders), fit.delays)
    )
    return OrderChoice(search.fits[best, delays], tuple(rivals), options.criterion)
