"""Behaviours of valves, sensors and disturbances: one effect, one file.

To add an effect, write its file; :mod:`.discovery` says where it is looked for.

Examples:
    >>> from stiction_ros import effects
    >>> valve = effects.from_mapping({"effect": "stiction", "law": "he", "f_s": 5, "f_d": 2})
    >>> valve.jump, valve.to_mapping()["law"]
    (3.0, 'he')
"""

from collections.abc import Mapping
from typing import Any

from stiction_ros.effects.behaviour import Behaviour as Behaviour
from stiction_ros.effects.behaviour import DrivenByNoise as DrivenByNoise
from stiction_ros.effects.behaviour import Filter as Filter
from stiction_ros.effects.behaviour import Memory as Memory
from stiction_ros.effects.behaviour import Parameter as Parameter
from stiction_ros.effects.behaviour import parameter as parameter
from stiction_ros.effects.data.time_shift import TimeShift as TimeShift
from stiction_ros.effects.data.tuning import Tuning as Tuning
from stiction_ros.effects.discovery import behaviours as behaviours
from stiction_ros.effects.discovery import register as register
from stiction_ros.effects.disturbance.coloured import ColouredDisturbance as ColouredDisturbance
from stiction_ros.effects.disturbance.drift import DriftDisturbance as DriftDisturbance
from stiction_ros.effects.disturbance.random_walk import (
    RandomWalkDisturbance as RandomWalkDisturbance,
)
from stiction_ros.effects.disturbance.sine import SineDisturbance as SineDisturbance
from stiction_ros.effects.disturbance.square import SquareDisturbance as SquareDisturbance
from stiction_ros.effects.disturbance.step import StepDisturbance as StepDisturbance
from stiction_ros.effects.disturbance.triangle import TriangleDisturbance as TriangleDisturbance
from stiction_ros.effects.friction.choudhury import ChoudhuryStiction as ChoudhuryStiction
from stiction_ros.effects.friction.he import HeStiction as HeStiction
from stiction_ros.effects.friction.kano import KanoStiction as KanoStiction
from stiction_ros.effects.friction.semi_physical import SemiPhysicalStiction as SemiPhysicalStiction
from stiction_ros.effects.friction.stiction import FrictionLaw as FrictionLaw
from stiction_ros.effects.friction.stiction import FrictionPair as FrictionPair
from stiction_ros.effects.friction.stiction import JumpForm as JumpForm
from stiction_ros.effects.friction.stiction import SlipJumpPair as SlipJumpPair
from stiction_ros.effects.friction.stiction import Stiction as Stiction
from stiction_ros.effects.friction.xch import XchStiction as XchStiction
from stiction_ros.effects.process.delay import ExtraDelay as ExtraDelay
from stiction_ros.effects.process.gain import ProcessGain as ProcessGain
from stiction_ros.effects.process.leak import Leak as Leak
from stiction_ros.effects.process.pole import ExtraPole as ExtraPole
from stiction_ros.effects.seen import Axis as Axis
from stiction_ros.effects.seen import FloatArray as FloatArray
from stiction_ros.effects.seen import Seen as Seen
from stiction_ros.effects.sensor.bias_step import BiasStep as BiasStep
from stiction_ros.effects.sensor.clip import Clip as Clip
from stiction_ros.effects.sensor.freeze import Freeze as Freeze
from stiction_ros.effects.sensor.quantisation import Quantisation as Quantisation
from stiction_ros.effects.valve.backlash import Backlash as Backlash
from stiction_ros.effects.valve.characteristic import Characteristic as Characteristic
from stiction_ros.effects.valve.characteristic_cubic import (
    CubicCharacteristic as CubicCharacteristic,
)
from stiction_ros.effects.valve.lag import Lag as Lag
from stiction_ros.effects.valve.offset import Offset as Offset
from stiction_ros.effects.valve.saturation import Saturation as Saturation
from stiction_ros.effects.valve.slew import Slew as Slew
from stiction_ros.errors import InputError

DEFAULT_LAW = "he"  # of stiction, where YAML names none


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
    kinds = behaviours()
    same_effect = [kind for kind in kinds if kind.effect == effect]
    if not same_effect:
        names = sorted({kind.effect for kind in kinds})
        raise InputError(f"unknown effect {effect!r}", fix=f"known effects: {', '.join(names)}")
    if law is None and len(same_effect) == 1:
        return same_effect[0].from_mapping(rest)
    wanted = DEFAULT_LAW if law is None and effect == Stiction.effect else law
    for kind in same_effect:
        if kind.law == wanted:
            return kind.from_mapping(rest)
    laws = ", ".join(str(kind.law) for kind in same_effect)
    raise InputError(f"unknown law {law!r} of effect {effect}", fix=f"known laws: {laws}")


def about(effect: str) -> type[Behaviour]:
    """Return the class that says what is known of an effect, whatever its law."""
    return next((kind for kind in behaviours() if kind.effect == effect), Behaviour)
