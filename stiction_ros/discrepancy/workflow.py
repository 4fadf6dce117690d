"""The workflow: the data judged, effects looked for one by one, wholes compared, the answer."""

import os
from collections.abc import Sequence

from stiction_ros.checks import of_kind
from stiction_ros.discrepancy.answer.results import Discrepancy
from stiction_ros.discrepancy.decision.scores import Progress
from stiction_ros.discrepancy.gap_options import GapOptions
from stiction_ros.discrepancy.steps.begin import begin
from stiction_ros.discrepancy.steps.closing import closing
from stiction_ros.discrepancy.steps.look import look_on
from stiction_ros.discrepancy.steps.settle import settle
from stiction_ros.intake.intake import record_of
from stiction_ros.loop import LoopModel
from stiction_ros.one_thread import one_thread
from stiction_ros.records import Record


def find_discrepancy(
    model: LoopModel,
    records: Sequence[Record | str | os.PathLike[str]],
    options: GapOptions | None = None,
    progress: Progress | None = None,
) -> Discrepancy:
    """Find what the simulation of a loop misses, add it to the model and measure the gap again.

    The model is driven by the recorded OP, one change is tried at a time, and what is said is
    checked on samples that nothing was fitted to; see docs/discrepancy.md.

    Args:
        model: the loop as it is simulated now.
        records: of this loop, one or more, or paths of their files; OP and PV at least.
        options: None for the defaults.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: records that do not fit the model, or a model whose free run grows
            without bound.

    Returns:
        The effects that the simulation lacks, their sizes, and the model with them added.

    Public as ``stiction_ros.find_gap``.

    Examples:
        >>> from stiction_ros import GapOptions, LoopModel, SetPoints
        >>> from stiction_ros import find_config, find_gap, simulate
        >>> truth = LoopModel.load(find_config("flow.loop.yaml"))
        >>> schedule = SetPoints.load(find_config("flow.set_points.yaml"), truth.outputs)
        >>> record = simulate(truth, schedule, samples=800)
        >>> found = find_gap(truth.with_ideal_valves(), [record], GapOptions(quick=True))
        >>> found
        <Discrepancy named: stiction at valve:V1>
    """
    of_kind(model, LoopModel, "model", "give LoopModel.load(path)")
    given = [records] if isinstance(records, Record | str | os.PathLike) else records
    measured = [record_of(record) for record in given]
    with one_thread():
        task, state = begin(model, measured, options or GapOptions(), progress)
        state = look_on(task, state)
        if not task.options.process_fitted:
            state = settle(task, state)
        return closing(task, state)
