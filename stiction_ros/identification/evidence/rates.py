"""One record looked at at several rates: every one, two, four and eight samples made one.

Where a sensor refreshes PV at regular times only, these are one, two, four and eight refreshes.

Averaging costs a clean record some of its evidence. It brings back friction that the historian has
hidden: samples that are held or drawn between two reports carry no news, yet as rows of their own
they tell the noise model that PV is smooth to the last digit. And it takes away what only looks
like friction because a load moves PV faster than the process could. So an answer counts where two
neighbouring rates give it. What is best at one rate is tried at the others.

A rate sees a response for as many rows as it has taps. Where the process goes on beyond that, it
is no longer among the processes that are tried, and friction makes up for what they lack: such a
rate has a say only where all coarser ones, one of which sees the end, find friction as well.

Where a wave from outside may be in an output, all this is done once more beside it, and at each
rate the better of both counts, with and without friction alike.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from stiction_ros.identification.closed_loop.tuning import tunings
from stiction_ros.identification.evidence.accepted import Accepted, accepted
from stiction_ros.identification.evidence.candidate import Candidate
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.further import settled
from stiction_ros.identification.evidence.outside_waves import outside_wave
from stiction_ros.identification.evidence.search import Found, better, search, search_again
from stiction_ros.identification.evidence.sensor_hold import refresh, restored
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.linear.response_prior import FREE
from stiction_ros.identification.problem.preparation import PART, liveliest_begin
from stiction_ros.records.record import Record

RATES = (1, 2, 4, 8)
LEAST_ROWS = 120  # that are left at a rate
RATE_ROUNDS = 2  # in which rates hand each other what they found
OLDEST = 2.0  # rows from one report to the next, at most, of a rate that may call a valve healthy
STRAIGHT = 1e-7  # of the range of PV: less is no bend
ALIKE = 1.5
"""Factor between the bands of two rates that may be one: averaging hides what OP does within a
row, and the friction with it."""


PRICE = 17.0
"""−2 log likelihood that friction must gain at two neighbouring rates: what the best of so many
frictions gains on quiet loops without any."""
BESIDE = 10.0
"""What it must gain more where a wave from outside is tried, whose period is chosen as well."""
INEXACT = 0.03
"""Share of a wave's own gain that it must gain besides: no wave is one to the letter, and what it
misses moves in time with it, as a friction may."""
UNDIED = 0.1  # of the largest tap: a response whose last tap is larger goes on beyond it


@dataclasses.dataclass(frozen=True)
class Look:
    """What one rate shows."""

    problem: Problem  # the record at this rate
    found: Found  # by the search
    accepted: tuple[Accepted, ...]  # per valve, frictions that are not rejected
    carries_news: bool = True  # whether at least every other row holds a report of its own
    # −2 log likelihood that waves from outside add where there is no friction; None where none is
    # believed
    wave_gain: float | None = None

    @property
    def price(self) -> float:
        """−2 log likelihood that friction must gain at this rate to be believed."""
        return price_beside(self.wave_gain)

    def beyond_price(self, valve: int) -> float:
        """Return what the friction of a valve gains beyond :attr:`price`."""
        return self.accepted[valve].gain - self.price

    def covers(self, valve: int) -> bool:
        """Return whether responses die away by their last tap, without friction of the valve.

        With friction is enough where the controller was tuned for what ends by then.
        """
        tried = [self.found.without[valve]]
        if self.problem.told_to_end:
            tried.append(self.found.best)
        taps = [np.abs([fit.responses for fit in one.fits]) for one in tried]
        return any(one[..., -1].max() <= UNDIED * one.max() for one in taps)

    def is_held(self, valve: int, candidate: Candidate) -> bool:
        """Return whether the controller of a valve holds what a candidate takes for its process.

        Means of samples, lines and held values can turn a controlled process into one that no
        controller would hold. Where none is known, any is held.
        """
        problem = self.problem
        told = zip(problem.tunings, candidate.fits, problem.shrunk, strict=False)
        return all(
            tuning.holds(problem.rate, float(shrunk), problem.taps_of(fit.responses[valve]))
            for tuning, fit, shrunk in told
            if tuning is not None and tuning.valve == valve
        )

    def sees_process(self, valve: int) -> bool:
        """Return whether what this rate takes for the process is the one that is controlled.

        It has news, sees all of the response, the controller holds it, and it has the sign for
        which this was tuned.
        """
        fits = zip(self.found.ideal.fits, self.problem.reaches, strict=True)
        backwards = any(
            fit.prior.reach == FREE
            and float(reach.heights @ fit.responses[valve]) * reach.unit <= 0.0
            for fit, reach in fits
            if reach is not None and reach.valve == valve
        )
        seen = self.carries_news and not backwards and self.covers(valve)
        return seen and self.is_held(valve, self.found.without[valve])


@dataclasses.dataclass(frozen=True)
class Agreement:
    """What two neighbouring rates say of one valve."""

    look: Look  # the one of the two with more evidence
    # the lesser of what friction gains at both beyond what it must, −2 log of the marginal
    # likelihood
    gain: float
    # whether the bands that they accept overlap, but for ``ALIKE``, and both rates have a say
    alike: bool


def price_beside(wave_gain: float | None) -> float:
    """Return −2 log likelihood that friction must gain to be believed.

    Args:
        wave_gain: what waves from outside gain where there is no friction; None where none is
            believed.
    """
    return PRICE if wave_gain is None else PRICE + BESIDE + INEXACT * wave_gain


def at_all_rates(record: Record, options: IdentificationOptions) -> list[Problem]:
    """Return a record without gaps at each rate for which enough rows are left, as it is first."""
    step, _ = refresh(record)
    rates = [step * k for k in RATES if k == 1 or len(record) // (step * k) >= LEAST_ROWS]
    told, measured = tunings(record), restored(record, options)
    return [Problem.of(measured, options, rate, told) for rate in rates]


def looks(record: Record, options: IdentificationOptions) -> tuple[Look, ...]:
    """Return what each rate shows for which enough rows are left, the record as it is first.

    Args:
        record: without gaps.
        options: law, largest friction, smallest delay and level.
    """
    problems = at_all_rates(record, options)
    further = settled(problems[0])
    problems = [dataclasses.replace(problem, further=further) for problem in problems]
    found = _searched(problems)
    outputs = range(len(record.outputs))
    waves = tuple(outside_wave(problems, i) for i in outputs)
    gains: list[float | None] = [None] * len(problems)
    if any(waves):
        beside = [problem.with_waves([w.lines if w else () for w in waves]) for problem in problems]
        also = _searched(beside, [head for one in found for head in one.heads()])
        for k, (plain, waved) in enumerate(zip(found, also, strict=True)):
            gains[k] = max(plain.ideal.loss - waved.ideal.loss, 0.0)
            found[k] = better(plain, waved)
            if found[k].best is waved.best:
                problems[k] = beside[k]
    between = samples_between_reports(record)
    seen = []
    for problem, one, gain in zip(problems, found, gains, strict=True):
        valves = range(len(record.valves))
        held = tuple(accepted(problem, one, j, options.confidence) for j in valves)
        seen.append(Look(problem, one, held, between <= OLDEST * problem.rate, gain))
    return tuple(seen)


def _searched(problems: Sequence[Problem], seeds: Sequence[Candidate] = ()) -> list[Found]:
    """Return what is found at each rate, what is best at one tried at the others, and ``seeds``."""
    found = [search(problem) for problem in problems]
    for _ in range(RATE_ROUNDS):
        heads_of = [one.heads() for one in found]
        for k, problem in enumerate(problems):
            others = [seed for other, row in enumerate(heads_of) if other != k for seed in row]
            found[k] = search_again(problem, found[k], [*others, *seeds])
    return found


def liveliest(record: Record) -> Record:
    """Return the :data:`PART` samples in which OP moves most; all of a shorter record.

    They begin with a refresh of PV, where a sensor refreshes it at regular times.
    """
    begin, end = 0, len(record)
    if len(record) > PART:
        begin = liveliest_begin((record.op / np.ptp(record.op, axis=0)).T, PART)
        end = begin + PART
    part = record.part(begin, end)
    _, first = refresh(part)
    return record if (begin, first, end) == (0, 0, len(record)) else part.part(first, end - begin)


def samples_between_reports(record: Record) -> float:
    """Return the mean number of samples from one report of PV to the next, 1 or more.

    A sample is none where PV stays as it is or goes on along a straight line, as historians hold
    or draw it; of several outputs the one reported most often counts.
    """
    bends = np.abs(np.diff(record.pv, 2, axis=0)) > STRAIGHT * np.ptp(record.pv, axis=0)
    return float(len(record) / max(bends.sum(axis=0).max(initial=0), 1))


def agreement(seen: tuple[Look, ...], valve: int) -> Agreement:
    """Return the neighbouring rates that agree best on a valve's friction."""
    if len(seen) == 1:
        return Agreement(seen[0], seen[0].beyond_price(valve), seen[0].covers(valve))
    covers = [look.covers(valve) for look in seen]
    finds = [look.beyond_price(valve) > 0.0 for look in seen]
    # Those that cover the process count, and those that such confirm.
    say = [covers[k] or (all(finds[k + 1 :]) and any(covers[k + 1 :])) for k in range(len(seen))]
    pairs = []
    for k, two in enumerate(itertools.pairwise(seen)):
        bands = [look.accepted[valve].band for look in two]
        low, high = max(band[0] for band in bands), min(band[1] for band in bands)
        gains = [look.beyond_price(valve) for look in two]
        alike = low <= ALIKE * high and say[k] and say[k + 1]
        more = gains.index(max(gains))
        pairs.append(Agreement(two[more], min(gains), alike))
    return max(pairs, key=lambda pair: (pair.alike, pair.gain))
