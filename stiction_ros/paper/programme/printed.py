"""The paper's method to the letter: the programme (12) from M printed starts, for T delays.

The best feasible, stable end of M × T runs of IPOPT at τ = 10⁴ wins; :mod:`.nlp` uses them better.
"""

import time
from collections.abc import Callable

import numpy as np

from stiction_ros.paper import one_step_result as one_step
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.programme.apparent_stiction import apparent_stictions
from stiction_ros.paper.programme.friction_programme import FrictionProgramme, Solution
from stiction_ros.paper.programme.nlp import MAX_CHOICES, NO_END, pairs
from stiction_ros.paper.programme.programme_data import ProgrammeData
from stiction_ros.paper.programme.starts import draw_starts
from stiction_ros.paper.search_log import PaperIdentification, SolvedStart
from stiction_ros.paper.smoothed_laws import final_smoothing
from stiction_ros.records import Record
from stiction_ros.signals.arx_fit import Delays

Progress = Callable[[float], None]


def identify_as_printed(
    record: Record, options: PaperOptions | None = None, progress: Progress | None = None
) -> PaperIdentification:
    """Identify by the method as printed; all else is as in :func:`~.nlp.identify_by_programme`."""
    begun = time.perf_counter()
    options = options or PaperOptions(method="nlp_printed")
    orders = one_step.check_record(record, options)
    choices = one_step.delay_choices(record, options, MAX_CHOICES)
    limits = one_step.friction_limits(record, options)
    stictions = np.minimum(apparent_stictions(record), limits)
    starts = draw_starts(limits, stictions, options.starts)
    smoothing = final_smoothing(limits)
    data = ProgrammeData.of(record.op, record.pv, limits, orders, options.law)
    ends: list[tuple[Delays, Solution]] = []
    log: list[SolvedStart] = []
    for delays in choices:
        programme = FrictionProgramme(data, delays)
        for start in starts:
            end = programme.solve(programme.start(start.friction), smoothing)
            ends.append((delays, end))
            log.append(
                SolvedStart(
                    kind=start.kind.value,
                    delays=delays,
                    start=pairs(start.friction),
                    end=pairs(end.friction),
                    objective=end.objective,
                    status=end.status,
                    iterations=end.iterations,
                    feasible=end.feasible,
                    stable=end.stable,
                )
            )
            if progress is not None:
                progress(len(ends) / (len(choices) * len(starts)))
    accepted = [one for one in ends if one[1].accepted]
    delays, best = min(accepted or ends, key=lambda one: one[1].objective)
    friction = best.friction if accepted else np.zeros((len(limits), 2))
    reason = "" if accepted else NO_END
    answer = one_step.Answer(reason, friction, delays, best.objective, len(ends), starts=tuple(log))
    return one_step.result(record, options, answer, time.perf_counter() - begun)
