"""Figure 6 in figures: who cycles and who does not, on the linear plant (A.3)."""

from collections.abc import Iterator

import pytest

from stiction_studies.examples import control_study
from stiction_studies.examples.control_study import COLUMNS, StudyOptions, run_trial
from stiction_studies.pages import control_scores
from stiction_studies.pages.control_scores import ColumnScore, score_trial

pytestmark = pytest.mark.trial


@pytest.fixture(scope="module")
def scores() -> Iterator[dict[str, ColumnScore]]:
    with pytest.MonkeyPatch.context() as patch:
        for module in (control_study, control_scores):
            patch.setattr(module, "COLUMNS", [c for c in COLUMNS if c.key != "exact"])
        yield score_trial(run_trial(StudyOptions(plant="linear"), 102))


def amplitude(score: ColumnScore) -> float:
    return score.outputs["C"].amplitude


def test_the_unaware_controller_cycles(scores: dict[str, ColumnScore]) -> None:
    assert amplitude(scores["unaware"]) > 0.03
    assert amplitude(scores["unaware"]) > 10 * amplitude(scores["free"])


def test_inversion_as_printed_cycles_too(scores: dict[str, ColumnScore]) -> None:
    assert amplitude(scores["inversion"]) > 0.5 * amplitude(scores["unaware"])


def test_embedding_as_printed_does_not_cycle(scores: dict[str, ColumnScore]) -> None:
    assert amplitude(scores["printed"]) < 0.1 * amplitude(scores["unaware"])
    assert scores["printed"].valves["V1"].moves < 0.5 * scores["unaware"].valves["V1"].moves


def test_embedding_as_printed_keeps_less_to_its_set_points_than_without_friction(
    scores: dict[str, ColumnScore],
) -> None:
    for output, bound in scores["free"].outputs.items():
        assert scores["printed"].outputs[output].offset > 2 * bound.offset
