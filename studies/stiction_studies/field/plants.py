"""Plants of the field, each from published equations."""

import dataclasses
import enum

import numpy as np

from stiction_studies.field import kernels
from stiction_studies.field.kernels import FloatArray


class Plant(enum.StrEnum):
    """Which equations."""

    FLOW = "flow"
    PRESSURE = "pressure"
    TANK = "tank"
    LEVEL = "level"
    FOUR_TANKS = "four_tanks"
    REACTOR = "reactor"
    EXCHANGER = "exchanger"
    COLUMN = "column"


KINDS = {
    Plant.FLOW: "flow",
    Plant.PRESSURE: "pressure",
    Plant.TANK: "level",
    Plant.LEVEL: "level",
    Plant.FOUR_TANKS: "level",
    Plant.REACTOR: "temperature",
    Plant.EXCHANGER: "temperature",
    Plant.COLUMN: "analyser",
}
"""Plant to the kind of its loop."""


@dataclasses.dataclass(frozen=True)
class Process:
    """A plant with its numbers.

    Attributes:
        name: which equations.
        code: their number in the kernels.
        parameters: of the kernels, read-only.
        guess: state from which the steady state is sought, read-only.
        stem: where the valve works, %.
        fastest: shortest time constant, s; steps of integration stay below it.
        slowest: in about four times as many seconds the plant has settled.
        dead_time: between valve and plant, s.
        cycle: of an analyser, s; 0 for a transmitter.
        integrating: whether it has no steady state of its own.
    """

    name: Plant
    code: int
    parameters: FloatArray
    guess: FloatArray
    stem: float
    fastest: float
    slowest: float
    dead_time: float = 0.0
    cycle: float = 0.0
    integrating: bool = False

    @property
    def kind(self) -> str:
        """The kind of the loop: flow, pressure, level, temperature or analyser."""
        return KINDS[self.name]


def draw_process(random: np.random.Generator, name: Plant) -> Process:
    """Return one plant of a kind with sizes as they occur."""
    return _DRAWS[name](random)


