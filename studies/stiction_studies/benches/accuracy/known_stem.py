"""What a record holds of a friction, whoever looks for it: what the true stem gains.

Nobody who has to find the stem does better than who is told it. Where even the stem that truly
moved gains less than what a search must ask of the best of its many frictions, the record does not
show that there is one; no rule that lets healthy loops in peace can find it.
"""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.output_fit import OutputFit, beginnings, fit_output
from stiction_ros.identification.evidence.outside_waves import outside_wave
from stiction_ros.identification.evidence.rates import at_all_rates, liveliest, price_beside
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.kernels.lags import in_rows
from stiction_ros.records.record import Record


def beyond_price(record: Record, stem: FloatArray) -> float | None:
    """Return what a known stem gains beyond the price of friction, at the rate where it is most.

    Process, noise and a wave from outside are fitted anew beside it, as beside a valve that
    follows OP, which it is held against. None for a record of which a part alone is searched.

    Args:
        record: of one valve and one output, without gaps.
        stem: that moved at its samples, in the unit of OP, shape (N,).
    """
    if liveliest(record) is not record:
        return None
    problems = at_all_rates(record, IdentificationOptions())
    wave = outside_wave(problems, 0)
    lines = None if wave is None else wave.lines
    return max(_beyond(one, stem - record.op[:, 0].mean(), lines) for one in problems)


def _beyond(problem: Problem, stem: FloatArray, lines: tuple[float, ...] | None) -> float:
    shares = (stem / problem.span[0])[: problem.rows * problem.rate, None]
    scale = float(problem.scale[0])
    rows = np.asarray(in_rows(np.ascontiguousarray(shares), problem.rate, problem.skipped, scale))
    free, known = _fits(problem, rows)
    if lines is None:
        return free.loss - known.loss - price_beside(None)
    free_beside, known_beside = _fits(problem.with_waves([lines]), rows)
    price = price_beside(max(free.loss - free_beside.loss, 0.0))
    gain = min(free.loss, free_beside.loss) - min(known.loss, known_beside.loss)
    return gain - price


def _fits(problem: Problem, rows: FloatArray) -> tuple[OutputFit, OutputFit]:
    """Return the best fits of a valve that follows OP and of the known stem.

    Both begin from each other's noise, too: what one of them takes for noise is none to the other.
    """
    starts = beginnings(problem, 0)
    ideal = problem.ideal_stems()
    free = fit_output(problem, 0, ideal, starts)
    known = fit_output(problem, 0, rows, [*starts, free])
    free = min(free, fit_output(problem, 0, ideal, [known]), key=lambda fit: fit.loss)
    return free, known
