"""What a loop model says of the friction of its valves, and how surely."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from stiction_ros.control import FrictionSpread
from stiction_ros.effects.behaviour import Behaviour
from stiction_ros.errors import InputError, is_finite
from stiction_ros.loop import LoopModel
from stiction_ros.loop.yaml_reading import parse_limited

ROUNDING = 1e-9  # share by which f_S that S and J tell may miss what it was made of
ALIKE = 0.02  # share by which two estimates of one friction may differ
WHERE = "loop_model"
LONGEST_DELAY = 1000  # samples; a process needs a state for each
LONGEST_REASON = 200  # characters of a refusal: names in it come from the text


def frictions_of(model: LoopModel, valves: tuple[str, ...]) -> tuple[Behaviour | None, ...]:
    """Return the stiction of each of ``valves`` that ``model`` knows, None for the others."""
    found: Mapping[str, Behaviour | None] = {
        valve.name: next((e for e in valve.effects if e.effect == "stiction"), None)
        for valve in model.valves
    }
    return tuple(found.get(name) for name in valves)


def spreads_of(model: LoopModel, valves: tuple[str, ...]) -> tuple[FrictionSpread | None, ...]:
    """Return how far f_S and f_D of each of ``valves`` may be off, None where not known.

    The intervals stand in the model's provenance, as the estimator writes it:
    ``{valve: V1, effect: stiction, f_s_interval: [low, high], f_d_interval: [low, high]}``. The
    last entry of a valve counts, and only if the value in force lies within its intervals.
    """
    frictions = dict(zip(valves, frictions_of(model, valves), strict=True))
    found: dict[str, FrictionSpread | None] = {}
    for entry in model.provenance:
        friction = frictions.get(str(entry.get("valve")))
        if friction is not None and entry.get("effect") == "stiction":
            found[str(entry["valve"])] = _spread(friction, entry)
    return tuple(found.get(name) for name in valves)


def alike(
    one: Sequence[Behaviour | None], other: Sequence[Behaviour | None], share: float = ALIKE
) -> bool:
    """Whether two sets of frictions are of the same laws, and all parameters within ``share``.

    The share is that of the law's largest parameter.
    """
    for a, b in zip(one, other, strict=True):
        if type(a) is not type(b):
            return False
        if a is None or b is None:
            continue
        names = [entry.attribute for entry in a.parameters()]
        x, y = ([abs(getattr(law, name)) for name in names] for law in (a, b))
        off = max(abs(p - q) for p, q in zip(x, y, strict=True))
        if off > share * max(*x, *y):
            return False
    return True


def scaled(law: Behaviour, factor: float) -> Behaviour:
    """Return ``law`` with all its parameters in % ``factor`` times as large."""
    sizes = {
        entry.attribute: factor * getattr(law, entry.attribute)
        for entry in law.parameters()
        if entry.unit == "%"
    }
    return dataclasses.replace(law, **sizes)


def _spread(friction: Behaviour, entry: Mapping[str, Any]) -> FrictionSpread | None:
    widths = []
    for attribute, key in (("static_friction", "f_s"), ("dynamic_friction", "f_d")):
        value, interval = getattr(friction, attribute), entry.get(f"{key}_interval")
        if not isinstance(interval, list | tuple) or len(interval) != 2:
            return None
        low, high = interval
        if not all(isinstance(end, int | float) and is_finite(end) for end in (low, high)):
            return None
        beyond = max(low - value, value - high, 0.0)
        if beyond > ROUNDING * max(abs(high), 1.0):
            return None
        widths.append(max(value - low, high - value))
    return FrictionSpread(*widths)


def read_offer(text: str, own: LoopModel) -> LoopModel:
    """Return the loop model that ``text`` holds, offered to a controller built on ``own``.

    It may take a while and is done beside the loop.

    Raises:
        InputError: too much text, no loop model, one of another sample time, or a process with
            a delay that no loop has; the reason is short whatever the text is.
    """
    document = parse_limited(text, WHERE)
    if isinstance(document, Mapping):
        if document.get("sample_time") != own.sample_time:
            raise InputError(
                f"its sample time is not {own.sample_time:g} s", where=f"{WHERE}: sample_time"
            )
        delays = _delays(document.get("process"), own.sample_time)
        if any(not delay <= LONGEST_DELAY for delay in delays):
            raise InputError(
                f"a delay of more than {LONGEST_DELAY} samples", where=f"{WHERE}: process"
            )
    try:
        return LoopModel.from_mapping(document, WHERE)
    except InputError as error:
        reason = str(error)
        if len(reason) <= LONGEST_REASON:
            raise
        raise InputError(f"{reason[:LONGEST_REASON]}…") from None


def _delays(value: Any, sample_time: float) -> Iterator[float]:
    """Yield all numbers below ``delay`` and ``dead_time``, wherever they stand, in samples."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if key in ("delay", "dead_time"):
                found = inner.values() if isinstance(inner, Mapping) else (inner,)
                unit = sample_time if key == "dead_time" else 1.0
                yield from (number / unit for number in found if isinstance(number, int | float))
            yield from _delays(inner, sample_time)
    elif isinstance(value, list):
        for inner in value:
            yield from _delays(inner, sample_time)
