import json
import math

from bag_making import SECOND, Bag, clock

from stiction_ros.records.run.events import Fit, ModeChange
from stiction_ros.records.run.log import RunLog, read_run
from stiction_ros.report.run.scoring import PhaseStatus, phases


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
    valve = {"name": "V1", "f_s": 8.0, "f_s_interval": [7.9, 8.1], "f_d": None}
    found = {"window_end": str(stamp), "identification": json.dumps({"valves": [valve]})}
    bag.diagnostics(stamp, "estimator: fit", found)
    bag.text("/loop_model", "loop: tank", stamp)
    bag.writer.close()

    run = read_run(bag.writer.directory)
    assert len(run.record) == 30
    assert run.start == start
    fit = run.fits[0]
    assert (fit.stamp, fit.friction("V1", "f_s")) == (stamp, (8.0, 7.9, 8.1))
    assert all(map(math.isnan, fit.friction("V1", "f_d")))
    assert run.modes == (
        ModeChange(start, "unaware", "ideal", ""),
        ModeChange(start + 20 * SECOND, "embedding", "fit 3", "trusted"),
    )
    assert run.swap is not None
    assert run.seconds(run.swap.stamp) == 20.0
    assert [item.text for item in run.loop_models] == ["loop: tank"]
    assert [(item.topic, item.text) for item in run.configs] == [("/plant/config", "seed: 7")]
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


def test_fits_and_the_friction_that_the_controller_works_with(bag: Bag) -> None:
    start = 5 * SECOND
    bag.loop(10)
    known = {"V1.f_s": "8.0", "V1.f_d": "1.0", "V1.trusted_f_s": "9"}
    for k, more in ((0, {}), (4, known), (7, {**known, "V1.f_s": "7.5"}), (8, {"V1.f_s": "?"})):
        values = {"mode": "embedding", "model": "tank", **more}
        bag.diagnostics(start + k * SECOND, "controller: mode", values)
    fit = {
        "window_end": str(start + 3 * SECOND),
        "V1.trusted_f_s": "8.0",
        "identification": '{"valves": []}',
    }
    bag.diagnostics(start + 4 * SECOND, "estimator: fit", fit)
    bag.diagnostics(start + 4 * SECOND, "estimator: fit", {**fit, "identification": "{"})
    bag.writer.close()
    run = read_run(bag.writer.directory)
    assert run.fits == (Fit(start + 3 * SECOND, {"valves": []}, {"V1.f_s": 8.0}),)
    assert [change.frictions for change in run.modes] == [
        {},
        {"V1.f_s": 8.0, "V1.f_d": 1.0},
        {"V1.f_s": 7.5, "V1.f_d": 1.0},
        {},
    ]


def test_stem_estimates_come_from_the_first_point_of_the_prediction(bag: Bag) -> None:
    start = 5 * SECOND
    bag.loop(4)
    for k in (0, 2, 3):
        bag.prediction(start + k * SECOND, ["C", "T", "V2", "V1"], [7.0, 42.0, 20.0 + k, 10.0 + k])
    bag.writer.close()
    run = read_run(bag.writer.directory)
    assert run.stem_estimate is not None
    assert run.stem_estimate.shape == (4, 2)
    assert run.stem_estimate[[0, 2, 3]].tolist() == [[10.0, 20.0], [12.0, 22.0], [13.0, 23.0]]
    assert all(math.isnan(value) for value in run.stem_estimate[1])
    assert run.wall_seconds == 3.0


def swapped_at(bag: Bag, samples: int, swap: int) -> RunLog:
    """Return the log of a run whose diagnostics tell of a swap at a sample."""
    start = 5 * SECOND
    bag.loop(samples)
    bag.diagnostics(start, "controller: mode", {"mode": "unaware"})
    bag.diagnostics(start + swap * SECOND, "controller: mode", {"mode": "embedding"})
    return read_run(bag.writer.directory)


def test_a_swap_whose_first_sample_was_cut_off_is_none(bag: Bag) -> None:
    run = swapped_at(bag, samples=30, swap=30)
    assert (run.swap, run.swap_sample, run.fit_at_swap) == (None, None, None)
    assert phases(run.record, run.swap_sample, None).status is PhaseStatus.NO_SWAP


def test_a_swap_at_the_last_sample_is_one(bag: Bag) -> None:
    assert swapped_at(bag, samples=30, swap=29).swap_sample == 29
