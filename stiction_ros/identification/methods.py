"""Identification by any method.

- ``evidence``, the default: friction by the marginal likelihood under any smooth process,
  :mod:`.evidence.engine`; it needs neither orders nor delays for that.
- ``exact``: friction and an ARX process of chosen order together, down to the best switching
  pattern, :mod:`.engine`. It takes the process at its word, and is several times as fast.
"""

import os
from collections.abc import Callable

from stiction_ros.checks import of_kind
from stiction_ros.identification.identification_options import IdentificationOptions, Progress
from stiction_ros.identification.problem.input_checks import refuse_swapped
from stiction_ros.identification.result import Identification
from stiction_ros.intake.intake import record_of
from stiction_ros.one_thread import one_thread
from stiction_ros.records.record import Record

Method = Callable[[Record, IdentificationOptions, Progress | None], Identification]


def search_of(method: str) -> Method:
    """Return what searches by a method, which is slow to import."""
    if method == "exact":
        from stiction_ros.identification.engine import identify_exact

        return identify_exact
    from stiction_ros.identification.evidence.engine import identify_by_evidence

    return identify_by_evidence


def identify(
    record: Record | str | os.PathLike[str],
    options: IdentificationOptions | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify friction and linear dynamics of every valve and output of a record.

    Args:
        record: what was measured, or the path of a file or bag of one loop.
        options: ``options.method`` names the search; None for the defaults.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: no record, one that no model can be fitted to, or an option that the method
            does not have, or OP and PV that are clearly swapped.

    Returns:
        A verdict, f_S and f_D in % with intervals for every valve, and the process behind it.
        It is a value also where no trustworthy model was found: see its ``status``.

    The valve is He's (4) by default; f_S and f_D are those that leave PV least to explain under
    any smooth response and autoregressive noise. The process (7)–(9) is fitted to their stems.

    Examples:
        >>> from stiction_ros import IdentificationOptions, LoopModel
        >>> from stiction_ros import find_config, identify, simulate
        >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=600)
        >>> found = identify(record, IdentificationOptions(output_order=1, delay=(0, 4)))
        >>> valve = found.valves[0]
        >>> print(valve.verdict, round(valve.static_friction), round(valve.dynamic_friction, 1))
        sticky 4 1.6
    """
    measured = record_of(record)
    chosen = IdentificationOptions() if options is None else options
    of_kind(chosen, IdentificationOptions, "options")
    with one_thread():
        if chosen.check_columns:
            refuse_swapped(measured)
        found = search_of(chosen.method)(measured, chosen, progress)
        from stiction_ros.identification.answer.advice import advised  # slow to import, now loaded

        return advised(measured, found, chosen)
