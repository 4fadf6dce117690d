"""What every effect is: a named behaviour with parameters, units and bounds.

A friction law, a hidden fault and a candidate of the discrepancy catalogue are the same
thing: a frozen dataclass in a file of its own that derives from :class:`Behaviour`.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from stiction_ros.errors import InputError, is_finite

FloatArray = NDArray[np.float64]
Memory = float | tuple[float, ...]
NO_SAMPLE = -1.0  # in a memory that holds the time of the last sample: there was none


def starts(start: FloatArray | float, points: int) -> FloatArray:
    """Return where each point of a grid had rested, shape (G,), from one value or one each."""
    return np.broadcast_to(np.asarray(start, dtype=float), points).copy()


def elapsed(before: float, now: float) -> float:
    """Return the seconds since the last sample; none for the first one."""
    return 0.0 if before == NO_SAMPLE else now - before


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One parameter of a behaviour, as YAML and reports name it.

    Attributes:
        key: name in YAML, such as ``f_s``.
        attribute: name in Python, such as ``static_friction``.
        unit: engineering unit, ``%`` of travel for valves.
        low, high: closed range of accepted values.
        description: one line for people.
    """

    key: str
    attribute: str
    unit: str
    low: float
    high: float
    description: str


def parameter(
    key: str,
    unit: str,
    description: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    default: Any = dataclasses.MISSING,
) -> Any:
    """Declare a dataclass field that is a :class:`Parameter` of its behaviour."""
    metadata = {"parameter": (key, unit, low, high, description)}
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True)
class Behaviour(ABC):
    """An effect on one signal, one sample at a time.

    Subclasses set :attr:`effect` (and :attr:`law` where one effect has several), declare
    their parameters with :func:`parameter` and write :meth:`step`.

    Attributes:
        effect: name in YAML.
        law: which of several laws of one effect, or None.
        places: where it can act: ``valve``, ``process``, ``disturbance``, ``sensor``, ``data``.
        signature: what a record of the loop shows, one sentence.
        minimum_data: what a record must hold to tell its size, one sentence.
        confusable: places and effects, such as ``sensor lag``, that look alike.

    Raises:
        InputError: a parameter that is not finite or lies outside its range.

    Examples:
        >>> from stiction_ros import effects
        >>> valve = effects.from_mapping({"effect": "backlash", "band": 2.0})
        >>> memory = valve.rest(50.0)
        >>> memory, stem = valve.step(memory, 53.0)  # OP leads by half the band
        >>> stem, [entry.key for entry in valve.parameters()]
        (52.0, ['band'])
    """

    effect: ClassVar[str]
    law: ClassVar[str | None] = None
    # For the page of the catalogue, docs/effects.md.
    places: ClassVar[tuple[str, ...]] = ()
    signature: ClassVar[str] = ""
    minimum_data: ClassVar[str] = ""
    confusable: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        for entry in self.parameters():
            value = getattr(self, entry.attribute)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise InputError(f"{value!r} is no number", where=entry.key)
            if not is_finite(value):
                raise InputError("the value is not finite", where=entry.key)
            if not entry.low <= value <= entry.high:
                raise InputError(
                    f"{value:g} lies outside [{entry.low:g}, {entry.high:g}] {entry.unit}",
                    where=entry.key,
                )
            object.__setattr__(self, entry.attribute, float(value))

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the parameters in the order of their declaration."""
        return tuple(
            Parameter(key, field.name, unit, low, high, description)
            for field in dataclasses.fields(cls)
            if "parameter" in field.metadata
            for key, unit, low, high, description in [field.metadata["parameter"]]
        )

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """Build from YAML keys; unknown and missing keys raise :class:`InputError`.

        Args:
            values: parameters by their keys in YAML, without ``effect`` and ``law``.
        """
        known = {entry.key: entry.attribute for entry in cls.parameters()}
        for key in values:
            if key not in known:
                raise InputError(
                    f"unknown key {key!r} for effect {cls.title()}",
                    fix=f"known keys: {', '.join(known)}",
                )
        required = {
            field.name for field in dataclasses.fields(cls) if field.default is dataclasses.MISSING
        }
        for key, attribute in known.items():
            if attribute in required and key not in values:
                raise InputError(f"effect {cls.title()} lacks {key!r}", fix=f"add {key}: VALUE")
        return cls(**{known[key]: value for key, value in values.items()})

    def to_mapping(self) -> dict[str, Any]:
        """Return the YAML mapping that :func:`stiction_ros.effects.from_mapping` reads."""
        head: dict[str, Any] = {"effect": self.effect}
        if self.law is not None:
            head["law"] = self.law
        return head | {entry.key: getattr(self, entry.attribute) for entry in self.parameters()}

    @classmethod
    def title(cls) -> str:
        """Return the name for people: ``stiction (he)``, ``backlash``."""
        return cls.effect if cls.law is None else f"{cls.effect} ({cls.law})"

    def rest(self, value: float) -> Memory:
        """Return the memory after the signal has rested at ``value`` for long."""
        return value

    @abstractmethod
    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        """Advance one sample.

        Args:
            memory: what :meth:`rest` or the last step returned.
            value: the incoming signal.
            time: seconds since the first sample.

        Returns:
            The new memory and the outgoing signal.
        """

    def simulate(
        self, values: FloatArray, start: float | None = None, sample_time: float = 1.0
    ) -> FloatArray:
        """Run :meth:`step` over ``values`` from rest at ``start`` and return what comes out.

        Args:
            values: the incoming signal, shape (N,).
            start: where it had rested before; None for its first value.
            sample_time: s.
        """
        out = np.empty(len(values))
        memory = self.rest(float(values[0]) if start is None else start)
        for k, value in enumerate(values.tolist()):
            memory, out[k] = self.step(memory, value, k * sample_time)
        return out


@runtime_checkable
class SimulatesGrid(Protocol):
    """A behaviour that simulates many parameter sets at once."""

    @classmethod
    def simulate_grid(
        cls,
        grid: FloatArray,
        values: FloatArray,
        start: FloatArray | float,
        sample_time: float = 1.0,
    ) -> FloatArray:
        """Return outputs, shape (N, G), for ``grid`` of shape (G, parameters).

        Args:
            grid: one set of parameters a row.
            values: the incoming signal, shape (N,).
            start: where it had rested before, one for all or shape (G,).
            sample_time: s; only behaviours with a time of their own take notice.
        """
        ...


@runtime_checkable
class LinearFilter(Protocol):
    """A behaviour that is linear and does not change with time."""

    def filter(self, sample_time: float) -> Filter:
        """Return the behaviour as a filter of samples ``sample_time`` seconds apart."""
        ...


@dataclasses.dataclass(frozen=True)
class Filter:
    """z⁺ = A z + B x, y = C z + D x with z = 0 at rest at x = 0.

    Attributes:
        a, b, c: shapes (n, n), (n,), (n,); n may be 0.
        d: direct gain.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: float


@runtime_checkable
class DrivenByNoise(Protocol):
    """A behaviour that is random: whoever simulates it draws its numbers."""

    def step_with(
        self, memory: Memory, value: float, time: float, normal: float
    ) -> tuple[Memory, float]:
        """Advance one sample with ``normal`` drawn from N(0, 1)."""
        ...


@runtime_checkable
class Invertible(Protocol):
    """A behaviour whose input can be chosen so that its output takes a wanted value."""

    def inverse(self, memory: Memory, wanted: float) -> float:
        """Return the input that brings the output as near to ``wanted`` as it can be."""
        ...


@runtime_checkable
class Symbolic(Protocol):
    """A behaviour with a differentiable CasADi expression of its step."""

    def expression(self, memory: Any, value: Any) -> Any:
        """Return the next output as a CasADi expression."""
        ...
