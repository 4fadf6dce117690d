"""What goes on between two samples while a stem slips or slews, or something lags."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.simulation.equation import DELAY, Changeable, with_equation
from stiction_ros.discrepancy.simulation.responses import Responses, end_to_end, responses_of
from stiction_ros.effects import Behaviour, FloatArray, Lag, Slew
from stiction_ros.loop import LoopModel
from stiction_ros.processes import AlteredProcess, ArxOutput, ArxProcess

if TYPE_CHECKING:
    from stiction_ros.discrepancy.simulation.free_run import FreeRun

SLIDING = ("stiction", "backlash", "slew")
"""Effects with which a stem that moves goes on moving between two samples."""


def moves_on(model: LoopModel, output: int, valve: int) -> bool:
    """Tell whether what a valve does to an output goes on between two samples."""
    on_stem = model.valves[valve].effects
    lags = _lags((*on_stem, *_in_process(model, output), *model.sensors[output]))
    return bool(lags) or any(effect.effect in SLIDING for effect in on_stem)


def left_open(run: "FreeRun", output: int) -> list[FloatArray]:
    """Return blocks of columns, shape (N, q) each, for what an output does between samples.

    How late within a sample a stem moves is not known, nor how far a lag goes on.
    """
    model, found = run.model, []
    asked = [j for j, each in enumerate(run.runs.between) if each]
    for valve in asked:
        if not run.responses.reaches(output, valve):
            continue
        on_stem = model.valves[valve].effects
        if any(effect.effect in SLIDING for effect in on_stem):
            found += [_a_sample_late(run, output, valve), _half_a_sample_late(run, output, valve)]
        found += [_ahead(run, lag, _of(run, output, lag, valve)) for lag in _lags(on_stem)]
    if asked:
        in_process, at_sensor = _lags(_in_process(model, output)), _lags(model.sensors[output])
        found += [_ahead(run, lag, _of(run, output, lag)) for lag in in_process]
        found += [_of(run, output, lag) for lag in at_sensor]
    return found


def beyond_samples(
    run: "FreeRun", output: int, lags: FloatArray, valve: int | None = None
) -> FloatArray:
    """Return what lags of a plant are beyond such that act on the samples alone, shape (N, G).

    A plant is slowed between samples as well. Where the equation is that of none, its output is
    taken half a sample late.

    Args:
        run: without the lag.
        output: index of the output that is slower.
        lags: time constants, s, shape (G,).
        valve: index of the slow valve; None for the process and the sensor, which slow all.
    """
    step, name = run.runs.sample_time, None if valve is None else run.model.valve_names[valve]
    plants, equation = [], _equation(run, output)
    if equation is not None:
        slower = [equation.lagged(lag / step, name) for lag in lags.tolist()]
        plants = [_behind(run, output, own) for own in slower if own is not None]
    parts = []
    for rows in run.runs.slices:
        inputs, values = run.inputs(rows), run.forced[rows, output]
        if valve is not None:
            inputs = _by_one_valve(inputs, valve)
            values = run.responses.forced(output, inputs)[:, 0]
        on_samples = Lag.simulate_grid(lags[:, None], values, float(values[0]), step)
        if plants:
            exact = np.hstack([plant.forced(output, inputs) for plant in plants])
            parts.append(exact - on_samples)
        else:
            parts.append(-0.5 * np.diff(on_samples, axis=0, prepend=on_samples[:1]))
    return end_to_end(parts)


def _equation(run: "FreeRun", output: int) -> Changeable | None:
    process = run.model.process
    inner = process.inner if isinstance(process, AlteredProcess) else process
    return Changeable(inner.equations[output]) if isinstance(inner, ArxProcess) else None


def _behind(run: "FreeRun", output: int, own: ArxOutput) -> Responses:
    """Return the responses of the process with another equation of an output."""
    step = run.runs.sample_time
    return responses_of(with_equation(run.model.process, output, own, step), step)


def _by_one_valve(inputs: list[FloatArray], valve: int) -> list[FloatArray]:
    """Return the inputs of the process, with all valves at rest but the given one."""
    return [stem if j == valve else np.zeros_like(stem) for j, stem in enumerate(inputs)]


def _of(run: "FreeRun", output: int, lag: Lag, valve: int | None = None) -> FloatArray:
    return beyond_samples(run, output, np.array([lag.time_constant]), valve)


def _ahead(run: "FreeRun", lag: Lag, values: FloatArray) -> FloatArray:
    """Return what entered a lag on the samples, by the values that left it."""
    keep = math.exp(-run.runs.sample_time / lag.time_constant)
    return np.asarray(lfilter([1.0, -keep], [1.0 - keep], values, axis=0))


def not_yet_moved(run: "FreeRun", stems: FloatArray, rates: FloatArray | None = None) -> FloatArray:
    """Return what stems, shape (N, G), move in each sample, %: they lack of it what is to come.

    Args:
        run: of the current model.
        stems: positions at the ends of their moves.
        rates: of slews, %/s, shape (G,): a move that takes a part of a sample lacks as much less.
    """
    moves = np.zeros_like(stems)
    for rows in run.runs.slices:
        moves[rows][1:] = np.diff(stems[rows], axis=0)
    if rates is None:
        return moves
    return np.asarray(moves * np.abs(moves) / (rates * run.runs.sample_time))


def _a_sample_late(run: "FreeRun", output: int, valve: int) -> FloatArray:
    """Return the error of an output whose stem moves one sample late, and two, shape (N, 2).

    The stem has a mass, so that a move may go on in the next sample.
    """
    slews = [each.rate for each in run.model.valves[valve].effects if isinstance(each, Slew)]
    moves = not_yet_moved(run, run.stems[:, [valve]], np.array(slews[-1:]) if slews else None)
    later = np.zeros_like(moves)
    for rows in run.runs.slices:
        later[rows][1:] = moves[rows][:-1]
    return run.slope(output, valve, np.hstack([moves, moves + later]))


def _half_a_sample_late(run: "FreeRun", output: int, valve: int) -> FloatArray:
    """Return the error of an output whose stem moves half a sample late, shape (N, 1).

    This error is not half of the error for a whole sample. Without an ARX equation the shape is
    (N, 0).
    """
    equation = _equation(run, output)
    if equation is None:
        return np.zeros((len(run.runs), 0))
    late = np.array([0.5 * (figure.what == DELAY) for figure in equation.figures])
    plant, parts = _behind(run, output, equation.changed(late)), []
    for rows in run.runs.slices:
        inputs = _by_one_valve(run.inputs(rows), valve)
        parts.append(plant.forced(output, inputs) - run.responses.forced(output, inputs))
    return end_to_end(parts)


def _in_process(model: LoopModel, output: int) -> tuple[Behaviour, ...]:
    process = model.process
    return process.effects[output] if isinstance(process, AlteredProcess) else ()


def _lags(effects: Sequence[Behaviour]) -> list[Lag]:
    return [effect for effect in effects if isinstance(effect, Lag) and effect.time_constant > 0.0]
