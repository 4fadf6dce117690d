"""A linear model of a whole record: fits, poles, gains, and the loop model made of it."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import LinearData, LinearStatus
from stiction_ros.identification.linear.subspace import OrderChoice, OrderRival
from stiction_ros.loop import LoopModel
from stiction_ros.processes import LinearModel
from stiction_ros.signals.subspace_projection import SubspaceMethod


@dataclasses.dataclass(frozen=True)
class LinearIdentification:
    """Every output of a record as one state-space model.

    Attributes:
        status: how the fit ended.
        reason: one sentence; empty when ok.
        record: name of the record.
        samples, sample_time: of the record, seconds.
        valves, outputs: tags.
        method: projection of the states.
        delay: t_d in samples, shape (p, m).
        a, b, c, k: A (n, n), B (n, m) per %, C (p, n) and K (n, p), in engineering units,
            without the delays.
        x0: state at the first sample after the delays, shape (n,).
        stem0, pv0: operating point χ_0 (m,), % and y_0 (p,): the offset of the model.
        noise_std: of the one-step error, shape (p,), engineering units.
        fit_one_step, fit_free_run: NRMSE fit, %, shape (p,).
        singular_values: of the weighted projection, falling.
        rivals: the orders tried.
        seconds: wall time spent.
        notes: remarks for people.

    Examples:
        >>> from stiction_ros import LinearOptions, LoopModel, find_config
        >>> from stiction_ros import fit_linear, prbs_experiment
        >>> ideal = LoopModel.load(find_config("flow.loop.yaml")).with_ideal_valves()
        >>> found = fit_linear(prbs_experiment(ideal, 400, seed=1), LinearOptions(order=1))
        >>> found.loop_model("fitted", limits=(0.0, 100.0)).outputs
        ('PV1',)
    """

    status: LinearStatus
    reason: str
    record: str
    samples: int
    sample_time: float
    valves: tuple[str, ...]
    outputs: tuple[str, ...]
    method: SubspaceMethod
    delay: NDArray[np.int64]
    a: FloatArray
    b: FloatArray
    c: FloatArray
    k: FloatArray
    x0: FloatArray
    stem0: FloatArray
    pv0: FloatArray
    noise_std: FloatArray
    fit_one_step: FloatArray
    fit_free_run: FloatArray
    singular_values: FloatArray
    rivals: tuple[OrderRival, ...]
    seconds: float = 0.0
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        fit = ", ".join(
            f"{name} {free:.0f} %"
            for name, free in zip(self.outputs, self.fit_free_run.tolist(), strict=True)
        )
        return f"<LinearIdentification {self.status}: free-run fit {fit}; {self.samples} samples>"

    @property
    def order(self) -> int:
        """Number n of states without the delays."""
        return len(self.a)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, largest first, shape (n,); the delays' zeros left out."""
        poles = np.linalg.eigvals(self.a).astype(complex)
        return poles[np.argsort(-np.abs(poles), kind="stable")]

    @property
    def gain(self) -> FloatArray:
        """C (I − A)⁻¹ B, shape (p, m), engineering units per %; the DC gain when stable."""
        return self.linear_model.gain

    @property
    def linear_model(self) -> LinearModel:
        """The process as matrices, its delays as further states."""
        n, none = self.order, np.zeros((self.order, 0))
        model = LinearModel(self.a, self.b, self.c, none, np.zeros(n), self.stem0, self.pv0)
        return model.behind_delays(self.delay[0].tolist())

    def loop_model(self, name: str, limits: tuple[float, float] | None = None) -> LoopModel:
        """Return the loop with ideal valves, this process, and where it came from.

        Args:
            name: tag of the loop.
            limits: of every valve, %; None leaves them out.

        Raises:
            InputError: the model is unstable.
        """
        if self.status is LinearStatus.UNSTABLE:
            raise InputError(self.reason, where=self.record, fix="try another order")
        ends = {} if limits is None else {"limits": list(limits)}
        noise = [{"std": std, "enters": "measurement"} for std in self.noise_std.tolist()]
        process = {
            "kind": "state_space",
            "delay": dict(zip(self.valves, self.delay[0].tolist(), strict=True)),
            **{key: getattr(self, key).tolist() for key in ("a", "b", "c")},
            "outputs": [
                {"name": tag, "noise": one} for tag, one in zip(self.outputs, noise, strict=True)
            ],
        }
        provenance = {
            "what": "process",
            "kind": "state_space",
            "record": self.record,
            "samples": self.samples,
            "status": self.status.value,
            "fit_one_step": dict(zip(self.outputs, self.fit_one_step.tolist(), strict=True)),
            "fit_free_run": dict(zip(self.outputs, self.fit_free_run.tolist(), strict=True)),
            "method": self.method.value,
            "order": self.order,
            "kalman_gain": self.k.tolist(),
        }
        return LoopModel.from_mapping(
            {
                "loop": name,
                "sample_time": self.sample_time,
                "valves": [{"name": valve, "effects": []} | ends for valve in self.valves],
                "process": process,
                "operating_point": {
                    "op": dict(zip(self.valves, self.stem0.tolist(), strict=True)),
                    "pv": dict(zip(self.outputs, self.pv0.tolist(), strict=True)),
                },
                "provenance": [provenance],
            },
            name,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``fit-linear --json`` but for ``record``."""
        gain = self.gain
        return {
            "samples": self.samples,
            "sample_time": self.sample_time,
            "seconds": self.seconds,
            "model": {
                "kind": "state_space",
                "status": self.status.value,
                "reason": self.reason,
                "notes": list(self.notes),
                "poles": [[float(pole.real), float(pole.imag)] for pole in self.poles],
                "method": self.method.value,
                "order": self.order,
                **{key: getattr(self, key).tolist() for key in ("a", "b", "c", "k", "x0")},
                "op0": self.stem0.tolist(),
                "pv0": self.pv0.tolist(),
                "singular_values": self.singular_values.tolist(),
                "rivals": [rival.to_dict() for rival in self.rivals],
            },
            "outputs": [
                {
                    "name": tag,
                    "delay": dict(zip(self.valves, self.delay[i].tolist(), strict=True)),
                    "gain": dict(zip(self.valves, gain[i].tolist(), strict=True)),
                    "noise_std": float(self.noise_std[i]),
                    "fit_one_step": float(self.fit_one_step[i]),
                    "fit_free_run": float(self.fit_free_run[i]),
                }
                for i, tag in enumerate(self.outputs)
            ],
        }


def in_engineering_units(
    data: LinearData, found: OrderChoice, method: SubspaceMethod
) -> LinearIdentification:
    """Return the order taken in the units of the record; arrays are not to be written to."""
    model = found.taken.model
    arrays = {
        "a": model.a,
        "b": model.b / data.u_scale,
        "c": model.c * data.y_scale[:, None],
        "k": model.k / data.y_scale,
        "x0": model.x0,
        "stem0": data.u_mean,
        "pv0": data.y_mean + data.y_scale * model.y0,
        "noise_std": found.taken.noise_std * data.y_scale,
        "fit_one_step": found.taken.fit_one_step,
        "fit_free_run": found.taken.fit_free_run,
        "singular_values": found.singular_values,
    }
    kept: dict[str, Any] = {key: np.array(values) for key, values in arrays.items()}
    for values in kept.values():
        values.flags.writeable = False
    return LinearIdentification(
        status=found.status,
        reason=found.reason,
        record=data.name,
        samples=data.samples,
        sample_time=data.sample_time,
        valves=data.valves,
        outputs=data.outputs,
        method=method,
        delay=np.tile(np.array(found.delay, dtype=np.int64), (len(data.outputs), 1)),
        rivals=found.rivals,
        **kept,
    )
