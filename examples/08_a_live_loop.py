"""The live loop: it cycles, the friction is identified, the controller is swapped.

For ROS engineers: what plant, controller and estimator do as nodes, in one process without ROS;
in lockstep and with the same seed the nodes give the same numbers, bit for bit.
"""

import numpy as np

from stiction_ros import LiveRun, Scenario, find_config, run_live


def error(live: LiveRun, first: int, last: int) -> str:
    """Return the mean |SP − PV| over some samples, in words."""
    record = live.run.record
    assert record.sp is not None
    mean = np.abs(record.sp - record.pv)[first:last].mean()
    return f"{mean:.3f} over samples {first} to {last}"


def main(samples: int = 5504) -> None:
    """Run the scenario siso for a round of its set-points before the swap, and one after."""
    scenario = Scenario.load(find_config("siso.scenario.yaml"))
    live = run_live(scenario, seed=7, samples=samples)
    for fit in live.fits:
        valve = fit.identification.valves[0]
        print(f"{fit.end:5d}: {valve.verdict}, f_S {valve.static_friction:.2f} %")
    for change in live.changes:
        print(f"{change.sample:5d}: {change.mode}")
    if live.swap is not None:
        swap = live.swap.sample
        print(f"mean |error| {error(live, max(swap - 2500, 0), swap)}")
        print(f"mean |error| {error(live, swap, samples)}")


if __name__ == "__main__":
    main()
