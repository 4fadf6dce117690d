"""What a caller may choose, and the constants behind the verdict."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from stiction_ros.checks import one_of
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError

LOOP_KINDS = ("flow", "pressure", "level", "temperature", "analyser")
METHODS = ("exact", "evidence")
AUTO = "auto"
Progress = Callable[[float], None]  # called with the share done, 0 to 1


def limited(span: FloatArray, limit: float | tuple[float, ...] | None) -> FloatArray:
    """Return the largest friction of every valve, shape (m,), %: its OP span, or less.

    Args:
        span: of OP, shape (m,), %.
        limit: one for all valves, or one for each; None for the span.

    Raises:
        InputError: a number of limits that is not that of the valves.
    """
    if limit is None:
        return span
    given = np.atleast_1d(np.asarray(limit, dtype=float))
    if len(given) not in (1, len(span)):
        raise InputError(
            f"{len(given)} limits for {len(span)} valves",
            where="friction_limit",
            fix="give one for all, or one for each",
        )
    return np.asarray(np.minimum(span, given), dtype=float)


@dataclasses.dataclass(frozen=True)
class IdentificationOptions:
    """Options of :func:`stiction_ros.identification.identify`.

    Attributes:
        method: ``evidence`` or ``exact``, see :mod:`.methods`; the paper's own methods have
            their own options, :class:`stiction_ros.paper.paper_options.PaperOptions`.
        output_order: n_a; None lets BIC choose among 1, 2 and 3 under the noise model.
        input_order: n_b; None means equal to n_a.
        delay: inclusive range of t_d, samples, for every channel.
        law: friction law of all valves, or :data:`AUTO`: of each valve the one that explains PV
            best, where the record tells it from He's.
        kind: what the loop controls, one of :data:`LOOP_KINDS`, or None; the process that is
            found is held against it, which is told as a note and changes no verdict.
        friction_limit: largest f_S searched, %, one for all valves or one for each; None is the
            OP span of each valve.
        noise_order: order p of the autoregressive noise on the free-run error.
        confidence: level of the intervals.
        check_columns: refuse a record in which OP and PV are clearly swapped.

    Raises:
        InputError: a value out of range.

    Examples:
        >>> from stiction_ros import IdentificationOptions
        >>> options = IdentificationOptions(output_order=1, delay=(0, 4))
        >>> options.law, options.confidence
        ('auto', 0.95)
    """

    method: str = "evidence"
    output_order: int | None = None
    input_order: int | None = None
    delay: tuple[int, int] = (0, 10)
    law: str = AUTO
    kind: str | None = None
    friction_limit: float | tuple[float, ...] | None = None
    noise_order: int = 6
    confidence: float = 0.95
    check_columns: bool = True

    @property
    def first_law(self) -> str:
        """The first law searched, the only one of exact, the live estimator and the paper."""
        return "he" if self.law == AUTO else self.law

    def __post_init__(self) -> None:
        one_of(self.method, METHODS, "method")
        if self.kind is not None:
            one_of(self.kind, LOOP_KINDS, "kind", "kind")
        low, high = self.delay
        if not 0 <= low <= high:
            raise InputError(
                f"{low}:{high} is no delay range", where="delay", fix="use LO:HI, 0 <= LO <= HI"
            )
        for key in ("output_order", "input_order"):
            order = getattr(self, key)
            if order is not None and not 1 <= order <= 10:
                raise InputError(f"order {order} lies outside 1 to 10", where=key)
        limit = self.friction_limit
        if limit is not None and not all(
            math.isfinite(one) and one > 0.0
            for one in (limit if isinstance(limit, tuple) else (limit,))
        ):
            raise InputError(f"{limit} is not positive", where="friction_limit")
        if not 0.5 < self.confidence < 1:
            raise InputError(f"{self.confidence} is no level", where="confidence", fix="use 0.95")
        if not 0 <= self.noise_order <= 20:
            raise InputError(f"order {self.noise_order} lies outside 0 to 20", where="noise_order")
