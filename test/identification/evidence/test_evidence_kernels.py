import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.effects.behaviour import FloatArray, IntArray
from stiction_ros.identification.evidence.fit_kernels import (
    Given,
    Lines,
    beside_lines,
    factorised,
    losses_of,
    solved,
)
from stiction_ros.identification.kernels.lags import (
    answered,
    beside_lags,
    grouped,
    in_rows,
    lag_products,
    lagged_products,
    moves_of,
    own_products,
    step_products,
    whitened,
    with_past,
)
from stiction_ros.identification.linear.response_prior import ResponsePrior


def _groups(signal: FloatArray, before: float, first: int, edges: IntArray) -> FloatArray:
    """Return the groups of lags written out, shape (r, N − first)."""
    whole = np.append(np.full(edges[-1], before), signal)
    rows = [whole[edges[-1] + first - 1 - i : len(whole) - 1 - i] for i in range(int(edges[-1]))]
    return np.add.reduceat(np.array(rows), edges[:-1])


EDGES = st.lists(st.integers(1, 4), min_size=1, max_size=5).map(
    lambda widths: np.append(0, np.cumsum(widths))
)


def _stem(random: np.random.Generator, rows: int, stays: float) -> FloatArray:
    """Return what stays in a share of its rows, shape (N,)."""
    moves = random.standard_normal(rows) * (random.random(rows) >= stays)
    return np.cumsum(moves)


NOISE = np.array([1.0, -0.6, 0.2])


@given(st.integers(0, 10**6), EDGES, st.integers(2, 20), st.sampled_from([0.0, 0.5, 0.9, 1.0]))
def test_products_of_lags_are_those_of_the_rows(
    seed: int, edges: IntArray, first: int, stays: float
) -> None:
    random, taps, count = np.random.default_rng(seed), int(edges[-1]), 60 - first
    stems = [_stem(random, 60, stays) for _ in range(2)]
    signals = [whitened(NOISE, stem, float(stem[0])) for stem in stems]
    one, two = (with_past(signal, taps)[-(taps + count + 1) :] for signal in signals)
    lags = [_groups(signal, float(signal[0]), first, np.arange(taps + 1)) for signal in signals]
    steps = [step_products(NOISE, lag[0], 60, taps) for lag in lags]
    moves = [moves_of(stem) for stem in stems]
    begun = lag_products(moves[0], steps[1], taps), lag_products(moves[1], steps[0], taps)
    assert begun[0] == pytest.approx(lags[0] @ lags[1][0], abs=1e-9)
    assert begun[1] == pytest.approx(lags[1] @ lags[0][0], abs=1e-9)
    rows, others = (np.add.reduceat(lag, edges[:-1]) for lag in lags)
    found = lagged_products(one, two, begun, edges)
    assert found == pytest.approx(rows @ others.T, abs=1e-8)
    signal = random.standard_normal((1, count))
    groups = np.concatenate([rows, others])
    assert beside_lags(NOISE, np.array(stems), signal, edges) == pytest.approx(
        signal @ groups.T, abs=1e-8
    )
    own = own_products(one, lag_products(moves[0], steps[0], taps), edges)
    assert own == pytest.approx(rows @ rows.T, abs=1e-8)
    other = random.standard_normal(count)
    seen = lag_products(moves[0], step_products(NOISE, other, 60, taps), taps)
    assert grouped(seen, edges) == pytest.approx(rows @ other, abs=1e-9)


@given(st.integers(0, 10**6), EDGES, st.integers(2, 20), st.integers(0, 3))
def test_products_of_lags_with_lines_are_those_of_the_rows(
    seed: int, edges: IntArray, first: int, harmonics: int
) -> None:
    random, taps, count = np.random.default_rng(seed), int(edges[-1]), 60 - first
    turns = random.uniform(0.05, 3.0, harmonics)
    angles = np.outer(turns, np.arange(first - 1, 60))
    lines = np.vstack([np.full((1, count + 1), 0.3), np.sin(angles), np.cos(angles)])
    signal = random.standard_normal(60)
    lags = _groups(signal, 0.7, first, edges)
    past = np.append(np.full(taps, 0.7), signal)[-(taps + count + 1) :]
    rows = np.ascontiguousarray(lines[:, 1:])
    found = beside_lines(past, Lines(rows, lines[:, 0].copy(), turns, rows @ rows.T), edges)
    assert found == pytest.approx(lags @ rows.T, abs=1e-8)


