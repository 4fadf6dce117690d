from __future__ import annotations

import math

from bag_making import JOINT_STATE, SECOND, Bag, clock, joint_state

from stiction_ros.records.run_log import Estimate, ModeChange, read_run


def test_a_run(bag: Bag) -> None:
    start = 5 * SECOND
    bag.text("/plant/config", "seed: 7", start)
    bag.text("/mode", "unaware", start)
    bag.loop(30)
    for k in range(30):
        stamp = start + k * SECOND
        bag.put("/clock", "rosgraph_msgs/msg/Clock", clock(stamp), stamp)
        swapped = k >= 20
        values = {
            "mode": "embedding" if swapped else "unaware",
            "model": "fit 3" if swapped else "ideal",
            "reason": "trusted" if k == 20 else "",
            "published:/op": str(k + 1),
        }
        bag.diagnostics(stamp, "controller: solve", values)
    bag.diagnostics(start, "plant: step", {"published /pv": "12", "published:/diagnostics": "1"})
    bag.diagnostics(start, "plant: step", {"published /pv": "30", "published:/diagnostics": "2"})
    bag.diagnostics(start, "estimator: fit", {"published:/diagnostics": "3"})
    stamp = start + 15 * SECOND
    state = joint_state(stamp, ["V1.f_s", "V1.f_d"], [8.0, 1.0], [7.9, 0.9], [8.1])
    bag.put("/stiction", JOINT_STATE, state, stamp)
    bag.text("/loop_model", "loop: tank", stamp)
    bag.writer.close()

    run = read_run(bag.writer.directory)
    assert len(run.record) == 30
    assert run.start == start
    assert run.estimates[0] == Estimate(stamp, "V1.f_s", 8.0, 7.9, 8.1)
    assert run.estimates[1].low == 0.9
    assert math.isnan(run.estimates[1].high)
    assert run.modes == (
        ModeChange(start, "unaware", "ideal", ""),
        ModeChange(start + 20 * SECOND, "embedding", "fit 3", "trusted"),
    )
    assert run.swap is not None
    assert run.seconds(run.swap.stamp) == 20.0
    assert [item.text for item in run.loop_models] == ["loop: tank"]
    assert [(item.topic, item.text) for item in run.configs] == [("/plant/config", "seed: 7")]
    assert run.clock == tuple(start + k * SECOND for k in range(30))
    assert run.recorded == bag.writer.counts
    assert run.published == {"/op": 30, "/pv": 30, "/diagnostics": 5}


def test_without_diagnostics_the_mode_topic_stands_in(bag: Bag) -> None:
    bag.loop(5)
    for time, mode in ((5, "unaware"), (6, "unaware"), (7, "embedding")):
        bag.text("/mode", mode, time * SECOND)
    run = read_run(bag.writer.directory)
    assert [(change.stamp, change.mode) for change in run.modes] == [
        (5 * SECOND, "unaware"),
        (7 * SECOND, "embedding"),
    ]
    assert run.published == {}
    assert run.notes == ("run_0.mcap was not closed by its writer",)


def test_a_run_that_never_swaps(bag: Bag) -> None:
    bag.loop(5)
    assert read_run(bag.writer.directory).swap is None
