"""Orders and delays of an ARX or ARMAX equation by AIC or BIC, with every rival shown."""

from __future__ import annotations

import dataclasses
import enum

from stiction_ros.errors import InputError
from stiction_ros.identification.linear.armax import ArmaxFit, check, fit_armax
from stiction_ros.identification.linear.armax_problem import ArmaxOrders
from stiction_ros.identification.linear.data import (
    LinearData,
    LinearKind,
    LinearStatus,
    OrderCriterion,
)

DELAY_MARGIN = 2.0
"""Of delays whose criteria differ by less, the longest is kept."""


class JudgedError(enum.StrEnum):
    """Which error the criterion is of."""

    ONE_STEP = "one_step"
    FREE_RUN = "free_run"


@dataclasses.dataclass(frozen=True)
class OrderOptions:
    """What :func:`choose_orders` may choose from.

    Attributes:
        kind: ``ARX`` or ``ARMAX``.
        output: n_a to try.
        input: n_b to try; empty takes n_b = n_a.
        noise: n_c of an ARMAX equation; None takes n_c = n_a.
        delay: inclusive range of t_d, samples, for every valve.
        criterion: AIC or BIC.
        judged: error of the criterion; None takes the one-step error for ARMAX and the free
            run for ARX, whose one-step error misleads when noise is added to PV.

    Raises:
        InputError: no order, state space as kind, or a range that holds no delay.
    """

    kind: LinearKind = LinearKind.ARX
    output: tuple[int, ...] = (1, 2, 3)
    input: tuple[int, ...] = ()
    noise: int | None = None
    delay: tuple[int, int] = (0, 10)
    criterion: OrderCriterion = OrderCriterion.BIC
    judged: JudgedError | None = None

    def __post_init__(self) -> None:
        if self.kind is LinearKind.STATE_SPACE:
            raise InputError("state space has one order n", where="kind", fix="use arx or armax")
        if not self.output:
            raise InputError("no order to try", where="na")
        if not 0 <= self.delay[0] <= self.delay[1]:
            low, high = self.delay
            raise InputError(
                f"{low}:{high} is no delay range", where="delay", fix="use LO:HI, 0 <= LO <= HI"
            )

    def orders(self) -> list[ArmaxOrders]:
        """Return all orders to try, in rising order."""
        found = []
        for na in sorted(set(self.output)):
            for nb in sorted(set(self.input)) or [na]:
                nc = 0 if self.kind is LinearKind.ARX else na if self.noise is None else self.noise
                found.append(ArmaxOrders(na, nb, nc))
        return found


@dataclasses.dataclass(frozen=True)
class OrderRow:
    """One rival: its orders, its delays and how well it does.

    Attributes:
        orders, delays: of the rival.
        status: of its fit.
        aic, bic: of the one-step error.
        free_run_aic, free_run_bic: of the free-run error.
        fit_one_step, fit_free_run: %.
        chosen: whether it was taken.
    """

    orders: ArmaxOrders
    delays: tuple[int, ...]
    status: LinearStatus
    aic: float
    bic: float
    free_run_aic: float
    free_run_bic: float
    fit_one_step: float
    fit_free_run: float
    chosen: bool

    def values(self, judged: JudgedError) -> tuple[float, float]:
        """Return (AIC, BIC) of one error."""
        if judged is JudgedError.ONE_STEP:
            return self.aic, self.bic
        return self.free_run_aic, self.free_run_bic


@dataclasses.dataclass(frozen=True)
class OrderChoice:
    """The equation taken, and all that were tried.

    Attributes:
        fit: the equation taken.
        rows: every rival, by orders and delays, all scored on the same samples.
        criterion, judged: what chose.
    """

    fit: ArmaxFit
    rows: tuple[OrderRow, ...]
    criterion: OrderCriterion
    judged: JudgedError

    def best_of_each_order(self) -> list[OrderRow]:
        """Return for each (n_a, n_b, n_c) the row with the delays that do best."""
        best: dict[ArmaxOrders, OrderRow] = {}
        for row in self.rows:
            now = best.get(row.orders)
            better = now is None or row.chosen
            if now is not None and not now.chosen:
                better = better or _value(row, self) < _value(now, self)
            if better:
                best[row.orders] = row
        return list(best.values())


def _value(scored: OrderRow | ArmaxFit, choice: OrderChoice | _Search) -> float:
    """Return the value of the criterion that chooses."""
    one_step = choice.judged is JudgedError.ONE_STEP
    if choice.criterion is OrderCriterion.AIC:
        return scored.aic if one_step else scored.free_run_aic
    return scored.bic if one_step else scored.free_run_bic


class _Search:
    """Fits rivals on one common window and remembers them."""

    def __init__(self, data: LinearData, output: int, options: OrderOptions) -> None:
        self.data, self.output, self.options = data, output, options
        self.criterion = options.criterion
        self.judged = options.judged or (
            JudgedError.FREE_RUN if options.kind is LinearKind.ARX else JudgedError.ONE_STEP
        )
        longest = (options.delay[1],) * len(data.valves)
        self.first = max(check(data, orders, longest) for orders in options.orders())
        self.fits: dict[tuple[ArmaxOrders, tuple[int, ...]], ArmaxFit] = {}

    def value(self, orders: ArmaxOrders, delays: tuple[int, ...]) -> float:
        key = orders, delays
        if key not in self.fits:
            self.fits[key] = fit_armax(self.data, self.output, orders, delays, self.first)
        return _value(self.fits[key], self)

    def scan(self, orders: ArmaxOrders, delays: tuple[int, ...], reach: int) -> tuple[int, ...]:
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

    def lengthened(self, orders: ArmaxOrders, delays: tuple[int, ...]) -> tuple[int, ...]:
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
        InputError: as :func:`stiction_ros.identification.linear.armax.fit_armax`.
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
    rows = tuple(
        OrderRow(
            orders=orders,
            delays=row_delays,
            status=fit.status,
            aic=fit.aic,
            bic=fit.bic,
            free_run_aic=fit.free_run_aic,
            free_run_bic=fit.free_run_bic,
            fit_one_step=fit.fit_one_step,
            fit_free_run=fit.fit_free_run,
            chosen=(orders, row_delays) == (best, delays),
        )
        for (orders, row_delays), fit in sorted(
            search.fits.items(), key=lambda item: (dataclasses.astuple(item[0][0]), item[0][1])
        )
    )
    return OrderChoice(search.fits[best, delays], rows, search.criterion, search.judged)