def _process(name: Plant, code: int, numbers: list[float], **rest: object) -> Process:
    guess = np.zeros(kernels.PLANT_STATES)
    given = np.asarray(rest.pop("guess"), dtype=float)
    guess[: len(given)] = given
    parameters = np.array(numbers, dtype=float)
    guess.flags.writeable = parameters.flags.writeable = False
    return Process(name, code, parameters, guess, **rest)  # type: ignore[arg-type]


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """Return a number drawn evenly over its logarithm."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _trim(random: np.random.Generator) -> float:
    """Return a rangeability: linear, or equal percent of 20 to 50 (IEC 60534-2-4)."""
    return float(random.choice([1.0, 1.0, 20.0, 35.0, 50.0]))


def flow(random: np.random.Generator) -> Process:
    r"""Return a flow through a valve in a pipe.

    .. math:: T \dot q = Q f / \sqrt{s + (1 - s) f^2} - q

    with the inherent characteristic f and the share s of the pressure that falls over the open
    valve; the transmitter lags. A liquid's inertia takes .3 to 3 s, filters .3 to 2 s.

    References:
        C. A. Smith, A. B. Corripio: Principles and Practice of Automatic Process Control, 3rd
        ed., Wiley 2006, chapter 5 (installed characteristic).
    """
    inertia, sensor = log_uniform(random, 0.3, 3.0), log_uniform(random, 0.3, 2.0)
    full = log_uniform(random, 10.0, 500.0)
    numbers = [_trim(random), random.uniform(0.15, 0.6), full, inertia, sensor]
    return _process(
        Plant.FLOW,
        kernels.FLOW,
        numbers,
        guess=[0.5 * full, 0.5 * full],
        stem=random.uniform(25.0, 70.0),
        fastest=min(inertia, sensor),
        slowest=inertia + sensor,
        dead_time=random.uniform(0.1, 1.0) * inertia,
    )


def pressure(random: np.random.Generator) -> Process:
    r"""Return a gas drum between a control valve and a resistance.

    .. math:: \dot P = \left(C_1 f \sqrt{P_1 (P_1 - P)} - C_2 \sqrt{P (P - P_2)}\right) / C

    the isothermal mass balance with flow through both restrictions by the compressible
    formula for small pressure drops; C is the drum's capacity.

    References:
        W. L. Luyben: Process Modeling, Simulation and Control for Chemical Engineers, 2nd ed.,
        McGraw-Hill 1990, chapter 3 (gas-phase vessels).
    """
    upstream, downstream = random.uniform(8.0, 15.0), random.uniform(1.0, 3.0)
    capacity, sensor = log_uniform(random, 4.0, 60.0), log_uniform(random, 0.3, 2.0)
    numbers = [_trim(random), upstream, downstream, 1.0, 0.35, capacity, sensor]
    middle = 0.5 * (upstream + downstream)
    if numbers[0] > 1.0:
        numbers[3] = 3.0
    return _process(
        Plant.PRESSURE,
        kernels.PRESSURE,
        numbers,
        guess=[middle, middle],
        stem=random.uniform(30.0, 65.0),
        fastest=min(sensor, 0.5 * capacity),
        slowest=3.0 * capacity,
        dead_time=random.uniform(0.02, 0.15) * capacity,
    )


def _vessel(random: np.random.Generator, name: Plant) -> Process:
    area = log_uniform(random, 0.5, 8.0)  # share of the tank, %, per unit of flow and second
    throughput = log_uniform(random, 0.1, 1.0)
    trim = float(random.choice([1.0, 1.0, 30.0]))
    residence = 50.0 * area / throughput
    stem, sensor = random.uniform(35.0, 65.0), log_uniform(random, 0.003, 0.03) * residence
    share = stem / 100.0 if trim == 1.0 else trim ** (stem / 100.0 - 1.0)
    gravity = 0.0 if name is Plant.LEVEL else 1.0
    numbers = [trim, throughput / share, throughput, area, gravity, 1.0, sensor]
    return _process(
        name,
        kernels.TANK,
        numbers,
        guess=[50.0, 50.0],
        stem=stem,
        fastest=sensor,
        slowest=3.0 * residence,
        dead_time=random.uniform(0.0, 2.0) * sensor,
        integrating=name is Plant.LEVEL,
    )


def tank(random: np.random.Generator) -> Process:
    r"""Return a tank that empties through the valve by its own head.

    .. math:: A \dot h = q_{in} - C f \sqrt{h}

    References:
        D. E. Seborg, T. F. Edgar, D. A. Mellichamp, F. J. Doyle: Process Dynamics and Control,
        3rd ed., Wiley 2011, section 2.4.5 (liquid storage systems).
    """
    return _vessel(random, Plant.TANK)


def level(random: np.random.Generator) -> Process:
    r"""Return a tank whose outflow depends on the valve alone, behind a pump: it integrates.

    .. math:: A \dot h = q_{in} - C f

    References:
        As :func:`tank`.
    """
    return _vessel(random, Plant.LEVEL)


def four_tanks(random: np.random.Generator) -> Process:
    r"""Return the lower first tank of the quadruple-tank process.

    .. math::
        A_1 \dot h_1 &= -a_1 \sqrt{2 g h_1} + a_3 \sqrt{2 g h_3} + \gamma_1 q_1 \\
        A_2 \dot h_2 &= -a_2 \sqrt{2 g h_2} + a_4 \sqrt{2 g h_4} + \gamma_2 q_2 \\
        A_3 \dot h_3 &= -a_3 \sqrt{2 g h_3} + (1 - \gamma_2) q_2 \\
        A_4 \dot h_4 &= -a_4 \sqrt{2 g h_4} + (1 - \gamma_1) q_1

    with the published areas, a valve in place of the first pump's voltage, and the other pump
    as the load. Areas of larger tanks are stretched.

    References:
        K. H. Johansson: The quadruple-tank process. IEEE Trans. Control Syst. Technol. 8,
        2000, 456-465.
    """
    stretch = log_uniform(random, 0.3, 4.0)
    stem = random.uniform(35.0, 65.0)
    nominal = 10.0 / (stem / 100.0)
    numbers = [1.0, nominal, 10.05, 0.70, 0.60, stretch, 28.0, 32.0, 0.071, 0.057]
    return _process(
        Plant.FOUR_TANKS,
        kernels.FOUR_TANKS,
        numbers,
        guess=[12.4, 12.7, 1.8, 1.4],
        stem=stem,
        fastest=20.0 * stretch,
        slowest=80.0 * stretch,
        dead_time=random.uniform(1.0, 5.0) * stretch,
    )


def reactor(random: np.random.Generator) -> Process:
    r"""Return the temperature of an exothermic stirred tank, cooled through a jacket.

    .. math::
        \dot c &= \tfrac{q}{V} (c_i - c) - k_0 e^{-E/RT} c \\
        \dot T &= \tfrac{q}{V} (T_i - T) + \tfrac{-\Delta H}{\rho C} k_0 e^{-E/RT} c
            + \tfrac{UA}{V \rho C} (T_c - T) \\
        \dot T_c &= \tfrac{F f}{V_c} (T_{ci} - T_c) + \tfrac{UA}{V_c \rho_c C_c} (T - T_c)

    with the published numbers; the feed is diluted to .4 to .6 mol/l, so that it is stable
    without control, and the jacket, a constant temperature there, has its own balance.

    References:
        D. E. Seborg and others, as :func:`tank`, example 2.5 (tank and kinetics).
        B. W. Bequette: Process Dynamics, Prentice Hall 1998, module 9 (jacket).
    """
    pace = log_uniform(random, 0.5, 3.0) / 60.0  # published in minutes
    numbers = [
        1.0,
        pace,
        random.uniform(0.4, 0.6),
        350.0,
        7.2e10 * pace,
        8750.0,
        5e4 / 239.0,
        5e4 / (100.0 * 239.0) * pace,
        random.uniform(285.0, 295.0),
        random.uniform(1.0, 2.0) * 2.0 * pace,
        0.6 * pace,
        random.uniform(0.05, 0.2) / pace,
    ]
    return _process(
        Plant.REACTOR,
        kernels.REACTOR,
        numbers,
        guess=[0.3, 340.0, 310.0, 340.0],
        stem=random.uniform(30.0, 65.0),
        fastest=0.1 / pace,
        slowest=1.5 / pace,
        dead_time=random.uniform(0.0, 0.1) / pace,
    )


def exchanger(random: np.random.Generator) -> Process:
    r"""Return the outlet temperature of a counter-current heat exchanger in four cells a side.

    .. math::
        \dot T_{h,i} &= \tfrac{q_h f}{V_h} (T_{h,i-1} - T_{h,i})
            + \tfrac{UA}{V_h \rho C} (T_{c,i} - T_{h,i}) \\
        \dot T_{c,i} &= \tfrac{q_c}{V_c} (T_{c,i+1} - T_{c,i})
            + \tfrac{UA}{V_c \rho C} (T_{h,i} - T_{c,i})

    with the valve in the heating stream.

    References:
        K. M. Hangos, J. Bokor, G. Szederkényi: Analysis and Control of Nonlinear Process
        Systems, Springer 2004, chapter 4 (heat exchanger cells).
    """
    residence = log_uniform(random, 5.0, 40.0)  # s of the cold side
    per_cell = kernels.CELLS / residence
    numbers = [
        float(random.choice([1.0, 30.0])),
        2.5 * per_cell,
        per_cell,
        random.uniform(0.3, 0.7) * per_cell,
        random.uniform(0.3, 0.7) * per_cell,
        random.uniform(80.0, 140.0),
        random.uniform(15.0, 30.0),
        random.uniform(0.1, 0.4) * residence,
    ]
    return _process(
        Plant.EXCHANGER,
        kernels.EXCHANGER,
        numbers,
        guess=[90.0, 80.0, 70.0, 60.0, 70.0, 60.0, 50.0, 40.0, 70.0],
        stem=random.uniform(30.0, 60.0),
        fastest=0.25 / per_cell,
        slowest=2.5 * residence,
        dead_time=random.uniform(0.05, 0.3) * residence,
    )


def column(random: np.random.Generator) -> Process:
    r"""Return one end of a pilot column that parts methanol and water, by its transfer functions.

    .. math::
        x_D &= \frac{12.8 e^{-s}}{16.7 s + 1} R + \frac{-18.9}{21 s + 1} S \\
        x_B &= \frac{-19.4 e^{-3 s}}{14.4 s + 1} S + \frac{6.6}{10.9 s + 1} R

    in minutes; the valve moves reflux R or steam S by .04 lb/min a percent, the other one is
    the load, and an analyser may show a value every one or two minutes only.

    References:
        R. K. Wood, M. W. Berry: Terminal composition control of a binary distillation column.
        Chem. Eng. Sci. 28, 1973, 1707-1717.
    """
    top = random.random() < 0.5
    pace = 60.0
    stem = random.uniform(35.0, 65.0)
    scale = 0.04
    numbers = (
        [1.0, 12.8 * scale, 16.7 * pace, -18.9, 21.0 * pace, stem]
        if top
        else [1.0, -19.4 * scale, 14.4 * pace, 6.6, 10.9 * pace, stem]
    )
    return _process(
        Plant.COLUMN,
        kernels.COLUMN,
        numbers,
        guess=[0.0, 0.0],
        stem=stem,
        fastest=5.0 * pace,
        slowest=20.0 * pace,
        dead_time=(1.0 if top else 3.0) * pace,
        cycle=float(random.choice([0.0, 1.0, 2.0])) * pace,
    )


_DRAWS = {
    Plant.FLOW: flow,
    Plant.PRESSURE: pressure,
    Plant.TANK: tank,
    Plant.LEVEL: level,
    Plant.FOUR_TANKS: four_tanks,
    Plant.REACTOR: reactor,
    Plant.EXCHANGER: exchanger,
    Plant.COLUMN: column,
}
