"""The worlds of the calibration: loops by their seeds, and whether their valve has friction."""

import dataclasses
import functools
from collections.abc import Callable, Mapping

from stiction_ros.records.record import Record
from stiction_studies.calibration.plain_loops import WORLDS as PLAIN_WORLDS
from stiction_studies.calibration.plain_loops import plain_loop


@dataclasses.dataclass(frozen=True)
class KnownLoop:
    """One record and its truth."""

    record: Record  # as the package reads it
    # whether the last valve has friction that matters and shows; None where it has some that shows
    # in too few slips
    friction: bool | None


def _plain(seed: int, world: str) -> KnownLoop:
    loop = plain_loop(seed, world=world)
    return KnownLoop(loop.record, loop.friction)


def _field(seed: int) -> KnownLoop:
    from stiction_studies.field import MANY, ValveKind, field_loop

    loop = field_loop(seed)
    if loop.truth.valve is ValveKind.HEALTHY:
        return KnownLoop(loop.record, False)
    return KnownLoop(loop.record, True if loop.judged_slips >= MANY else None)


WORLDS: Mapping[str, Callable[[int], KnownLoop]] = {
    "field": _field,
    **{world: functools.partial(_plain, world=world) for world in PLAIN_WORLDS},
}
