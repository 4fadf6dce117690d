"""Which effects a record could show: the BIC that an effect of engineering size would gain."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.discrepancy.candidates import Candidate
from stiction_ros.discrepancy.noise import left_by, projector, whiten
from stiction_ros.discrepancy.search import Baseline
from stiction_ros.effects import FloatArray

EXPERIMENTS = {
    "stiction": "let OP reverse by more than the friction that matters, as a cycle does",
    "backlash": "let OP reverse by more than the play that matters",
    "slew": "move the set-point so far that OP moves fast",
    "lag": "move the set-point in steps",
    "pole": "move the set-point in steps",
    "delay": "move the set-point in steps",
    "saturation": "drive OP towards the limit and hold it there until PV settles",
    "characteristic": "hold the set-point at levels for which OP differs by tens of per cent",
    "gain": "move the set-point in steps well above the noise",
    "leak": "move the set-point and hold it for several times the leak's time",
    "step": "take a longer record around the moment",
    "drift": "take a longer record",
    "sine": "take a record of many periods",
    "offset": "measure the stem: a constant offset is taken up by the operating point",
    "coloured": "none: coloured noise is what the noise model describes",
}


@dataclasses.dataclass(frozen=True)
class Testable:
    """Whether one effect of engineering size would be seen.

    Attributes:
        place, effect: as loop models name them.
        expected: BIC that it would gain on this record.
        testable: whether that beats the margin.
        experiment: what would make it testable.
    """

    place: str
    effect: str
    expected: float
    testable: bool
    experiment: str


def testable_effects(
    base: Baseline, candidates: list[Candidate], margin: float
) -> tuple[Testable, ...]:
    """Return for every candidate of the catalogue what it would gain at a size that matters."""
    found: dict[tuple[str, str], Testable] = {}
    for candidate in candidates:
        if not candidate.inside:
            continue
        expected = _expected(base, candidate)
        for name in candidate.keys:
            old = found.get(name)
            if old is None or old.expected < expected:
                hint = EXPERIMENTS.get(candidate.effect, "")
                found[name] = Testable(*name, expected, expected >= margin, hint)
    for valve in base.run.model.valves:
        name = (f"valve:{valve.name}", "offset")
        found[name] = Testable(*name, 0.0, False, EXPERIMENTS["offset"])
    return tuple(found.values())


def _expected(base: Baseline, candidate: Candidate) -> float:
    point = reference_point(base, candidate)
    response = candidate.respond(base.run, point)
    energy = 0.0
    rows = 2
    for i in response.outputs:
        noise, blocks = base.noise[i], base.blocks[i]
        wave = np.zeros(len(base.run.runs))
        if i in response.shifts:
            wave = wave + response.shifts[i][:, 0]
        if i in response.sizes:
            wave = wave + _reference_size(candidate, noise.innovation_std, response.sizes[i][:, 0])
        train = blocks.train
        basis = projector(whiten(base.columns[i], noise.ar)[train])
        left = left_by(basis, whiten(wave, noise.ar)[train])
        energy += float(left @ left) / max(noise.innovation_std**2, 1e-300)
        rows = max(rows, noise.rows)
    return energy - candidate.count(point[0]) * float(np.log(rows))


def reference_point(base: Baseline, candidate: Candidate) -> FloatArray:
    """Return the searched figures of an effect of engineering size, shape (1, axes)."""
    step = base.run.runs.sample_time
    length = len(base.run.runs) * step
    if candidate.effect == "saturation":
        low, high = candidate.axes
        op = base.run.stems[:, _valve(base, candidate)]
        return np.array([[low.low, float(np.clip(np.quantile(op, 0.95), high.low, high.high))]])
    sizes = {
        "stiction": (1.0, 0.5, 0.0),
        "backlash": (1.0, 0.0),
        "lag": (3.0 * step, 0.0),
        "pole": (3.0 * step, 0.0),
        "delay": (2.0,),
        "characteristic": (1.0,),
        "leak": (10.0 / length,),
        "step": (0.5 * length,),
        "sine": (10.0 / len(base.run.runs),),
    }
    if candidate.effect == "slew":
        return np.array([[0.2 * candidate.axes[0].high]])
    values = sizes.get(candidate.effect, ())
    axes = zip(values, candidate.axes, strict=True)
    return np.array([[float(np.clip(v, axis.low, axis.high)) for v, axis in axes]])


def _reference_size(candidate: Candidate, std: float, columns: FloatArray) -> FloatArray:
    """Return the wave of a size that matters: a tenth of the gain, or three innovations."""
    if candidate.effect == "gain":
        return np.asarray(0.1 * columns[:, 0])
    span = max(float(np.ptp(columns[:, 0])), 1e-300)
    return np.asarray(columns[:, 0] * (3.0 * std / span))


def _valve(base: Baseline, candidate: Candidate) -> int:
    names = [f"valve:{name}" for name in base.run.model.valve_names]
    return names.index(candidate.place)
