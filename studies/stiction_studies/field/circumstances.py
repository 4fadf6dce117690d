"""Under which circumstances a loop of the field is recorded; what occurs, and how often.

Half of the loops have friction that matters. Bands are 1 to 10 % of travel, as valves of plants
are reported with, and are drawn evenly over their logarithm; a valve that does not matter has
less than a twentieth of what OP moves. Coulomb friction is 50 to 88 % of the static one (1.2
times as much static friction is published for several valves), f_D any share of f_S. OP works
between 25 and 70 %. Noise is .02 to .25 of what the band makes of PV, less where the controller
would pass it on to the valve, and .03 to .5 % of the valve where there is no friction. A cause
from outside swings as much as 2 to 10 % of the valve would. Lengths are 500 to 4000 samples,
mostly 700 to 2000, as historians are asked for a shift or a day.
"""

import dataclasses
import enum
from typing import TypeVar

import numpy as np

from stiction_studies.field.loads import Wave
from stiction_studies.field.plants import Plant
from stiction_studies.field.valves import Law

T = TypeVar("T")


class Friction(enum.StrEnum):
    """How much friction a valve shall have."""

    MUCH = "much"
    FEW_SLIPS = "few_slips"
    NONE = "none"


class Outside(enum.StrEnum):
    """What acts on a loop besides noise and drift."""

    NOTHING = "nothing"
    SQUARE = Wave.SQUARE.value
    TRIANGLE = Wave.TRIANGLE.value
    SINE = Wave.SINE.value
    NEIGHBOUR = "neighbour"
    RINGING = "ringing"
    SET_POINT = "set_point_cycle"


class Sampling(enum.StrEnum):
    """How fast the record is sampled."""

    USUAL = "usual"
    FAST = "fast"
    SLOW = "slow"


class Keeping(enum.StrEnum):
    """What the historian does to the signals."""

    AS_READ = "as_read"
    OP_ROUNDED = "op_rounded"
    PV_ROUNDED = "pv_rounded"
    BOTH_ROUNDED = "both_rounded"
    EXCEPTION = "exception"
    SWINGING_DOOR = "swinging_door"
    AVERAGED = "averaged"


class Hole(enum.StrEnum):
    """What is missing in the record."""

    NOTHING = "nothing"
    ROWS = "missing_rows"
    BAD = "bad_values"
    GAP = "gap"


class Unit(enum.StrEnum):
    """What OP is counted in."""

    PERCENT = "percent"
    CENTRED = "op_centred"
    SHARE = "op_0_to_1"
    CURRENT = "op_4_to_20"
    OTHER = "op_span_5"


UNITS = {
    Unit.PERCENT: (1.0, 0.0),
    Unit.CENTRED: (1.0, 0.0),
    Unit.SHARE: (0.01, 0.0),
    Unit.CURRENT: (0.16, 4.0),
    Unit.OTHER: (0.05, 0.0),
}
"""Unit of OP to its factor and offset on %; the centred one also loses its mean."""

SECOND_CAUSE = 0.2  # share of sticky valves beside which something else acts
QUIET = 0.25  # share of healthy loops in which nothing but noise and drift acts


@dataclasses.dataclass(frozen=True)
class Circumstances:
    """What is drawn before any number.

    Attributes:
        plant: which equations.
        friction: how much of it.
        law: of the valve.
        outside: what acts besides.
        sampling: of the record.
        scan_ratio: sample time over the controller's scan: above 1 the record is slower.
        keeping: of the historian.
        hole: in the record.
        unit: of OP.
        set_point_moves: whether SP moves now and then.
        set_point_kept: whether the record has SP.
        manual: whether a stretch of the record is in manual.
        manual_marked: whether the record says so.
        noise_colour: time constant of the noise in scans; 0 is white.
        samples: of the record.
    """

    plant: Plant
    friction: Friction
    law: Law
    outside: Outside
    sampling: Sampling
    scan_ratio: float
    keeping: Keeping
    hole: Hole
    unit: Unit
    set_point_moves: bool
    set_point_kept: bool
    manual: bool
    manual_marked: bool
    noise_colour: float
    samples: int

    @property
    def names(self) -> tuple[str, ...]:
        """Everything that is not usual, by name."""
        told = [
            (self.outside.value, self.outside is not Outside.NOTHING),
            (self.sampling.value, self.sampling is not Sampling.USUAL),
            ("slow_scan", self.scan_ratio < 1.0),
            ("fast_scan", self.scan_ratio > 1.0),
            (self.keeping.value, self.keeping is not Keeping.AS_READ),
            (self.hole.value, self.hole is not Hole.NOTHING),
            (self.unit.value, self.unit is not Unit.PERCENT),
            ("set_point_moves", self.set_point_moves),
            ("no_set_point", not self.set_point_kept),
            ("manual", self.manual),
            ("coloured_noise", self.noise_colour > 0.0),
        ]
        return tuple(name for name, there in told if there)


