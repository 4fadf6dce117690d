"""The estimator of a running loop: window in, trusted friction and loop model out."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import (
    Identification,
    IdentificationOptions,
    identify,
)
from stiction_ros.loop import LoopModel
from stiction_ros.online.schedule import FitSchedule
from stiction_ros.online.trust import Trust, TrustedFriction, TrustRule
from stiction_ros.records import Record
from stiction_ros.settings import setting


@dataclasses.dataclass(frozen=True)
class EstimatorSettings(FitSchedule, TrustRule):
    """What the estimator looks at, when, and what it needs to be sure."""

    window: int = setting(2500, "samples in the sliding window", low=20)
    output_order: int = setting(0, "n_a of the ARX model; 0 chooses by BIC", low=0, high=20)
    input_order: int = setting(0, "n_b of the ARX model; 0 chooses by BIC", low=0, high=20)
    delay_low: int = setting(0, "smallest delay tried, samples", low=0)
    delay_high: int = setting(10, "largest delay tried, samples", low=0)

    def options(self) -> IdentificationOptions:
        """Return what :func:`stiction_ros.identification.identify` is asked."""
        return IdentificationOptions(
            output_order=self.output_order or None,
            input_order=self.input_order or None,
            delay=(self.delay_low, self.delay_high),
            one_step_best=False,
            check_columns=False,
        )


@dataclasses.dataclass(frozen=True)
class FitUpdate:
    """What one fit says and changes.

    Attributes:
        end: last sample of the window.
        identification: the fit itself.
        trusted: trusted friction by valve after this fit.
        loop_model: the loop with the trusted friction, only when it differs from before.
    """

    end: int
    identification: Identification
    trusted: Mapping[str, TrustedFriction]
    loop_model: LoopModel | None


def fit(record: Record, options: IdentificationOptions) -> Identification:
    """Run one fit; a plain function, so that a worker process can run it."""
    return identify(record, options)


class LiveEstimator:
    """Keeps the window and the trust; the fit itself runs wherever its user wants.

    Per sample: :meth:`add`; when it returns a record, run :func:`fit` on it and hand the
    result to :meth:`conclude`.

    Attributes:
        settings: in force.
        loop, valves, outputs, sample_time: of the loop; seconds.
        published_model: the loop model of the last fit that had a new one.
    """

    def __init__(
        self,
        settings: EstimatorSettings,
        loop: str,
        valves: Sequence[str],
        outputs: Sequence[str],
        sample_time: float,
    ) -> None:
        """Start with an empty window.

        Raises:
            InputError: settings that no fit can use.
        """
        settings.options()
        self.settings = settings
        self.loop, self.sample_time = loop, sample_time
        self.valves, self.outputs = tuple(valves), tuple(outputs)
        self.published_model: LoopModel | None = None
        self._trust = Trust(self.valves, settings)
        self._op: deque[FloatArray] = deque(maxlen=settings.window)
        self._pv: deque[FloatArray] = deque(maxlen=settings.window)
        self._published: dict[str, Any] | None = None

    def retune(self, settings: EstimatorSettings) -> None:
        """Change settings from the next sample on; window and trust are kept.

        Raises:
            InputError: settings that no fit can use; the old ones stay in force.
        """
        settings.options()
        self.settings = settings
        self._trust.retune(settings)
        self._op = deque(self._op, maxlen=settings.window)
        self._pv = deque(self._pv, maxlen=settings.window)

    def add(self, sample: int, op: FloatArray, pv: FloatArray) -> Record | None:
        """Take in one sample, OP (m,) and PV (p,); return the window when a fit is due.

        No window holds a sample that is not finite: it begins anew behind it.
        """
        if np.isfinite(op).all() and np.isfinite(pv).all():
            self._op.append(np.array(op, dtype=float))
            self._pv.append(np.array(pv, dtype=float))
        else:
            self.restart()
        if not self.settings.due(sample):
            return None
        return Record(
            self.loop,
            self.sample_time,
            self.valves,
            self.outputs,
            np.array(self._op).reshape(-1, len(self.valves)),
            np.array(self._pv).reshape(-1, len(self.outputs)),
            start=(sample + 1 - len(self._op)) * self.sample_time,
        )

    def restart(self) -> None:
        """Empty the window, as after samples that were missed; trust is kept."""
        self._op.clear()
        self._pv.clear()

    def conclude(self, end: int, found: Identification) -> FitUpdate:
        """Apply the rule of trust to the fit of the window that ends at sample ``end``."""
        trusted = dict(self._trust.update(found.valves))
        effects = {name: friction.behaviour().to_mapping() for name, friction in trusted.items()}
        model = None
        if effects != (self._published or {}):
            model = self.describe(FitUpdate(end, found, trusted, None))
            self._published, self.published_model = effects, model
        return FitUpdate(end, found, trusted, model)

    def describe(self, update: FitUpdate) -> LoopModel:
        """Return the loop as a fit found it, with the friction that is trusted after it."""
        found, trusted = update.identification, update.trusted
        valves = []
        for name in self.valves:
            friction = trusted.get(name)
            effects = [] if friction is None else [friction.behaviour().to_mapping()]
            valves.append({"name": name, "effects": effects})
        outputs = [
            {
                "name": output.name,
                "a": [float(v) for v in output.a],
                "b": {valve: [float(v) for v in b] for valve, b in output.b.items()},
                "delay": {valve: int(d) for valve, d in output.delay.items()},
                "bias": float(output.bias),
                "noise": {"std": float(output.noise_std), "enters": "equation"},
            }
            for output in found.outputs
        ]
        provenance = [
            {
                "valve": name,
                "effect": "stiction",
                "from": f"window of {found.samples} samples ending at sample {update.end}",
                "f_s_interval": list(friction.static_interval),
                "f_d_interval": list(friction.dynamic_interval),
            }
            for name, friction in trusted.items()
        ]
        return LoopModel.from_mapping(
            {
                "loop": self.loop,
                "sample_time": self.sample_time,
                "valves": valves,
                "process": {"kind": "arx", "outputs": outputs},
                "provenance": provenance,
            },
            f"model identified for {self.loop}",
        )
