"""One record looked at at several rates: every one, two, four and eight samples made one.

Averaging costs a clean record some of its evidence. It brings back friction that the historian has
hidden: samples that are held or drawn between two reports carry no news, yet as rows of their own
they tell the noise model that PV is smooth to the last digit. And it takes away what only looks
like friction because a load moves PV faster than the process could. So an answer counts where two
neighbouring rates give it. What is best at one rate is tried at the others.
"""

from __future__ import annotations

import dataclasses
import itertools

from stiction_ros.identification.evidence.accepted import Accepted, accepted
from stiction_ros.identification.evidence.problem import Problem
from stiction_ros.identification.evidence.search import (
    APART,
    Candidate,
    Found,
    heads,
    search,
    search_again,
)
from stiction_ros.identification.options import IdentificationOptions
from stiction_ros.records.record import Record

RATES = (1, 2, 4, 8)
LEAST_ROWS = 120  # that are left at a rate
ROUNDS = 2  # in which rates hand each other what they found
SEEDS = 2  # frictions of each rate that are tried at the others
ALIKE = 1.5
"""Factor between the bands of two rates that may be one: averaging hides what OP does within a
row, and the friction with it."""


@dataclasses.dataclass(frozen=True)
class Look:
    """What one rate shows.

    Attributes:
        problem: the record at this rate.
        found: by the search.
        accepted: per valve, frictions that are not rejected.
    """

    problem: Problem
    found: Found
    accepted: tuple[Accepted, ...]


@dataclasses.dataclass(frozen=True)
class Agreement:
    """What two neighbouring rates say of one valve.

    Attributes:
        look: the one of the two with more evidence.
        gain: the lesser of both gains of friction, −2 log of the marginal likelihood.
        alike: whether the bands that they accept overlap, but for :data:`ALIKE`.
    """

    look: Look
    gain: float
    alike: bool


def looks(record: Record, options: IdentificationOptions) -> tuple[Look, ...]:
    """Return what each rate shows for which enough rows are left, the record as it is first."""
    rates = [rate for rate in RATES if rate == 1 or len(record) // rate >= LEAST_ROWS]
    problems = [Problem.of(record, options.law, rate, options.delay[0]) for rate in rates]
    found = [search(problem) for problem in problems]
    for _ in range(ROUNDS):
        seeds = [_heads(*one) for one in zip(problems, found, strict=True)]
        for k, problem in enumerate(problems):
            others = [seed for other, row in enumerate(seeds) if other != k for seed in row]
            found[k] = search_again(problem, found[k], others)
    seen = []
    for problem, one in zip(problems, found, strict=True):
        valves = range(len(record.valves))
        held = tuple(accepted(problem, one, j, options.confidence) for j in valves)
        seen.append(Look(problem, one, held))
    return tuple(seen)


def _heads(problem: Problem, found: Found) -> list[Candidate]:
    """Return the candidates of one rate that are worth a trial at the others."""
    limits = enumerate(problem.limit)
    return [one for j, limit in limits for one in heads(found, j, SEEDS, APART * float(limit))]


def agreement(seen: tuple[Look, ...], valve: int) -> Agreement:
    """Return the neighbouring rates that agree best on a valve's friction."""
    if len(seen) == 1:
        return Agreement(seen[0], seen[0].accepted[valve].gain, True)
    pairs = []
    for two in itertools.pairwise(seen):
        held = [look.accepted[valve] for look in two]
        low, high = max(one.band[0] for one in held), min(one.band[1] for one in held)
        gains = [one.gain for one in held]
        pairs.append(Agreement(two[gains.index(max(gains))], min(gains), low <= ALIKE * high))
    return max(pairs, key=lambda pair: (pair.alike, pair.gain))
