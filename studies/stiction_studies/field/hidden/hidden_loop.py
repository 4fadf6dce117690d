"""Loops with something hidden in them, by their seeds."""

import dataclasses
import math
from typing import Any

import numpy as np
from scipy.signal import lfilter

from stiction_ros.errors import InputError
from stiction_ros.records.record import Record
from stiction_studies.field import loads
from stiction_studies.field.circumstances import choice
from stiction_studies.field.drawing import INTERVALS
from stiction_studies.field.hidden.effect import OUTPUT, SENSOR, Effect, Name
from stiction_studies.field.hidden.given import Kept, Noise, given_model, off
from stiction_studies.field.hidden.hiding import KINDS, MECHANICS, Draw
from stiction_studies.field.hidden.plants import Plant, drawn_plant
from stiction_studies.field.hidden.simulation import AT_REST, LEAD, Base, Run, Signals, run
from stiction_studies.field.hidden.surroundings import Surroundings, draw_surroundings
from stiction_studies.field.hidden.tuning import calmed, simc, tight
from stiction_studies.field.historian import excepted, rounded, swinging_door
from stiction_studies.field.kernels import FlagArray, FloatArray
from stiction_studies.field.plants import log_uniform

FAMILIES = ("single", "two", "physics")
GIVEN = ("exact", "off")
HEALTHY = 0.2  # share of loops with one effect that have none
ATTEMPTS = 8  # effects drawn, each smaller, until the loop stays in control
SMALLER = 0.7
LIMITED = 0.25  # share of a record in which OP may stand at a limit, unless the stem is limited
STEM_RECORDED = 0.08  # share of loops with the stem in the record, where flow is proportional to it
STEM_STEP = 0.05  # %: to which a recorded stem is rounded
REACH, KICK = 12.0, 20.0  # %: that a set-point asks at most, and by which it may move OP at once
PER_UNIT = 30.0  # samples in which 1 % of the valve counts for an integrator
WHITE = 0.1  # correlation of neighbours, up to which noise counts as white
RECORDED = 1e-6  # of the unit: digits of a record


@dataclasses.dataclass(frozen=True)
class HiddenLoop:
    """One loop, what is given of it, and the answer.

    Attributes:
        seed, family: that it came from.
        record: OP, PV, mostly SP, seldom the stem.
        given: mapping of the loop model that the plant has.
        known: the plant as that model knows it.
        hidden: what it lacks.
        also: places and effects that are there too and may be named.
        surroundings: under which it was recorded.
        base: the healthy loop, its sample time that of the simulation.
        noise: of the loop.
        unit: what 1 % of the valve makes of PV.
        op: OP at every sample of the simulation, the lead included, %.
        kept: what transmitter and historian add to PV.
        plain: rows that no spike hits, shape (N,).
    """

    seed: int
    family: str
    record: Record
    given: dict[str, Any]
    known: Plant
    hidden: tuple[Effect, ...]
    also: frozenset[Name]
    surroundings: Surroundings
    base: Base
    noise: Noise
    unit: float
    op: FloatArray
    kept: Kept
    plain: FlagArray

    @property
    def cause(self) -> str:
        """The name in tables: ``none``, an effect with its kind of place, or two."""
        return " + ".join(effect.cause for effect in self.hidden) or "none"

    @property
    def every(self) -> int:
        """Samples of the simulation in one of the record."""
        return round(self.record.sample_time / self.base.sample_time)


