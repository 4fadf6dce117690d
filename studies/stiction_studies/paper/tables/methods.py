"""Computing times of Section 4, and how often each method is right."""

import platform

from stiction_ros.config_files import find_config
from stiction_ros.paper.grid_search import count_points
from stiction_ros.paper.one_step_result import oscillation_spans
from stiction_ros.paper.search_log import PaperIdentification
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.settings import printed_example
from stiction_studies.paper.sources import Sources
from stiction_studies.paper.success import FILE, OWN, RIGHT, Success

NAMES = {
    "exact": "exact search",
    "evidence": "evidence search",
    "nlp": "paper's NLP, re-made",
    "nlp_printed": "paper's NLP, to the letter",
    "grid": "paper's grid",
}


def table_of_times(sources: Sources) -> Exhibit:
    """Return times and answers of all methods on one record of each example."""
    rows = []
    for number in (1, 2):
        printed, example = printed_example(number), sources.example(number)
        base = sources.found(number, "exact").seconds
        spans = ", ".join(f"{span:.3g}" for span in oscillation_spans(example.record))
        times = {"nlp": printed.nlp_seconds, "nlp_printed": printed.nlp_seconds}
        times["grid"] = printed.grid_seconds
        for method, name in NAMES.items():
            found = sources.found(number, method)
            told = found.identification
            log = told.search if isinstance(told, PaperIdentification) else None
            points = count_points(example.record, printed.options(example, "grid"))
            work = {"exact": "", "evidence": "", "grid": f", {points} points"}.get(
                method, f", {len(log.starts) if log else 0} runs of IPOPT"
            )
            friction = ", ".join(
                f"{v.static_friction:.2f} / {v.dynamic_friction:.2f}"
                for v in found.identification.valves
            )
            rows.append(
                Row(
                    f"Example {number}, {name}{work}",
                    f"{times[method]:g} s" if method in times else "",
                    f"{found.seconds:.3g} s",
                    f"{found.seconds / base:.3g} × the exact search; f_S / f_D {friction}",
                )
            )
        rows.append(Row(f"Example {number}, Δu, %", "", spans, "f_max of NLP and grid"))
    remark = (
        f"One record, seed {sources.seed}, {platform.machine()}, one process. Compare the ratios: "
        "the printed seconds are of another machine and of Python 3.6 with CasADi 3.4."
    )
    return Exhibit("times", "Computing times", tuple(rows), remark=remark)


def table_of_success(sources: Sources) -> Exhibit:
    """Return the stored counts over many seeds."""
    stored = Success.load(find_config(FILE))
    rows = []
    for rate in stored.rates():
        printed = "one record, accurate" if rate.method not in OWN else ""
        if rate.method == "grid":
            printed = "one record, exact"
        rows.append(
            Row(
                f"Example {rate.example}, {NAMES[rate.method]}, seeds "
                f"{rate.seeds[0]} to {rate.seeds[1]}",
                printed,
                f"{rate.right} of {rate.total}",
                f"delays right in {rate.delay_right}; median {rate.seconds:.2g} s",
            )
        )
    commands = "; ".join(stored.commands)
    remark = (
        f"Right: every f_S and f_D within {RIGHT} % of the truth, at the paper's orders, M, T, "
        f"steps and Δu. The true friction is a node of both grids. Stored from: {commands}."
    )
    return Exhibit("success", "How often a method is right", tuple(rows), remark=remark)
