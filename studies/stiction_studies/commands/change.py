"""``stiction study-change``: a scenario whose sticky valve changes after the swap."""

import argparse
import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.scenarios import find
from stiction_ros.effects import Behaviour, HeStiction
from stiction_ros.errors import InputError
from stiction_ros.loop import ValveChange
from stiction_studies.seeds import add_jobs, add_seeds, run_seeds

if TYPE_CHECKING:
    from stiction_ros.online.session import LiveRun, Scenario

CHANGES = ("serviced", "little", "grown", "both", "unchanged")
UNAWARE_ROUNDS = 3  # of set-points in the run that is never swapped; all but the first count
AT = 0.7  # of the scenario's samples: when the valve changes
MOVES = 60  # moves of the stem within which a service should be noticed
NEAR = (0.3, 0.05)  # % and share by which a friction found may be off
QUIET = 0.15  # amplitude of the cycle after a growth, over that without a swap


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One seed."""

    seed: int  # of the noise
    good: bool  # whether the loop did what is asked of it
    # samples from the change to the first sample of a controller that knows it, None when there was
    # none
    noticed: int | None
    moves: int  # moves of the stem estimate in the meantime, or since the change
    mode: str  # mode, static_friction: trusted at the end; f_S in %, None without friction
    static_friction: float | None
    # of the cycle in the last round over that which the same seed has under the unaware controller
    # with the friction from before the change, by output
    amplitude: dict[str, float]


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "study-change",
        description="Run a scenario's live loop over many seeds by the core, without ROS; once the "
        "controller knows the friction, the valve changes: serviced (no friction is left), "
        "little (f_S .2 %, f_D .1 %), grown (f_S half as large again), both (f_D as well), or "
        "unchanged. Exit code 1 when a run did not do what is asked.",
    )
    parser.add_argument("scenario", metavar="SCENARIO", help="tank, siso, or a file")
    parser.add_argument(
        "--change", choices=CHANGES, default="serviced", help="how the valve changes (serviced)"
    )
    add_seeds(parser, 11, 30)
    add_jobs(parser)
    parser.add_argument("--json", metavar="F", help="write every run; - for stdout")
    parser.set_defaults(run=run)


def _sticky(scenario: "Scenario") -> int:
    """Return the index of the valve that changes.

    Raises:
        InputError: no valve with He's friction.
    """
    for j, valve in enumerate(scenario.plant.valves):
        if any(isinstance(effect, HeStiction) for effect in valve.effects):
            return j
    raise InputError("has no sticky valve", where=scenario.name, fix="give one law: he")


def changed(scenario: "Scenario", change: str) -> "tuple[Scenario, Behaviour | None]":
    """Return the scenario with the change, and the friction of its valve after it.

    Raises:
        InputError: no valve with He's friction.
    """
    valve = scenario.plant.valves[_sticky(scenario)]
    old = next(effect for effect in valve.effects if isinstance(effect, HeStiction))
    new: dict[str, HeStiction | None] = {
        "serviced": None,
        "little": HeStiction(0.2, 0.1),
        "grown": HeStiction(1.5 * old.static_friction, old.dynamic_friction),
        "both": HeStiction(1.5 * old.static_friction, 1.5 * old.dynamic_friction),
        "unchanged": old,
    }
    at = round(AT * scenario.samples)
    round_samples = round(scenario.set_points.repeat / scenario.plant.sample_time)
    rounds = math.ceil((at + scenario.estimator.window) / round_samples)
    friction = new[change]
    changes = ValveChange(
        at * scenario.plant.sample_time, valve.name, () if friction is None else (friction,)
    )
    longer = dataclasses.replace(
        scenario,
        samples=rounds * round_samples,
        valve_changes=() if change == "unchanged" else (changes,),
    )
    return longer, friction


def run_seed(scenario: "Scenario", change: str, seed: int) -> Outcome:
    """Run one seed; a plain function, so that a worker process can run it."""
    from stiction_ros.control import ControlMode
    from stiction_ros.online.session import run_live

    chosen, friction = changed(scenario, change)
    live = run_live(chosen, seed=seed)
    at = round(AT * scenario.samples)
    fit = next((f for f in live.fits if f.end >= at and _happened(f)), None)
    sample = None if fit is None else fit.end + scenario.controller.fit_latency
    if friction is None or change == "little":
        modes = [c.sample for c in live.changes if c.mode is ControlMode.UNAWARE]
        sample = next((k for k in modes if k >= at), None)
    stem = live.stem_estimate[at - 1 : sample, _sticky(scenario)]
    moves = int(np.count_nonzero(np.diff(stem)))
    trusted = [t.static_friction for t in live.fits[-1].trusted.values()]
    outcome = Outcome(
        seed,
        False,
        None if sample is None else sample - at,
        moves,
        live.changes[-1].mode.value,
        trusted[0] if trusted else None,
        _amplitudes(live, chosen, seed),
    )
    good = _good(outcome, change, friction, scenario.estimator.window)
    return dataclasses.replace(outcome, good=good)


def _happened(fit: Any) -> bool:
    from stiction_ros.online.estimator.friction_change import ChangeStatus

    return any(change.status is not ChangeStatus.UNCHANGED for change in fit.changes)


def _good(outcome: Outcome, change: str, friction: Behaviour | None, window: int) -> bool:
    from stiction_ros.control import ControlMode

    found = outcome.static_friction
    if change in ("serviced", "little"):
        soon = outcome.noticed is not None and (
            outcome.moves <= MOVES and outcome.noticed <= window
        )
        return soon and found is None and outcome.mode == ControlMode.UNAWARE
    assert isinstance(friction, HeStiction)
    true = friction.static_friction
    near = found is not None and abs(found - true) <= max(NEAR[0], NEAR[1] * true)
    if change == "unchanged":
        return near and outcome.noticed is None and outcome.mode == ControlMode.EMBEDDING
    return near and all(value <= QUIET for value in outcome.amplitude.values())


def _amplitudes(live: "LiveRun", scenario: "Scenario", seed: int) -> dict[str, float]:
    """Return the cycle of the last round over that of the unaware controller.

    What comes before the swap does for this only where the swap comes late enough; the twin that
    is never swapped has cycles in every seed.
    """
    from stiction_ros.online.session import run_live
    from stiction_ros.report.run.scoring import errors, score
    from stiction_ros.signals.oscillation import dominant_cycle

    record = live.run.record
    round_samples = round(scenario.set_points.repeat / record.sample_time)
    unchanged = dataclasses.replace(scenario, valve_changes=())
    twin = run_live(unchanged, seed=seed, samples=UNAWARE_ROUNDS * round_samples, identify=False)
    cycle = dominant_cycle(*errors(twin.run.record.part(round_samples, len(twin.run.record))))
    if cycle is None:
        return dict.fromkeys(record.outputs, math.nan)
    sigma = [0.0] * len(record.outputs)
    before, after = (
        score(one, first, len(one), cycle.period, sigma).scores
        for one, first in ((twin.run.record, round_samples), (record, len(record) - round_samples))
    )
    return {
        name: (one.amplitude or math.nan) / (before[name].amplitude or math.nan)
        for name, one in after.items()
    }


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    path = find(options.scenario)
    from stiction_ros.online.session import Scenario

    scenario = Scenario.load(path)
    changed(scenario, options.change)  # refuses before anything is run
    work = functools.partial(run_seed, scenario, options.change)
    outcomes = run_seeds(work, options.seeds, options.jobs, f"{scenario.name} {options.change}")
    hand_over(
        options.json,
        [dataclasses.asdict(outcome) for outcome in outcomes],
        lambda: _print(scenario, options.change, outcomes),
    )
    return 0 if all(outcome.good for outcome in outcomes) else 1


def _print(scenario: "Scenario", change: str, outcomes: list[Outcome]) -> None:
    console = Console()
    table = Table(title=f"{scenario.name}, {change}", title_justify="left")
    for name in ("seed", "as asked", "noticed after", "moves", "mode", "f_S", "amplitude"):
        table.add_column(name)
    for one in outcomes:
        table.add_row(
            str(one.seed),
            "yes" if one.good else "no",
            "never" if one.noticed is None else f"{one.noticed} samples",
            str(one.moves),
            one.mode,
            "–" if one.static_friction is None else f"{one.static_friction:.2f}",
            ", ".join(f"{name} {value:.3f}" for name, value in one.amplitude.items()),
        )
    console.print(table)
    good = sum(one.good for one in outcomes)
    console.print(f"{good} of {len(outcomes)} runs did what is asked")
