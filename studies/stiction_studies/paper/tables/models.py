"""Tables 1 and 2: the transfer functions of the tank, actual and identified."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import ss2tf

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.sources import Sources
from stiction_studies.paper.tables.printed_numbers import (
    TABLE_1,
    TABLE_1_MENDED_POLES,
    TABLE_1_POLES,
    TABLE_2,
    TABLE_2_MENDED,
    TABLE_2_POLES,
    gain,
)


def table1(sources: Sources) -> Exhibit:
    """Return G(z), printed and computed from (A.3)."""
    model = LoopModel.load(find_config("tank_linear.loop.yaml"))
    linear = model.process.linear(model.sample_time)
    rows = []
    poles = np.poly(linear.a)
    largest = float(np.abs(np.roots(TABLE_1_MENDED_POLES)).max())
    rows.append(
        Row(
            "denominator",
            _listed(TABLE_1_POLES),
            _listed(poles),
            f"−8.1438 must be +8.1438; mended, four decimals still give a pole of {largest:.3f}",
        )
    )
    for i in range(2):
        for j in range(2):
            numerators = ss2tf(linear.a, linear.b, linear.c, np.zeros((2, 2)), input=j)[0]
            remark = "two coefficients lack their · 10⁻⁵" if (i, j) == (0, 1) else ""
            name = f"numerator of g{i + 1}{j + 1}"
            rows.append(Row(name, _listed(TABLE_1[i][j]), _listed(numerators[i][1:]), remark))
    gains = linear.gain
    for i in range(2):
        for j in range(2):
            printed = f"{gain(TABLE_1[i][j], TABLE_1_MENDED_POLES):.4g}"
            remark = "of the table with the mended denominator: rounding spoils it"
            rows.append(Row(f"gain of g{i + 1}{j + 1}", printed, f"{gains[i, j]:.4g}", remark))
    remark = (
        "Ours are those of (A.3), from which everything here is built: the table repeats it with "
        "too few digits to be used."
    )
    return Exhibit("table1", "Table 1: G(z) of the stirred tank", tuple(rows), remark=remark)


def table2(sources: Sources) -> Exhibit:
    """Return Ĝ(z), printed and identified by the paper's method, re-made."""
    found = sources.found(2, "nlp").identification
    linear = sources.example(2).truth.process.linear(60.0)
    rows = []
    for i, output in enumerate(found.outputs):
        remark = "" if i == 0 else "the denominators are as printed"
        ours = _listed([1.0, *output.a])
        rows.append(Row(f"denominator of row {i + 1}", _listed(TABLE_2_POLES[i]), ours, remark))
    for i, output in enumerate(found.outputs):
        for j, numerator in enumerate(output.b.values()):
            remark = "g12 and g21 are interchanged, −0.044 must be −0.0044" if i != j else ""
            name = f"numerator of g{i + 1}{j + 1}"
            rows.append(Row(name, _listed(TABLE_2[i][j]), _listed(numerator), remark))
    for i, output in enumerate(found.outputs):
        for j, numerator in enumerate(output.b.values()):
            own = gain(tuple(numerator), (1.0, *output.a))
            mended = gain(TABLE_2_MENDED[i][j], TABLE_2_POLES[i])
            rows.append(
                Row(
                    f"gain of g{i + 1}{j + 1}",
                    f"{gain(TABLE_2[i][j], TABLE_2_POLES[i]):.4g}",
                    f"{own:.4g}",
                    f"mended {mended:.4g}, actual {linear.gain[i, j]:.4g}",
                )
            )
    remark = (
        f"Seed {sources.seed}, orders (5, 5). Single coefficients of an ARX model over noisy PV "
        "are not comparable between two records; gains are."
    )
    return Exhibit("table2", "Table 2: identified ARX model", tuple(rows), remark=remark)


def _listed(values: Sequence[float] | np.ndarray) -> str:
    return ", ".join(f"{value:.4g}".replace("-", "−") for value in values)
