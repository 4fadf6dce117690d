"""What the product answers is what was written down; a commit that changes a case says why."""

import pytest

from stiction_studies import freeze

QUICK = ("field_50000", "bag_signals_only", "example1_measurement_exact")


def test_every_case_has_its_file_and_every_file_its_case() -> None:
    assert {path.stem for path in freeze.FOLDER.glob("*.json")} == set(freeze.cases())


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in QUICK else pytest.mark.trial)
        for name in freeze.cases()
    ],
)
def test_an_answer_is_as_frozen(name: str) -> None:
    assert freeze.difference(freeze.frozen(name), freeze.answer(name)[1]) is None
