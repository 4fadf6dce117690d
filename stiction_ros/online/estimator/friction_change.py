"""Whether a valve that is known to stick has been serviced, or sticks more than before."""

import dataclasses
import enum
import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.online.estimator.change_evidence import START_ROWS, Evidence
from stiction_ros.online.estimator.trust import Interval, TrustedFriction
from stiction_ros.settings import setting

SUSPICION = 20.0  # log likelihood against the trusted friction from which no window revises it
CERTAINTY = 30.0  # log likelihood that a larger friction needs over every one near the trusted
CREDIBLE = 12.0  # log likelihood below the best that an interval still holds,
MISFIT = 0.1  # and share of that of the best: no process is linear
INFORMATION = 15.0  # least squared length of a signature, in σ
NEAR = 0.1  # share of f_S within which a friction is the same as before
NEAR_DYNAMIC = 0.06  # the same for f_D, as a share of f_S
LOW = 0.1  # share of f_S below which a valve counts as serviced
BURST = 20  # samples in which a valve that stays behind shows,
LOUD = 80.0  # and what they add to the squared innovations, beside twice the usual
ONSETS = 4  # bursts whose beginning is looked at,
FINELY = 3  # of the moves are looked at on a fine grid
BEFORE = 10  # and moves before each that may be the first of the new friction
DYNAMIC_ERROR = 0.008  # standard error of f_D, in f_S, that no number of moves takes away
EXPLAINED = 3.0  # mean square of the innovations up to which the trusted friction is not replaced
NUDGE = 1e-4  # of f_S, by which f_D is moved to see what PV says of it: no slip hangs on it
WORST = 2.0  # mean square of the innovations that a new friction may leave

STATIC_SHARES = np.geomspace(0.2, 3.0, 92)  # steps of 3 %
DYNAMIC_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5])
FINE_SHARES = np.geomspace(0.4, 2.5, 185)  # steps of 1 %


class ChangeStatus(enum.StrEnum):
    """What the moves of a valve say of its friction."""

    UNCHANGED = "unchanged"
    SERVICED = "serviced"
    CHANGED = "changed"


@dataclasses.dataclass(frozen=True)
class ChangeRule:
    r"""When a valve's friction is taken to have changed.

    A valve whose friction is compensated is moved by kicks: OP goes past the stem by f_D for a
    sample. A valve without friction follows the kick, and its process shows so after a while:
    the *share* of that signature in PV is 0 while nothing has changed and 1 after a service.
    The errors of the model, of its gain foremost, move the share a little, and by how much the
    episodes of moves disagree tells how far. The valve is taken to be serviced when the share
    lies ``change_margin`` of its standard errors above one half, over ``change_moves`` moves at
    least. A valve that sticks more stays where it should have moved, which shows at once and
    by far; the same margin holds.
    """

    change_moves: int = setting(
        10, "stem moves that must agree before a valve counts as serviced; 0: never looked", low=0
    )
    change_margin: float = setting(
        1.5, "standard errors by which a change must be nearer than none", low=0.5, high=20.0
    )


@dataclasses.dataclass(frozen=True)
class FrictionChange:
    """The verdict on one valve."""

    status: ChangeStatus  # unchanged, serviced or changed
    valve: str  # tag
    samples: int = 0  # samples of the window that follow the change; 0 when unchanged
    friction: TrustedFriction | None = None  # with intervals; None when unchanged or serviced
    doubted: bool = False  # whether the window speaks against the trusted friction, if not enough
    explained: bool = False  # whether process and trusted friction explain the window


@dataclasses.dataclass(frozen=True)
class _Found:
    """A friction from sample ``first`` of the window on, with its log likelihood."""

    first: int
    static: float
    dynamic: float
    gain: float


def look_for_change(
    rule: ChangeRule, evidence: Evidence, valve: int, trusted: TrustedFriction
) -> FrictionChange:
    """Return what the window says of the friction of ``valve``, an index."""
    name, op = evidence.reference.valves[valve], evidence.op[:, valve]
    serviced, since = _serviced(rule, evidence, valve)
    grown, near = _grown(evidence, valve, trusted)
    doubted = max(serviced, grown.gain - near) > SUSPICION
    rival = max(near, serviced, 0.0)
    if grown.gain - rival > CERTAINTY + MISFIT * grown.gain:
        change = _changed(rule, evidence, valve, grown, trusted)
        if change is not None:
            return change
    if serviced > SUSPICION and _shows(rule, evidence, valve, since, op[since:]):
        return FrictionChange(ChangeStatus.SERVICED, name, len(op) - since)
    explained = evidence.mean_square <= EXPLAINED
    return FrictionChange(ChangeStatus.UNCHANGED, name, doubted=doubted, explained=explained)


