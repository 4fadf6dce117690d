"""Which formulation a mode stands for."""

import math

from stiction_ros.control.belief import ValveBeliefs
from stiction_ros.control.design import ControlDesign
from stiction_ros.control.embedding import EmbeddingMpc
from stiction_ros.control.formulation import Formulation
from stiction_ros.control.result import ControlMode
from stiction_ros.control.unaware import InversionMpc, UnawareMpc
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError

ROUNDING = 1e-9  # of a rate limit, by which a kick may exceed it


def formulation_of(
    mode: ControlMode, design: ControlDesign, unaware: UnawareMpc, valves: ValveBeliefs
) -> Formulation | None:
    """Return the formulation of ``mode``; None for ``hold``, which plans nothing.

    Raises:
        InputError: the formulation cannot be set up for these valves, or the rate limit of an OP
            is below what the smallest jump of its valve takes.
    """
    known, others = valves.frictions, design.others
    if mode is ControlMode.HOLD:
        return None
    aware = mode in (ControlMode.EMBEDDING, ControlMode.INVERSION)
    if aware and others is not None:
        return others(mode, unaware, known)
    if mode is ControlMode.EMBEDDING:
        weights, spreads = design.embedding, valves.spreads
        embedding = EmbeddingMpc(design.model, weights, design.limits, known, design.jumps, spreads)
        _check_rates(design, embedding.least_kicks)
        return embedding
    if mode is ControlMode.INVERSION:
        inversion = InversionMpc(unaware, known)
        _check_rates(design, inversion.least_kicks)
        return inversion
    return unaware


def _check_rates(design: ControlDesign, kicks: FloatArray) -> None:
    """Raise InputError where OP may not move by the ``kicks`` (m,), %, that its valve needs."""
    for j, (kick, limit) in enumerate(zip(kicks, design.limits.move, strict=True)):
        if kick > limit * (1.0 + ROUNDING):
            name = design.valve_names[j] if design.valve_names else f"valve {j + 1}"
            enough = math.ceil(100.0 * kick) / 100.0
            way_out = "leave the controller unaware (mode: unaware)"
            raise InputError(
                f"{limit:g} % per sample is less than the kick that moves {name}, {kick:.3g} %",
                where="op_rate_limits",
                fix=f"raise it to at least {enough:g}, or {way_out}",
            )
