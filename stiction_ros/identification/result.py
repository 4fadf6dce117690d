"""What identification returns: frozen values that can judge and print themselves."""

import dataclasses
import enum
import math
from collections.abc import Mapping
from typing import Any, Self

from stiction_ros.effects import Stiction
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.identification.friction import behaviour_of, find_law, first_values
from stiction_ros.identification.judgement import Figures, VerdictKind
from stiction_ros.processes import ArxOutput, Noise
from stiction_ros.signals.arx import driven, fitted_free_run

Interval = tuple[float, float]
__all__ = ["FitStatus", "Identification", "OrderRow", "OutputModel", "ValveEstimate", "VerdictKind"]


@dataclasses.dataclass(frozen=True)
class Look:
    """One way of looking at a record."""

    name: str  # for people, such as ``rows of 4 s`` or ``first half``
    gain: float  # −2 log likelihood that friction adds there
    agrees: bool  # whether this look alone speaks for what is told of the valve
    # f_S + f_D that it does not reject, %; None where it takes the friction of the whole
    band: Interval | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return an entry of ``stability.tried`` of ``identify --json``."""
        band = None if self.band is None else list(self.band)
        return {"look": self.name, "gain": self.gain, "band": band, "agrees": self.agrees}


@dataclasses.dataclass(frozen=True)
class Stability:
    """What was tried beside the answer, and what of it agreed.

    A valve that is told to be healthy is agreed on by looks that see no friction; whatever else
    is told, by looks that see the friction that stands beside it.
    """

    tried: tuple[Look, ...]  # at least one

    @property
    def agreed(self) -> tuple[str, ...]:
        """Names of the looks that agree."""
        return tuple(look.name for look in self.tried if look.agrees)

    @property
    def share(self) -> float:
        """Share of the looks that agree, 0 to 1."""
        return len(self.agreed) / len(self.tried)

    def to_dict(self) -> dict[str, Any]:
        """Return ``valves[].stability`` of ``identify --json``."""
        return {"tried": [look.to_dict() for look in self.tried], "agreed": list(self.agreed)}


def halves(gains: Interval, unheard: float | None) -> tuple[Look, ...]:
    """Return the looks at both halves of the record.

    Args:
        gains: −2 log likelihood that the friction of the whole adds in either half.
        unheard: gain up to which a half speaks for a healthy valve; None where friction is told,
            which each half must see.
    """
    return tuple(
        Look(name, gain, gain > 0.0 if unheard is None else gain <= unheard)
        for name, gain in zip(("first half", "second half"), gains, strict=True)
    )


class CauseKind(enum.StrEnum):
    """What an oscillation comes from.

    ``VALVE``: the friction that was identified. ``TUNING``: controller and process ring
    without it. ``DISTURBANCE``: a wave that enters behind the valve. ``SET_POINT``: moves of
    the set-point. ``NONE``: there is no regular oscillation. ``UNKNOWN``: there is one and
    nothing explains it.
    """

    VALVE = "valve"
    TUNING = "tuning"
    DISTURBANCE = "disturbance"
    SET_POINT = "set_point"
    NONE = "none"
    UNKNOWN = "unknown"


@dataclasses.dataclass(frozen=True)
class Cause:
    """Why one output oscillates."""

    kind: CauseKind  # see ``CauseKind``
    period: float | None  # of PV − SP, s; None where nothing stands out
    regularity: float  # above 1 is regular, see ``stiction_ros.signals.oscillation``
    amplitude: float  # √2 × RMS of the line at this period, engineering units
    sentence: str  # for people

    def to_dict(self) -> dict[str, str | float | None]:
        """Return the mapping of ``identify --json``."""
        return {
            "kind": self.kind.value,
            "period": self.period,
            "regularity": self.regularity,
            "amplitude": self.amplitude,
        }


class FitStatus(enum.StrEnum):
    """How the identification ended; everything but ``OK`` is a failure as a value."""

    OK = "ok"
    NO_MODEL = "no_model"


@dataclasses.dataclass(frozen=True)
class ValveEstimate:
    """Friction of one valve and the verdict on it."""

    name: str  # tag of the valve
    verdict: VerdictKind  # sticky, backlash, healthy or undecided
    law: str  # friction law that the figures belong to
    static_friction: float  # f_S, %, the middle of its interval
    # values of f_S whose switching pattern the record does not reject, %
    static_interval: tuple[float, float]
    dynamic_friction: float  # f_D, %, the best fit
    dynamic_interval: tuple[float, float]  # values of f_D that the record does not reject, %
    # the smallest move of the stem, %, as the jump form of the law tells it; J = f_S − f_D for a
    # law that has none; 0 where the record does not distinguish the friction from a pure deadband
    # (J = 0)
    jump: float
    stem_start: float  # stem position before the first sample, %
    moves: int  # number of samples at which the estimated stem moved
    # named figures behind the verdict, see ``stiction_ros.identification.conclusion``
    evidence: Mapping[str, float]
    band_share: float = 0.0  # f_S + f_D over the width of OP's movement about its slow mean
    # how the answer holds at other rates and in halves; None where a method does not look
    stability: Stability | None = None
    experiment: str = ""  # what would decide, with figures; empty where it is decided
    # the law's parameters behind the first two, by their keys in YAML; empty where it has no others
    # or the valve no friction
    further: Mapping[str, float] = dataclasses.field(default_factory=dict)
    # values of each that the record does not reject
    further_intervals: Mapping[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    # values of f_S + f_D that the record does not reject, %; None where a method does not look at
    # the sum: see ``sum_interval``
    band_interval: tuple[float, float] | None = None
    probability: float | None = None
    figures: Figures | None = None
    responds: bool = True  # whether PV answers this valve at all, as far as the record shows

    def __repr__(self) -> str:
        frictions = f"f_S {self.static_friction:.3g} %, f_D {self.dynamic_friction:.3g} %"
        return f"<ValveEstimate {self.name}: {self.verdict}, {frictions}, law {self.law}>"

    @property
    def is_likely(self) -> bool:
        """Whether friction is found, or more likely than not."""
        return self.verdict.has_friction or (self.probability or 0.0) > 0.5

    @property
    def sum_interval(self) -> tuple[float, float]:
        """Values of f_S + f_D that are possible, %."""
        if self.band_interval is not None:
            return self.band_interval
        static, dynamic = self.static_interval, self.dynamic_interval
        return static[0] + dynamic[0], static[1] + dynamic[1]

    @property
    def further_values(self) -> tuple[float, ...]:
        """Further parameters in the order of the law; where none is told, where it begins."""
        return tuple(self.further.values()) or first_values(find_law(self.law))

    def with_frictions(self, static: float, dynamic: float) -> Self:
        """Return the estimate with another f_S and f_D, %, further parameters kept."""
        return dataclasses.replace(self, static_friction=static, dynamic_friction=dynamic)

    def behaviour(self) -> Behaviour | None:
        """Return the friction as an effect of a loop model; None for a valve without any."""
        if self.static_friction <= 0.0:
            return None
        frictions = self.static_friction, self.dynamic_friction
        return behaviour_of(self.law, frictions, self.further)

    def with_own_jump(self) -> Self:
        """Return the estimate with the least move of its law, which need not be f_S − f_D."""
        law = self.behaviour() if self.jump > 0.0 else None
        form = law.jump_form() if isinstance(law, Stiction) else None
        return self if form is None else dataclasses.replace(self, jump=form.least)

    @property
    def rows(self) -> dict[str, tuple[float, float, float]]:
        """Value and ends of the interval of f_S and f_D by ``V1.f_s``, %.

        Of a law other than He's all its parameters follow, as ``V1.kano.s``, which tells the law;
        their ends are NaN where they follow from those of f_S and f_D.
        """
        found = {
            f"{self.name}.f_s": (self.static_friction, *self.static_interval),
            f"{self.name}.f_d": (self.dynamic_friction, *self.dynamic_interval),
        }
        law = None if self.law == "he" else self.behaviour()
        for entry in () if law is None else law.parameters():
            ends = self.further_intervals.get(entry.key, (math.nan, math.nan))
            found[f"{self.name}.{self.law}.{entry.key}"] = (getattr(law, entry.attribute), *ends)
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``identify --json``."""
        return {
            "name": self.name,
            "verdict": self.verdict.value,
            "probability": self.probability,
            "band_share": self.band_share,
            "responds": self.responds,
            "stability": None if self.stability is None else self.stability.to_dict(),
            "law": self.law,
            "f_s": self.static_friction,
            "f_s_interval": list(self.static_interval),
            "f_d": self.dynamic_friction,
            "f_d_interval": list(self.dynamic_interval),
            "band_interval": list(self.sum_interval),
            **self.further,
            **{f"{key}_interval": list(ends) for key, ends in self.further_intervals.items()},
            "jump": self.jump,
            "evidence": dict(self.evidence),
            "experiment": self.experiment or None,
        }


