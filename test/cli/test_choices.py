"""The words of the options are those that the modules know."""

from __future__ import annotations

from stiction_ros.blind.truth import FAMILIES as BLIND
from stiction_ros.cli import choices, gap
from stiction_ros.control.paper_weights import WarmStart, WeightPreset
from stiction_ros.discrepancy import GapVerdict
from stiction_ros.examples import FAMILIES, NOISES, PLANTS
from stiction_ros.examples.control_cases import CASES
from stiction_ros.examples.control_study import SCHEDULES
from stiction_ros.field import MANY
from stiction_ros.identification import METHODS
from stiction_ros.identification.friction_grid import LAWS
from stiction_ros.identification.linear_data import LinearKind, OrderCriterion
from stiction_ros.identification.subspace_projection import SubspaceMethod


def test_every_choice_is_known_and_none_is_missing() -> None:
    assert tuple(METHODS) == choices.METHODS
    assert set(choices.laws()) == set(LAWS)
    assert tuple(kind.value for kind in LinearKind) == choices.LINEAR_KINDS
    assert tuple(criterion.value for criterion in OrderCriterion) == choices.CRITERIA
    assert tuple(method.value for method in SubspaceMethod) == choices.SUBSPACE_METHODS
    assert choices.NOISES == NOISES
    assert choices.PLANTS == PLANTS
    assert choices.HEALTHY == FAMILIES
    assert tuple(preset.value for preset in WeightPreset) == choices.PRESETS
    assert tuple(start.value for start in WarmStart) == choices.WARM_STARTS
    assert choices.SCHEDULES == SCHEDULES
    assert choices.BLIND_FAMILIES == BLIND
    assert tuple(CASES) == choices.CONTROL_CASES
    assert choices.MANY == MANY


def test_every_verdict_of_gap_has_an_exit_code() -> None:
    assert set(gap.EXIT_CODES) == {verdict.value for verdict in GapVerdict}
