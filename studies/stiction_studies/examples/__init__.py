"""Loops whose truth is known: the paper's two, a coupled one, and loops without friction."""

from stiction_studies.examples.comparison import Comparison, compare
from stiction_studies.examples.coupled import coupled_loop
from stiction_studies.examples.example import Example
from stiction_studies.examples.healthy import FAMILIES, healthy_loop
from stiction_studies.examples.paper import (
    NOISES,
    PLANTS,
    example1,
    example2,
    example2_of_one_round,
)
from stiction_studies.examples.tally import Finding, tally

__all__ = [
    "FAMILIES",
    "NOISES",
    "PLANTS",
    "Comparison",
    "Example",
    "Finding",
    "compare",
    "coupled_loop",
    "example1",
    "example2",
    "example2_of_one_round",
    "healthy_loop",
    "tally",
]
