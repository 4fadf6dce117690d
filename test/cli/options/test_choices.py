"""The words of the options are those that the modules know."""

from __future__ import annotations

from stiction_ros.cli.loop import gap
from stiction_ros.cli.options import choices
from stiction_ros.discrepancy import GapVerdict
from stiction_ros.identification import METHODS
from stiction_ros.identification.answer.loop_kind import LoopKind
from stiction_ros.identification.friction.grid import laws
from stiction_ros.identification.linear.data import LinearKind, OrderCriterion
from stiction_ros.identification.linear.subspace_projection import SubspaceMethod
from stiction_ros.identification.options import LOOP_KINDS
from stiction_ros.paper import methods
from stiction_ros.paper.controllers.weights import ProgrammeCost, WarmStart, WeightPreset
from stiction_studies.blind.loops.truth import FAMILIES as BLIND
from stiction_studies.examples import FAMILIES, NOISES, PLANTS, control_study
from stiction_studies.examples.control_cases import CASES
from stiction_studies.examples.control_study import SCHEDULES
from stiction_studies.field import MANY
from stiction_studies.field.hidden import FAMILIES as HIDDEN
from stiction_studies.field.hidden import GIVEN


def test_every_choice_is_known_and_none_is_missing() -> None:
    assert (*METHODS, *methods.METHODS) == choices.METHODS
    assert tuple(methods.METHODS) == choices.PAPER_METHODS
    assert set(choices.laws()) == set(laws())
    assert tuple(kind.value for kind in LoopKind) == choices.LOOP_KINDS == LOOP_KINDS
    assert tuple(kind.value for kind in LinearKind) == choices.LINEAR_KINDS
    assert tuple(criterion.value for criterion in OrderCriterion) == choices.CRITERIA
    assert tuple(method.value for method in SubspaceMethod) == choices.SUBSPACE_METHODS
    assert choices.NOISES == NOISES
    assert choices.PLANTS == PLANTS
    assert choices.HEALTHY == FAMILIES
    assert tuple(preset.value for preset in WeightPreset) == choices.PRESETS
    assert tuple(start.value for start in WarmStart) == choices.WARM_STARTS
    assert tuple(cost.value for cost in ProgrammeCost) == choices.PROGRAMME_COSTS
    assert tuple(control_study.LAWS) == choices.PRINTED_LAWS
    assert choices.SCHEDULES == SCHEDULES
    assert choices.BLIND_FAMILIES == BLIND
    assert {*choices.BLIND_FAMILIES, choices.PHYSICS} == {*BLIND, *HIDDEN}
    assert choices.GIVEN == GIVEN
    assert tuple(CASES) == choices.CONTROL_CASES
    assert choices.MANY == MANY


def test_every_verdict_of_gap_has_an_exit_code() -> None:
    assert set(gap.EXIT_CODES) == {verdict.value for verdict in GapVerdict}
