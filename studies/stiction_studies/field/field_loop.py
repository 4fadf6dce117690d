"""Loops of the field by their seeds."""

import copy
import dataclasses
import enum

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.records.record import Record
from stiction_studies.field.circumstances import UNITS, Circumstances, Friction, draw_circumstances
from stiction_studies.field.drawing import Made, make
from stiction_studies.field.historian import archived
from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.simulation import Loop, Run, Signals, run
from stiction_studies.field.truth import EVEN, Cause, Swings, Truth, ValveKind, causes, slips
from stiction_studies.field.valves import Law, slow_triangle

MANY = 6  # slips from which a record shows friction well
ATTEMPTS = 6  # loops drawn for a seed, until one is as its circumstances want it
MATTERS = 0.1  # share of OP's range that a band has which matters, at least
NEGLIGIBLE = 0.05  # share of OP's range that a band has which does not matter, at most
# samples between two slips on average, at least: a record that is slower shows none of them
APART = 4.0
LIMITED = 0.1  # share of a record in which OP may stand at a limit


@dataclasses.dataclass(frozen=True)
class FieldLoop:
    """One recorded loop and the answer to it.

    Attributes:
        seed: that it came from.
        record: as the package reads records, without the stem.
        kind: flow, pressure, level, temperature or analyser.
        plant: name of its equations.
        circumstances: names of everything that is not usual.
        truth: the answer.
        stem: true position of the stem at the samples, in the record's unit of OP, shape
            (N, 1), read-only.
    """

    seed: int
    record: Record
    kind: str
    plant: str
    circumstances: tuple[str, ...]
    truth: Truth
    stem: FloatArray

    @property
    def sample_time(self) -> float:
        """Seconds between two samples."""
        return self.record.sample_time

    @property
    def judged_rows(self) -> tuple[int, int]:
        """First row, and the one behind the last, of the longest good part."""
        return max(self.record.usable_rows(), key=lambda rows: rows[1] - rows[0])

    @property
    def judged_slips(self) -> int:
        """Slips in the longest good part, which is what is looked at."""
        return self.truth.slips_between(*self.judged_rows)


def field_loop(seed: int) -> FieldLoop:
    """Return the loop of a seed; seeds below 1000 are for tuning, from 10 000 on for reporting.

    Raises:
        InputError: a negative seed.
    """
    made, loop = drawn(seed)
    truth = dataclasses.replace(loop.truth, causes=_causes(made))
    return dataclasses.replace(loop, truth=truth)


def with_friction(seed: int, share: float) -> FieldLoop | None:
    """Return the loop of a seed with a valve of He's law in it, all else as it was drawn.

    Loads, noise, controller and historian stay. Three fifths of the band are f_S, two fifths f_D.

    Args:
        seed: of the loop.
        share: band, of OP's range before; what it is of the range then stands in the truth, whose
            causes are left out.

    Returns:
        None where the loop does not stay finite with it.

    Raises:
        InputError: a negative seed.
    """
    found = _drawn(seed)
    made = found.made
    span = _range(run(made.loop, made.signals), made)
    band = share * span
    valve = dataclasses.replace(made.loop.valve, law=Law.HE, static=0.6 * band, sliding=0.4 * band)
    other = dataclasses.replace(made, loop=dataclasses.replace(made.loop, valve=valve))
    out = run(other.loop, made.signals)
    if not np.isfinite(out.clean).all():
        return None
    c = draw_circumstances(np.random.default_rng([seed, 0]))
    c = dataclasses.replace(c, friction=Friction.MUCH, law=Law.HE)
    return _recorded(copy.deepcopy(found.random), c, other, out, seed)


@dataclasses.dataclass(frozen=True)
class _Drawn:
    """A loop, what it is made of, and the generator as it stood before the historian drew."""

    made: Made
    loop: FieldLoop
    random: np.random.Generator


def drawn(seed: int) -> tuple[Made, FieldLoop]:
    """Return what the loop of a seed is made of, and the loop but for what makes it cycle.

    Raises:
        InputError: a negative seed.
    """
    found = _drawn(seed)
    return found.made, found.loop


