"""What every effect is: a frozen dataclass with parameters, units and bounds, in its own file."""

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from stiction_ros.checks import number
from stiction_ros.effects.seen import Axis, Seen
from stiction_ros.effects.seen import FloatArray as FloatArray
from stiction_ros.errors import InputError

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Memory = float | tuple[float, ...]
Start = FloatArray | float  # where a signal had rested: one value, or one for each point of a grid
NO_SAMPLE = -1.0  # in a memory that holds the time of the last sample: there was none


def starts(start: Start, points: int) -> FloatArray:
    """Return where each point of a grid had rested, shape (G,), from one value or one each."""
    return np.broadcast_to(np.asarray(start, dtype=float), points).copy()


def elapsed(before: float, now: float) -> float:
    """Return the seconds since the last sample; none for the first one."""
    return 0.0 if before == NO_SAMPLE else now - before


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One parameter of a behaviour, as YAML and reports name it."""

    key: str  # name in YAML, such as ``f_s``
    attribute: str  # name in Python, such as ``static_friction``
    unit: str  # engineering unit, ``%`` of travel for valves
    low: float  # low, high: closed range of accepted values
    high: float
    description: str  # one line for people


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
    their parameters with :func:`parameter` and write :meth:`step`. All else may be left out: it
    is then simulated, and ``stiction gap`` says that it does not consider it.

    Attributes:
        effect: name in YAML.
        law: which of several laws of one effect, or None.
        places: where it can act: ``valve``, ``process``, ``disturbance``, ``sensor``, ``data``.
        experiment: what to record so that it shows, in the imperative.
        separation: what tells it from what looks alike, in the imperative.
        family: effects of one family at one place are told apart by a test of their own, or
            serve for each other: ``friction``, ``lag``.
        least: size of its first figure from which on it matters.
        absorbed: whether another linear process would do as well.
        bends: whether it bends the way from OP to PV, without memory.
        in_values: whether the values of PV show it without any model.
        kernel: function of :mod:`.grid_kernels` that does a whole grid at once; empty for none.
        told_of_step: members that hold for one :meth:`step` alone, not for that of a subclass.
        not_searched: why ``stiction gap`` does not search it, one clause.

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
    places: ClassVar[tuple[str, ...]] = ()
    # For `stiction gap`.
    experiment: ClassVar[str] = ""
    separation: ClassVar[str] = ""
    family: ClassVar[str] = ""
    least: ClassVar[float] = 0.0
    absorbed: ClassVar[bool] = False
    bends: ClassVar[bool] = False
    in_values: ClassVar[bool] = False
    not_searched: ClassVar[str] = "it names no axes on which its figures are searched"
    kernel: ClassVar[str] = ""
    told_of_step: ClassVar[tuple[str, ...]] = ("kernel", "simulate_grid", "filter")

    def __init_subclass__(cls) -> None:
        """Take back what a base class said of its own :meth:`step` where this one has another."""
        super().__init_subclass__()
        if "step" not in cls.__dict__:
            return
        for name in cls.told_of_step:
            if name not in cls.__dict__:
                safe = [kind.__dict__[name] for kind in cls.__mro__ if name in kind.__dict__]
                setattr(cls, name, safe[-1])

    def __post_init__(self) -> None:
        for entry in self.parameters():
            value = getattr(self, entry.attribute)
            low, high, unit = entry.low, entry.high, entry.unit if entry.unit != "1" else ""
            checked = number(value, entry.key, low=low, high=high, unit=unit)
            object.__setattr__(self, entry.attribute, checked)

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
        """Build from ``values`` by YAML keys; unknown and missing keys raise InputError."""
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
        """Advance one sample; return the new memory and the outgoing signal.

        Args:
            memory: what :meth:`rest` or the last step returned.
            value: the incoming signal.
            time: seconds since the first sample.
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

    @classmethod
    def simulate_grid(
        cls, grid: FloatArray, values: FloatArray, start: Start, sample_time: float = 1.0
    ) -> FloatArray:
        """Return outputs, shape (N, G), for ``grid`` of shape (G, parameters).

        By :attr:`kernel`; without one, one point after the other, by :meth:`step`.

        Args:
            grid: one set of parameters a row.
            values: the incoming signal, shape (N,).
            start: where it had rested before, one for all or shape (G,).
            sample_time: s; only behaviours with a time of their own take notice.
        """
        begun = starts(start, len(grid))
        if cls.kernel:
            from stiction_ros.effects import grid_kernels  # compiled: slow to import

            figures = cls.kernel_figures(grid, sample_time)
            stems = getattr(grid_kernels, cls.kernel)
            return np.asarray(stems(*figures, np.asarray(values, dtype=float), begun))
        rows = zip(grid.tolist(), begun.tolist(), strict=True)
        return np.stack([cls(*row).simulate(values, at, sample_time) for row, at in rows], axis=1)

    @classmethod
    def kernel_figures(cls, grid: FloatArray, sample_time: float) -> Sequence[FloatArray]:
        """Return what :attr:`kernel` takes of each point of a grid, shape (G,) each.

        These are the parameters, unless a behaviour says otherwise; those that the grid lacks are
        at their defaults.
        """
        figures = [np.ascontiguousarray(column) for column in grid.T]
        defaults = {field.name: field.default for field in dataclasses.fields(cls)}
        for entry in cls.parameters()[len(figures) :]:
            figures.append(np.full(len(grid), defaults[entry.attribute]))
        return figures

    def filter(self, sample_time: float) -> "Filter | None":
        """Return the filter of samples ``sample_time`` s apart; None if not linear, or changing."""
        return None

    @classmethod
    def axes(cls, seen: Seen) -> tuple[Axis, ...]:
        """Return on which figures ``stiction gap`` searches it: one per parameter, in order.

        It would act on the signal ``seen``; without axes :attr:`not_searched` says why.
        """
        return ()

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        """Return figures of engineering size for a ``seen`` signal, in the order of axes.

        ``stiction gap`` says of a record whether an effect of this size would show in it.
        """
        return tuple(
            float(axis.outer(np.array([0.5 * (axis.inner(axis.low) + axis.inner(axis.high))]))[0])
            for axis in cls.axes(seen)
        )


@dataclasses.dataclass(frozen=True)
class Filter:
    """z⁺ = A z + B x, y = C z + D x with z = 0 at rest at x = 0."""

    a: FloatArray  # a, b, c: shapes (n, n), (n,), (n,); n may be 0
    b: FloatArray
    c: FloatArray
    d: float  # direct gain


@dataclasses.dataclass(frozen=True)
class DrivenByNoise(Behaviour):
    """A random wave w: whoever simulates it draws its numbers.

    A plant takes :meth:`step_with` in the place of ``step`` and draws from its own seed, the same
    numbers in every run of that seed. ``step`` says what it does where nothing is drawn: of a wave
    at rest nothing is expected. The memory is (w, time of the last sample).
    """

    places: ClassVar[tuple[str, ...]] = ("load", "disturbance")

    def rest(self, value: float) -> Memory:
        return (0.0, NO_SAMPLE)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        return self.step_with(memory, value, time, 0.0)

    @abstractmethod
    def step_with(
        self, memory: Memory, value: float, time: float, normal: float
    ) -> tuple[Memory, float]:
        """Advance one sample with ``normal`` drawn from N(0, 1)."""
