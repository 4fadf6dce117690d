"""What a caller may choose, and the constants behind the verdict."""

from __future__ import annotations

import dataclasses
import math

from stiction_ros.errors import InputError

METHOD_NAMES = ("exact", "evidence", "nlp", "grid")
GRID_LAWS = ("he_smoothed", "he")


@dataclasses.dataclass(frozen=True)
class IdentificationOptions:
    """Options of :func:`stiction_ros.identification.identify`.

    Attributes:
        method: ``exact``, ``evidence``, or one of the paper's ``nlp`` and ``grid``; see
            :mod:`.methods`.
        output_order: n_a; None lets BIC choose among 1, 2 and 3 under the noise model (method
            ``exact`` or ``evidence``; the others take 3).
        input_order: n_b; None means equal to n_a.
        delay: inclusive range of t_d, samples, for every channel.
        law: friction law.
        friction_limit: largest f_S searched, %; None is the OP span of each valve.
        noise_order: order p of the autoregressive noise on the free-run error.
        confidence: level of the intervals.
        bic_margin: BIC by which friction must beat the friction-free rival to be believed.
        min_moves: fewest stem moves from which anything may be concluded.
        negligible_friction: f_S up to this is healthy, %.
        negligible_share: f_S up to this share of the OP span is healthy.
        starts: M, first guesses of the nonlinear programme (method ``nlp``).
        grid_step: step of f_S and of f_D, % (method ``grid``).
        grid_law: stem of the grid, ``he_smoothed`` as published or ``he``.

        one_step_best: also find the friction and delays of least one-step SE (exact, He's law).
        check_columns: refuse a record in which OP and PV are clearly swapped.

    Raises:
        InputError: a value out of range.

    Examples:
        >>> from stiction_ros import IdentificationOptions
        >>> options = IdentificationOptions(output_order=1, delay=(0, 4))
        >>> options.law, options.confidence
        ('he', 0.95)
    """

    method: str = "exact"
    output_order: int | None = None
    input_order: int | None = None
    delay: tuple[int, int] = (0, 10)
    law: str = "he"
    friction_limit: float | None = None
    noise_order: int = 6
    confidence: float = 0.95
    bic_margin: float = 20.0
    min_moves: int = 6
    negligible_friction: float = 0.3
    negligible_share: float = 0.03
    starts: int = 7
    grid_step: float = 0.5
    grid_law: str = "he_smoothed"
    one_step_best: bool = True
    check_columns: bool = True

    def __post_init__(self) -> None:
        for key, known in (("method", METHOD_NAMES), ("grid_law", GRID_LAWS)):
            if getattr(self, key) not in known:
                raise InputError(
                    f"unknown value {getattr(self, key)!r}",
                    where=key,
                    fix=f"use {' | '.join(known)}",
                )
        if not 1 <= self.starts <= 1000:
            raise InputError(f"{self.starts} lies outside 1 to 1000", where="starts")
        if not (math.isfinite(self.grid_step) and self.grid_step > 0.0):
            raise InputError(f"{self.grid_step} is not positive", where="grid_step")
        low, high = self.delay
        if not 0 <= low <= high:
            raise InputError(
                f"{low}:{high} is no delay range", where="delay", fix="use LO:HI, 0 <= LO <= HI"
            )
        for key in ("output_order", "input_order"):
            order = getattr(self, key)
            if order is not None and not 1 <= order <= 10:
                raise InputError(f"order {order} lies outside 1 to 10", where=key)
        if self.friction_limit is not None and not self.friction_limit > 0:
            raise InputError(f"{self.friction_limit} is not positive", where="friction_limit")
        if not 0.5 < self.confidence < 1:
            raise InputError(f"{self.confidence} is no level", where="confidence", fix="use 0.95")
        if not 0 <= self.noise_order <= 20:
            raise InputError(f"order {self.noise_order} lies outside 0 to 20", where="noise_order")
