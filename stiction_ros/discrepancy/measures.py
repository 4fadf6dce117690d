"""Limits that several steps share: of evidence, of shares, of rounding."""

import math
from statistics import NormalDist

import numpy as np

MARGIN = 10.0  # BIC by which an effect must beat no effect and its best rival
SURE = 2.0 * MARGIN  # BIC above the margin: there is a gap, even where no effect can be named
MAJORITY = 0.5  # of a thing: more is most of it
NEARLY_ALL = 0.9  # of a thing
SETTLED = 0.01  # BIC: a search gains no more
QUARTER = 0.25  # of a quantity
SLIGHT = 0.05  # of a quantity: a smaller part does not matter
NEGLIGIBLE = 0.01  # of a quantity: a smaller part cannot be seen
CONFIDENCE = 0.95  # that an interval holds the truth
NORMAL = NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE)  # standard errors on either side that hold it
NORMAL_OF_MEDIAN = 1.0 / NormalDist().inv_cdf(0.75)  # σ of normal values, by the median size
SMOOTH = NORMAL**2  # −2 log likelihood above the least: χ² of one degree of freedom
STEPPED = -2.0 * math.log1p(-math.sqrt(CONFIDENCE))
"""The same of the place of a step, (1 − exp(−x / 2))²: Hansen, Econometrica 68 (2000)."""
TRACE = 1e-3  # of a quantity: a smaller part leaves no trace in a measurement
LARGER = 1.0 + QUARTER  # times what is usual: more is another thing
ROUNDING = 1e-9  # of a size: less is none
EPSILON = float(np.finfo(float).eps)  # relative precision of a number
ROUNDS = 5  # of a search on smaller and smaller grids, or of two fits in turns
FINE_ROUNDS = 2 * ROUNDS  # of a search in small boxes around the best point
STEPS = 20  # of an iteration that has not settled before
SURPRISE = 5.0  # standard deviations: a larger deviation is never chance
OUTLYING = SURPRISE * NORMAL_OF_MEDIAN  # times the median size: a move of SP or a spike
TRIED = 4  # of the best, that are looked at further
PROBE = 0.01  # of a figure or its axis, by which it is varied for a derivative
LONGEST_DELAY = 20  # samples by which one signal may follow another
ALONG = 101  # points of a range that is looked through
ALL_AROUND = 20  # points that stand for a region
SCATTERED = 300  # points thrown among all figures of a search
SIDES = (-1.0, -0.5, 0.0, 0.5, 1.0)  # of what is best, of the steps at which it was found
OFTEN = 8  # times: what happens so often is no chance
TURNS = 2  # in which effects, and a process that is fitted with them, are fitted again
