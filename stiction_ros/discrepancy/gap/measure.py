"""Step 2: how large the gap is, against its noise floor, and its noise against the declared one."""

import dataclasses
import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise, seen_noise
from stiction_ros.discrepancy.measures import LARGER, TRACE
from stiction_ros.effects import FloatArray


@dataclasses.dataclass(frozen=True)
class OutputGap:
    """The gap of one output on the held-out rows, units of the output."""

    name: str  # tag
    free_run_rmse: float  # of PV less the free run
    one_step_rmse: float  # of the innovations
    floor_free_run: float  # stationary standard deviation of the AR noise
    floor_one_step: float  # standard deviation of its innovations on the fitted rows

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``gap --json``."""
        return {
            "free_run_rmse": self.free_run_rmse,
            "one_step_rmse": self.one_step_rmse,
            "noise_floor": {"free_run": self.floor_free_run, "one_step": self.floor_one_step},
        }


def levelled(base: Baseline) -> Baseline:
    """Return the model with the level and the start that suit the free run best.

    The likelihood of noise with a long memory hardly sees them, and a free run with its figures may
    stand anywhere. A column that is next to nothing in the fitted rows is left out, as its figure
    could move the held-out rows by any amount.

    Args:
        base: the model.
    """
    noises = []
    for noise, columns, blocks in zip(base.noise, base.columns, base.blocks, strict=True):
        sizes = np.linalg.norm(columns[blocks.scored], axis=0)
        scaled = columns / np.where(sizes > 0.0, sizes, 1.0)
        rows, left = blocks.train, noise.residual
        shift = np.linalg.lstsq(scaled[rows], left[rows], rcond=TRACE)[0]
        noises.append(dataclasses.replace(noise, residual=left - scaled @ shift))
    return dataclasses.replace(base, noise=tuple(noises))


def free_run_gap(base: Baseline) -> tuple[OutputGap, ...]:
    """Return the gap of every output as a reader sees it: its free run is :func:`levelled`."""
    pairs = zip(measure_gap(levelled(base)), measure_gap(base), strict=True)
    return tuple(dataclasses.replace(run, one_step_rmse=own.one_step_rmse) for run, own in pairs)


def measure_gap(base: Baseline) -> tuple[OutputGap, ...]:
    """Return the gap of every output on rows that no figure was fitted to."""
    found = []
    for name, noise, blocks in zip(base.run.model.outputs, base.noise, base.blocks, strict=True):
        found.append(
            OutputGap(
                name,
                rms(noise.residual[blocks.held]),
                rms(noise.innovations[blocks.held]),
                min(noise.stationary_std, rms(noise.residual[blocks.train])),
                noise.innovation_std,
            )
        )
    return tuple(found)


class Shrunk(NamedTuple):
    """What is left of one output without something and with it, units of the output."""

    before: float
    after: float
    floor: float  # of the model with it: what it caused counts as noise before
    unit: float  # standard deviation of the innovations


def closed_share(before: tuple[OutputGap, ...], after: tuple[OutputGap, ...]) -> float:
    """Return the share of the free-run excess over the noise floor that is gone."""
    return gone_share(
        Shrunk(old.free_run_rmse, new.free_run_rmse, new.floor_free_run, new.floor_one_step)
        for old, new in zip(before, after, strict=True)
    )


def gone_share(outputs: Iterable[Shrunk]) -> float:
    """Return the share of the excess over the noise floor that is gone.

    Rows that have less noise by chance have a lower floor. Outputs are weighted by their excess in
    units of their innovations. 0 where there was no excess.
    """
    excess, gone = 0.0, 0.0
    for each in outputs:
        floor, unit = min(each.floor, each.after), max(each.unit, 1e-300)
        much, left = (max(rmse - floor, 0.0) / unit for rmse in (each.before, each.after))
        excess += much
        gone += much - left
    return gone / excess if excess > 0.0 else 0.0


def rms(values: FloatArray) -> float:
    """Return the root of the mean square, NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


@dataclasses.dataclass(frozen=True)
class OutputNoise:
    """The noise of one output, units of the output."""

    name: str  # tag
    # standard deviation of the innovations as the model has it; NaN where the model declares none
    declared: float
    # of those that the declared noise and what the sensor does to the values, such as rounding,
    # make together; NaN where none is declared
    expected: float
    found: float  # of those that the answer leaves, under the declared form
    disagrees: bool  # whether they are larger than declared, or depend on each other
    dependent: bool  # whether they depend on each other

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``gap --json``; a missing declaration is null."""
        return {
            "declared": None if math.isnan(self.declared) else self.declared,
            "found": self.found,
            "disagrees": self.disagrees,
        }


def check_noise(base: Baseline) -> tuple[OutputNoise, ...]:
    """Return declared and found noise of every output under a model."""
    found = []
    runs = base.run.runs
    seen = seen_noise(base.run.model, runs.lattices, runs.unseen)
    for i, (name, declared) in enumerate(
        zip(base.run.model.outputs, declared_noise(base.run.model), strict=True)
    ):
        fit, quantum = base.noise[i], runs.quanta[i]
        if declared is None:
            found.append(OutputNoise(name, math.nan, math.nan, fit.innovation_std, False, False))
            continue
        shown = max(seen[i], key=lambda form: form.std)
        expected = math.sqrt(shown.std**2 + (0.0 if len(shown.ar) else quantum**2 / 12.0))
        disagrees = fit.enlarged or fit.innovation_std > LARGER * expected
        found.append(
            OutputNoise(name, declared.std, expected, fit.innovation_std, disagrees, fit.enlarged)
        )
    return tuple(found)


def noise_sentences(noises: tuple[OutputNoise, ...]) -> list[str]:
    """Return where and how far the noise is another than declared, for people."""
    said = []
    for each in noises:
        if not each.disagrees:
            continue
        size = f"{each.name}: innovations of {each.found:.3g} where the model declares "
        size += f"{each.declared:.3g}"
        if each.dependent:
            size += ", and they depend on each other"
        said.append(size)
    return said
