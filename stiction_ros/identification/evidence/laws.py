"""Each valve's own friction law, where a record tells it from He's.

He's law is searched first. Where two neighbouring rates believe in a friction, the other laws are
searched at the rate that shows more and at its neighbour. What is compared is −2 log of the
marginal likelihood: of two laws the wrong one is ahead by more than 2 log(1 / α) with a probability
of α at most, whatever the laws are, as the mean of a likelihood ratio is 1 under the law in its
denominator. With K laws tried, α is (1 − the level of the intervals) / K. As in the intervals, no
law is rejected for a tenth of what its friction gains. The laws tried have two figures, as He's.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from stiction_ros.effects import FrictionLaw
from stiction_ros.identification.evidence.accepted import MISFIT, accepted
from stiction_ros.identification.evidence.candidate import Candidate
from stiction_ros.identification.evidence.rates import Look, agreement
from stiction_ros.identification.evidence.search import Found, search_again, search_law
from stiction_ros.identification.friction import find_law
from stiction_ros.identification.identification_options import AUTO, IdentificationOptions

Law = type[FrictionLaw]
Looks = tuple[Look, ...]
RIVALS = ("kano", "choudhury")  # compiled laws of f_S and f_D alone, the simpler first
NAMED = (*RIVALS, "xch")  # which gives Kano's stems


def with_own_laws(seen: Looks, options: IdentificationOptions) -> tuple[Looks, tuple[str, ...]]:
    """Return what each rate shows under the law of each valve, and a clause on each that is chosen.

    Args:
        seen: each rate, under the law that the search begins with.
        options: of the search; a law that is given is kept.
    """
    told = [""] * len(seen[0].problem.op)
    for valve in range(len(told)) if options.law == AUTO else ():
        seen, told[valve] = _with_own_law(seen, valve, options)
    return seen, tuple(told)


def _with_own_law(seen: Looks, valve: int, options: IdentificationOptions) -> tuple[Looks, str]:
    # The rate that shows most of those that agree best, and its better neighbour.
    look = agreement(seen, valve).look
    at = next(k for k, one in enumerate(seen) if one is look)
    beside = [k for k in (at - 1, at + 1) if 0 <= k < len(seen)]
    rates = (at, *sorted(beside, key=lambda k: -seen[k].beyond_price(valve))[:1])
    if min(seen[k].beyond_price(valve) for k in rates) <= 0.0:
        return seen, ""
    first = seen[0].problem.laws[valve]
    seeds = _heads((look.found for look in seen), valve)
    rivals: dict[Law, dict[int, Found]] = {}
    for law in map(find_law, reversed(RIVALS)):  # so that the simpler one lacks no seed
        rivals[law] = {k: _searched(seen[k], valve, law, seeds) for k in rates}
        seeds = [*_heads(rivals[law].values(), valve), *seeds]
    price = 2.0 * math.log(len(RIVALS) / (1.0 - options.confidence))
    chosen, best = first, {k: seen[k].found for k in rates}
    for law, found in reversed(rivals.items()):
        gains = [best[k].without[valve].loss - best[k].best.loss for k in rates]
        ahead = [best[k].best.loss - found[k].best.loss for k in rates]
        if all(more > price + MISFIT * gain for more, gain in zip(ahead, gains, strict=True)):
            chosen, best = law, found
    if chosen is first:
        return seen, ""
    gain = min(seen[k].found.best.loss - best[k].best.loss for k in rates)
    clause = f"law {chosen.law} explains PV better than {first.law} by {gain / 2.0:.0f} nats"
    others = [name for name in NAMED if name != chosen.law]
    alike = [name for name in others if _alike(seen[at], valve, find_law(name), best[at].best)]
    if alike:
        clause += f"; {' and '.join(alike)} cannot be told from it by this record"
    return _under(seen, valve, chosen, best, options), clause


def _searched(look: Look, valve: int, law: Law, seeds: Sequence[Candidate]) -> Found:
    return search_law(look.problem.under(valve, law), look.found, valve, seeds)


def _heads(found: Iterable[Found], valve: int) -> list[Candidate]:
    return [head for one in found for head in one.heads(valve)]


def _alike(look: Look, valve: int, law: Law, best: Candidate) -> bool:
    """Tell whether a law gives the very stem of a valve that is best under another one."""
    friction, start = best.friction[valve][None, :], best.starts[valve]
    stems = look.problem.under(valve, law).stems(valve, friction, start)
    return bool(np.allclose(stems[0], best.stems[valve]))


def _under(
    seen: Looks, valve: int, law: Law, known: Mapping[int, Found], options: IdentificationOptions
) -> Looks:
    """Return every rate under the law of a valve, what is best at one tried at the others."""
    seeds = _heads(known.values(), valve)
    own = [known.get(k) or _searched(look, valve, law, seeds) for k, look in enumerate(seen)]
    told = []
    for k, look in enumerate(seen):
        problem = look.problem.under(valve, law)
        found = search_again(problem, own[k], _heads([*own[:k], *own[k + 1 :]], valve))
        held = [accepted(problem, found, j, options.confidence) for j in range(len(problem.op))]
        told.append(dataclasses.replace(look, problem=problem, found=found, accepted=tuple(held)))
    return tuple(told)
