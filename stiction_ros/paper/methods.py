"""PaperIdentification by the paper's methods: ``nlp``, ``nlp_printed`` and ``grid``."""

from collections.abc import Callable

from stiction_ros.identification.problem.input_checks import refuse_swapped, swapped_columns
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.search_log import PaperIdentification
from stiction_ros.records import Record

Progress = Callable[[float], None]


def identify(
    record: Record, options: PaperOptions | None = None, progress: Progress | None = None
) -> PaperIdentification:
    """Identify friction and linear dynamics as the paper does; see :class:`PaperOptions`.

    They are point estimates without verdict or interval; ``search`` tells the way. A record that
    no model can be fitted to, or with OP and PV clearly swapped, is refused.
    """
    options = options or PaperOptions()
    refuse_swapped(record, swapped_columns(record))
    # Each is slow to import.
    if options.method == "grid":
        from stiction_ros.paper.grid_search import identify_by_grid as search
    elif options.method == "nlp_printed":
        from stiction_ros.paper.programme.nlp import identify_as_printed as search
    else:
        from stiction_ros.paper.programme.nlp import identify_by_programme as search
    return search(record, options, progress)
