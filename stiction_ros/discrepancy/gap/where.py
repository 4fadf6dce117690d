"""Step 3, where the gap is: in time, at which moves, at which place, at which frequency."""

import dataclasses

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.least_squares import left_by, projector
from stiction_ros.discrepancy.measures import LARGER, MAJORITY, MARGIN
from stiction_ros.discrepancy.simulation.free_run import FEWEST
from stiction_ros.effects.behaviour import BoolArray, FloatArray
from stiction_ros.signals.holds import set_point_moves
from stiction_ros.texts import spoken

WEIGHTS = 10.0 ** np.arange(-3.0, 4.0)


@dataclasses.dataclass(frozen=True)
class Track:
    """A slow disturbance at one place that would close the gap, smoothed."""

    place: str  # ``valve:TAG`` or ``disturbance:TAG``
    wave: FloatArray  # shape (N,), % at a valve, units of the output at a disturbance
    gain: float  # −2 log likelihood that it gains, less two per degree of freedom that it uses


@dataclasses.dataclass(frozen=True)
class Where:
    """Where the gap of one model is."""

    sentences: tuple[str, ...]  # for people
    track: Track | None  # at the place where it gains most; None in a record that is too short


def locate(base: Baseline) -> Where:
    """Return where the gap of the current model is."""
    track = max(_tracks(base), key=lambda track: track.gain, default=None)
    sentences: list[str] = []
    for i, name in enumerate(base.run.model.outputs):
        sentences += _at_moments(base, i, name)
        period, share = _line(base, i)
        if share > MAJORITY:
            sentences.append(
                f"{name}: {100 * share:.0f} % of the gap has a period of {spoken(period)}"
            )
    if track is not None and track.gain > MARGIN:
        sentences.append(f"a slow disturbance at {track.place} would close most of the gap")
    return Where(tuple(sentences), track)


def _at_moments(base: Baseline, output: int, name: str) -> list[str]:
    """Return at which moments the innovations are larger than elsewhere."""
    noise = base.noise[output]
    scored = base.blocks[output].scored
    squares = noise.innovations**2
    usual = float(np.median(squares[scored])) if scored.any() else 0.0
    if usual <= 0.0:
        return []
    found = []
    for what, moments in _moments(base).items():
        rows = moments & scored
        if 5 <= rows.sum() < 0.5 * scored.sum():
            ratio = float(np.sqrt(np.mean(squares[rows]) / np.mean(squares[scored & ~rows])))
            if ratio > LARGER:
                found.append(f"{name}: innovations are {ratio:.1f} times larger {what}")
    moment, ratio = _change(noise.residual, scored)
    if ratio > MAJORITY:
        at = spoken(base.run.runs.time[moment])
        found.append(f"{name}: the gap's level changes at {at}")
    return found


def _moments(base: Baseline) -> dict[str, BoolArray]:
    """Return rows shortly after moves of SP, and with OP at a limit."""
    run = base.run
    count = len(run.runs)
    found: dict[str, BoolArray] = {}
    moved = np.zeros(count, dtype=bool)
    for record, rows in zip(run.runs.records, run.runs.slices, strict=True):
        if record.sp is not None:
            moved[rows][set_point_moves(record.sp)] = True
    reach = max(run.responses.skip + 10, 10)
    if moved.any():
        after = np.convolve(moved.astype(float), np.ones(reach))[:count]
        found["after moves of the set-point"] = after > 0.0
    for j, valve in enumerate(run.model.valves):
        op = run.runs.op[:, j]
        if valve.limits is not None:
            found[f"while OP of {valve.name} is at a limit"] = np.isin(op, valve.limits)
    return found


def _change(residual: FloatArray, scored: BoolArray) -> tuple[int, float]:
    """Return the moment of the largest change of level and the share of variance it explains."""
    values = np.where(scored, residual, 0.0)
    mean = values[scored].mean() if scored.any() else 0.0
    total = float(np.sum((values[scored] - mean) ** 2))
    if total <= 0.0:
        return 0, 0.0
    count = np.cumsum(scored).astype(float)
    summed = np.cumsum(np.where(scored, residual - mean, 0.0))
    weight = count * (count[-1] - count) / count[-1]
    inside = weight > 0.05 * count[-1]
    gain = np.where(inside, summed**2 / np.maximum(weight, 1e-9), 0.0)
    moment = int(np.argmax(gain))
    return moment, float(gain[moment]) / total


def _line(base: Baseline, output: int) -> tuple[float, float]:
    """Return the strongest period of the gap in seconds and its share of the variance."""
    part = base.scored(output, base.noise[output].residual)[base.run.runs.longest]
    part = part - part.mean()
    power = np.abs(np.fft.rfft(part * np.hanning(len(part)))) ** 2
    power[:2] = 0.0
    peak = int(np.argmax(power))
    total = float(power.sum())
    share = float(power[max(peak - 2, 0) : peak + 3].sum()) / total if total > 0.0 else 0.0
    return len(part) * base.run.runs.sample_time / max(peak, 1), share


def _tracks(base: Baseline) -> list[Track]:
    run = base.run
    hats = _hats(base)
    found = []
    for i, name in enumerate(run.model.outputs):
        if int(base.blocks[i].train.sum()) < FEWEST:
            continue
        found.append(_track(base, i, f"disturbance:{name}", hats, hats))
        for j, valve in enumerate(run.model.valves):
            moved = run.drive(i, j, run.stems[:, j, None] + hats) - run.forced[:, i, None]
            if np.ptp(moved) > 0.0:
                found.append(_track(base, i, f"valve:{valve.name}", hats, moved))
    return found


def _hats(base: Baseline) -> FloatArray:
    """Return piecewise linear functions of time, shape (N, K)."""
    count = len(base.run.runs)
    at = np.linspace(0.0, count - 1.0, max(2 * count // base.run.runs.block, 3))
    width = at[1] - at[0]
    rows = np.arange(count)[:, None]
    return np.asarray(np.maximum(1.0 - np.abs(rows - at) / width, 0.0))


def _track(base: Baseline, output: int, place: str, hats: FloatArray, columns: FloatArray) -> Track:
    """Return the smooth wave at a place by penalised least squares, its weight by AIC.

    What is left counts as white: the noise model would take the slow part of the gap for noise.
    """
    train = base.blocks[output].train
    basis = projector(base.columns[output][train])
    target = left_by(basis, base.run.gap[train, output])
    inner = left_by(basis, columns[train])
    gram, cross = inner.T @ inner, inner.T @ target
    rough = np.diff(np.eye(columns.shape[1]), axis=0)
    penalty = rough.T @ rough
    scale = float(np.trace(gram)) / max(float(np.trace(penalty)), 1e-300)
    rows, before = len(target), max(float(target @ target), 1e-300)
    best, wave = -np.inf, np.zeros(len(hats))
    for weight in WEIGHTS * scale:
        held = gram + weight * penalty + 1e-9 * float(np.trace(gram)) * np.eye(len(gram))
        beta = np.linalg.solve(held, cross)
        left = max(float(np.sum((target - inner @ beta) ** 2)), 1e-300)
        freedom = float(np.trace(np.linalg.solve(held, gram)))
        gain = rows * float(np.log(before / left)) - 2.0 * freedom
        if gain > best:
            best, wave = gain, hats @ beta
    return Track(place, wave, best)
