"""``stiction bench gain``: what gain promises against what the field's simulators then do."""

import argparse
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import write_json
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.gain.embedding import EmbeddingDesign, EmbeddingRun
from stiction_ros.gain.gain import Gain, What, gain_of
from stiction_ros.gain.measures import Measures
from stiction_ros.gain.recorded_loop import RecordedLoop
from stiction_ros.identification import identify
from stiction_ros.records.parts import longest_part
from stiction_studies.benches.accuracy.answer import FOUND
from stiction_studies.benches.accuracy.field import FIRST, LAST
from stiction_studies.field.counterfactual.again import Again, Control, Sampled, TakeOver
from stiction_studies.seeds import run_seeds

NEAR = 0.25  # share of the truth within which a promise is kept
NEAR_NOW = 0.05  # the same of what the loop does now
PROMISED = 0.10  # share of now that a promise is about
KEYS = ("amplitude", "iae_per_hour")


@dataclasses.dataclass(frozen=True)
class Promise:
    """One option of one loop: what was said and what came, both over now."""

    what: str
    key: str
    said: float
    true: float

    @property
    def kept(self) -> bool:
        """Whether it came about as it was said."""
        return abs(self.said - self.true) <= max(NEAR * abs(self.true), NEAR_NOW)

    @property
    def broken(self) -> bool:
        """Whether something was promised and it became no better."""
        return self.said <= 1.0 - PROMISED and self.true >= 1.0


@dataclasses.dataclass(frozen=True)
class Judged:
    """One loop: its truth, what identification said, and the promises; or why there are none."""

    seed: int
    valve: str
    verdict: str
    promises: tuple[Promise, ...] = ()
    reason: str = ""


def judge(seed: int) -> Judged:
    """Return what gain promises of one loop of the field, and what comes."""
    again = Again.of(seed)
    record = longest_part([again.loop.record])
    valve = again.loop.truth.valve.value
    try:
        found = identify(record)
    except InputError as error:
        return Judged(seed, valve, "refused", reason=str(error))
    verdict = found.valves[0].verdict.value
    try:
        loop = RecordedLoop.of(record, found)
        gain = gain_of(record, found)
    except InputError as error:
        return Judged(seed, valve, verdict, reason=str(error))
    rows = _rows(again, loop)

    def measured(run: Sampled) -> Measures:
        return loop.yardstick.measure(run.error[rows], run.stem[rows])

    recorded = again.as_recorded()
    now = measured(recorded)
    true = {What.LEAVE: now, What.SERVICE: measured(again.serviced())}
    factors = gain.option(What.RETUNE).settings
    if factors:
        true[What.RETUNE] = measured(
            again.retuned(factors["gain_factor"], factors["integral_time_factor"])
        )
    promises = _promises(gain, true, now)
    if gain.option(What.EMBEDDING).measures is not None:
        part = loop.embedding_part()
        late = _rows(again, part)

        def behind(run: Sampled) -> Measures:
            return part.yardstick.measure(run.error[late], run.stem[late])

        came = behind(again.controlled(_embedding(loop), late.start))
        promises += _promises(gain, {What.EMBEDDING: came}, behind(recorded))
    note = "" if promises else gain.option(What.SERVICE).note
    return Judged(seed, valve, verdict, promises, note)


def _rows(again: Again, loop: RecordedLoop) -> slice:
    """Return the rows of the whole record that were run again."""
    whole = again.loop.record
    after = round((loop.record.start - whole.start) / whole.sample_time)
    first = int(np.searchsorted(again.samples, after))
    return slice(first + loop.rows[0], first + loop.rows[1])


def _embedding(loop: RecordedLoop) -> TakeOver:
    """Return what makes the controller between the signals of the record."""
    scales, j, i = loop.loop, loop.valve, loop.output
    op_mean, pv_mean = float(scales.op_mean[j]), float(scales.pv_mean[i])
    known = loop.record.sp is not None
    rest = float(loop.law.set_point[loop.rows[0]])

    def take_over(pasts: FloatArray, ops: FloatArray) -> Control:
        run = EmbeddingRun(
            EmbeddingDesign.of(loop),
            (pasts - pv_mean) / loop.pv_scale,
            (ops - op_mean) / loop.op_scale,
        )

        def control(pv: float, sp: float, op: float) -> float:
            goal = (sp - pv_mean) / loop.pv_scale if known else rest
            at = run((pv - pv_mean) / loop.pv_scale, goal, (op - op_mean) / loop.op_scale)
            return at * loop.op_scale + op_mean

        return control

    return take_over


def _promises(gain: Gain, true: dict[What, Measures], now: Measures) -> tuple[Promise, ...]:
    found = []
    for option in gain.options:
        if option.measures is None or option.what not in true:
            continue
        for key in KEYS:
            said, base = getattr(option.measures, key), getattr(gain.now, key)
            came, was = getattr(true[option.what], key), getattr(now, key)
            if None not in (said, base, came, was) and min(base, was) > 0.0:
                found.append(Promise(option.what.value, key, said / base, came / was))
    return tuple(found)


def run(options: argparse.Namespace, machine: str) -> int:
    """Run the benchmark."""
    rows = run_seeds(judge, options.seeds or (FIRST, LAST), options.jobs or 1, "gain")
    if options.json is not None:
        document = {
            "name": "gain",
            "machine": machine,
            "rows": [
                {"case": what, "subject": "gain", "baseline": "truth", **_row(rows, what, found)}
                for what in What
                for found in (False, True)
            ],
            "loops": [dataclasses.asdict(row) for row in rows],
        }
        write_json(options.json, document)
    if options.json != "-":
        _show(rows)
    return 0


def _row(rows: Sequence[Judged], what: str, found: bool) -> dict[str, Any]:
    """Return the counts of one option, of all loops or of those that were found."""
    chosen = [row for row in rows if not found or row.verdict in FOUND]
    by_loop = [[p for p in row.promises if p.what == what] for row in chosen]
    said = [promises for promises in by_loop if promises]
    return {
        "loops": len(chosen),
        "said": len(said),
        "kept": sum(all(p.kept for p in promises) for promises in said),
        "broken": sum(any(p.broken for p in promises) for promises in said),
        "note": "found sticky or backlash" if found else "all",
        "subject_ms": None,
        "baseline_ms": None,
        "p99_ms": None,
        "ratio": None,
    }


def _show(rows: Sequence[Judged]) -> None:
    table = Table("option", "loops", "of", "said", "kept", "promised in vain")
    for what in What:
        for found in (False, True):
            row = _row(rows, what, found)
            cells = (row["loops"], row["said"], row["kept"], row["broken"])
            table.add_row(what.value, row["note"], *map(str, cells))
    console = Console()
    console.print(table)
    for judged in rows:
        for promise in judged.promises:
            if not promise.kept or promise.broken:
                console.print(
                    f"seed {judged.seed}, valve {judged.valve}, said {judged.verdict}: "
                    f"{promise.what} {promise.key} {promise.said:.2f} of now said, "
                    f"{promise.true:.2f} came"
                )