def hidden_loop(seed: int, family: str = "single", given: str = "exact") -> HiddenLoop:
    """Return a loop with something hidden in it.

    The seed decides everything; ``given`` changes nothing but the model.

    Args:
        seed: ≥ 0; below 1000 for tuning, from 100 000 on for reporting.
        family: ``single``, one effect, or none in a fifth of the loops; ``two``, one of the valve
            or the process and a load; ``physics``, friction by the mechanics of the stem.
        given: whether the model knows the plant exactly or is some per cent ``off``.

    Raises:
        InputError: an unknown family or model, a negative seed.
    """
    for value, known, where in ((family, FAMILIES, "family"), (given, GIVEN, "given")):
        if value not in known:
            raise InputError(
                f"unknown value {value!r}", where=where, fix=f"use {' | '.join(known)}"
            )
    if seed < 0:
        raise InputError(f"{seed} is negative", where="seed")
    random = np.random.default_rng([seed, FAMILIES.index(family), 17])
    surroundings = draw_surroundings(random)
    healthy = family == "single" and random.random() < HEALTHY
    names = () if healthy else _names(random, family, surroundings)
    surroundings = _fitting(surroundings, names, healthy)
    straight = not any("characteristic" in name or "offset" in name for name in names)
    shown = np.random.default_rng([seed, FAMILIES.index(family), 19]).random() < STEM_RECORDED
    surroundings = dataclasses.replace(surroundings, stem_recorded=straight and bool(shown))
    scene = _Scene(random, surroundings)
    hidden, out = scene.hide(names)
    plant = scene.base.plant
    if given == "off":
        wrong = np.random.default_rng([seed, FAMILIES.index(family), 18])
        plant = off(wrong, plant, scene.base.sample_time)
    return scene.recorded(seed, family, plant, hidden, out)


def _names(random: np.random.Generator, family: str, s: Surroundings) -> tuple[str, ...]:
    """Return which kinds of effects are hidden."""
    if family == "physics":
        return (MECHANICS[int(random.integers(len(MECHANICS)))],)
    asked = s.closed and s.set_point_kept and s.scan == 1.0
    out = {
        "process leak": s.plant != "level",
        "data tuning": not (asked and s.tuning_known) or s.winding,
        "data time_shift": not asked,
    }
    shares = {name: kind.share for name, kind in KINDS.items() if not out.get(name, False)}
    if family == "single":
        return (choice(random, shares),)
    first = {name: share for name, share in shares.items() if KINDS[name].first}
    second = {name: share for name, share in shares.items() if KINDS[name].second}
    return choice(random, first), choice(random, second)


def _fitting(s: Surroundings, names: tuple[str, ...], healthy: bool) -> Surroundings:
    """Return circumstances that do not hide twice what is hidden already."""
    values = any(name.startswith("sensor") for name in names)
    if values and s.keeping in ("pv_rounded", "exception", "swinging_door"):
        s = dataclasses.replace(s, keeping="as_read")
    if s.scan < 1.0:
        s = dataclasses.replace(s, noise="measurement")
    if "valve saturation" in names and s.excitation == "quiet":
        s = dataclasses.replace(s, excitation="moves")
    if "disturbance coloured" in names or "disturbance random_walk" in names:
        s = dataclasses.replace(s, declared=True)
    if "load random_walk" in names:
        s = dataclasses.replace(s, declared=True)
    if len(names) == 2 and s.excitation == "quiet":
        s = dataclasses.replace(s, excitation="moves", half=False)
    return dataclasses.replace(s, half=False) if healthy else s


