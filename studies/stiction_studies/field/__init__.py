"""Loops from simulators that share nothing with the rest of the package, to judge it by.

Nothing here imports effects, processes, loop, blind, identification, control, discrepancy or
online; valves, plants, controllers and historians are written anew from what is published.
"""

from stiction_studies.field.field_loop import MANY, FieldLoop, field_loop, with_friction
from stiction_studies.field.truth import Cause, Truth, ValveKind

__all__ = ["MANY", "Cause", "FieldLoop", "Truth", "ValveKind", "field_loop", "with_friction"]
