"""Linear plants from published equations, in continuous time."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.plants import log_uniform

FINE = 8
"""Steps of integration in a sample; dead times are whole numbers of them."""


@dataclasses.dataclass(frozen=True)
class Plant:
    r"""A linear plant between stem and output, in deviations from rest.

    .. math:: G(s) = K \frac{1 + z s}{s^{i} \prod (1 + \tau_j s)} e^{-\theta s}, \quad i = 0, 1
    """

    kind: str  # which of :data:`KINDS`
    gain: float  # K, engineering units per %; per % and second of an integrator
    lags: tuple[float, ...]  # τ, s
    lead: float = 0.0  # z, s; 0 is none, below 0 an answer that begins the wrong way
    dead_time: float = 0.0  # θ, s
    integrating: bool = False  # whether i is 1
    decay: float = 0.0  # share that an integrator loses per second

    @property
    def slow(self) -> float:
        """Sum of the lags, s."""
        return sum(self.lags)

    def poles(self) -> list[float]:
        """Return the poles, 1/s."""
        poles = [-1.0 / lag for lag in self.lags]
        return [*poles, -self.decay] if self.integrating else poles

    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A, B, C of the plant without dead time, one state for each pole in a row."""
        poles = self.poles()
        n = len(poles)
        a = np.diag(poles)
        for i in range(1, n):
            a[i, i - 1] = 1.0
        b = np.zeros(n)
        b[0] = 1.0
        scale = self.gain / math.prod(self.lags)
        c = np.zeros(n)
        c[-1] = scale
        if self.lead:  # (1 + z s) on the last state: its own rate of change adds z times
            c[-1] += scale * self.lead * poles[-1]
            if n > 1:
                c[-2] += scale * self.lead
        return a, b, c

    def stepped(self, h: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the matrices of a step of ``h`` s under a held stem."""
        a, b, c = self.matrices()
        n = len(b)
        whole = np.zeros((n + 1, n + 1))
        whole[:n, :n], whole[:n, n] = a, b
        moved = expm(whole * h)
        return np.ascontiguousarray(moved[:n, :n]), np.ascontiguousarray(moved[:n, n]), c

    def fine_dead_time(self, sample_time: float, fine: int = FINE) -> int:
        """Return the dead time in fine steps, so many of them in a sample."""
        return round(self.dead_time * fine / sample_time)

    def sampled(self, sample_time: float, fine: int = FINE) -> tuple[FloatArray, FloatArray, int]:
        """Return a₁ …, b₁ … and whole samples of dead time under a stem held for a sample.

        The equation y_k = −a₁ y_{k−1} − … + b₁ χ_{k−1−d} + … is exact: its denominator has the
        plant's poles, its numerator follows from the answer to a pulse of one sample. A dead
        time between two samples, a whole number of ``fine`` steps, takes one more b.
        """
        a, b, c = self.stepped(sample_time / fine)
        whole, late = divmod(self.fine_dead_time(sample_time, fine), fine)
        poles = np.exp(np.array(self.poles()) * sample_time)
        denominator = np.real(np.poly(poles))
        n = len(poles)
        x, answer = np.zeros(n), [0.0]
        for k in range(fine * (n + 2)):
            x = a @ x + b * float(0 <= k - late < fine)
            if (k + 1) % fine == 0:
                answer.append(float(c @ x))
        numerator = np.convolve(denominator, answer)[1 : n + 2]
        if abs(numerator[-1]) < 1e-9 * np.abs(numerator).max():
            numerator = numerator[:-1]
        return denominator[1:], numerator, whole


def _gain(random: np.random.Generator) -> float:
    return float(random.choice([-1.0, 1.0])) * log_uniform(random, 0.3, 3.0)


def flow(random: np.random.Generator) -> Plant:
    """Return liquid in a pipe behind a valve with a linear installed characteristic.

    Its inertia and the transmitter are a lag each.

    References:
        C. A. Smith, A. B. Corripio: Principles and Practice of Automatic Process Control, 3rd
        ed., Wiley 2006 (transmitters and valves as first-order lags).
    """
    slow = log_uniform(random, 2.0, 20.0)
    return Plant(
        "flow", abs(_gain(random)), (slow, slow * random.uniform(0.1, 0.8)), 0.0, _dead(random)
    )


def heater(random: np.random.Generator) -> Plant:
    r"""Return the temperature of a stirred tank heated through a wall that stores heat.

    .. math::
        m C \dot T &= w C (T_i - T) + h_e A_e (T_e - T) \\
        m_e C_e \dot T_e &= Q - h_e A_e (T_e - T)

    which is of second order in the heat Q.

    References:
        D. E. Seborg, T. F. Edgar, D. A. Mellichamp, F. J. Doyle: Process Dynamics and Control,
        3rd ed., Wiley 2011, example 2.2 (electrically heated stirred tank).
    """
    residence = log_uniform(random, 8.0, 40.0)  # m / w
    wall = residence * random.uniform(0.05, 0.5)  # m_e C_e / (h_e A_e)
    ratio = random.uniform(0.05, 0.3)  # m_e C_e / (m C)
    # residence·wall s² + (residence + wall + residence·ratio) s + 1
    linear = residence + wall + residence * ratio
    return Plant("heater", abs(_gain(random)), _lags(residence * wall, linear), 0.0, _dead(random))


def two_tanks(random: np.random.Generator) -> Plant:
    r"""Return the second level of two tanks that act on each other through a resistance.

    .. math::
        A_1 \dot h_1 = q - (h_1 - h_2)/R_1, \quad A_2 \dot h_2 = (h_1 - h_2)/R_1 - h_2/R_2

    References:
        K. Ogata: Modern Control Engineering, 5th ed., Prentice Hall 2010, section 4-2
        (liquid-level systems with interaction).
    """
    first, second = (
        log_uniform(random, 4.0, 25.0),
        log_uniform(random, 4.0, 25.0),
    )  # A_1 R_1, A_2 R_2
    across = first * random.uniform(0.2, 1.0)  # A_1 R_2
    return Plant(
        "two_tanks", abs(_gain(random)), _lags(first * second, first + second + across), 0.0,
        _dead(random),
    )  # fmt: skip


def level(random: np.random.Generator) -> Plant:
    """Return a tank that a pump empties: A dh/dt = q − q_out, behind a transmitter's lag.

    References:
        Seborg and others, as :func:`heater`, section 2.4.5 (liquid storage with a pump).
    """
    sensor = log_uniform(random, 1.0, 8.0)
    gain = _gain(random) / log_uniform(random, 30.0, 120.0)
    return Plant("level", gain, (sensor,), 0.0, _dead(random), integrating=True)


def column(random: np.random.Generator) -> Plant:
    """Return one path of a pilot column that parts methanol and water, time in minutes.

    References:
        R. K. Wood, M. W. Berry: Terminal composition control of a binary distillation column.
        Chem. Eng. Sci. 28, 1973, 1707-1717.
    """
    paths = ((12.8, 16.7, 1.0), (-18.9, 21.0, 3.0), (6.6, 10.9, 7.0), (-19.4, 14.4, 3.0))
    gain, lag, dead = paths[int(random.integers(len(paths)))]
    return Plant("column", 0.1 * gain, (lag,), 0.0, dead)


def lags(random: np.random.Generator) -> Plant:
    """Return three lags in a row, as of a heat exchanger's wall, fluid and thermowell.

    References:
        K. J. Åström, T. Hägglund: Advanced PID Control, ISA 2006, chapter 7 (test batch).
    """
    slow = log_uniform(random, 5.0, 25.0)
    rest = sorted((slow * random.uniform(0.1, 0.9) for _ in range(2)), reverse=True)
    return Plant("lags", _gain(random), (slow, *rest), 0.0, _dead(random))


def wrong_way(random: np.random.Generator) -> Plant:
    """Return a plant that begins the wrong way, as a boiler's drum that swells.

    References:
        Åström, Hägglund, as :func:`lags`: (1 − αs)/(1 + s)³ of the test batch, one lag less.
    """
    slow = log_uniform(random, 8.0, 30.0)
    second = slow * random.uniform(0.3, 0.9)
    lead = -second * random.uniform(0.2, 0.8)
    return Plant("wrong_way", _gain(random), (slow, second), lead, _dead(random))


def late(random: np.random.Generator) -> Plant:
    """Return a lag behind a dead time as long as itself, as a web or a long pipe has.

    References:
        Seborg and others, as :func:`heater`, section 6.2 (transport delay).
    """
    slow = log_uniform(random, 6.0, 20.0)
    return Plant("late", _gain(random), (slow,), 0.0, slow * random.uniform(0.6, 1.5))


KINDS: dict[str, Callable[[np.random.Generator], Plant]] = {
    "flow": flow,
    "heater": heater,
    "two_tanks": two_tanks,
    "level": level,
    "column": column,
    "lags": lags,
    "wrong_way": wrong_way,
    "late": late,
}
"""Draws by kind; times in a unit that :func:`drawn_plant` stretches."""


def _dead(random: np.random.Generator) -> float:
    return float(random.uniform(0.5, 6.0))


def _lags(product: float, total: float) -> tuple[float, float]:
    """Return the two lags whose product and sum these are."""
    apart = math.sqrt(total * total - 4.0 * product)
    return 0.5 * (total + apart), 0.5 * (total - apart)


def drawn_plant(random: np.random.Generator, kind: str, sample_time: float) -> Plant:
    """Return a plant whose unit of time is one sample, its dead time in whole fine steps."""
    plant = KINDS[kind](random)
    fine = sample_time / FINE
    dead = plant.dead_time * sample_time
    if random.random() < 0.7:  # most are asked in whole samples
        dead = round(dead / sample_time) * sample_time
    gain = plant.gain / sample_time if plant.integrating else plant.gain
    return dataclasses.replace(
        plant,
        gain=gain,
        lags=tuple(lag * sample_time for lag in plant.lags),
        lead=plant.lead * sample_time,
        dead_time=round(dead / fine) * fine,
    )