@dataclasses.dataclass(frozen=True)
class OutputModel:
    r"""Linear part of one output, equations (7)-(9) with a constant.

    .. math:: y_k = -\sum_i a_i y_{k-i} + \sum_j \sum_i b_{j,i} \chi^{(j)}_{k-i-t_{d,j}} + bias

    driven by the stems in free run; what remains is autoregressive noise.
    """

    name: str  # tag of the output
    a: tuple[float, ...]  # a_1 … a_na, sign as in (8a)
    b: Mapping[str, tuple[float, ...]]  # per valve b_1 … b_nb, engineering units per %
    delay: Mapping[str, int]  # per valve t_d, samples
    bias: float  # constant of the equation, engineering units
    noise_std: float  # standard deviation of the innovations, engineering units
    fit_one_step: float  # NRMSE fit of the one-step prediction with the noise model, %
    fit_free_run: float  # NRMSE fit of the free run, 100 (1 − ‖y − ŷ‖ / ‖y − mean y‖), %
    cause: Cause | None = None  # of its oscillation; None where the loop was not closed again

    def free_run(self, stems: Mapping[str, FloatArray], measured: FloatArray) -> FloatArray:
        """Return PV, (N,), driven by stems, (N,), %, alone, its start fitted to that measured.

        Infinite throughout where the model is not stable.
        """
        delays = [self.delay[valve] for valve in self.b]
        drive = driven(self.b.values(), delays, [stems[valve] for valve in self.b], self.bias)
        return fitted_free_run(self.a, drive, measured)

    def equation(self, noise: Noise) -> ArxOutput:
        """Return the equation as a process takes it, with this noise."""
        return ArxOutput(self.name, self.a, self.b, self.delay, self.bias, noise)

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``identify --json``."""
        return {
            "name": self.name,
            "a": list(self.a),
            "b": {valve: list(values) for valve, values in self.b.items()},
            "delay": dict(self.delay),
            "bias": self.bias,
            "noise_std": self.noise_std,
            "fit_one_step": self.fit_one_step,
            "fit_free_run": self.fit_free_run,
            "cause": None if self.cause is None else self.cause.to_dict(),
        }


@dataclasses.dataclass(frozen=True)
class OrderRow:
    """One choice of orders, friction as the search found it."""

    output_order: int  # output_order, input_order: n_a and n_b
    input_order: int
    # aic, bic: information criteria of the linear parts under the noise model; only differences
    # count
    aic: float
    bic: float


@dataclasses.dataclass(frozen=True)
class Identification:
    """Everything one record says about its valves.

    Attributes:
        status: ok, or why there is no trustworthy model.
        reason: one sentence; empty when ok.
        method: name of the search.
        samples, sample_time: of the record, seconds.
        seconds: wall time spent.
        valves, outputs: estimates in the order of the record.
        stem: estimated stem positions, shape (N, m), %, read-only.
        notes: remarks for people.
        orders: all orders that were compared.
        row_samples: samples that are one row where the friction was judged.

    Examples:
        >>> from stiction_ros import IdentificationOptions, LoopModel
        >>> from stiction_ros import find_config, identify, simulate
        >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=400)
        >>> found = identify(record, IdentificationOptions(output_order=1, delay=(2, 2)))
        >>> found.status.value, found.samples, found.stem.shape
        ('ok', 400, (400, 1))
        >>> found
        <Identification ok: V1 sticky; 400 samples>
        >>> print(found.summary().splitlines()[0])
        400 samples of 1 s, 400 s of operation
    """

    status: FitStatus
    reason: str
    method: str
    samples: int
    sample_time: float
    seconds: float
    valves: tuple[ValveEstimate, ...]
    outputs: tuple[OutputModel, ...]
    stem: FloatArray
    notes: tuple[str, ...] = ()
    orders: tuple[OrderRow, ...] = ()
    row_samples: int = 1

    def __repr__(self) -> str:
        valves = ", ".join(f"{valve.name} {valve.verdict}" for valve in self.valves)
        return f"<Identification {self.status}: {valves or self.reason}; {self.samples} samples>"

    @property
    def rows(self) -> dict[str, tuple[float, float, float]]:
        """What the valves say, as :attr:`ValveEstimate.rows`."""
        return {name: row for valve in self.valves for name, row in valve.rows.items()}

    def summary(self) -> str:
        """Return verdicts, frictions, what to do next and the process as text of 80 columns."""
        from stiction_ros.identification.answer.summary import summary  # stands above

        return summary(self)

    def _repr_html_(self) -> str:
        from stiction_ros.identification.answer.summary import as_html  # stands above

        return as_html(self)

    def __rich__(self) -> Any:
        from stiction_ros.identification.answer.summary import as_table  # stands above

        return as_table(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``identify --json`` but for ``record``."""
        model: dict[str, Any] = {
            "kind": "arx",
            "status": self.status.value,
            "reason": self.reason,
            "method": self.method,
            "notes": list(self.notes),
        }
        if self.orders:
            model["orders"] = [dataclasses.asdict(row) for row in self.orders]
        return {
            "samples": self.samples,
            "sample_time": self.sample_time,
            "seconds": self.seconds,
            "model": model,
            "rate": {"sample_time": self.sample_time, "used": self.row_samples * self.sample_time},
            "valves": [valve.to_dict() for valve in self.valves],
            "outputs": [output.to_dict() for output in self.outputs],
        }
