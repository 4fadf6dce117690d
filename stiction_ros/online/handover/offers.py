"""Whether the past speaks against a model of the friction that is offered."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.control import FrictionSpread, History, MpcController
from stiction_ros.effects import Stiction
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.online.handover.known_friction import alike, scaled
from stiction_ros.settings import setting

Maker = Callable[[], MpcController]
FAR = 0.25  # share by which a friction must differ to be another one, not a better estimate
FEWEST = 50  # samples by which a model that says since when it holds is judged at least
GAIN = 0.6  # largest share of the misfit that a friction of a healthy valve may leave
OTHER_SIZES = (0.25, 0.5, 2.0)  # that an offered friction is compared with
SIZE_RATIO = 1.25  # by which another size must explain the past better to speak against it
SLIPS = 2  # of each valve that an offered friction must explain


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

    - A past shorter than ``hand_over_samples`` speaks for nothing: the offer waits.
    - So does a friction by which the valve has never slipped, or once only: that it rests is
      explained by any friction that is large enough, and compensating it takes large kicks.
    - Friction of a valve that was taken to be healthy must leave no more than ``GAIN`` of the mean
      square innovation, and explain the past as well as the same law a quarter, half and twice
      as strong: a valve that rests most of the time is explained by too large a friction as
      well, compared with none. Its own interval is used for this: a friction that is right to
      2 % may miss slips that the past shows.
    - A friction that is more than ``FAR`` from the one in force must be better by
      ``offer_ratio``, over all these samples or lately: that it is no worse says nothing where
      the valve has hardly moved.
    - A model that says since when it holds, of a valve that was known to stick, must not be
      worse by ``offer_ratio`` over the samples since then; that it is the better one is what its
      estimator has tested.
    - A model that was rolled back must be better lately by ``offer_ratio`` to come again.
    """

    offer_samples: int = setting(
        5000, "past samples that an offered model must explain; 0: none", low=0, high=20_000
    )
    offer_ratio: float = setting(1.5, "by how much it may explain them worse", low=1.0)


@dataclasses.dataclass(frozen=True)
class Judge:
    """Holds an offered controller against the past; runs wherever its user wants."""

    rule: OfferRule  # how much, and how many samples
    in_force: Maker  # makes a twin of the controller in force
    offered_before: bool = False  # the offered friction was in force once and was rolled back
    last_samples: int = 0  # how many samples the offered model says it holds for; 0 for all

    def doubt(self, offered: Maker, past: History) -> str:
        """Return why ``past``, up to the present sample, speaks against it, or an empty text."""
        now, new = self.in_force(), offered()
        if now.frictions == new.frictions and now.design.model is new.design.model:
            return ""
        there, needed = len(past.op), new.design.hand_over_samples
        if there < needed:
            return f"only {there} samples of the past are known and {needed} are needed"
        if not self.rule.offer_samples:
            return ""
        gained = any(
            old is None and found is not None
            for old, found in zip(now.frictions, new.frictions, strict=True)
        )
        samples = min(self.rule.offer_samples, there)
        if self.last_samples and not gained and not self.offered_before:
            samples = min(max(self.last_samples, FEWEST), there)
            return _worse(self.in_force, offered, past, samples, self.rule.offer_ratio)
        for j, law in enumerate(new.frictions):
            slips = SLIPS if law is None else _slips(law, past.op[-samples:, j])
            if slips < SLIPS:
                return f"by it valve {j + 1} slipped {slips} times in the last {samples} samples"
        if self.offered_before:
            if _worse(self.in_force, offered, past, needed, 1.0 / self.rule.offer_ratio):
                return "it was rolled back before, and is not clearly better lately"
            return ""
        if gained:
            return self._unearned(new, past, samples)
        better = 1.0 / self.rule.offer_ratio
        asked = better if _far(now.frictions, new.frictions) else self.rule.offer_ratio
        said = _worse(self.in_force, offered, past, samples, asked)
        if said and _worse(self.in_force, offered, past, needed, better):
            return said
        return ""

    def _unearned(self, new: MpcController, past: History, samples: int) -> str:
        """Say that a friction not known before is not what explains the past."""
        design = new.design.without_rates()  # other frictions take other kicks; none is made

        def misfit(laws: Sequence[Behaviour | None]) -> float:
            return _misfit(MpcController(design, new.mode, laws), past, samples)

        own = min(misfit(laws) for laws in _within(new.frictions, new.spreads))
        none = _misfit(self.in_force(), past, samples)
        if own > GAIN * none:
            return (
                f"it hardly explains the last {samples} samples: mean square innovation "
                f"{own:.3g} against {none:.3g} of the model in force"
            )
        for factor in OTHER_SIZES:
            other = misfit([None if law is None else scaled(law, factor) for law in new.frictions])
            if own > SIZE_RATIO * other:
                return (
                    f"{factor:g} times its size explains the last {samples} samples better: "
                    f"mean square innovation {other:.3g} against {own:.3g}"
                )
        return ""


def _far(now: Sequence[Behaviour | None], new: Sequence[Behaviour | None]) -> bool:
    """Whether any valve that was and is sticky has another friction by more than a refinement."""
    known = [(a, b) for a, b in zip(now, new, strict=True) if a is not None and b is not None]
    return not alike([a for a, _ in known], [b for _, b in known], FAR)


def _within(
    frictions: Sequence[Behaviour | None], spreads: Sequence[FrictionSpread | None]
) -> list[tuple[Behaviour | None, ...]]:
    """Return the frictions and the corners of their intervals, all valves alike."""
    found = [tuple(frictions)]
    for static, dynamic in itertools.product((-1.0, 1.0), repeat=2):
        corner: list[Behaviour | None] = []
        for law, spread in zip(frictions, spreads, strict=True):
            form = law.jump_form() if isinstance(law, Stiction) else None
            if form is not None and spread is not None:
                static_friction = max(form.static_friction + static * spread.static, 0.0)
                dynamic_friction = max(form.dynamic_friction + dynamic * spread.dynamic, 0.0)
                law = form.law.with_frictions(
                    static_friction, min(dynamic_friction, static_friction)
                )
            corner.append(law)
        if corner != list(frictions):
            found.append(tuple(corner))
    return found


def last_samples(model: LoopModel) -> int:
    """Return for how many samples up to its window's end ``model`` says it holds; 0 for all."""
    told = [entry.get("last_samples") for entry in model.provenance]
    return min((n for n in told if isinstance(n, int) and n > 0), default=0)


def _slips(law: Behaviour, op: FloatArray) -> int:
    """Return at how many samples ``law`` moves the stem of a valve that is given ``op`` (N,), %."""
    return int(np.count_nonzero(np.diff(law.simulate(op, float(op[0])))))


def _worse(in_force: Maker, offered: Maker, past: History, samples: int, ratio: float) -> str:
    """Say that the offered one explains ``samples`` worse than ``ratio`` times the other."""
    before, after = (_misfit(make(), past, samples) for make in (in_force, offered))
    if after <= ratio * before:
        return ""
    return (
        f"it explains the last {samples} samples no better than the model in force: mean square "
        f"innovation {after:.3g} against {before:.3g}"
    )


def _misfit(controller: MpcController, past: History, samples: int) -> float:
    """Return the misfit of the last ``samples``, the observer settled on those before.

    Where there are not enough before, up to a quarter of the samples themselves is given to it.
    """
    settling = controller.design.hand_over_samples
    taken = min(samples + settling, len(past.op))
    skip = max(taken - samples, min(settling, samples // 4))
    value = controller.take_over(past, taken, skip)
    return value if np.isfinite(value) else float("inf")
