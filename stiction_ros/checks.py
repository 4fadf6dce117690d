"""Values that came from outside, checked: the one place that says what a usable number is.

Settings and ROS parameters, the keys of YAML files and the parameters of behaviours declare what
they take; all of them are checked here, so that the same mistake is told by the same sentence.
"""

import difflib
import math
from collections.abc import Iterable
from typing import Any, TypeVar

from stiction_ros.errors import InputError, is_finite

T = TypeVar("T")

LONGEST = 40  # characters of a value that an error repeats
LISTED = 20  # choices that an error lists


def number(
    value: Any,
    where: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float = -math.inf,
    unit: str = "",
    whole: bool = False,
    unlimited: bool = False,
) -> Any:
    """Return ``value`` as a float, or as an int where it must be ``whole``.

    Args:
        value: of any type.
        where: file and key, for the error.
        low, high: closed range.
        above: must be exceeded.
        unit: for the error.
        whole: whether only whole numbers count.
        unlimited: whether it may be infinite.

    Raises:
        InputError: no number, not finite, or out of range.
    """
    if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
        kind = "whole number" if whole else "number"
        raise InputError(f"{shown(value)} is no {kind}", where=where, fix=_as_number(value))
    if not is_finite(value) and not (unlimited and isinstance(value, float)):
        raise InputError(f"{shown(value)} is not finite", where=where, fix="give a finite number")
    if not low <= value <= high or (above > -math.inf and value <= above):
        fix = f"use {_range(low, high, above)} {unit}".rstrip()
        raise InputError(f"{value:g} is out of range", where=where, fix=fix)
    return value if whole else float(value)


def one_of(value: object, choices: Iterable[T], where: str, what: str = "value") -> T:
    """Return the choice that ``value`` is: a member of an enumeration also for its text.

    Args:
        value: of any type.
        choices: all that are allowed.
        where: argument or key, for the error.
        what: it should be.

    Raises:
        InputError: it is none of them; the closest one is named.
    """
    known = list(choices)
    for choice in known:
        if isinstance(value, type(choice) | str) and value == choice:
            return choice
    words = [str(choice) for choice in known]
    folded = {word.casefold(): word for word in words}
    near = difflib.get_close_matches(str(value).casefold(), folded, n=1)
    asked = f"; did you mean {folded[near[0]]}?" if near else ""
    more = [f"and {len(words) - LISTED} more"] if len(words) > LISTED else []
    fix = f"use {' | '.join([*words[:LISTED], *more])}{asked}"
    raise InputError(f"unknown {what} {shown(value)}", where=where, fix=fix)


def of_kind(value: object, kind: type[T], where: str, fix: str = "") -> T:
    """Return ``value``; raise an InputError where it is not of a ``kind``, named by ``where``."""
    if not isinstance(value, kind):
        given, wanted = type(value).__name__, kind.__name__
        raise InputError(f"{given} is no {wanted}", where=where, fix=fix or f"give {wanted}(…)")
    return value


def shown(value: Any) -> str:
    """Return ``value`` as an error repeats it: not more than ``LONGEST`` characters."""
    text = repr(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _range(low: float, high: float, above: float) -> str:
    if above > -math.inf:
        return f"> {above:g}"
    if math.isinf(high):
        return f"≥ {low:g}"
    return f"[{low:g}, {high:g}]"


def _as_number(value: Any) -> str:
    """Return how to write a text such as 1e-3, which YAML does not take for a number."""
    try:
        text = repr(float(value)) if isinstance(value, str) else ""
    except ValueError:
        return ""
    return f"write {text if '.' in text else text.replace('e', '.0e')}" if text else ""
