import numpy as np
import pytest

from stiction_studies.field import ValveKind
from stiction_studies.field.counterfactual.again import Again, Control
from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.simulation import run
from stiction_studies.field.valves import Law


def _plain(law: Law) -> Again:
    """Return the first loop of a law whose controller moves once a sample, as it is read."""
    for seed in range(200):
        again = Again.of(seed)
        clock, circumstances = again.made.loop.clock, again.loop.circumstances
        unusual = {"averaged", "manual", "exception", "swinging_door", "both_rounded"}
        if again.made.loop.valve.law is not law or clock.scan != clock.sample:
            continue
        if again.loop.truth.valve is ValveKind.HEALTHY or unusual & set(circumstances):
            continue
        if {"op_rounded", "pv_rounded", "gap"} & set(circumstances):
            continue
        return again
    raise AssertionError("no such loop")


@pytest.fixture(scope="module")
def again() -> Again:
    return _plain(Law.HE)


def test_the_run_is_the_one_that_was_recorded(again: Again) -> None:
    recorded = again.as_recorded()
    assert recorded.stem == pytest.approx(again.loop.stem[:, 0])
    record = again.loop.record
    good = np.isfinite(record.pv[:, 0])
    if record.sp is not None:
        error = (record.pv - record.sp)[good, 0]
        assert np.median(np.abs(recorded.error[good] - error)) < 1e-9


def test_a_controller_that_repeats_op_repeats_the_loop(again: Again) -> None:
    made = again.made
    out = run(made.loop, made.signals)
    op = iter((again.factor * out.op + again.offset)[made.warm :: made.loop.clock.sample])
    repeated = again.controlled(lambda past, ops: lambda pv, sp, last: float(next(op)))
    recorded = again.as_recorded()
    assert repeated.stem == pytest.approx(recorded.stem, abs=1e-6)
    assert repeated.error == pytest.approx(recorded.error, abs=1e-6 * np.ptp(recorded.error))


def test_a_controller_takes_over_at_a_row_what_has_been_so_far(again: Again) -> None:
    row, made = 150, again.made
    out = run(made.loop, made.signals)
    step = made.loop.clock.sample
    begun = made.warm + int(again.samples[row]) * step
    op = iter((again.factor * out.op + again.offset)[begun::step])
    taken = []

    def take_over(pv: FloatArray, ops: FloatArray) -> Control:
        taken.append((pv, ops))
        return lambda pv, sp, last: float(next(op))

    repeated, recorded = again.controlled(take_over, row), again.as_recorded()
    assert repeated.stem == pytest.approx(recorded.stem, abs=1e-6)
    assert repeated.error == pytest.approx(recorded.error, abs=1e-6 * np.ptp(recorded.error))
    ((pv, ops),) = taken
    assert pv[-1] == out.pv[begun - step]
    assert ops[-1] == again.factor * out.op[begun - step] + again.offset
    assert len(pv) == len(ops) >= row


def test_a_serviced_valve_follows_and_the_loop_does_better(again: Again) -> None:
    before, after = again.as_recorded(), again.serviced()
    assert np.abs(after.error).mean() < np.abs(before.error).mean()


def test_factors_of_one_change_nothing(again: Again) -> None:
    assert np.array_equal(again.retuned(1.0, 1.0).error, again.as_recorded().error)
    assert not np.array_equal(again.retuned(0.5, 2.0).error, again.as_recorded().error)