def static_interval(
    evidence: Evidence, valve: int, first: int, friction: tuple[float, float]
) -> Interval:
    """Return the values of f_S, %, that the samples from ``first`` on do not reject.

    Before, the stems are as trusted. It is looked near the f_S of ``friction``, with its f_D.
    """
    static, dynamic = friction
    grid = np.column_stack([static * FINE_SHARES, np.full(len(FINE_SHARES), dynamic)])
    grid[:, 1] = np.minimum(grid[:, 1], grid[:, 0])
    gains, left = _gains(evidence, valve, first, grid)
    best = int(np.argmax(gains))
    least = gains[best] - _slack(float(gains[best])) * max(1.0, float(left[best]))
    # Without a rejected one on a side anything goes there, for all that these samples say.
    rejected = grid[gains < least, 0]
    low = rejected[rejected < grid[best, 0]].max(initial=0.0)
    high = rejected[rejected > grid[best, 0]].min(initial=STATIC_SHARES[-1] * static)
    return float(low), float(high)


def _slack(gain: float) -> float:
    return CREDIBLE + MISFIT * max(gain, 0.0)


def _shows(rule: ChangeRule, evidence: Evidence, valve: int, first: int, stems: FloatArray) -> bool:
    """Return whether PV shows other stems from ``first`` on, (n − first,), %, by enough."""
    share = evidence.share(valve, first, stems)
    return share.information >= INFORMATION and share.margin >= rule.change_margin


def _serviced(rule: ChangeRule, evidence: Evidence, valve: int) -> tuple[float, int]:
    """Return the largest log likelihood of a valve that follows OP, and from when on it does."""
    moves, op = evidence.moves[valve].tolist(), evidence.op[:, [valve]]
    starts = moves[: max(len(moves) - rule.change_moves + 1, 0)]
    gains = [float(evidence.gains(valve, k, op[k:], starts[0])[0][0]) for k in starts]
    if not gains:
        return 0.0, 0
    best = int(np.argmax(gains))
    return gains[best], starts[best]


def _grown(evidence: Evidence, valve: int, trusted: TrustedFriction) -> tuple[_Found, float]:
    """Return the friction that explains bursts of innovations best, and how well near ones do."""
    starts = _starts(evidence, valve)
    known = (trusted.static_friction, trusted.dynamic_friction)
    low, high = ((1 - NEAR) * trusted.static_interval[0], (1 + NEAR) * trusted.static_interval[1])

    def search(first: int, shares: FloatArray) -> tuple[float, float, _Found]:
        grid = _grid(*known, shares)
        gains, left = _gains(evidence, valve, first, grid, starts[0])
        near = (grid[:, 0] >= low) & (grid[:, 0] <= high)
        near &= np.abs(grid[:, 1] - known[1]) <= NEAR_DYNAMIC * known[0]
        best_near, i = float(gains[near].max(initial=0.0)), int(np.argmax(gains))
        found = _Found(first, float(grid[i, 0]), float(grid[i, 1]), float(gains[i]))
        margin = found.gain - max(best_near, 0.0)
        return (margin if left[i] <= WORST else min(margin, 0.0)), best_near, found

    roughly = [search(first, STATIC_SHARES) for first in starts]
    roughly.sort(key=lambda one: one[2].gain - one[1])
    finely = [search(one[2].first, FINE_SHARES) for one in roughly[-FINELY:]]
    nothing = (0.0, 0.0, _Found(0, *known, 0.0))
    _, near, best = max([nothing, *roughly, *finely], key=lambda one: one[0])
    return best, near


def _starts(evidence: Evidence, valve: int) -> list[int]:
    """Return the moves that may be the first of a new friction: those before a burst."""
    squares = np.sum([seen**2 for seen in evidence.innovations], axis=0)
    usual = 2.0 * len(evidence.innovations)
    sums = np.convolve(squares - usual, np.ones(BURST))[: len(squares)]
    loud = np.flatnonzero(sums > LOUD)
    if not len(loud):
        return []
    onsets = loud[np.diff(loud, prepend=-BURST) >= BURST][-ONSETS:]
    moves = evidence.moves[valve]
    found: set[int] = set()
    for onset in onsets:
        found.update(moves[moves <= onset][-BEFORE:].tolist())
    return sorted(found)


