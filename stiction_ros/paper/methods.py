"""PaperIdentification by the paper's methods: ``nlp``, ``nlp_printed`` and ``grid``."""

import time

from stiction_ros.identification.identification_options import Progress
from stiction_ros.identification.problem.input_checks import refuse_swapped
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.search_log import PaperIdentification
from stiction_ros.records import Record


def identify(
    record: Record, options: PaperOptions | None = None, progress: Progress | None = None
) -> PaperIdentification:
    """Identify friction and linear dynamics as the paper does; see :class:`PaperOptions`.

    They are point estimates without verdict or interval; ``search`` tells the way. The status is
    ``no_model`` when no run of a programme ended feasible with a stable process. A record that no
    model can be fitted to, or with OP and PV clearly swapped, is refused.
    """
    begun = time.perf_counter()
    options = options or PaperOptions()
    refuse_swapped(record)
    # Each is slow to import.
    from stiction_ros.paper.one_step_result import check_record, result

    if options.method == "grid":
        from stiction_ros.paper.grid_search import search
    elif options.method == "nlp_printed":
        from stiction_ros.paper.programme.nlp import search_as_printed as search
    else:
        from stiction_ros.paper.programme.nlp import search_at_its_best as search
    orders = check_record(record, options)
    answer = search(record, options, orders, progress or (lambda share: None))
    return result(record, options, answer, time.perf_counter() - begun)
