"""Reading a loop model that comes over the network."""

from collections.abc import Iterator, Mapping
from typing import Any

from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.loop.yaml_reading import parse_limited

WHERE = "loop_model"
LONGEST_DELAY = 1000  # samples; a process needs a state for each
LONGEST_REASON = 200  # characters of a refusal: names in it come from the text


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
