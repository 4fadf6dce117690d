"""What the user may choose."""

import dataclasses

from stiction_ros.discrepancy.measures import MARGIN
from stiction_ros.errors import InputError


@dataclasses.dataclass(frozen=True)
class GapOptions:
    """Options of :func:`stiction_ros.discrepancy.find_discrepancy`.

    Attributes:
        quick: take intervals of the likelihood instead of bootstraps.
        margin: BIC by which an effect must beat no effect and its best rival. Of records of noise
            alone the best effect stays below 2.1 in 95 of 100, below 4.4 with two valves.
        most_effects: how many effects are added at most.
        process_fitted: the process was fitted to these records, as by ``gap --fit-linear``: its
            figures stay open, and no change of them is named.
        resamples: of each bootstrap.
        seed: of the bootstraps.

    Raises:
        InputError: a negative margin, no effect at all, fewer than ten resamples.

    Examples:
        >>> from stiction_ros import GapOptions
        >>> GapOptions(quick=True).margin
        10.0
    """

    quick: bool = False
    margin: float = MARGIN
    most_effects: int = 3
    process_fitted: bool = False
    resamples: int = 40
    seed: int = 0

    def __post_init__(self) -> None:
        if self.margin < 0.0:
            raise InputError(f"{self.margin:g} is negative", where="margin")
        if self.most_effects < 1:
            raise InputError(f"{self.most_effects} effects", where="most_effects", fix="use 1 up")
        if self.resamples < 10:
            raise InputError(f"{self.resamples} are too few", where="resamples", fix="use 10 up")
