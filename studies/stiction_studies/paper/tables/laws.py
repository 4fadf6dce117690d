"""The paper's methods with the other smoothed laws."""

import time

from stiction_ros.paper.methods import identify
from stiction_ros.paper.paper_options import METHOD_NAMES, PaperOptions
from stiction_studies.examples import example1
from stiction_studies.examples.control_study import COLUMNS, StudyOptions, run_trial
from stiction_studies.pages.control_scores import score_trial
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.sources import Sources

LAWS = ("kano", "semi_physical")
DELAYS = (5, 6)  # the two between which Example 1 is in doubt
STEP = 0.25


def table_of_laws(sources: Sources) -> Exhibit:
    """Return Example 1 with other laws by every method, and printed SI and SE with Kano's."""
    rows = [_identified(sources.seed, law, method) for law in LAWS for method in METHOD_NAMES]
    options = StudyOptions("linear", law="kano", schedule="scenario")
    scores = score_trial(run_trial(options, sources.seed))
    for column in COLUMNS:
        score = scores[column.key]
        told = ", ".join(
            f"{tag} IAE {one.iae:.3g}, offset {one.offset:.2g}"
            for tag, one in score.outputs.items()
        )
        valve = next(iter(score.valves.values()))
        told += f"; travel {valve.travel:.0f} %, {valve.moves:.0f} moves"
        rows.append(Row(f"{column.title}, Kano's valve on (A.3)", "", told))
    remark = (
        "Identification: Example 1 with a valve of that law, f_S = 5 and f_D = 2 %, order 3, "
        f"delays {DELAYS[0]} and {DELAYS[1]}, M = 7, grid of {STEP:g} %. XCH's reconstruction has "
        "Kano's signature; Choudhury's law has no smoothed form."
    )
    return Exhibit("laws", "Other smoothed laws", tuple(rows), remark=remark)


def _identified(seed: int, law: str, method: str) -> Row:
    example = example1(seed, law=law)
    options = PaperOptions(
        method=method, law=law, output_order=3, input_order=3, delay=DELAYS, grid_step=STEP
    )
    begun = time.perf_counter()
    found = identify(example.record, options)
    seconds = time.perf_counter() - begun
    valve, delay = found.valves[0], next(iter(found.outputs[0].delay.values()))
    return Row(
        f"{law}, {method}",
        "can be applied",
        f"{valve.static_friction:.2f} / {valve.dynamic_friction:.2f}, delay {delay}",
        f"SE {found.search.squared_error:.3g}, {seconds:.2g} s",
    )