def _drawn(seed: int) -> _Drawn:
    if seed < 0:
        raise InputError(f"{seed} is negative", where="seed", fix="use 0 or more")
    circumstances = draw_circumstances(np.random.default_rng([seed, 0]))
    shrink, best, best_fit = 1.0, None, Fit.NOT
    for attempt in range(1, ATTEMPTS + 1):
        random = np.random.default_rng([seed, attempt])
        made = make(random, circumstances, shrink)
        out = run(made.loop, made.signals)
        if not np.isfinite(out.clean).all():
            continue
        before = copy.deepcopy(random)
        loop = _recorded(random, circumstances, made, out, seed)
        fit = _fit(circumstances, loop, out)
        if best is None or fit > best_fit:
            best, best_fit = _Drawn(made, loop, before), fit
        if fit is Fit.AS_WANTED:
            break
        shrink *= _correction(circumstances, loop)
    assert best is not None, f"no loop of seed {seed} is finite"
    return best


class Fit(enum.IntEnum):
    """How far a drawn loop is as wanted."""

    NOT = 0
    CLEAR = 1
    """Not as wanted, and yet clearly with friction that matters or without."""
    AS_WANTED = 2


def _fit(c: Circumstances, loop: FieldLoop, out: Run) -> Fit:
    """Tell how far a loop has the friction that its circumstances want, and is in control."""
    limited = np.mean((out.op <= 0.0) | (out.op >= 100.0))
    overflows = loop.kind == "level" and (out.clean.min() <= 0.0 or out.clean.max() >= 100.0)
    if limited > LIMITED or overflows:
        return Fit.NOT
    if c.friction is Friction.NONE:
        return Fit.AS_WANTED if loop.truth.band_share <= NEGLIGIBLE else Fit.NOT
    first, last = loop.judged_rows
    if loop.truth.band_share < MATTERS or loop.judged_slips > (last - first) / APART:
        return Fit.NOT
    many, wanted = loop.judged_slips >= MANY, c.friction is Friction.MUCH
    return Fit.AS_WANTED if many is wanted and loop.judged_slips > 0 else Fit.CLEAR


def _correction(c: Circumstances, loop: FieldLoop) -> float:
    """Return by which factor the next friction is drawn larger or smaller."""
    if c.friction is Friction.NONE and loop.truth.band_share > NEGLIGIBLE:
        return 0.5
    if c.friction is Friction.FEW_SLIPS and loop.judged_slips >= MANY:
        return 1.1
    if c.friction is Friction.MUCH and loop.truth.band_share < MATTERS:
        return 1.2
    return 1.0


def _recorded(
    random: np.random.Generator, c: Circumstances, made: Made, out: Run, seed: int
) -> FieldLoop:
    """Return the record of a run and what is true of it."""
    clock = made.loop.clock
    sampled = slice(made.warm, None, clock.sample)
    kept = archived(random, c, made, out, f"field{seed:05d}")
    factor, _ = UNITS[c.unit]
    shown = slow_triangle(made.loop.valve)
    at_scans = out.stem[:: clock.scan]
    starts, turned = slips(at_scans[made.warm // clock.scan :], shown)
    rows = [
        row
        for start in starts
        if (row := kept.row_of(int(start * clock.scan) // clock.sample)) is not None
    ]
    span = _range(out, made)
    sticks = c.friction is not Friction.NONE
    valve = ValveKind.HEALTHY
    if sticks:
        even = shown.jump < EVEN * shown.band
        valve = ValveKind.BACKLASH if even else ValveKind.STICKY
    he = made.loop.valve if made.loop.valve.law is Law.HE else None
    truth = Truth(
        valve=valve,
        law=made.loop.valve.law.word,
        band=factor * shown.band,
        jump=factor * shown.jump,
        f_s=None if he is None else factor * he.static,
        f_d=None if he is None else factor * he.sliding,
        slip_rows=tuple(rows),
        reversals=turned,
        causes=frozenset(),
        band_share=shown.band / max(span, 1e-9),
    )
    stem = (factor * out.stem[sampled] + kept.offset)[kept.rows]
    stem = stem[:, None]
    stem.flags.writeable = False
    return FieldLoop(seed, kept.record, made.loop.process.kind, c.plant.value, c.names, truth, stem)


def _range(out: Run, made: Made) -> float:
    """Return OP's range at the samples of the record, %."""
    sampled = out.op[made.warm :: made.loop.clock.sample]
    return float(np.subtract(*np.percentile(sampled, [98.0, 2.0])))


def _causes(made: Made) -> frozenset[Cause]:
    """Return what makes the loop cycle, by running it without one thing after the other."""
    sampled = slice(made.warm, None, made.loop.clock.sample)

    def swings(loop: Loop, signals: Signals) -> Swings:
        out = run(loop, signals)
        return Swings((signals.set_point - out.clean)[sampled], out.op[sampled])

    whole = swings(made.loop, made.steady)
    return causes(whole, {cause: swings(*rest) for cause, rest in made.without.items()})
