"""Figures 2 and 5: unit step responses of the actual and the identified process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification
from stiction_ros.report.shapes import step_response, true_response
from stiction_studies.drawing import BLUE, GREEN, GREY, ORANGE, Drawing, panels, style
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
METHODS = (("nlp", "paper's NLP, re-made", BLUE), ("exact", "exact search", GREEN))


def figure2(sources: Sources) -> Exhibit:
    """Return Example 1: P(s) and what was identified of it."""
    count = SAMPLES[1]
    printed = step_response(
        {"a": THETA_1_A, "b": {"V1": THETA_1_B}, "delay": {"V1": THETA_1_DELAY}},
        "V1",
        count,
    )
    with style():
        figure, axes = panels(1, 4.0)
        _draw(axes[0, 0], sources, 1, (0, 0), [("θ̂ as printed", printed)])
        axes[0, 0].set_title("V1 → PV1")
        axes[0, 0].set_xlabel("time since the step (s)")
        axes[0, 0].set_ylabel("PV1 per %")
        axes[0, 0].legend(loc="lower right")
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
    drawing = Drawing(
        "figure2",
        "Figure 2: Example 1, unit step response of the actual and the identified process",
        f"Seed {sources.seed}. The printed coefficients are drawn with their delay of 5.",
        figure,
    )
    return Exhibit("figure2", drawing.title, tuple(rows), drawing)


def figure5(sources: Sources) -> Exhibit:
    """Return Example 2: the four channels of (A.3) and what was identified of them."""
    example = sources.example(2)
    with style():
        figure, axes = panels(2, 6.4, 2, sharex=True)
        for i, output in enumerate(example.record.outputs):
            for j, valve in enumerate(example.record.valves):
                count = SAMPLES[2]
                shown = [
                    ("Table 2, mended", responses(TABLE_2_MENDED[i][j], TABLE_2_POLES[i], count))
                ]
                if i == j:
                    shown = [
                        ("Table 2, as printed", responses(TABLE_2[i][j], TABLE_2_POLES[i], count))
                    ]
                axis = axes[i, j]
                _draw(axis, sources, 2, (i, j), shown)
                axis.set_title(f"{valve} → {output}")
                axis.set_xlabel("time since the step (min)" if i == 1 else "")
        axes[0, 0].legend(loc="lower right", fontsize=8)
        axes[0, 1].legend(loc="upper right", fontsize=8)
    drawing = Drawing(
        "figure5",
        "Figure 5: Example 2, unit step response of the actual and the identified process",
        f"Seed {sources.seed}, 620 samples, orders (5, 5). V1 → T and V2 → C are drawn with the "
        "interchanged numerators of Table 2 put right. V2 → C is nought but for rounding: mind "
        "its scale.",
        figure,
    )
    return Exhibit("figure5", drawing.title, friction_rows(sources, 2), drawing)


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


def _draw(
    axis: Any,
    sources: Sources,
    number: int,
    channel: tuple[int, int],
    printed: Sequence[tuple[str, FloatArray]],
) -> None:
    i, j = channel
    example, count = sources.example(number), SAMPLES[number]
    valve = example.record.valves[j]
    at = np.arange(count)
    actual = true_response(example.truth, i, j, count)
    axis.plot(at, actual, color=ORANGE, linewidth=3.2, alpha=0.7, label="actual")
    for label, values in printed:
        axis.plot(at, values, color=GREY, linestyle=(0, (5, 2)), label=label)
    for method, label, colour in METHODS:
        output = sources.found(number, method).identification.outputs[i].to_dict()
        axis.plot(at, step_response(output, valve, count), color=colour, label=label)


def printed_gain() -> float:
    """Return the gain of the printed θ̂."""
    return sum(THETA_1_B) / (1.0 + sum(THETA_1_A))


def _gain(found: Identification, output: int, valve: str) -> float:
    model = found.outputs[output]
    return sum(model.b[valve]) / (1.0 + sum(model.a))
