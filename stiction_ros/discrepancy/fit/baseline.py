"""The current model alone, which every candidate is judged against."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from stiction_ros.discrepancy.likelihood.declared_noise import arx_equations, seen_noise
from stiction_ros.discrepancy.likelihood.least_squares import projector, whitened_columns
from stiction_ros.discrepancy.likelihood.noise import (
    Blocks,
    NoiseFit,
    best_noise,
    given_noise,
    noise_forms,
)
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import FloatArray

BASES = 8  # of shared columns, that are kept for the next grids
_FIRST_GUESSES = (None, np.array([0.99]))  # white and slow: the turns may end in either


@dataclasses.dataclass(frozen=True)
class Baseline:
    """The current model alone: its gap, its noise, and what every fit shares."""

    run: FreeRun  # the free run
    # per output the columns that every fit projects out, shape (N, q)
    columns: tuple[FloatArray, ...]
    blocks: tuple[Blocks, ...]  # per output the fitted and the held-out rows
    noise: tuple[NoiseFit, ...]  # per output the fit of the gap without any change
    plain: tuple[NoiseFit, ...]  # the same as if nothing were rounded, for the search
    # per output φ of the noise that the model declares; none where it declares none
    declared: tuple[tuple[FloatArray, ...], ...]
    # what was computed of it and may be asked for again, by name
    known: dict[tuple[object, ...], Any] = dataclasses.field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def basis(self, output: int, ar: FloatArray) -> FloatArray:
        """Return an orthonormal basis of an output's shared columns, whitened, shape (n, r).

        The searches ask for few φ in succession; the last ones are kept.
        """
        name = ("basis", output, ar.tobytes())
        if name not in self.known:
            bases = [other for other in self.known if other[0] == "basis"]
            for other in bases[: max(len(bases) - BASES + 1, 0)]:
                del self.known[other]
            rows = self.blocks[output].train
            self.known[name] = projector(whitened_columns(self.columns[output], ar, rows))
        return cast("FloatArray", self.known[name])

    @classmethod
    def of(
        cls,
        run: FreeRun,
        columns: Sequence[FloatArray] | None = None,
        like: Sequence[Mapping[int, NoiseFit]] = (),
    ) -> "Baseline":
        """Fit the noise of the current model.

        Args:
            run: its free run.
            columns: per output what every fit projects out, shape (N, q), in place of the run's.
            like: noises per output with which the search for its own begins, too.
        """
        gap = run.gap
        shared = tuple(run.free if columns is None else columns)
        blocks = tuple(run.blocks(i) for i in range(gap.shape[1]))
        seen = seen_noise(run.model, run.runs.lattices, run.runs.unseen)
        declared = tuple(
            () if thinned else tuple(noise.ar for noise in forms)
            for forms, thinned in zip(seen, run.runs.thinned, strict=True)
        )
        forms = []
        for i in range(gap.shape[1]):
            starts = (*_FIRST_GUESSES, *(noise[i].ar for noise in like if i in noise))
            forms.append(noise_forms(gap[:, i], shared[i], blocks[i], starts, declared[i]))
        plain = tuple(best_noise(each) for each in forms)
        noise = tuple(
            best_noise(each, quantum, own)
            for each, quantum, own in zip(forms, run.runs.quanta, blocks, strict=True)
        )
        return cls(run, shared, blocks, noise, plain, declared)

    def under_declared(self, output: int) -> NoiseFit:
        """Return the fit of an output's gap under the noise that the model declares."""
        gap, columns, blocks = self.run.gap[:, output], self.columns[output], self.blocks[output]
        fits = [given_noise(gap, columns, blocks, ar) for ar in self.declared[output]]
        return best_noise(fits, self.run.runs.quanta[output], blocks)

    @functools.cached_property
    def plausible(self) -> tuple[FloatArray, ...]:
        """Return per output φ of the declared noise, or of noise in its equation without one."""
        equations = arx_equations(self.run.model.process)
        found = []
        for i, forms in enumerate(self.declared):
            if not forms and equations is not None:
                forms = (-np.asarray(equations[i].a, dtype=float),)
            found.append(forms[0] if forms else np.zeros(0))
        return tuple(found)

    def scored(self, output: int, values: FloatArray) -> FloatArray:
        """Return values of an output, shape (N,), 0 where they are not scored.

        The first rows tell nothing, and a fast plant's state may be any number there.
        """
        return np.where(self.blocks[output].scored, values, 0.0)

    @property
    def bic(self) -> float:
        """BIC of the current model, but for what every candidate shares with it."""
        return sum(fit.bic(0) for fit in self.noise)

    @property
    def score(self) -> float:
        """−2 log likelihood of fitted and held-out rows, and the price of the noise."""
        return self.bic + sum(fit.held_minus_two_log for fit in self.noise)

    @property
    def score_under_declared(self) -> float:
        """The same under the declared noise, of every output whose model declares one."""
        total = 0.0
        for i, own in enumerate(self.noise):
            fit = self.under_declared(i) if self.declared[i] and own.enlarged else own
            total += fit.bic(0) + fit.held_minus_two_log
        return total

    def held_gain(self, before: "Baseline") -> float:
        """Return −2 log likelihood that it gains on the held-out rows against another model."""
        return sum(
            old.held_minus_two_log - new.held_minus_two_log
            for old, new in zip(before.noise, self.noise, strict=True)
        )
