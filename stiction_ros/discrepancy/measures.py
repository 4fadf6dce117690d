"""Limits that several steps share: of evidence, of shares, of rounding."""

MARGIN = 10.0  # BIC by which an effect must beat no effect and its best rival
SURE = 2.0 * MARGIN  # BIC above the margin: there is a gap, even where no effect can be named
MAJORITY = 0.5  # of a thing: more is most of it
NEARLY_ALL = 0.9  # of a thing
NORMAL = 1.96  # standard errors on either side that hold 95 %
ROUNDING = 1e-9  # of a size: less is none
GAUSS_NEWTON = 20  # steps of a search that has not settled before
OUTLYING = 8.0  # times the usual size: what is larger is another thing, as a move of SP or a spike
TRIED = 3  # of the best, that are tried as wholes
TURNS = 2  # in which effects, and a process that is fitted with them, are fitted again