@given(st.integers(0, 10**6), st.integers(1, 60), st.floats(0.0, 1.0))
def test_a_stem_is_its_beginning_and_its_moves(seed: int, rows: int, stays: float) -> None:
    stem = _stem(np.random.default_rng(seed), rows, stays)
    moves = moves_of(stem)
    again = np.full(rows, moves.begin)
    for k, move in zip(moves.at, moves.by, strict=True):
        again[k:] += move
    assert again == pytest.approx(stem, abs=1e-12)
    assert len(moves.at) == np.count_nonzero(np.diff(stem))


@pytest.mark.parametrize("size", [1, 8, 19])
@pytest.mark.parametrize(("rate", "skipped"), [(1, 0), (1, 3), (4, 0), (2, 1)])
def test_rows_are_means_that_come_later(size: int, rate: int, skipped: int) -> None:
    stems = np.random.default_rng(size).standard_normal((26, size))
    rows = len(stems) // rate
    means = stems[: rows * rate].reshape(rows, rate, size).mean(axis=1)
    wanted = np.vstack([means[:1]] * skipped + [means])[:rows].T / 2.0
    assert in_rows(stems, rate, skipped, 2.0) == pytest.approx(wanted, abs=1e-12)


@given(st.integers(0, 10**6), st.integers(1, 12), st.integers(1, 30))
def test_a_response_answers_to_what_was_before_the_record(seed: int, taps: int, rows: int) -> None:
    random = np.random.default_rng(seed)
    signal, response = random.standard_normal(rows), random.standard_normal(taps)
    lags = _groups(signal, float(signal[0]), 0, np.arange(taps + 1))
    assert answered(signal, response) == pytest.approx(response @ lags, abs=1e-9)


def test_a_signal_that_was_constant_before_the_record_has_no_transient() -> None:
    noise = np.array([1.0, -0.8, 0.1])
    assert whitened(noise, np.full(9, 2.0), 2.0) == pytest.approx(np.full(9, 0.6))


@given(st.integers(0, 10**6), st.integers(1, 9))
def test_factor_solves_and_tells_the_determinant(seed: int, size: int) -> None:
    random = np.random.default_rng(seed)
    root = random.standard_normal((size, size + 3))
    matrix, right = root @ root.T + 0.1 * np.eye(size), random.standard_normal(size)
    factor = matrix.copy()
    assert factorised(factor) == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-8)
    solution, explained = solved(factor, right)
    assert matrix @ solution == pytest.approx(right, abs=1e-8)
    assert explained == pytest.approx(right @ np.linalg.solve(matrix, right), rel=1e-8)


@settings(max_examples=15)
@given(st.integers(0, 10**6), EDGES, st.integers(0, 5))
def test_evidence_is_the_marginal_likelihood_of_a_normal_record(
    seed: int, edges: IntArray, decay: int
) -> None:
    random = np.random.default_rng(seed)
    stem, y = _stem(random, 50, 0.5), random.standard_normal(40)
    prior, noise = ResponsePrior(decay, 2), np.array([1.0, -0.5])
    given = _given(noise, y, edges, prior)
    (loss,) = losses_of(stem[None], given, 0)
    rows = _groups(whitened(noise, stem, float(stem[0])), float(stem[0]) * 0.5, 10, edges)
    kernel = np.linalg.inv(prior.precision(edges))
    covariance = np.eye(40) + rows.T @ kernel @ rows
    wanted = 40 * np.log(y @ np.linalg.solve(covariance, y) / 40)
    wanted += np.linalg.slogdet(covariance)[1]
    assert loss == pytest.approx(wanted, abs=1e-6)


def test_a_stem_that_moves_too_seldom_is_not_judged() -> None:
    edges, random = np.arange(4), np.random.default_rng(3)
    stems = np.zeros((2, 50))
    stems[0, 20:] = 1.0
    stems[1, 20:], stems[1, 30:] = 1.0, 2.0
    given = _given(np.array([1.0, -0.5]), random.standard_normal(40), edges, ResponsePrior())
    found = losses_of(stems, given, 2)
    assert np.isinf(found[0])
    assert found[1] == losses_of(stems, given, 0)[1]


def _given(noise: FloatArray, y: FloatArray, edges: IntArray, prior: ResponsePrior) -> Given:
    """Return what stands beside the only stem of an output of zero mean."""
    taps, rows = int(edges[-1]), len(y) + 10
    return Given(
        noise=noise,
        judged=len(y),
        lines=Lines(np.zeros((1, len(y))), np.zeros(1), np.empty(0), np.zeros((1, 1))),
        others=np.empty((0, rows)),
        beside=np.empty((0, taps + len(y) + 1)),
        others_first=np.empty((0, rows + taps + 8)),
        root=np.eye(1),
        target=step_products(noise, y, rows, taps),
        pull=np.zeros(len(edges) - 1),
        energy=float(y @ y),
        edges=edges,
        precision=prior.precision(edges),
        constant=prior.log_determinant(edges),
    )