def _gains(
    evidence: Evidence, valve: int, first: int, grid: FloatArray, begin: int | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return log likelihoods of frictions from ``first`` on, and the mean squares they leave."""
    stems = evidence.stems(valve, first, grid)
    keys = np.random.default_rng(0).standard_normal(len(stems)) @ stems
    _, chosen, back = np.unique(keys, return_index=True, return_inverse=True)
    gains, left = evidence.gains(valve, first, stems[:, chosen], begin)
    return gains[back], left[back]


def narrowed(
    evidence: Evidence, valve: int, friction: TrustedFriction, *, whole: bool
) -> TrustedFriction:
    """Return ``friction`` as a window behind the change tells it; ``whole`` with every move."""
    first = evidence.first or min(START_ROWS, len(evidence.op) // 2)
    known = (friction.static_friction, friction.dynamic_friction)
    best, error = _best(evidence, valve, first, known)
    static = static_interval(evidence, valve, first, best)
    return friction.narrowed(static, best[1], _around(best[1], error), anew=whole)


def _best(
    evidence: Evidence, valve: int, first: int, near: tuple[float, float]
) -> tuple[tuple[float, float], float]:
    """Return f_S and f_D, looked for about ``near``, and the standard error of f_D, %."""
    grid = np.vstack([near, _grid(*near, FINE_SHARES)])
    gains, _ = _gains(evidence, valve, first, grid)
    better = gains.max() > gains[0] + _slack(float(gains.max() - gains[0]))
    static, dynamic = grid[int(np.argmax(gains)) if better else 0].tolist()
    dynamic, error = _refined_dynamic(evidence, valve, first, static, dynamic)
    return (static, dynamic), error


def _grid(static: float, dynamic: float, shares: FloatArray) -> FloatArray:
    """Return pairs (f_S, f_D), shape (G, 2), about known ones, %."""
    pairs = np.array([(s, d) for s in shares for d in DYNAMIC_SHARES])
    grid = pairs * [static, max(dynamic, 0.1 * static)]
    return np.asarray(grid[grid[:, 1] <= grid[:, 0]])


def _changed(
    rule: ChangeRule, evidence: Evidence, valve: int, found: _Found, trusted: TrustedFriction
) -> FrictionChange | None:
    """Return the change to ``found``, its f_D refined; None where it does not stand up."""
    first = found.first
    best, error = _best(evidence, valve, first, (found.static, found.dynamic))
    _, left = _gains(evidence, valve, first, np.array([best]))
    stems = evidence.stems(valve, first, np.array([best]))[:, 0]
    low, high = static_interval(evidence, valve, first, best)
    if (
        not _shows(rule, evidence, valve, first, stems)
        or left[0] > WORST
        or low <= LOW * trusted.static_friction
    ):
        return None  # the last: perhaps it is serviced, which more moves must show
    new = trusted.narrowed((low, high), best[1], _around(best[1], error), anew=True)
    name = evidence.reference.valves[valve]
    return FrictionChange(ChangeStatus.CHANGED, name, len(evidence.op) - first, new)


def _refined_dynamic(
    evidence: Evidence, valve: int, first: int, static: float, dynamic: float
) -> tuple[float, float]:
    """Return the likeliest f_D from ``first`` on, and its standard error, %.

    While the moves stay as they are, the stem is linear in f_D, and the log likelihood a parabola.
    """

    def gains(tried: Sequence[float]) -> list[float]:
        grid = np.column_stack([np.full(len(tried), static), tried])
        return [float(gain) for gain in _gains(evidence, valve, first, grid)[0]]

    error, nudge = static, NUDGE * static
    for _ in range(2):
        middle = min(max(dynamic, nudge), static - nudge)
        low, here, high = gains([middle - nudge, middle, middle + nudge])
        bend = 2.0 * here - low - high
        if bend <= 0.0:  # it shows nowhere
            break
        error = nudge / math.sqrt(bend)
        stepped = min(max(middle + 0.5 * nudge * (high - low) / bend, 0.0), static)
        if gains([stepped])[0] < here:  # other moves than those that the step reckoned with
            break
        dynamic = stepped
    return dynamic, error + DYNAMIC_ERROR * static


def _around(dynamic: float, error: float) -> Interval:
    return max(dynamic - 3.0 * error, 0.0), dynamic + 3.0 * error
