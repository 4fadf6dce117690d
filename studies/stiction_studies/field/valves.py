"""Valves of the field, and what a slow triangle shows of them."""

import dataclasses
import enum

import numpy as np

from stiction_ros.errors import InputError
from stiction_studies.field import kernels
from stiction_studies.field.kernels import FloatArray

RAMP_STEPS = 1500  # of each leg of the triangle
LEGS = 5  # the first only takes up what the stem stood at
REACH = 4.0  # height of the triangle over the band at most expected
SETTLES = 12.0  # natural times that one step of the triangle lasts
STARTS = 3.0  # steps of the triangle by which a stem moves at least where it slips


class Law(enum.Enum):
    """How a valve's stem follows its command; the value is the number in the kernels."""

    HE = kernels.HE
    BACKLASH = kernels.BACKLASH
    KARNOPP = kernels.KARNOPP
    LUGRE = kernels.LUGRE

    @property
    def word(self) -> str:
        """The name in tables."""
        return self.name.lower()


@dataclasses.dataclass(frozen=True)
class Stem:
    """Mechanics of a stem with its actuator.

    Attributes:
        natural: natural time of mass and spring, s.
        damping: viscous friction over the critical one.
        lag: of the actuator's pressure, s.
        positioner: proportional gain of a positioner; 0 is none.
        stiffness: of the bristles over the spring's (LuGre).
        stribeck: speed at which static friction has fallen to Coulomb's, %/s (LuGre).
    """

    natural: float = 0.1
    damping: float = 1.15
    lag: float = 0.2
    positioner: float = 0.0
    stiffness: float = 100.0
    stribeck: float = 1.0


@dataclasses.dataclass(frozen=True)
class Valve:
    r"""One valve.

    He's law follows its two published parameters: the stem stays while the command is at most
    f_S away and otherwise goes to f_D short of it. Backlash is a stem that is taken along at
    half the band. The mechanical laws are those of Karnopp and of LuGre over :class:`Stem`.

    Attributes:
        law: see :class:`Law`.
        static: f_S, or half the band of a backlash: the command at which the stem breaks
            loose, % of travel.
        sliding: f_D of He's law, else Coulomb friction, same unit; at most ``static``.
        stem: mechanics, of no account to He's law and backlash.

    References:
        Q. P. He, J. Wang, M. Pottmann, S. J. Qin: A curve fitting method for detecting valve
        stiction in oscillating control loops. Ind. Eng. Chem. Res. 46, 2007, 4549-4560.
        D. Karnopp: Computer simulation of stick-slip friction in mechanical dynamic systems.
        J. Dyn. Syst. Meas. Control 107, 1985, 100-103.
        C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky: A new model for control of
        systems with friction. IEEE Trans. Autom. Control 40, 1995, 419-425.
        M. A. A. S. Choudhury, N. F. Thornhill, S. L. Shah: Modelling valve stiction. Control
        Eng. Practice 13, 2005, 641-658 (mass, spring and viscous friction of a stem).
        C. Garcia: Comparison of friction models applied to a control valve. Control Eng.
        Practice 16, 2008, 1231-1243.

    Raises:
        InputError: a friction that is negative or not finite, or more sliding than static.
    """

    law: Law
    static: float
    sliding: float
    stem: Stem = Stem()

    def __post_init__(self) -> None:
        if not 0.0 <= self.sliding <= self.static < np.inf:
            raise InputError(
                f"static {self.static:g} and sliding {self.sliding:g} are no frictions",
                where=f"valve {self.law.word}",
                fix="use 0 <= sliding <= static",
            )

    def parameters(self) -> FloatArray:
        """Return the kernel's array; forces in % of travel by the spring."""
        stem, force = self.stem, 1.0 + self.stem.positioner
        if self.law in (Law.HE, Law.BACKLASH):
            return np.array([self.static, self.sliding])
        least = 1e-9  # a valve without friction slides on this much
        return np.array(
            [
                max(self.static * force, least),
                max(self.sliding * force, least),
                stem.natural,
                stem.damping,
                stem.lag,
                stem.positioner,
                stem.stiffness,
                stem.stribeck,
            ]
        )

    def rest(self, position: float) -> FloatArray:
        """Return the state of a stem at rest."""
        state = np.zeros(kernels.STEM_STATES)
        state[0] = state[3] = position
        return state

    def without_friction(self) -> "Valve":
        """Return the same valve with nothing that holds it."""
        return dataclasses.replace(self, static=0.0, sliding=0.0)

    def follow(self, commands: FloatArray, seconds: float) -> FloatArray:
        """Return the stem after each command, held for ``seconds`` each, from rest at the first."""
        state = self.rest(float(commands[0]))
        return kernels.stem_path(self.law.value, self.parameters(), state, commands, seconds)


@dataclasses.dataclass(frozen=True)
class Ramped:
    """What a slow triangle shows.

    Attributes:
        band: command going up less command going down at the same stem, mean, %.
        jump: median size of a slip, %; 0 where the stem moves on evenly.
    """

    band: float
    jump: float


def slow_triangle(valve: Valve) -> Ramped:
    """Move the command up and down so slowly that neither stem nor actuator lags behind.

    The valve is moved as it is: behind a positioner a slip ends where the actuator's pressure has
    fallen, so its lag decides how far it goes. The command makes :data:`RAMP_STEPS` steps a leg.
    The band is read over the middle half of the legs, where the stem has long been taken along.
    """
    if valve.static == 0.0:
        return Ramped(0.0, 0.0)
    height = REACH * 2.0 * valve.static
    leg = np.linspace(-0.5, 0.5, RAMP_STEPS + 1)[1:] * height
    commands = 50.0 + np.concatenate([leg * (-1.0) ** k for k in range(LEGS)])
    path = valve.follow(commands, SETTLES * valve.stem.natural)
    inside = slice(RAMP_STEPS // 4, 3 * RAMP_STEPS // 4)
    behind = (commands - path).reshape(LEGS, RAMP_STEPS)[1:, inside].mean(axis=1)
    signs = np.array([-1.0, 1.0] * (LEGS // 2))
    band = 2.0 * float(np.mean(behind * signs))
    slips = []
    for k in range(1, LEGS):
        part = path[k * RAMP_STEPS : (k + 1) * RAMP_STEPS][inside]
        slips += _slips(part, STARTS * height / RAMP_STEPS)
    jump = float(np.median(slips)) if slips else 0.0
    return Ramped(band, jump)


def _slips(stem: FloatArray, least: float) -> list[float]:
    """Return the sizes of the runs in which every step is at least ``least``, %."""
    moves = np.diff(stem)
    fast = np.abs(moves) >= least
    edges = np.flatnonzero(np.diff(np.concatenate([[False], fast, [False]])))
    return [
        float(abs(moves[first:last].sum()))
        for first, last in zip(edges[::2], edges[1::2], strict=True)
    ]
