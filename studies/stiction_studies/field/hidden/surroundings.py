"""Under which circumstances a loop with something hidden in it is recorded.

Most are as an engineer would like them; each of the others comes in a tenth or two of the loops:
what is hidden has to be told from them.
"""

import dataclasses

import numpy as np

from stiction_studies.field.circumstances import choice

PLANTS = {
    "flow": 1.5,
    "heater": 1.5,
    "two_tanks": 1.5,
    "level": 1.2,
    "column": 1.0,
    "lags": 1.3,
    "wrong_way": 0.8,
    "late": 1.2,
}
EXCITATIONS = {"moves": 0.66, "open_loop": 0.14, "ramps": 0.1, "quiet": 0.1}
NOISES = {"measurement": 0.4, "equation": 0.35, "coloured": 0.25}
KEEPINGS = {
    "as_read": 0.66,
    "pv_rounded": 0.12,
    "op_rounded": 0.09,
    "exception": 0.04,
    "swinging_door": 0.04,
    "spikes": 0.05,
}
SAMPLES = (1200, 2000)


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What is drawn before any number."""

    plant: str  # kind of its equations
    tight: bool  # whether the loop is tuned near its limit
    # ``moves`` or ``ramps`` of the set-point, ``open_loop``: OP moved by hand, ``quiet``: nothing
    # but noise, three times as large
    excitation: str
    # white ``measurement`` noise, ``equation`` noise beside little of it, or ``coloured`` noise
    # beside it
    noise: str
    keeping: str  # what becomes of the values in the record
    scan: float  # samples of a scan of the controller; below 1 the record leaves scans out
    winding: bool  # whether the integral part goes on at the limits of OP
    declared: bool  # whether the model says what noise there is
    tuning_known: bool  # whether the model holds the tuning
    set_point_kept: bool  # whether the record has SP
    half: bool  # whether the effect has half its size
    samples: int  # of the record
    stem_recorded: bool = False  # whether the record has the stem

    @property
    def closed(self) -> bool:
        """Whether a controller is at work."""
        return self.excitation != "open_loop"

    @property
    def names(self) -> tuple[str, ...]:
        """Everything that is not usual, by name."""
        told = [
            ("tight", self.tight),
            (self.excitation, self.excitation != "moves"),
            (f"{self.noise}_noise", self.noise != "measurement"),
            (self.keeping, self.keeping != "as_read"),
            ("slow_scan", self.scan > 1.0),
            ("fast_scan", self.scan < 1.0),
            ("winding_up", self.winding),
            ("noise_not_declared", not self.declared),
            ("no_tuning", not self.tuning_known),
            ("no_set_point", not self.set_point_kept),
            ("stem_recorded", self.stem_recorded),
            ("half", self.half),
        ]
        return tuple(name for name, there in told if there)


def draw_surroundings(random: np.random.Generator) -> Surroundings:
    """Return circumstances that go together; an integrating plant is never left to itself."""
    plant = choice(random, PLANTS)
    excitation = choice(random, EXCITATIONS)
    if plant == "level" and excitation == "open_loop":
        excitation = "moves"
    noise = choice(random, NOISES)
    if excitation == "quiet" and noise == "measurement":
        noise = "equation"
    closed = excitation != "open_loop"
    return Surroundings(
        plant=plant,
        tight=closed and plant != "level" and random.random() < 0.15,
        excitation=excitation,
        noise=noise,
        keeping=choice(random, KEEPINGS),
        scan=choice(random, {1.0: 0.83, 2.0: 0.06, 5.0: 0.06, 0.5: 0.05}) if closed else 1.0,
        winding=closed and random.random() < 0.3,
        declared=random.random() < 0.85,
        tuning_known=closed and random.random() < 0.75,
        set_point_kept=closed and random.random() < 0.85,
        half=random.random() < 0.25,
        samples=int(random.integers(SAMPLES[0], SAMPLES[1] + 1)),
    )
