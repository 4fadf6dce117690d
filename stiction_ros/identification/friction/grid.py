"""Grids over the friction triangle 0 ≤ f_D ≤ f_S ≤ limit, and what one simulation reveals."""

from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.checks import one_of
from stiction_ros.effects import (
    Behaviour,
    FloatArray,
    FrictionLaw,
    HeStiction,
    Stiction,
    behaviours,
)
from stiction_ros.errors import InputError

TURN = 0.1  # of the span of OP: less is no turn


def laws() -> dict[str, type[FrictionLaw]]:
    """Return every law that can be identified, by its name."""
    return {kind.law: kind for kind in _stictions() if kind.law and not _refusal(kind)}  # type: ignore[misc]


def _stictions() -> list[type[Behaviour]]:
    return [kind for kind in behaviours() if kind.effect == Stiction.effect]


def _refusal(kind: type[Behaviour]) -> str:
    """Return why a law is not identified; empty when it is."""
    if not issubclass(kind, FrictionLaw):
        return "it is not derived from FrictionPair or SlipJumpPair"
    return kind.not_identified


def find_law(name: str) -> type[FrictionLaw]:
    """Return the friction law called ``name``.

    Raises:
        InputError: no such law, or one that is not identified.
    """
    known = laws()
    for kind in _stictions():
        if kind.law == name and name not in known:
            fix = f"known laws: {', '.join(known)}"
            reason = f"law {name!r} is not identified: {_refusal(kind)}"
            raise InputError(reason, where="law", fix=fix)
    return known[one_of(name, known, "law", "friction law")]


def triangle(limit: float, steps: int, first: int = 1) -> FloatArray:
    """Return an even triangular grid of rows (f_S, f_D), f_S from ``first`` steps to ``limit``."""
    nodes = np.arange(steps + 1) * (limit / steps)
    rows = [(nodes[i], nodes[j]) for i in range(first, steps + 1) for j in range(i + 1)]
    return np.array(rows, dtype=float)


def coarse_grid(limit: float) -> FloatArray:
    """Return the first grid: 20 steps over the whole triangle, finer towards small friction."""
    fine = [triangle(limit / 4.0, 14), triangle(limit / 20.0, 8), triangle(limit / 100.0, 4)]
    return _without_repetition(np.vstack([triangle(limit, 20), *fine]))


def _without_repetition(rows: FloatArray) -> FloatArray:
    """Return rows (f_S, f_D), rounded, in rising order, each once."""
    pairs = np.ascontiguousarray(rows.round(12)).view(np.complex128)[:, 0]
    return np.unique(pairs).view(np.float64).reshape(-1, 2)


def even_grid(limit: float, steps: int) -> FloatArray:
    """Return the triangle in even steps of J = f_S − f_D and S = f_S + f_D, limit / steps each."""
    nodes = (np.arange(2 * steps) + 0.5) * (limit / steps)
    jump, reverse = (part.ravel() for part in np.meshgrid(nodes, nodes, indexing="ij"))
    return _rows(jump, reverse, limit)


def cross_grid(jumps: FloatArray, reverses: FloatArray, limit: float, steps: int) -> FloatArray:
    """Return lines of the given J, along S, and of the given S, along J, limit / steps apart."""
    fine = (np.arange(2 * steps) + 0.5) * (limit / steps)
    jump = np.concatenate([np.repeat(jumps, len(fine)), np.tile(fine, len(reverses))])
    reverse = np.concatenate([np.tile(fine, len(jumps)), np.repeat(reverses, len(fine))])
    return _rows(jump, reverse, limit)


def _rows(jump: FloatArray, reverse: FloatArray, limit: float) -> FloatArray:
    """Return rows (f_S, f_D) of the points (J, S) inside the triangle."""
    inside = (jump >= 0.0) & (reverse >= jump) & (jump + reverse <= 2.0 * limit)
    return 0.5 * np.column_stack([reverse + jump, reverse - jump])[inside]


def finer_grid(centres: FloatArray, step: float, limit: float, half: int = 3) -> FloatArray:
    """Return grids of (2·half + 1)² rows round each centre, kept inside the triangle.

    Even in the plane of J = f_S − f_D and S = f_S + f_D, along which the valleys of the
    criterion run: a reversal slips once OP has turned by S, a repeated move by J.
    """
    offsets = np.arange(-half, half + 1) * step
    jump, reverse = (part.ravel() for part in np.meshgrid(offsets, offsets, indexing="ij"))
    mesh = 0.5 * np.column_stack([reverse + jump, reverse - jump])
    rows = (centres[:, None, :] + mesh[None]).reshape(-1, 2)
    static = np.clip(rows[:, 0], 0.0, limit)
    dynamic = np.clip(rows[:, 1], 0.0, static)
    grid = _without_repetition(np.column_stack([static, dynamic]))
    return np.asarray(grid[grid[:, 0] > 0.0])


def behaviour_of(
    law: str, frictions: tuple[float, float], further: Mapping[str, float]
) -> Stiction:
    """Return a law by its name, with f_S and f_D in % and its further parameters by their keys."""
    static, dynamic = frictions
    kind = find_law(law)
    own = kind.rows_of_frictions(np.array([[static, min(dynamic, static)]]))[0].tolist()
    keys = [entry.key for entry in kind.parameters()]
    found = kind.from_mapping(dict(zip(keys, own, strict=False)) | dict(further))
    assert isinstance(found, Stiction)
    return found


def simulate(
    law: type[FrictionLaw],
    grid: FloatArray,
    u: FloatArray,
    start: FloatArray | float,
    further: Sequence[float] = (),
) -> FloatArray:
    """Return stems, shape (N, G), for rows (f_S, f_D, …) and OP u, shape (N,).

    Laws with other parameters, such as S and J, get those that are equivalent.

    Args:
        law: whose stems.
        grid: shape (G, 2), or with all further parameters of the law behind.
        u: OP, %.
        start: stem before the first sample, %, one for all or shape (G,).
        further: values of its further parameters for rows that have none.
    """
    rows = law.rows_of_frictions(grid[:, :2])
    if grid.shape[1] > 2:
        rows = np.column_stack([rows, grid[:, 2:]])
    elif len(further):
        rows = np.column_stack([rows, np.tile(further, (len(rows), 1))])
    return law.simulate_grid(rows, u, start)


def samples_of_turns(op: FloatArray, band: float, turns: int) -> int | None:
    """Return how many samples of OP hold so many reversals by ``band``; None: there are fewer."""
    moves = np.diff(HeStiction.simulate_grid(np.array([[band, band]]), op, float(op[0]))[:, 0])
    at = np.flatnonzero(moves)
    reversed_at = at[1:][np.sign(moves[at[1:]]) != np.sign(moves[at[:-1]])]
    return int(reversed_at[turns - 1]) + 1 if len(reversed_at) >= turns else None
