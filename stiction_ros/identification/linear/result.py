"""A linear model of a whole record: fits, poles, gains, and the loop model made of it."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import LinearData, LinearKind, LinearStatus
from stiction_ros.identification.linear.orders import OrderChoice
from stiction_ros.identification.linear.subspace import StateSpaceFit
from stiction_ros.loop import LoopModel
from stiction_ros.processes import ArxProcess, LinearModel, Noise, StateSpaceProcess
from stiction_ros.processes.linear_process import LinearProcess


@dataclasses.dataclass(frozen=True)
class LinearIdentification:
    """Every output of a record as one linear model.

    Attributes:
        kind: structure.
        status: the worst of the parts.
        reason: one sentence; empty when ok.
        record: name of the record.
        samples, sample_time: of the record, seconds.
        valves, outputs: tags.
        delay: t_d in samples, shape (p, m).
        gain: DC gain in engineering units per %, shape (p, m).
        poles: of all outputs for state space, else of each output in turn.
        noise_std: of the one-step error, shape (p,), engineering units.
        fit_one_step, fit_free_run: NRMSE fit, %, shape (p,).
        process: the deterministic part as plants and controllers take it; None without model.
        detail: the fits behind it, with their rivals.
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

    kind: LinearKind
    status: LinearStatus
    reason: str
    record: str
    samples: int
    sample_time: float
    valves: tuple[str, ...]
    outputs: tuple[str, ...]
    delay: NDArray[np.int64]
    gain: FloatArray
    poles: NDArray[np.complex128]
    noise_std: FloatArray
    fit_one_step: FloatArray
    fit_free_run: FloatArray
    process: LinearProcess | None
    detail: StateSpaceFit | tuple[OrderChoice, ...]
    seconds: float = 0.0
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        fit = ", ".join(
            f"{name} {free:.0f} %"
            for name, free in zip(self.outputs, self.fit_free_run.tolist(), strict=True)
        )
        said = f"free-run fit {fit}" if self.process is not None else self.reason
        return f"<LinearIdentification {self.kind} {self.status}: {said}; {self.samples} samples>"

    @property
    def linear_model(self) -> LinearModel:
        """The process as matrices.

        Raises:
            InputError: there is no model.
        """
        if self.process is None:
            raise InputError(self.reason, where=self.record, fix="try another order")
        return self.process.model

    def loop_model(self, name: str, limits: tuple[float, float] | None = None) -> LoopModel:
        """Return the loop with ideal valves, this process, and where it came from.

        Args:
            name: tag of the loop.
            limits: of every valve, %; None leaves them out.

        Raises:
            InputError: there is no model, or it is unstable.
        """
        if self.status in (LinearStatus.NO_MODEL, LinearStatus.UNSTABLE):
            raise InputError(self.reason, where=self.record, fix="try another order")
        valves: list[dict[str, Any]] = [{"name": valve, "effects": []} for valve in self.valves]
        if limits is not None:
            for valve in valves:
                valve["limits"] = list(limits)
        model = self.linear_model
        return LoopModel.from_mapping(
            {
                "loop": name,
                "sample_time": self.sample_time,
                "valves": valves,
                "process": _process_mapping(self),
                "operating_point": {
                    "op": dict(zip(self.valves, model.stem0.tolist(), strict=True)),
                    "pv": dict(zip(self.outputs, model.pv0.tolist(), strict=True)),
                },
                "provenance": [_provenance(self)],
            },
            name,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``fit-linear --json`` but for ``record``."""
        outputs = []
        for i, tag in enumerate(self.outputs):
            entry: dict[str, Any] = {
                "name": tag,
                "delay": dict(zip(self.valves, self.delay[i].tolist(), strict=True)),
                "gain": dict(zip(self.valves, self.gain[i].tolist(), strict=True)),
                "noise_std": float(self.noise_std[i]),
                "fit_one_step": float(self.fit_one_step[i]),
                "fit_free_run": float(self.fit_free_run[i]),
            }
            if not isinstance(self.detail, StateSpaceFit):
                entry |= _equation_json(self.detail[i], self.valves)
            outputs.append(entry)
        return {
            "samples": self.samples,
            "sample_time": self.sample_time,
            "seconds": self.seconds,
            "model": {
                "kind": self.kind.value,
                "status": self.status.value,
                "reason": self.reason,
                "notes": list(self.notes),
                "poles": [[float(pole.real), float(pole.imag)] for pole in self.poles],
            }
            | (_matrices_json(self.detail) if isinstance(self.detail, StateSpaceFit) else {}),
            "outputs": outputs,
        }


def state_space_result(data: LinearData, fit: StateSpaceFit) -> LinearIdentification:
    """Return the common face of a state-space model."""
    process = None
    if fit.order:
        noise = tuple(Noise(float(std)) for std in fit.noise_std)
        process = StateSpaceProcess(fit.linear_model(), data.valves, data.outputs, noise)
    return LinearIdentification(
        kind=LinearKind.STATE_SPACE,
        status=fit.status,
        reason=fit.reason,
        record=data.name,
        samples=data.samples,
        sample_time=data.sample_time,
        valves=data.valves,
        outputs=data.outputs,
        delay=np.tile(np.array(fit.delay, dtype=np.int64), (len(data.outputs), 1)),
        gain=fit.gain,
        poles=fit.poles,
        noise_std=fit.noise_std,
        fit_one_step=fit.fit_one_step,
        fit_free_run=fit.fit_free_run,
        process=process,
        detail=fit,
    )


def arx_result(data: LinearData, choices: tuple[OrderChoice, ...]) -> LinearIdentification:
    """Return the common face of one ARX equation per output."""
    fits = [choice.fit for choice in choices]
    doubtful = [fit for fit in fits if fit.status is not LinearStatus.OK]
    equations = tuple(fit.equation(data.valves) for fit in fits)
    return LinearIdentification(
        kind=LinearKind.ARX,
        status=doubtful[0].status if doubtful else LinearStatus.OK,
        reason="; ".join(f"{fit.name}: {fit.reason}" for fit in doubtful),
        record=data.name,
        samples=data.samples,
        sample_time=data.sample_time,
        valves=data.valves,
        outputs=data.outputs,
        delay=np.array([fit.delays for fit in fits], dtype=np.int64),
        gain=np.stack([fit.gain for fit in fits]),
        poles=np.concatenate([fit.poles for fit in fits]),
        noise_std=np.array([fit.noise_std for fit in fits]),
        fit_one_step=np.array([fit.fit_one_step for fit in fits]),
        fit_free_run=np.array([fit.fit_free_run for fit in fits]),
        process=ArxProcess(equations, data.valves, data.u_mean, data.y_mean),
        detail=choices,
    )


def _process_mapping(found: LinearIdentification) -> dict[str, Any]:
    """Return the ``process`` section of a loop model."""
    process = found.process
    if isinstance(process, ArxProcess):
        return {"kind": "arx", "outputs": [each.to_mapping() for each in process.equations]}
    model = found.linear_model
    return {
        "kind": "state_space",
        "a": model.a.tolist(),
        "b": model.b.tolist(),
        "c": model.c.tolist(),
        "outputs": [
            {"name": tag, "noise": {"std": float(std), "enters": "measurement"}}
            for tag, std in zip(found.outputs, found.noise_std, strict=True)
        ],
    }


def _provenance(found: LinearIdentification) -> dict[str, Any]:
    """Return where the process came from, with what a process section cannot hold."""
    entry: dict[str, Any] = {
        "what": "process",
        "kind": found.kind.value,
        "record": found.record,
        "samples": found.samples,
        "status": found.status.value,
        "fit_one_step": dict(zip(found.outputs, found.fit_one_step.tolist(), strict=True)),
        "fit_free_run": dict(zip(found.outputs, found.fit_free_run.tolist(), strict=True)),
    }
    if isinstance(found.detail, StateSpaceFit):
        fit = found.detail
        entry |= {"method": fit.method.value, "order": fit.order, "kalman_gain": fit.k.tolist()}
    return entry


def _matrices_json(fit: StateSpaceFit) -> dict[str, Any]:
    return {
        "method": fit.method.value,
        "order": fit.order,
        "a": fit.a.tolist(),
        "b": fit.b.tolist(),
        "c": fit.c.tolist(),
        "k": fit.k.tolist(),
        "x0": fit.x0.tolist(),
        "op0": fit.stem0.tolist(),
        "pv0": fit.pv0.tolist(),
        "singular_values": fit.singular_values.tolist(),
        "rivals": [dataclasses.asdict(row) for row in fit.rivals],
    }


def _equation_json(choice: OrderChoice, valves: tuple[str, ...]) -> dict[str, Any]:
    """Return the equation in absolute units, as ``identify --json`` gives it, and its rivals."""
    fit = choice.fit
    bias = fit.constant + (1.0 + fit.a.sum()) * fit.pv0 - fit.b.sum(axis=1) @ fit.stem0
    return {
        "a": fit.a.tolist(),
        "b": dict(zip(valves, fit.b.tolist(), strict=True)),
        "bias": float(bias),
        "status": fit.status.value,
        "criterion": f"{choice.criterion} of the free run",
        "rivals": [
            {
                "na": rival.orders.output,
                "nb": rival.orders.input,
                "delays": list(rival.delays),
                "status": rival.status.value,
                "aic": rival.aic,
                "bic": rival.bic,
                "fit_one_step": rival.fit_one_step,
                "fit_free_run": rival.fit_free_run,
                "chosen": rival is fit,
            }
            for rival in choice.rivals
        ],
    }
