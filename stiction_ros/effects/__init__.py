"""Behaviours of valves, sensors and disturbances: one effect, one file.

To add an effect, write its file and name its class in :data:`BEHAVIOURS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, Parameter
from stiction_ros.effects.disturbance import (
    DriftDisturbance,
    SineDisturbance,
    StepDisturbance,
)
from stiction_ros.effects.friction_parameters import FrictionLaw
from stiction_ros.effects.stiction_choudhury import ChoudhuryStiction
from stiction_ros.effects.stiction_he import HeStiction
from stiction_ros.effects.stiction_he_smoothed import SmoothedHeStiction
from stiction_ros.effects.stiction_kano import KanoStiction
from stiction_ros.effects.stiction_kano_smoothed import SmoothedKanoStiction
from stiction_ros.effects.stiction_semi_physical import SemiPhysicalStiction
from stiction_ros.effects.stiction_xch import XchStiction
from stiction_ros.errors import InputError

BEHAVIOURS: tuple[type[Behaviour], ...] = (
    HeStiction,
    SmoothedHeStiction,
    SemiPhysicalStiction,
    KanoStiction,
    SmoothedKanoStiction,
    ChoudhuryStiction,
    XchStiction,
    StepDisturbance,
    DriftDisturbance,
    SineDisturbance,
)

__all__ = [
    "BEHAVIOURS",
    "Behaviour",
    "ChoudhuryStiction",
    "DriftDisturbance",
    "FloatArray",
    "FrictionLaw",
    "HeStiction",
    "KanoStiction",
    "Memory",
    "Parameter",
    "SemiPhysicalStiction",
    "SineDisturbance",
    "SmoothedHeStiction",
    "SmoothedKanoStiction",
    "StepDisturbance",
    "XchStiction",
    "from_mapping",
]


def from_mapping(values: Mapping[str, Any]) -> Behaviour:
    """Build a behaviour from YAML, such as ``{effect: stiction, law: he, f_s: 5, f_d: 2}``.

    Raises:
        InputError: unknown effect, law or key, or a value out of range.
    """
    if not isinstance(values, Mapping) or "effect" not in values:
        raise InputError(f"{values!r} is no effect", fix="write it as {effect: NAME, ...}")
    rest = dict(values)
    effect = rest.pop("effect")
    law = rest.pop("law", None)
    same_effect = [kind for kind in BEHAVIOURS if kind.effect == effect]
    if not same_effect:
        names = sorted({kind.effect for kind in BEHAVIOURS})
        raise InputError(f"unknown effect {effect!r}", fix=f"known effects: {', '.join(names)}")
    if law is None:
        return same_effect[0].from_mapping(rest)
    for kind in same_effect:
        if kind.law == law:
            return kind.from_mapping(rest)
    laws = ", ".join(str(kind.law) for kind in same_effect)
    raise InputError(f"unknown law {law!r} of effect {effect}", fix=f"known laws: {laws}")
