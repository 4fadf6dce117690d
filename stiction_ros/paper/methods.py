"""PaperIdentification by the paper's methods: ``nlp``, ``nlp_printed`` and ``grid``."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from stiction_ros.identification.problem.input_checks import refuse_swapped, swapped_columns
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.search_log import PaperIdentification
from stiction_ros.records import Record

Progress = Callable[[float], None]
Method = Callable[[Record, PaperOptions, Progress | None], PaperIdentification]


def _by_programme(
    record: Record, options: PaperOptions, progress: Progress | None
) -> PaperIdentification:
    from stiction_ros.paper.programme.nlp import identify_by_programme  # CasADi loads slowly

    return identify_by_programme(record, options, progress)


def _as_printed(
    record: Record, options: PaperOptions, progress: Progress | None
) -> PaperIdentification:
    from stiction_ros.paper.programme.printed import identify_as_printed  # CasADi loads slowly

    return identify_as_printed(record, options, progress)


def _by_grid(
    record: Record, options: PaperOptions, progress: Progress | None
) -> PaperIdentification:
    from stiction_ros.paper.grid_search import identify_by_grid  # slow to import

    return identify_by_grid(record, options, progress)


METHODS: Mapping[str, Method] = {"nlp": _by_programme, "nlp_printed": _as_printed, "grid": _by_grid}


def identify(
    record: Record, options: PaperOptions | None = None, progress: Progress | None = None
) -> PaperIdentification:
    """Identify friction and linear dynamics as the paper does; see :class:`PaperOptions`.

    Returns:
        Point estimates without verdict or interval; ``search`` tells what was tried.

    Raises:
        InputError: a record that no model can be fitted to, or OP and PV clearly swapped.
    """
    options = options or PaperOptions()
    if options.check_columns:
        refuse_swapped(record, swapped_columns(record))
    return METHODS[options.method](record, options, progress)
