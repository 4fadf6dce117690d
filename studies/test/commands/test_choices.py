"""The words of the options are those that the modules of the studies know."""

from stiction_ros.paper.controllers.weights import ProgrammeCost, WarmStart, WeightPreset
from stiction_studies.blind.loops.truth import FAMILIES as BLIND
from stiction_studies.commands import choices
from stiction_studies.examples import FAMILIES, NOISES, PLANTS, control_study
from stiction_studies.examples.control_cases import CASES
from stiction_studies.examples.control_study import SCHEDULES
from stiction_studies.field import MANY
from stiction_studies.field.hidden import FAMILIES as HIDDEN
from stiction_studies.field.hidden import GIVEN


def test_every_choice_is_known_and_none_is_missing() -> None:
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
