"""Figure 3: measured and estimated time trends of Example 1."""

from stiction_studies.examples import compare
from stiction_studies.pages.example_report import trends
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.sources import Sources


def figure3(sources: Sources) -> Exhibit:
    """Return PV, OP and stem around a set-point move, and how well they fit."""
    example, found = sources.example(1), sources.found(1, "nlp").identification
    compared = compare(example, found)
    output = found.outputs[0]
    error = compared.stem_error / len(example.record)
    rows = (
        Row("fit of PV", "high", f"{output.fit_one_step:.1f} % one step"),
        Row("fit of PV without PV's past", "", f"{output.fit_free_run:.1f} % free run"),
        Row("mean squared error of the stem", "very accurate", f"{error:.3g} %²", "Remark 2"),
    )
    title = "Figure 3: Example 1, measured and estimated trends"
    return Exhibit("figure3", title, rows, trends(example, found))
