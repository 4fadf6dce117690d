"""Why an effect was chosen, in one sentence."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stiction_ros.discrepancy.answer.say import experiment_for, reason_for
from stiction_ros.discrepancy.candidate.base import Candidate, Response
from stiction_ros.discrepancy.decision.decide import GapVerdict
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Behaviour, FloatArray


class Named(Candidate):
    """A candidate that is only a name."""

    def answer(self, run: FreeRun, points: FloatArray) -> Response:
        raise NotImplementedError

    def behaviour(self, point: FloatArray, factors: FloatArray) -> Behaviour | None:
        raise NotImplementedError


def fit(effect: str, delta_bic: float) -> CandidateFit:
    candidate = Named(place="valve:V1", effect=effect, axes=())
    return CandidateFit(candidate, np.zeros(0), np.zeros(0), {}, delta_bic, 0.0)


def look(chosen: CandidateFit, *others: CandidateFit) -> Any:
    """Return what a sentence needs of a look."""
    fits = (chosen, *others)

    def of(place: str, effect: str) -> CandidateFit | None:
        return next((f for f in fits if f.candidate.key == (place, effect)), None)

    return SimpleNamespace(
        scores=SimpleNamespace(fits=fits, of=of), decision=SimpleNamespace(chosen=chosen)
    )


@pytest.mark.parametrize(
    ("rival", "said"),
    [
        (60.0, "It gains 80 BIC over no effect, the next best (lag of valve V1) 60"),
        (-1.0, "It gains 80 BIC over no effect; no other effect gains anything"),
        (
            95.0,
            "It gains 80 BIC over no effect; lag of valve V1 gained more before the other effects "
            "were in the model",
        ),
    ],
)
def test_a_rival_is_the_next_best_or_gained_more_before(rival: float, said: str) -> None:
    own, other = fit("slew", 80.0), fit("lag", rival)
    added = cast("Any", SimpleNamespace(fit=own, alternatives=()))
    assert reason_for(added, [look(own, other)]) == said


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ([("disturbance:PV1", "step"), ("sensor:PV1", "bias_step")], "second sensor"),
        ([("load:V1", "step"), ("valve:V1", "offset")], "record the stem position"),
        ([("disturbance:PV1", "sine"), ("load:V1", "sine")], "measure the flow behind the valve"),
        ([("disturbance:PV1", "coloured"), ("disturbance:PV1", "random_walk")], "longer record"),
    ],
)
def test_the_experiment_is_one_that_tells_the_set_apart(
    names: list[tuple[str, str]], said: str
) -> None:
    first, *others = names
    found = SimpleNamespace(place=first[0], effect=first[1], alternatives=tuple(others))
    text = experiment_for(GapVerdict.AMBIGUOUS, [cast("Any", found)], others, [])
    assert said in text
    assert ";" not in text
