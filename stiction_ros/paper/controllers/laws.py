"""Friction laws that the paper's controllers take: those with a smoothed form and He's inverse.

A plan begins with the valve at rest, so what a moving stem would go on by itself is not planned.
"""

from collections.abc import Sequence
from typing import Any

from stiction_ros.effects import HeStiction, KanoStiction, XchStiction
from stiction_ros.effects.behaviour import Behaviour
from stiction_ros.effects.friction.he_smoothed import smoothed_step
from stiction_ros.effects.friction.kano_smoothed import kano_step
from stiction_ros.errors import InputError

PrintedFriction = HeStiction | KanoStiction | XchStiction


def printed_frictions(frictions: Sequence[Behaviour | None]) -> tuple[PrintedFriction | None, ...]:
    """Return ``frictions`` when the paper's controllers can take all of them; else InputError."""
    known: list[PrintedFriction | None] = []
    for friction in frictions:
        if friction is not None and not isinstance(friction, PrintedFriction):
            raise InputError(
                f"the paper's controllers know He's law, Kano's and XCH's, not {friction.title()}",
                where="formulation",
                fix="use formulation: exact",
            )
        known.append(friction)
    return tuple(known)


def directed(friction: PrintedFriction) -> bool:
    """Return whether the law remembers which way the stem moves."""
    return not isinstance(friction, HeStiction)


def smoothed_stem(
    friction: PrintedFriction,
    before: tuple[Any, Any, Any],
    op: Any,
    figures: tuple[Any, Any, Any],
    tanh: Any,
) -> tuple[Any, Any]:
    """Return the next stem and direction of motion by the smoothed law of ``friction``.

    ``before`` are stem, OP and direction one sample ago, ``figures`` f_S, f_D and τ; all are
    numbers or CasADi expressions, as ``tanh`` takes them.
    """
    if directed(friction):
        found: tuple[Any, Any] = kano_step(before, op, figures, tanh)
        return found
    static, dynamic, smoothing = figures
    return smoothed_step(before[0], op, (static, dynamic), smoothing, tanh), before[2]
