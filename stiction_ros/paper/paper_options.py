"""What a caller of the paper's methods may choose."""

import dataclasses
import math

from stiction_ros.checks import one_of
from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions

METHOD_NAMES = ("nlp", "nlp_printed", "grid")
OutputOrders = int | tuple[int, ...]
InputOrders = int | tuple[int | tuple[int, ...], ...]


@dataclasses.dataclass(frozen=True)
class PaperOptions:
    """Options of :func:`stiction_ros.paper.methods.identify`.

    Raises:
        InputError: a value out of range.
    """

    # ``nlp``, the nonlinear programme (12) at its best; ``nlp_printed``, the same to the letter of
    # the paper; or ``grid``
    method: str = "nlp"
    output_order: OutputOrders | None = None  # n_a, or one for each output (8a); None takes 3
    input_order: InputOrders | None = None  # n_b, or by output, or by valve (8b), (8c); None is n_a
    delay: tuple[int, int] = (0, 10)  # inclusive range of t_d, samples, for every channel
    # friction law, one with a smoothed form: ``he``, ``kano``, ``xch`` or ``semi_physical`` with K
    # = 1.99
    law: str = "he"
    # f_max, %, one for all valves or one for each; None is Δu, the span of OP's sustained
    # oscillation, found in the record
    friction_limit: float | tuple[float, ...] | None = None
    starts: int = 7  # M, first guesses of the nonlinear programme for every choice of delays
    grid_step: float = 0.5  # step of f_S and of f_D, %

    def __post_init__(self) -> None:
        one_of(self.method, METHOD_NAMES, "method")
        if not 1 <= self.starts <= 1000:
            raise InputError(f"{self.starts} lies outside 1 to 1000", where="starts")
        if not (math.isfinite(self.grid_step) and self.grid_step > 0.0):
            raise InputError(f"{self.grid_step} is not positive", where="grid_step")
        # What both kinds of method share is checked in one place.
        for output in _flat(self.output_order):
            for past in _flat(self.input_order):
                IdentificationOptions(
                    output_order=output,
                    input_order=past,
                    delay=self.delay,
                    friction_limit=self.friction_limit,
                )

    @classmethod
    def of(cls, options: IdentificationOptions, method: str, **chosen: object) -> "PaperOptions":
        """Return options of a method of the paper with the orders and delays of ``options``."""
        keys = ("output_order", "input_order", "delay", "friction_limit")
        shared = {key: getattr(options, key) for key in keys}
        return cls(method=method, **(shared | {"law": options.first_law} | chosen))


def _flat(orders: OutputOrders | InputOrders | None) -> tuple[int | None, ...]:
    if orders is None or isinstance(orders, int):
        return (orders,)
    return tuple(one for entry in orders for one in _flat(entry))
