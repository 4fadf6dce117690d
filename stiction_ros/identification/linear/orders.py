"""Orders and delays of an ARX equation by AIC or BIC of its free run, with every rival shown."""

import dataclasses

from stiction_ros.errors import InputError
from stiction_ros.identification.linear.arx import EquationFit, EquationOrders, check, fit_equation
from stiction_ros.identification.linear.data import LinearData, OrderCriterion

DELAY_MARGIN = 2.0
"""Of delays whose criteria differ by less, the longest is kept."""


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
        InputError: as :func:`stiction_ros.identification.linear.arx.fit_equation`.
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
