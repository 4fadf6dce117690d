"""Loops in which one thing or two are hidden, for the discrepancy workflow to find.

They are simulated in continuous time, from published transfer functions and balances, by code
that shares nothing with what is judged by them.
"""

from stiction_studies.field.hidden.effect import Effect, Name
from stiction_studies.field.hidden.hidden_loop import FAMILIES, GIVEN, HiddenLoop, hidden_loop

__all__ = ["FAMILIES", "GIVEN", "Effect", "HiddenLoop", "Name", "hidden_loop"]