class _Scene:
    """A healthy loop under drawn circumstances, with all that acts on it."""

    def __init__(self, random: np.random.Generator, s: Surroundings) -> None:
        self.random, self.s = random, s
        self.interval = float(random.choice(INTERVALS[3:]))
        self.every = 2 if s.scan < 1.0 else 1
        sample_time = self.interval / self.every
        plant = drawn_plant(random, s.plant, sample_time)
        scan = max(round(s.scan), 1)
        tuning = calmed(
            plant, sample_time, scan, simc(plant, sample_time, random.uniform(1.0, 3.0))
        )
        if s.tight:
            tuning = tight(plant, sample_time, scan, tuning, random.uniform(40.0, 150.0))
        self.base = Base(plant, tuning, sample_time, scan, s.winding)
        per_percent = plant.gain * (PER_UNIT * sample_time if plant.integrating else 1.0)
        self.unit = abs(per_percent)
        self.samples = s.samples * self.every
        self.noise = self._drawn_noise()
        output, reading = self._noise_signals()
        spikes = self._spikes() if s.keeping == "spikes" else np.zeros(len(reading))
        self.spiked = spikes != 0.0
        reading = reading + spikes
        self.signals = self._moved(output, reading)

    def _drawn_noise(self) -> Noise:
        random, louder = self.random, 3.0 if self.s.excitation == "quiet" else 1.0
        white = log_uniform(random, 0.015, 0.15) * self.unit
        slow = log_uniform(random, 0.03, 0.4) * self.unit * louder
        if self.s.noise == "measurement":
            return Noise(white)
        if self.s.noise == "coloured":
            memory = random.uniform(5.0, 40.0) * self.interval
            return Noise(white, coloured=slow, memory=memory)
        a, _, _ = self.base.plant.sampled(self.base.sample_time)
        pulse = lfilter([1.0], [1.0, *a], np.eye(1, 200)[0])
        return Noise(0.0, equation=slow / float(np.linalg.norm(pulse)))

    def _noise_signals(self) -> tuple[FloatArray, FloatArray]:
        """Return what noise adds to the output and to the reading."""
        count, noise = LEAD + self.samples, self.noise
        reading = noise.white * self.random.standard_normal(count)
        output = np.zeros(count)
        if noise.equation:
            a, _, _ = self.base.plant.sampled(self.base.sample_time)
            white = noise.equation * self.random.standard_normal(count)
            output = lfilter([1.0], [1.0, *a], white)
        if noise.coloured:
            steps = noise.memory / self.base.sample_time
            output = noise.coloured * loads.coloured(self.random, count, steps)
        return output, reading

    def _spikes(self) -> FloatArray:
        """Return single readings that are far off, one in a hundred to four hundred."""
        count = LEAD + self.samples
        spikes = np.zeros(count)
        rows = self.random.random(count) < self.random.uniform(0.0025, 0.01)
        sizes = self.random.uniform(3.0, 10.0, count) * self.random.choice([-1.0, 1.0], count)
        spikes[rows] = (sizes * 0.3 * self.unit)[rows]
        return spikes

    def _moved(self, output: FloatArray, reading: FloatArray) -> Signals:
        """Return all signals; set-points so small that OP stays off its limits."""
        count = LEAD + self.samples
        state = self.random.bit_generator.state
        for smaller in (1.0, 0.6, 0.35, 0.2):
            self.random.bit_generator.state = state
            by_hand = np.full(count, np.nan)
            set_point = np.full(count, AT_REST)
            if self.s.excitation == "open_loop":
                by_hand = AT_REST + 0.8 * REACH * smaller * self._path(count)
            elif self.s.excitation != "quiet":
                kick = abs(self.base.tuning.gain) * self.unit
                reach = min(REACH, 0.5 * KICK / kick) * smaller
                set_point = AT_REST + reach * self.unit * self._path(count)
            signals = Signals(set_point, output, reading, by_hand)
            op = run(self.base, signals).op
            if np.mean((op <= 1.0) | (op >= 99.0)) < 0.01:
                break
        return signals

    def _path(self, count: int) -> FloatArray:
        """Return moves or ramps between −1 and 1, shape (count,)."""
        random, base = self.random, self.base
        settled = (base.plant.slow + base.plant.dead_time) / base.sample_time
        hold = min(max(3.0 * settled, 60.0), 200.0)
        times, values = [0.0], [0.0]
        at = float(random.uniform(20.0, 60.0))
        while at < count:
            times.append(round(at))
            values.append(float(random.uniform(-1.0, 1.0)))
            at += hold * float(random.uniform(0.7, 1.4))
        every = np.arange(count)
        if self.s.excitation == "ramps":
            return np.asarray(np.interp(every, times, values))
        return np.asarray(values)[np.searchsorted(times, every, side="right") - 1]

    def hide(self, names: tuple[str, ...]) -> tuple[tuple[Effect, ...], Run]:
        """Return effects of these kinds with which the loop stays in control, and its run."""
        reference = run(self.base, self.signals)
        pv = reference.pv[LEAD:]
        noise = self.noise.white or self.noise.equation
        scale = 0.5 if self.s.half else 1.0
        hidden: tuple[Effect, ...] = ()
        out = reference
        for _ in range(ATTEMPTS):
            draw = Draw(
                self.random, self.base, reference, self.unit, noise, self.samples, scale
            )  # fmt: skip
            hidden = tuple(KINDS[name].draw(draw) for name in names)
            out = run(self.base, self.signals, hidden)
            limited = np.mean((out.op <= 0.0) | (out.op >= 100.0))
            swing = np.ptp(out.pv[LEAD:]) / (np.ptp(pv) + 10.0 * self.unit)
            may = any(effect.name in ("saturation", "clip") for effect in hidden)
            if swing < 5.0 and (may or limited < LIMITED):
                break
            scale *= SMALLER
        return hidden, out

    def recorded(
        self, seed: int, family: str, known: Plant, hidden: tuple[Effect, ...], out: Run
    ) -> HiddenLoop:
        """Return the record of a run with the model that is given."""
        s, rows = self.s, slice(LEAD, None, self.every)
        last = slice(LEAD + self.every - 1, None, self.every)
        op, pv, sp = out.op[rows], out.pv[rows], self.signals.set_point[rows]
        for effect in hidden:
            if effect.name == "time_shift":
                late = round(effect.figures["shift"])
                pv = np.concatenate([np.full(late, pv[0]), pv[:-late]])
        op, pv, also = self._stored(op, pv)
        kept = Kept(self.noise.white)
        if s.keeping in ("pv_rounded", "exception", "swinging_door"):
            kept = _kept(pv - out.clean[rows])
        if not s.declared and (self.noise.equation or self.noise.coloured):
            also |= {(OUTPUT, "coloured")}
        digits = RECORDED * self.unit
        quantum = next((e.figures["step"] for e in hidden if e.name == "quantisation"), 0.0)
        if quantum == 0.0 and s.keeping != "pv_rounded":
            pv = rounded(pv, digits)
        record = Record(
            name=f"hidden{seed:06d}",
            sample_time=self.interval,
            valves=("V1",),
            outputs=("PV1",),
            op=op[:, None],
            pv=pv[:, None],
            sp=sp[:, None] if s.set_point_kept else None,
            stem=rounded(out.stem[last], STEM_STEP)[:, None] if s.stem_recorded else None,
        )
        return HiddenLoop(
            seed=seed,
            family=family,
            record=record,
            given=given_model(
                self.base, known, self.noise if s.declared else None, self.interval, s.tuning_known
            ),
            known=known,
            hidden=hidden,
            also=also,
            surroundings=s,
            base=self.base,
            noise=self.noise,
            unit=self.unit,
            op=out.op,
            kept=kept,
            plain=~self.spiked[rows],
        )

    def _stored(
        self, op: FloatArray, pv: FloatArray
    ) -> tuple[FloatArray, FloatArray, frozenset[Name]]:
        """Return what the historian keeps of OP and PV, and what there is to be named of it."""
        random, keeping = self.random, self.s.keeping
        noise = self.noise.white or self.noise.equation
        if keeping == "op_rounded":
            return rounded(op, float(random.choice([0.05, 0.1, 0.2]))), pv, frozenset()
        if keeping == "pv_rounded":
            quantum = log_uniform(random, 0.5, 8.0) * noise
            return op, rounded(pv, quantum), frozenset({(SENSOR, "quantisation")})
        longest = int(random.integers(20, 60))
        values: frozenset[Name] = frozenset({(SENSOR, "compression"), ("data", "compression")})
        width = random.uniform(0.3, 2.0) * noise
        if keeping == "exception":
            return op, excepted(pv, width, longest), values
        if keeping == "swinging_door":
            return op, swinging_door(pv, width, longest), values
        return op, pv, frozenset()


def _kept(added: FloatArray) -> Kept:
    """Return the first-order noise that is nearest to what was added to an output."""
    added = added - added.mean()
    std = float(added.std())
    share = float(added[1:] @ added[:-1]) / max(float(added @ added), 1e-300)
    return Kept(std, -1.0 / math.log(share) if WHITE < share < 1.0 else 0.0)
