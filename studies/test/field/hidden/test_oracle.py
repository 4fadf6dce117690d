"""The oracle: noise made white, what is there found, what is not there not."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter

from stiction_studies.field.hidden import Effect, HiddenLoop, hidden_loop
from stiction_studies.field.hidden.effect import LOAD, OUTPUT, PROCESS, SENSOR, VALVE
from stiction_studies.field.hidden.given import Kept, Noise
from stiction_studies.field.hidden.likelihood import Likelihood, true_form
from stiction_studies.field.hidden.oracle import Fits, family, oracle
from stiction_studies.field.hidden.plants import Plant

PLANT = Plant("flow", 1.0, (10.0, 4.0), 0.0, 3.0)
ROWS = 3000


def residual(noise: Noise) -> np.ndarray:
    random = np.random.default_rng(4)
    lead = 300
    white = random.standard_normal(ROWS + lead)
    values = noise.white * random.standard_normal(ROWS + lead)
    if noise.equation:
        a, _, _ = PLANT.sampled(1.0)
        values = values + lfilter([noise.equation], [1.0, *a], white)
    if noise.coloured:
        kept = np.exp(-1.0 / noise.memory)
        size = noise.coloured * np.sqrt(1.0 - kept**2)
        values = values + lfilter([size], [1.0, -kept], white)
    return np.asarray(values[lead:])


@pytest.mark.trial
@pytest.mark.parametrize(
    "noise", [Noise(0.5), Noise(0.0, equation=0.2), Noise(0.3, coloured=0.8, memory=12.0)]
)
def test_noise_of_its_true_form_becomes_white_and_of_size_one(noise: Noise) -> None:
    form = true_form(noise, PLANT, 1.0, Kept(noise.white))
    likelihood = Likelihood(form, np.ones((ROWS, 1)), np.ones(ROWS, dtype=np.bool_))
    bare = likelihood.bare(residual(noise)[:, None])[:, 0]
    assert bare.std() == pytest.approx(1.0, abs=0.05)
    for apart in range(1, 6):
        assert abs(np.mean(bare[apart:] * bare[:-apart])) < 0.07


@pytest.mark.trial
def test_the_true_form_is_likelier_than_another() -> None:
    noise = Noise(0.3, coloured=0.8, memory=12.0)
    rows = np.ones(ROWS, dtype=np.bool_)
    forms = [true_form(n, PLANT, 1.0, Kept(n.white)) for n in (noise, Noise(0.8))]
    true, white = (Likelihood(f, np.ones((ROWS, 1)), rows).of(residual(noise)) for f in forms)
    assert true > white + 100.0


def test_free_columns_and_rows_that_do_not_count_change_nothing() -> None:
    values = residual(Noise(0.5))
    rows = np.ones(ROWS, dtype=np.bool_)
    rows[100:110] = False
    likelihood = Likelihood(true_form(Noise(0.5), PLANT, 1.0, Kept(0.5)), np.ones((ROWS, 1)), rows)
    before = likelihood.of(values)
    spoilt = values + 7.0
    spoilt[100:110] = 1e6
    assert likelihood.of(spoilt) == pytest.approx(before)


def test_columns_gain_what_they_explain() -> None:
    values = residual(Noise(0.5))
    late = (np.arange(ROWS) > 1200).astype(float)
    likelihood = Likelihood(
        true_form(Noise(0.5), PLANT, 1.0, Kept(0.5)),
        np.ones((ROWS, 1)),
        np.ones(ROWS, dtype=np.bool_),
    )
    left = values + 0.4 * late
    (gained,) = likelihood.with_columns(left, late[:, None], 1)
    assert gained == pytest.approx(likelihood.of(values), abs=3.0)
    assert gained > likelihood.of(left) + 100.0


def test_columns_that_are_free_gain_nothing_again() -> None:
    rows, time = np.ones(ROWS, dtype=np.bool_), np.arange(ROWS, dtype=float)
    free = np.column_stack([np.ones(ROWS), time])
    likelihood = Likelihood(true_form(Noise(0.5), PLANT, 1.0, Kept(0.5)), free, rows)
    values = residual(Noise(0.5))
    again = np.column_stack([3.0 * time - 2.0, np.cos(time), np.sin(time)])
    (gained,) = likelihood.with_columns(values, again[:, :1], 1)
    assert gained == likelihood.of(values)
    (twice,) = likelihood.with_columns(values, again[:, [1, 1]], 2)
    (once,) = likelihood.with_columns(values, again[:, [1]], 1)
    assert twice == pytest.approx(once)


def found(cause: str, first: int = 700, integrating: bool | None = None) -> HiddenLoop:
    """Return the next loop in which this is hidden at full size."""
    for seed in range(first, 1000):
        loop = hidden_loop(seed)
        if integrating not in (None, loop.base.plant.integrating):
            continue
        if loop.cause == cause and not loop.surroundings.half:
            return loop
    raise AssertionError(cause)


@pytest.mark.parametrize(
    "cause",
    [
        "valve stiction",
        *(
            pytest.param(c, marks=pytest.mark.trial)
            for c in ("load step", "process gain", "sensor clip")
        ),
    ],
)
def test_what_is_hidden_is_gained_by_the_oracle(cause: str) -> None:
    loop = found(cause)
    (gain,) = oracle(loop)
    assert gain.effect == loop.hidden[0].key
    assert gain.over_none >= gain.over_rival > 20.0
    assert gain.rival not in family(loop, loop.hidden[0])


@pytest.mark.trial
def test_what_is_not_there_gains_nothing() -> None:
    loop = found("none")
    absent = dataclasses.replace(loop, hidden=(Effect(PROCESS, "gain", {"factor": 1.1}),))
    (gain,) = oracle(absent)
    assert gain.over_none < 12.0


def test_the_op_at_which_a_level_stood_still_before_the_record_is_not_known_either() -> None:
    (gain,) = oracle(
        hidden_loop(730078)
    )  # an offset in front of a level, and noise of its equation
    assert gain.over_none == pytest.approx(0.0, abs=0.1)


def test_an_output_of_a_level_that_drifts_is_a_level_about_another_op() -> None:
    loop = found("none", integrating=True)
    fits = Fits(loop, ())
    time = np.arange(fits.count, dtype=float)[:, None]
    drifting = fits.left + 5.0 * fits.left.std() * time[:, 0] / fits.count
    none = fits.likelihood.of(drifting)
    assert none == pytest.approx(fits.none, abs=1.0)
    assert fits.likelihood.with_columns(drifting, time, 1)[0] == pytest.approx(none, abs=1.0)


def test_a_healthy_loop_leaves_its_declared_noise_and_nothing_else() -> None:
    clean = 0
    for seed in range(700, 760):
        loop = hidden_loop(seed)
        kept = loop.surroundings.keeping
        if loop.hidden or kept in ("exception", "swinging_door"):
            continue
        fits = Fits(loop, ())
        bare = fits.likelihood.bare(fits.left[:, None])[loop.plain, 0]
        assert bare.std() == pytest.approx(1.0, abs=0.08)
        for apart in (1, 2, 5, 20):
            assert abs(np.sum(bare[apart:] * bare[:-apart])) < 4.0 * np.sqrt(len(bare))
        clean += 1
    assert clean >= 4


@pytest.mark.trial
def test_of_two_each_is_gained_beside_the_other() -> None:
    loop = hidden_loop(901, "two")
    both = oracle(loop)
    assert [gain.effect for gain in both] == [effect.key for effect in loop.hidden]


def test_families_hold_what_no_record_tells_apart() -> None:
    loop = found("load step")
    step = loop.hidden[0]
    assert family(loop, step) == {(LOAD, "step"), (VALVE, "offset")}
    lag = Effect(SENSOR, "lag", {"tau": 3.0})
    assert family(loop, lag) == {(SENSOR, "lag"), (PROCESS, "pole"), (VALVE, "lag")}
    plain = Effect(VALVE, "stiction", {"f_s": 4.0, "f_d": 2.0})
    assert family(loop, plain) == {(VALVE, "stiction")}
    mechanics = dataclasses.replace(plain, law="karnopp")
    assert family(loop, mechanics) == {(VALVE, "stiction"), (VALVE, "backlash")}
    drift = family(loop, Effect(OUTPUT, "drift", {"rate": 1.0}))
    assert ((LOAD, "drift") in drift) is not loop.base.plant.integrating
