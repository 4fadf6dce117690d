"""The words of the options are those that the modules know."""

from stiction_ros.cli import gap
from stiction_ros.cli.shared import searches
from stiction_ros.discrepancy import GapVerdict
from stiction_ros.identification import METHODS
from stiction_ros.identification.answer.advice import EXPECTED
from stiction_ros.identification.friction import laws
from stiction_ros.identification.identification_options import LOOP_KINDS
from stiction_ros.identification.linear.data import OrderCriterion
from stiction_ros.paper.paper_options import METHOD_NAMES
from stiction_ros.signals.subspace_projection import SubspaceMethod


def test_every_choice_is_known_and_none_is_missing() -> None:
    assert (*METHODS, *METHOD_NAMES) == searches.METHODS
    assert METHOD_NAMES == searches.PAPER_METHODS
    assert set(searches.laws()) == set(laws())
    assert tuple(EXPECTED) == searches.LOOP_KINDS == LOOP_KINDS
    assert tuple(criterion.value for criterion in OrderCriterion) == searches.CRITERIA
    assert tuple(method.value for method in SubspaceMethod) == searches.SUBSPACE_METHODS


def test_every_verdict_of_gap_has_an_exit_code() -> None:
    assert set(gap.EXIT_CODES) == {verdict.value for verdict in GapVerdict}
