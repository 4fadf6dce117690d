"""One function for all methods, and options that belong to one of them."""

import dataclasses
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.errors import InputError
from stiction_ros.identification import METHODS, IdentificationOptions, identify, methods
from stiction_ros.identification.evidence import engine
from stiction_ros.identification.linear.fit import fit_linear
from stiction_ros.records.csv_writer import write_csv
from stiction_ros.records.record import Record

SMALL = IdentificationOptions(output_order=1, input_order=1, delay=(5, 5), friction_limit=6.0)


@pytest.mark.parametrize("method", METHODS)
def test_each_method_signs_its_result(method: str) -> None:
    record = loops.example1(0, samples=300)
    found = identify(record, dataclasses.replace(SMALL, method=method))
    assert found.method == method
    document = found.to_dict()
    assert document["model"]["method"] == method
    assert json.loads(json.dumps(document, allow_nan=False))["valves"][0]["name"] == "V1"


def test_a_path_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record = loops.example1(0, samples=300)
    write_csv(record, tmp_path / "loop.csv")

    def refuse(read: Record, *_: object) -> None:
        assert np.array_equal(read.op, record.op)
        raise InputError("read")

    monkeypatch.setattr(methods, "search_of", lambda method: refuse)
    for path in (tmp_path / "loop.csv", str(tmp_path / "loop.csv")):
        with pytest.raises(InputError, match="read"):
            identify(path)


@pytest.mark.parametrize("call", [identify, fit_linear])
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([np.zeros(9), np.zeros(9)], r"ndarray is no record; give a Record: Record.from_arrays\("),
        ([[1.0, 2.0]], "list is no record"),
        (["no.csv"], "no.csv: no such file"),
        ([loops.example1(0, samples=30), {"law": "he"}], "options: dict is no "),
    ],
)
def test_what_is_no_record_gets_a_sentence(
    call: Callable[..., object], given: list[Any], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        call(*given)


@pytest.mark.trial
def test_the_default_is_the_search_by_evidence() -> None:
    record = loops.example1(0, samples=700)
    assert identify(record, SMALL).valves == engine.identify_by_evidence(record, SMALL).valves


@pytest.mark.parametrize(
    "wrong",
    [
        {"method": "guess"},
        {"method": "nlp"},
        {"friction_limit": (5.0, 0.0)},
        {"friction_limit": float("nan")},
    ],
)
def test_options_of_methods_are_checked(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError):
        IdentificationOptions(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", ["constant op", "constant pv", "short", "law"])
def test_unusable_records_are_refused(method: str, case: str) -> None:
    record = loops.example1(0, samples=300)
    options = dataclasses.replace(SMALL, method=method)
    if case.startswith("constant"):
        record = dataclasses.replace(record, **{case[-2:]: np.full((300, 1), 5.0)})
    if case == "short":
        record = record.part(0, 30)
    if case == "law":
        options = dataclasses.replace(options, law="none")
    with pytest.raises(InputError):
        identify(record, options)


def test_a_node_that_fits_nothing_compiles_nothing() -> None:
    code = (
        "import sys, stiction_ros.control, stiction_ros.loop, stiction_ros.records; "
        "sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.trial
def test_casadi_is_left_alone_by_all_but_the_nonlinear_programme() -> None:
    code = (
        "import sys, stiction_ros.cli.main, stiction_ros.online.estimator.live; "
        "sys.exit('casadi' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def _swapped() -> Record:
    record = loops.example1(1, samples=900)
    return dataclasses.replace(record, op=record.pv, pv=record.op)


def test_swapped_columns_are_refused_before_a_slow_method_begins(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(methods, "search_of", lambda method: pytest.fail("it began"))
    with pytest.raises(InputError, match="look swapped"):
        identify(_swapped(), IdentificationOptions(method="evidence"))


def test_swapped_columns_are_a_better_reason_than_what_the_method_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> None:
        raise InputError("too short")

    monkeypatch.setattr(methods, "search_of", lambda method: refuse)
    with pytest.raises(InputError, match="look swapped"):
        identify(_swapped())
    with pytest.raises(InputError, match="too short"):
        identify(loops.example1(1, samples=900))
