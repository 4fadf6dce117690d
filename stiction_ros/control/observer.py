"""State and output-disturbance estimation for offset-free control."""

import copy
import dataclasses
import enum

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

FORGETTING = 0.98  # of the running mean square of what was passed on
LIVELY = 2.0  # usual innovations, as which a larger one counts in that mean


class ObserverKind(enum.StrEnum):
    """How the observer gain is chosen."""

    KALMAN = "kalman"
    LUENBERGER = "luenberger"


@dataclasses.dataclass(frozen=True)
class ObserverTuning:
    """Covariances relative to the measurement noise, or the Luenberger gain."""

    kind: ObserverKind  # Kalman filter, or the Luenberger observer with K_x = 0 and K_d = gain · I
    state_noise: float  # variance of stem-like noise that enters through B, in %²
    disturbance_noise: FloatArray  # variance of the random walk of d, per output, in (units of PV)²
    measurement_noise: FloatArray  # variance of measurement noise, per output, in (units of PV)²
    gain: float = 0.2  # K_d of the Luenberger observer, 0 < gain ≤ 1; 1 is deadbeat and jitters
    gate: float = 20.0  # standard deviations from which innovations are outliers; inf takes all
    gate_samples: int = 3  # successive outliers of one output after which they are taken for true


class Observer:
    r"""Observer of the model with a constant output disturbance.

    .. math::
        \hat e_k &= y_k - C \hat\xi_k - \hat d_k - y_0 \\
        \hat\xi_k^+ &= \hat\xi_k + K_x \hat e_k, \quad \hat d_k^+ = \hat d_k + K_d \hat e_k \\
        \hat\xi_{k+1} &= A \hat\xi_k^+ + B (\hat\chi_k - \chi_0) + E w_k + g

    Feed it the stem positions that the controller believes in, not OP. An innovation that
    the :class:`~stiction_ros.control.observer.InnovationGate` holds back counts as 0.
    """

    def __init__(self, model: LinearModel, tuning: ObserverTuning) -> None:
        """Design the gain; InputError when the augmented model is not detectable."""
        _check_detectable(model)
        self.model = model
        n, p = model.order, len(model.pv0)
        if tuning.kind is ObserverKind.LUENBERGER:
            self.gain = _luenberger(model, tuning)
            covariance = np.diag(tuning.measurement_noise)
        else:
            self.gain, covariance = _kalman(model, tuning)
        self._weight = np.linalg.inv(covariance)
        self._deviation = deviation = np.sqrt(np.diag(covariance))
        self._gate = InnovationGate(deviation, tuning.gate, tuning.gate_samples)
        self._outlier = tuning.gate * deviation
        self._gain_x, self._gain_d = self.gain[:n], self.gain[n:]
        self.state: FloatArray = np.zeros(n)
        self.disturbance = np.zeros(p)
        self.innovation = self._seen = np.zeros(p)

    def rest(self, stem: FloatArray, pv: FloatArray) -> None:
        """Start from the steady state at ``stem`` (m,), d̂ chosen so that it shows ``pv``."""
        model = self.model
        drive = model.b @ (stem - model.stem0) + model.constant
        steady = np.linalg.lstsq(np.eye(model.order) - model.a, drive, rcond=None)[0]
        self.state = np.asarray(steady, dtype=float)
        self.disturbance = pv - model.pv0 - model.c @ self.state

    def copy(self) -> "Observer":
        """Return an observer of its own with the same estimates."""
        other = copy.copy(self)  # every array is replaced, never changed
        other._gate = copy.copy(self._gate)
        return other

    @property
    def misfit(self) -> float:
        """The last innovation squared and weighed by its expected covariance.

        Beyond the width of the gate it counts as on it, whether it is held back or not.
        """
        seen = np.clip(self._seen, -self._outlier, self._outlier)
        return float(seen @ self._weight @ seen)

    @property
    def standard_innovation(self) -> FloatArray:
        """The last innovation in the standard deviations that it is expected to have, (p,)."""
        return np.asarray(self.innovation / self._deviation)

    @property
    def held_back(self) -> NDArray[np.bool_]:
        """Which outputs of the last measurement were taken for outliers, shape (p,)."""
        return self._gate.closed

    @property
    def output(self) -> FloatArray:
        """Estimated outputs, shape (p,)."""
        return np.asarray(self.model.c @ self.state + self.model.pv0 + self.disturbance)

    def correct(self, pv: FloatArray) -> None:
        """Take in the measurement ``pv``, shape (p,)."""
        model = self.model
        self._seen = pv - model.pv0 - model.c @ self.state - self.disturbance
        self.innovation = self._gate.pass_on(self._seen)
        self.state = self.state + self._gain_x @ self.innovation
        self.disturbance = self.disturbance + self._gain_d @ self.innovation

    def predict(self, stem: FloatArray, dv: FloatArray) -> None:
        """Move one sample on with stems ``stem`` (m,), % and disturbances ``dv`` (d,)."""
        model = self.model
        self.state = model.a @ self.state + model.b @ (stem - model.stem0) + model.constant
        if model.e.shape[1]:
            self.state = self.state + model.e @ dv