def choice(random: np.random.Generator, shares: dict[T, float]) -> T:
    """Return one of the keys by its share."""
    total = sum(shares.values())
    at = random.choice(len(shares), p=[share / total for share in shares.values()])
    return list(shares)[int(at)]


def draw_circumstances(random: np.random.Generator) -> Circumstances:
    """Return circumstances that go together."""
    friction = choice(random, {Friction.MUCH: 48, Friction.FEW_SLIPS: 6, Friction.NONE: 46})
    law = choice(random, {Law.HE: 30, Law.KARNOPP: 28, Law.LUGRE: 22, Law.BACKLASH: 20})
    plant = choice(
        random,
        {
            Plant.FLOW: 26,
            Plant.PRESSURE: 14,
            Plant.TANK: 8,
            Plant.LEVEL: 16,
            Plant.FOUR_TANKS: 8,
            Plant.REACTOR: 9,
            Plant.EXCHANGER: 11,
            Plant.COLUMN: 8,
        },
    )
    sampling = choice(random, {Sampling.USUAL: 68, Sampling.FAST: 18, Sampling.SLOW: 14})
    if friction is Friction.FEW_SLIPS and random.random() < 0.7:
        sampling = Sampling.FAST
    keeping = choice(
        random,
        {
            Keeping.AS_READ: 40,
            Keeping.OP_ROUNDED: 9,
            Keeping.PV_ROUNDED: 9,
            Keeping.BOTH_ROUNDED: 9,
            Keeping.EXCEPTION: 12,
            Keeping.SWINGING_DOOR: 10,
            Keeping.AVERAGED: 11,
        },
    )
    outside = _outside(random, friction, law, plant)
    return Circumstances(
        plant=plant,
        friction=friction,
        law=law,
        outside=outside,
        sampling=sampling,
        scan_ratio=_scan_ratio(random, sampling, keeping),
        keeping=keeping,
        hole=choice(random, {Hole.NOTHING: 82, Hole.ROWS: 7, Hole.BAD: 5, Hole.GAP: 6}),
        unit=choice(
            random,
            {Unit.PERCENT: 80, Unit.CENTRED: 6, Unit.SHARE: 5, Unit.CURRENT: 4, Unit.OTHER: 5},
        ),
        set_point_moves=outside is not Outside.SET_POINT and random.random() < 0.25,
        set_point_kept=random.random() < 0.75,
        manual=random.random() < 0.08,
        manual_marked=random.random() < 0.6,
        noise_colour=float(random.choice([0.0, 0.0, 2.0, 6.0])),
        samples=_samples(random, friction),
    )


def _outside(random: np.random.Generator, friction: Friction, law: Law, plant: Plant) -> Outside:
    waves = {Outside.SQUARE: 12, Outside.TRIANGLE: 12, Outside.SINE: 12, Outside.NEIGHBOUR: 14}
    if friction is Friction.NONE:
        if random.random() < QUIET:
            return Outside.NOTHING
        return choice(random, {**waves, Outside.RINGING: 16, Outside.SET_POINT: 9})
    if friction is Friction.FEW_SLIPS:
        return Outside.NOTHING
    # A deadband moves by itself in loops that integrate twice; elsewhere something moves it.
    moved = law is Law.BACKLASH and plant is not Plant.LEVEL
    if moved or random.random() < SECOND_CAUSE:
        return choice(random, {**waves, Outside.SET_POINT: 15})
    return Outside.NOTHING


def _scan_ratio(random: np.random.Generator, sampling: Sampling, keeping: Keeping) -> float:
    if keeping is Keeping.AVERAGED:
        return float(random.choice([4.0, 6.0, 10.0]))
    if sampling is Sampling.SLOW:
        return float(random.choice([4.0, 6.0, 10.0]))
    if sampling is Sampling.FAST:
        return float(random.choice([1.0, 1.0, 1.0, 0.5, 0.2]))
    return float(random.choice([1.0, 1.0, 1.0, 2.0, 5.0]))


def _samples(random: np.random.Generator, friction: Friction) -> int:
    draw = random.random()
    if draw < 0.1 or friction is Friction.FEW_SLIPS:
        return int(random.integers(500, 700))
    if draw < 0.9:
        return int(random.integers(700, 2000))
    return int(random.integers(2000, 4001))
