"""A process whose outputs pass further linear effects: gain, delay, pole, leak."""

import numpy as np

from stiction_ros.effects import Behaviour, Filter, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes.process import LinearModel, Process


class AlteredProcess(Process):
    r"""The process ``inner`` with ``effects`` on its outputs, about its operating point.

    .. math::
        y_k &= y_0 + C z_k + D (x_k - y_0) \\
        z_{k+1} &= A z_k + B (x_k - y_0)

    with x the output of the process as it was. The effects come before disturbances, noise
    and sensors. For a linear process it is the same whether they act on the output or on all
    inputs of that output's equation; noise that enters the equation passes them, too. The state is
    that of the process and then z.
    """

    def __init__(
        self, inner: Process, effects: tuple[tuple[Behaviour, ...], ...], sample_time: float
    ) -> None:
        """Put ``effects``, one tuple of linear ones per output, behind ``inner``."""
        from scipy.linalg import block_diag  # slow to import

        if len(effects) != len(inner.outputs):
            raise InputError(f"{len(effects)} lists of effects for {len(inner.outputs)} outputs")
        self.inner, self.effects = inner, effects
        self.kind, self.valves, self.outputs = inner.kind, inner.valves, inner.outputs
        self.noise, self.upsets = inner.noise, inner.upsets
        self.measured_disturbances = inner.measured_disturbances
        self._point = inner.linear(sample_time).pv0
        self._chains = [[_filter(effect, sample_time) for effect in chain] for chain in effects]
        filters = [_in_series(chain) for chain in self._chains]
        self._a = block_diag(*[f.a for f in filters])
        self._b = block_diag(*[f.b[:, None] for f in filters])
        self._c = block_diag(*[f.c[None, :] for f in filters])
        self._d = np.array([f.d for f in filters])

    def rest(self, stem: FloatArray, pv: FloatArray) -> FloatArray:
        """Return the state that gives ``pv``; delays and poles rest, a leak begins."""
        moved = np.array(pv - self._point)
        past: list[FloatArray] = []
        for i, chain in enumerate(self._chains):
            states: list[FloatArray] = []
            for entry in reversed(chain):
                state, moved[i] = _at_rest(entry, float(moved[i]))
                states.insert(0, state)
            past += states
        return np.concatenate([self.inner.rest(stem, self._point + moved), *past])

    def advance(
        self, state: FloatArray, stem: FloatArray, upset: FloatArray, noise: FloatArray
    ) -> FloatArray:
        inside, past = self._split(state)
        moved = self.inner.output(inside) - self._point
        following = self.inner.advance(inside, stem, upset, noise)
        return np.concatenate([following, self._a @ past + self._b @ moved])

    def output(self, state: FloatArray) -> FloatArray:
        inside, past = self._split(state)
        moved = self.inner.output(inside) - self._point
        return np.asarray(self._point + self._c @ past + self._d * moved)

    def linear(self, sample_time: float) -> LinearModel:
        """Return the linear model of the process with the effects' states appended."""
        model = self.inner.linear(sample_time)
        more = len(self._a)
        below = np.zeros((more, model.b.shape[1]))
        return LinearModel(
            np.block([[model.a, np.zeros((model.order, more))], [self._b @ model.c, self._a]]),
            np.vstack([model.b, below]),
            np.hstack([self._d[:, None] * model.c, self._c]),
            np.vstack([model.e, np.zeros((more, model.e.shape[1]))]),
            np.concatenate([model.constant, np.zeros(more)]),
            model.stem0,
            model.pv0,
        )

    def _split(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        count = len(state) - len(self._a)
        return state[:count], state[count:]


def _filter(effect: Behaviour, sample_time: float) -> Filter:
    found = effect.filter(sample_time)
    if found is None:
        raise InputError(f"{effect.title()} is not linear")
    return found


def _at_rest(entry: Filter, out: float) -> tuple[FloatArray, float]:
    """Return the state and the input at which the filter rests at ``out``."""
    n = len(entry.b)
    shape = np.linalg.lstsq(np.eye(n) - entry.a, entry.b, rcond=None)[0]
    gain = entry.d + float(entry.c @ shape)
    if abs(gain) < 1e-9:
        return np.zeros(n), out / entry.d
    return np.asarray(shape * (out / gain)), out / gain


def _in_series(filters: list[Filter]) -> Filter:
    """Return one filter for filters that follow each other."""
    whole = Filter(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0)
    for new in filters:
        n, m = len(whole.b), len(new.b)
        whole = Filter(
            np.block([[whole.a, np.zeros((n, m))], [np.outer(new.b, whole.c), new.a]]),
            np.concatenate([whole.b, new.b * whole.d]),
            np.concatenate([new.d * whole.c, new.c]),
            whole.d * new.d,
        )
    return whole