def _augmented(model: LinearModel) -> tuple[FloatArray, FloatArray]:
    n, p = model.order, len(model.pv0)
    a = np.eye(n + p)
    a[:n, :n] = model.a
    return a, np.hstack([model.c, np.eye(p)])


def _check_detectable(model: LinearModel) -> None:
    """Hautus test of every eigenvalue on or outside the unit circle."""
    a, c = _augmented(model)
    values = np.append(np.linalg.eigvals(model.a), 1.0)
    for value in values[np.abs(values) >= 1.0 - 1e-9]:
        pencil = np.vstack([a - value * np.eye(len(a)), c])
        if np.linalg.matrix_rank(pencil, tol=1e-10) < len(a):
            raise InputError(
                f"mode {value:.4g} cannot be told from an output disturbance",
                where="process model",
                fix="an integrating or unstable mode needs another disturbance model; "
                "use a process model whose modes are all stable",
            )


def _kalman(model: LinearModel, tuning: ObserverTuning) -> tuple[FloatArray, FloatArray]:
    """Return the stationary gain (n + p, p), and the covariance (p, p) of the innovations."""
    a, c = _augmented(model)
    n = model.order
    noise = np.zeros_like(a)
    noise[:n, :n] = tuning.state_noise * model.b @ model.b.T + 1e-12 * np.eye(n)
    noise[n:, n:] = np.diag(tuning.disturbance_noise)
    measurement = np.diag(tuning.measurement_noise)
    try:
        covariance = solve_discrete_are(a.T, c.T, noise, measurement)
        innovation = c @ covariance @ c.T + measurement
        gain = np.asarray(np.linalg.solve(innovation, c @ covariance).T)
        if np.isfinite(gain).all() and np.all(np.diag(innovation) > 0.0):
            return gain, np.asarray(innovation)
    except ValueError:  # LinAlgError is one
        pass
    raise InputError(
        "there is no Kalman filter for these variances",
        where="measurement_noise",
        fix="give the noise variances in the units of PV squared, and all of them finite",
    )


def _luenberger(model: LinearModel, tuning: ObserverTuning) -> FloatArray:
    if np.abs(np.linalg.eigvals(model.a)).max(initial=0.0) >= 1.0:
        raise InputError(
            "the Luenberger observer needs a stable process model",
            where="observer",
            fix="use observer: kalman",
        )
    n, p = model.order, len(model.pv0)
    gain = np.zeros((n + p, p))
    gain[n:] = tuning.gain * np.eye(p)
    return gain


class InnovationGate:
    """Holds back innovations that are far too large, until they last.

    The gate of an output stands at ``width`` times a standard deviation: the expected one, or that
    of the innovations passed on lately if this is larger. So the gate stays open where the noise
    was given too small. It widens by 3 % a sample at most, so that bad values do not
    open it for others. After ``patience`` successive samples beyond it the change is real and
    is passed on in growing portions, one gate width more at each sample, until an innovation
    fits again: a step of a few units passes at once, a value out of all proportion does not.
    """

    def __init__(self, deviation: FloatArray, width: float, patience: int) -> None:
        """Start open; ``deviation`` (p,) in the units of PV, all positive."""
        self._floor = self._usual = deviation
        self._width, self._patience = width, patience
        self._beyond = np.zeros(len(deviation), dtype=int)
        self.closed: NDArray[np.bool_] = np.zeros(len(deviation), dtype=bool)

    def pass_on(self, innovation: FloatArray) -> FloatArray:
        """Return ``innovation`` (p,) with 0 for every output that is held back."""
        size = np.abs(innovation)
        wild = size > self._width * np.maximum(self._floor, self._usual)
        self._beyond = np.where(wild, self._beyond + 1, 0)
        self.closed = wild & (self._beyond <= self._patience)
        # Only what fits widens the gate, and slowly, or a lasting fault would open it for good.
        usual = np.maximum(self._floor, self._usual)
        calm = np.where(wild, self._usual, np.minimum(size, LIVELY * usual))
        self._usual = np.hypot(np.sqrt(FORGETTING) * self._usual, np.sqrt(1 - FORGETTING) * calm)
        portion = np.where(wild, (self._beyond - self._patience) * self._width * usual, np.inf)
        return np.where(self.closed, 0.0, np.clip(innovation, -portion, portion))
