"""The paper's methods by one function, and the options that they have."""

import dataclasses
import json

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions
from stiction_ros.paper.methods import identify
from stiction_ros.paper.paper_options import METHOD_NAMES, PaperOptions
from stiction_ros.paper.programme import nlp

SMALL = PaperOptions(
    output_order=1, input_order=1, delay=(5, 5), starts=1, grid_step=2.0, friction_limit=6.0
)


@pytest.mark.parametrize("method", METHOD_NAMES)
def test_each_method_signs_its_result(method: str) -> None:
    record = loops.example1(0, samples=300)
    found = identify(record, dataclasses.replace(SMALL, method=method))
    assert found.method == method
    document = found.to_dict()
    assert document["model"]["method"] == method
    assert json.loads(json.dumps(document, allow_nan=False))["valves"][0]["name"] == "V1"


@pytest.mark.parametrize(
    "wrong",
    [
        {"method": "exact"},
        {"starts": 0},
        {"grid_step": 0.0},
        {"grid_step": float("nan")},
        {"friction_limit": (1.0, -1.0)},
        {"delay": (3, 1)},
        {"output_order": 0},
    ],
)
def test_options_are_checked(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError):
        PaperOptions(**wrong)  # type: ignore[arg-type]


def test_orders_and_delays_of_the_default_search_are_taken_over() -> None:
    own = IdentificationOptions(output_order=2, input_order=1, delay=(1, 4), friction_limit=3.0)
    options = PaperOptions.of(own, "grid", grid_step=0.25)
    assert (options.method, options.grid_step) == ("grid", 0.25)
    assert (options.output_order, options.input_order, options.delay) == (2, 1, (1, 4))
    assert options.friction_limit == 3.0


@pytest.mark.parametrize("method", METHOD_NAMES)
@pytest.mark.parametrize("case", ["constant op", "constant pv", "short", "law", "limits"])
def test_unusable_records_are_refused(method: str, case: str) -> None:
    record = loops.example1(0, samples=300)
    options = dataclasses.replace(SMALL, method=method)
    if case.startswith("constant"):
        record = dataclasses.replace(record, **{case[-2:]: np.full((300, 1), 5.0)})
    if case == "short":
        record = record.part(0, 30)
    if case == "law":
        options = dataclasses.replace(options, law="choudhury")
    if case == "limits":
        options = dataclasses.replace(options, friction_limit=(1.0, 2.0))
    with pytest.raises(InputError):
        identify(record, options)


def test_swapped_columns_are_refused_before_a_slow_method_begins(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    record = loops.example1(1, samples=900)
    swapped = dataclasses.replace(record, op=record.pv, pv=record.op)
    monkeypatch.setattr(nlp, "search_at_its_best", lambda *_: pytest.fail("it began"))
    with pytest.raises(InputError, match="look swapped"):
        identify(swapped, PaperOptions())
