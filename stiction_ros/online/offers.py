"""Whether the past speaks against a model of the friction that is offered."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.control import History, MpcController
from stiction_ros.settings import setting


@dataclasses.dataclass(frozen=True)
class OfferRule:
    """An offered model must explain the past about as well as the one in force.

    A loop that is compensated hardly excites the friction band: its stems stay with OP at the
    stem, or jump by far more than f_S. A window of such samples says little of f_S, and two
    such windows in succession have most of their samples in common, so that a fit may be wrong
    twice. Samples from before, when the loop cycled, tell. Both models are therefore replayed
    over up to ``offer_samples``; the offered one is doubted when the mean square of its
    innovations is more than ``offer_ratio`` times that of the one in force. A valve that has
    really changed shows in the last ``hand_over_samples``: a model that is better there by the
    same ratio is taken.
    """

    offer_samples: int = setting(
        5000, "past samples that an offered model must explain; 0: none", low=0, high=20_000
    )
    offer_ratio: float = setting(1.5, "by how much it may explain them worse", low=1.0)


def doubt(
    rule: OfferRule,
    controllers: tuple[MpcController, MpcController],
    past: History,
    last: int | None = None,
) -> str:
    """Return why the second of two controllers contradicts the past, or an empty text.

    Args:
        rule: how much, and how many samples.
        controllers: the one in force and the offered one; neither is changed.
        past: up to the present sample.
    """
    if last is not None:
        before, after = (_misfit(one, past, min(last, len(past.op))) for one in controllers)
        return "" if after <= rule.offer_ratio * before else "it explains its samples worse"
    recent = controllers[0].design.hand_over_samples
    samples = min(rule.offer_samples, len(past.op))
    if samples < recent:
        return ""
    before, after = (_misfit(one, past, samples) for one in controllers)
    if after <= rule.offer_ratio * before:
        return ""
    before_lately, after_lately = (_misfit(one, past, recent) for one in controllers)
    if rule.offer_ratio * after_lately < before_lately:
        return ""
    return (
        f"it explains the last {samples} samples worse than the model in force: mean square "
        f"innovation {after:.3g} against {before:.3g}"
    )


def _misfit(controller: MpcController, past: History, samples: int) -> float:
    design = dataclasses.replace(controller.design, hand_over_samples=samples)
    twin = MpcController(design, controller.mode, controller.frictions, controller.spreads)
    value = twin.take_over(past)
    return value if np.isfinite(value) else float("inf")
