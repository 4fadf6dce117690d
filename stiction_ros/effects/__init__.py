"""Behaviours of valves, sensors and disturbances: one effect, one file.

To add an effect, write its file and name its class in :data:`BEHAVIOURS`.

Examples:
    >>> from stiction_ros import effects
    >>> valve = effects.from_mapping({"effect": "stiction", "law": "he", "f_s": 5, "f_d": 2})
    >>> valve.jump, valve.to_mapping()["law"]
    (3.0, 'he')
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stiction_ros.effects.backlash import Backlash
from stiction_ros.effects.behaviour import (
    Behaviour,
    DrivenByNoise,
    Filter,
    FloatArray,
    LinearFilter,
    Memory,
    Parameter,
)
from stiction_ros.effects.bias_step import BiasStep
from stiction_ros.effects.characteristic import Characteristic
from stiction_ros.effects.delay import ExtraDelay, TimeShift
from stiction_ros.effects.disturbance import (
    DriftDisturbance,
    SineDisturbance,
    StepDisturbance,
)
from stiction_ros.effects.disturbance_coloured import ColouredDisturbance
from stiction_ros.effects.freeze import Freeze
from stiction_ros.effects.friction_parameters import FrictionLaw
from stiction_ros.effects.lag import ExtraPole, Lag
from stiction_ros.effects.leak import Leak
from stiction_ros.effects.offset import Offset
from stiction_ros.effects.process_gain import ProcessGain
from stiction_ros.effects.quantisation import Quantisation
from stiction_ros.effects.saturation import Clip, Saturation
from stiction_ros.effects.slew import Slew
from stiction_ros.effects.stiction_choudhury import ChoudhuryStiction
from stiction_ros.effects.stiction_he import HeStiction
from stiction_ros.effects.stiction_he_smoothed import SmoothedHeStiction
from stiction_ros.effects.stiction_kano import KanoStiction
from stiction_ros.effects.stiction_kano_smoothed import SmoothedKanoStiction
from stiction_ros.effects.stiction_semi_physical import SemiPhysicalStiction
from stiction_ros.effects.stiction_xch import XchStiction
from stiction_ros.effects.tuning import Tuning
from stiction_ros.errors import InputError

BEHAVIOURS: tuple[type[Behaviour], ...] = (
    HeStiction,
    SmoothedHeStiction,
    SemiPhysicalStiction,
    KanoStiction,
    SmoothedKanoStiction,
    ChoudhuryStiction,
    XchStiction,
    Backlash,
    Slew,
    Lag,
    Saturation,
    Characteristic,
    Offset,
    ProcessGain,
    ExtraDelay,
    ExtraPole,
    Leak,
    StepDisturbance,
    DriftDisturbance,
    SineDisturbance,
    ColouredDisturbance,
    BiasStep,
    Quantisation,
    Freeze,
    Clip,
    Tuning,
    TimeShift,
)

__all__ = [
    "BEHAVIOURS",
    "Backlash",
    "Behaviour",
    "BiasStep",
    "Characteristic",
    "ChoudhuryStiction",
    "Clip",
    "ColouredDisturbance",
    "DriftDisturbance",
    "DrivenByNoise",
    "ExtraDelay",
    "ExtraPole",
    "Filter",
    "FloatArray",
    "Freeze",
    "FrictionLaw",
    "HeStiction",
    "KanoStiction",
    "Lag",
    "Leak",
    "LinearFilter",
    "Memory",
    "Offset",
    "Parameter",
    "ProcessGain",
    "Quantisation",
    "Saturation",
    "SemiPhysicalStiction",
    "SineDisturbance",
    "Slew",
    "SmoothedHeStiction",
    "SmoothedKanoStiction",
    "StepDisturbance",
    "TimeShift",
    "Tuning",
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
