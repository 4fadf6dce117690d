"""Figures 2 and 5: unit step responses of the actual and the identified process."""

from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification
from stiction_ros.pages.plot import Curve, over_time
from stiction_ros.report.run.identified import step_response, true_response
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.settings import printed_example
from stiction_studies.paper.sources import Sources
from stiction_studies.paper.tables.printed_numbers import (
    TABLE_2,
    TABLE_2_MENDED,
    TABLE_2_POLES,
    THETA_1_A,
    THETA_1_B,
    THETA_1_DELAY,
    responses,
)

SAMPLES = {1: 100, 2: 120}
METHODS = (("nlp", "paper's NLP, re-made", "pv"), ("exact", "exact search", "stem"))


def figure2(sources: Sources) -> Exhibit:
    """Return Example 1: P(s) and what was identified of it."""
    count = SAMPLES[1]
    printed = step_response(
        {"a": THETA_1_A, "b": {"V1": THETA_1_B}, "delay": {"V1": THETA_1_DELAY}}, "V1", count
    )
    actual = true_response(sources.example(1).truth, 0, 0, 600)[-1]
    rows = [*friction_rows(sources, 1)]
    rows.append(
        Row(
            "gain at steady state",
            f"{printed_gain():.3f}",
            _each(sources, 1, lambda found: f"{_gain(found, 0, 'V1'):.3f}"),
            f"(17) has 1, (18) as rounded {actual:.3f}",
        )
    )
    title = "Figure 2: Example 1, unit step response of the actual and the identified process"
    remark = f"Seed {sources.seed}. The printed coefficients are drawn with their delay of 5."
    drawn = _drawn(sources, 1, (0, 0), ("θ̂ as printed", printed))
    return Exhibit("figure2", title, tuple(rows), drawn, remark)


def figure5(sources: Sources) -> Exhibit:
    """Return Example 2: the four channels of (A.3) and what was identified of them."""
    record, drawn = sources.example(2).record, []
    for i in range(len(record.outputs)):
        for j in range(len(record.valves)):
            name, entries = "Table 2, mended", TABLE_2_MENDED
            if i == j:
                name, entries = "Table 2, as printed", TABLE_2
            printed = responses(entries[i][j], TABLE_2_POLES[i], SAMPLES[2])
            drawn.append(_drawn(sources, 2, (i, j), (name, printed)))
    title = "Figure 5: Example 2, unit step response of the actual and the identified process"
    remark = (
        f"Seed {sources.seed}, 620 samples, orders (5, 5). V1 → T and V2 → C are drawn with the "
        "interchanged numerators of Table 2 put right. V2 → C is nought but for rounding: mind "
        "its scale."
    )
    return Exhibit("figure5", title, friction_rows(sources, 2), "".join(drawn), remark)


def friction_rows(sources: Sources, number: int) -> tuple[Row, ...]:
    """Return rows of f_S, f_D and delay, printed and found."""
    printed, example = printed_example(number), sources.example(number)
    rows = []
    for j, name in enumerate(example.record.valves):
        true = "{:g} / {:g}".format(*example.friction(name))
        rows.append(
            Row(
                f"{name}: f_S / f_D, %",
                "{:.2f} / {:.2f}".format(*printed.friction[j]),
                _each(
                    sources,
                    number,
                    lambda found, j=j: (
                        f"{found.valves[j].static_friction:.2f} / "
                        f"{found.valves[j].dynamic_friction:.2f}"
                    ),
                ),
                f"true {true}",
            )
        )
    if printed.choices > 1:
        ours = _each(
            sources, number, lambda found: str(next(iter(found.outputs[0].delay.values())))
        )
        remark = "noise is added to PV, as (2) says; the paper's own grid finds 6"
        rows.append(Row("delay, samples", str(printed.delay), ours, remark))
    return tuple(rows)


def _each(sources: Sources, number: int, say: Any) -> str:
    """Return what every method found, in words."""
    return "; ".join(
        f"{method} {say(sources.found(number, method).identification)}" for method, _, _ in METHODS
    )


def _drawn(
    sources: Sources, number: int, channel: tuple[int, int], printed: tuple[str, FloatArray]
) -> str:
    """Return the figure of one channel: actual, printed, and as each method found it."""
    (i, j), (label, values) = channel, printed
    example, count = sources.example(number), SAMPLES[number]
    record = example.record
    curves = [
        Curve("actual", "whole", true_response(example.truth, i, j, count)),
        Curve(label, "sp", values),
    ]
    for method, name, kind in METHODS:
        output = sources.found(number, method).identification.outputs[i].to_dict()
        curves.append(Curve(name, kind, step_response(output, record.valves[j], count)))
    time = record.sample_time * np.arange(float(count))
    title = f"{record.valves[j]} → {record.outputs[i]}, from the step on."
    return over_time(title, time, curves, f"{record.outputs[i]} per %")


def printed_gain() -> float:
    """Return the gain of the printed θ̂."""
    return sum(THETA_1_B) / (1.0 + sum(THETA_1_A))


def _gain(found: Identification, output: int, valve: str) -> float:
    model = found.outputs[output]
    return sum(model.b[valve]) / (1.0 + sum(model.a))
