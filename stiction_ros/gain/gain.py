"""What would help one loop, with the uncertainty of the identification carried through."""

import dataclasses
import enum
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.gain.advice import PROMISED
from stiction_ros.gain.draws import DRAWS, SEED, Draws
from stiction_ros.gain.embedding import EmbeddingDesign, embedded
from stiction_ros.gain.measures import Measures
from stiction_ros.gain.recorded_loop import RecordedLoop
from stiction_ros.gain.retuning import FASTEST, UNCHANGED, best_tuning, times_as_fast
from stiction_ros.identification.result import CauseKind, Identification
from stiction_ros.records.record import Record

# share of what comes by which a promised figure may miss; a figure that misses more in the drawn
# loop at the 5th or 95th percentile is not given
AGREED = 0.25
AGREED_NOW = 0.05  # the same as a share of now
ENDS = (5.0, 95.0)  # percentiles of the draws that are given as interval
# share by which a drawn loop may differ from the record in IAE and amplitude; a loop that differs
# more is not the recorded one
REPEATS = 0.25
# drawn loops that must repeat the record, the likeliest among them, for anything to be said
FEWEST = 10
# causes by which a loop shows its process well enough to be tuned by it: what comes from outside
# and is fed back tells as much of the controller as of the process
RETUNED = (CauseKind.VALVE, CauseKind.TUNING)
KEYS = tuple(field.name for field in dataclasses.fields(Measures))

# measures on which the drawn loops must agree, in words
WORDS = {"iae_per_hour": "mean |PV−SP|", "amplitude": "amplitude"}


class What(enum.StrEnum):
    """What may be done about a loop."""

    SERVICE = "service"
    EMBEDDING = "embedding"
    RETUNE = "retune"
    LEAVE = "leave"


@dataclasses.dataclass(frozen=True)
class Option:
    """One thing that may be done, and what the loop then does."""

    what: What  # see ``What``
    # of the likeliest of the drawn loops, of the embedding their medians; None where it could not
    # be simulated, or where the draws do not agree
    measures: Measures | None
    # 5th and 95th percentile of each measure over the draws
    interval: dict[str, tuple[float, float]]
    note: str  # one sentence
    # weights of the embedding, factors of the retuning
    settings: dict[str, float] = dataclasses.field(default_factory=dict)

    def beside(self, now: Measures, left: Measures) -> "Option":
        """Return the option with measures in the ratio to what is recorded.

        What the identified loop does otherwise than the recorded one is in the simulation of
        every option and in that of leaving the loop as it is: their ratio is what is believed.
        """
        if self.measures is None or self.measures is now:
            return self
        factors = {key: _ratio(getattr(now, key), getattr(left, key)) for key in KEYS}
        measures: dict[str, Any] = {
            key: None if (value := getattr(self.measures, key)) is None else factors[key] * value
            for key in KEYS
        }
        interval = {
            key: (factors[key] * low, factors[key] * high)
            for key, (low, high) in self.interval.items()
        }
        return dataclasses.replace(self, measures=Measures(**measures), interval=interval)

    def where_agreed(self, now: Measures) -> "Option":
        """Return the option, without figures where they would not hold in each drawn loop.

        The note says on which measure the loops do not agree, and on which they do.
        """
        if self.measures is None or not (apart := self._apart(now)):
            return self
        said = " and ".join(
            f"{WORDS[key]} ({low:.3g} to {high:.3g}, now {getattr(now, key):.3g})"
            for key, (low, high) in apart.items()
        )
        note = f"{self.note} Not promised: the simulated loops do not agree on its {said}."
        for key in WORDS.keys() & self.interval.keys() - apart.keys():
            note += f" That they agree on its {WORDS[key]} alone is not enough."
        return dataclasses.replace(self, measures=None, note=note)

    def _apart(self, now: Measures) -> dict[str, tuple[float, float]]:
        """Return the interval of each measure whose figure would not hold in each drawn loop.

        Nor does one that promises less where some loops show no less than now.
        """
        found = {}
        for key in WORDS.keys() & self.interval.keys():
            said, before = getattr(self.measures, key), getattr(now, key)
            room = AGREED_NOW * before
            far = any(abs(said - came) > max(AGREED * came, room) for came in self.interval[key])
            if far or (said <= (1.0 - PROMISED) * before <= before <= self.interval[key][1]):
                found[key] = self.interval[key]
        return dict(sorted(found.items(), reverse=True))

    def to_dict(self) -> dict[str, Any]:
        """Return an entry of ``options`` of ``gain --json``."""
        measures = dict.fromkeys(KEYS) if self.measures is None else vars(self.measures)
        return {
            "what": self.what.value,
            **measures,
            "interval": {key: list(ends) for key, ends in self.interval.items()},
            "note": self.note,
            "settings": self.settings,
        }


@dataclasses.dataclass(frozen=True)
class Gain:
    """What would help a loop."""

    valve: str  # valve, output: tags of what was looked at
    output: str
    now: Measures  # of the record
    options: tuple[Option, ...]  # in the order of ``What``

    def option(self, what: What) -> Option:
        """Return one option."""
        return next(option for option in self.options if option.what is what)

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``gain --json``."""
        return {
            "valve": self.valve,
            "output": self.output,
            "now": dict(vars(self.now)),
            "options": [option.to_dict() for option in self.options],
        }


def gain_of(record: Record, found: Identification, valve: str | None = None) -> Gain:
    """Simulate what would help one valve of a record, its longest good part.

    Without a tag it is the valve whose band is widest for its OP. InputError where there is no
    model, or where no controller can be recovered.
    """
    loop = RecordedLoop.of(record, found, valve)
    draws = loop.drawn(np.random.default_rng(SEED))
    now = loop.now()
    runs = loop.run(draws)
    kept = [k for k, run in enumerate(runs) if _repeats(now, run)]
    names = record.valves[loop.valve], record.outputs[loop.output]
    if len(kept) < FEWEST or kept[: draws.likeliest] != list(range(draws.likeliest)):
        note = f"Not simulated: {_doubt(now, runs, len(kept))}."
        others = [Option(what, None, {}, note) for what in What if what is not What.LEAVE]
        same = Option(What.LEAVE, now, {}, "The loop as it is, as recorded.")
        return Gain(*names, now, (*others, same))
    note = f"The loop as it is: {len(kept)} of {DRAWS} simulated loops repeat the record."
    left = option_of(What.LEAVE, [runs[k] for k in kept], note, likeliest=draws.likeliest)
    draws = draws.taken(kept)
    assert left.measures is not None
    service = _service(loop, draws, now).beside(now, left.measures)
    retuned = _retune(loop, draws, found, now).beside(now, left.measures)
    options = (service, _embedding(loop, found, now), retuned)
    told = tuple(option.where_agreed(now) for option in options)
    return Gain(*names, now, (*told, left.beside(now, left.measures)))


def _repeats(now: Measures, run: Measures | None) -> bool:
    """Tell whether a drawn loop does what was recorded."""
    if run is None:
        return False
    pairs = [(getattr(now, key), getattr(run, key)) for key in WORDS]
    return all(abs(came - was) <= REPEATS * was for was, came in pairs if None not in (was, came))


def _doubt(now: Measures, runs: Sequence[Measures | None], kept: int) -> str:
    """Return why the simulated loop cannot stand for the recorded one."""
    if runs[0] is None:
        return "the identified loop grows without end"
    if _repeats(now, runs[0]):
        return f"no more than {kept} of {len(runs)} simulated loops repeat the record"
    return (
        "the identified loop does not repeat the record, its mean |PV−SP| is "
        f"{_ratio(runs[0].iae_per_hour, now.iae_per_hour):.2f} and its amplitude "
        f"{_ratio(runs[0].amplitude, now.amplitude):.2f} times the recorded one"
    )


def _service(loop: RecordedLoop, draws: Draws, now: Measures) -> Option:
    if not draws.frictions.any():
        return _as_now(What.SERVICE, now, "No friction was found: a service changes nothing.")
    runs = loop.run(draws, serviced=True)
    note = "No friction, same controller: the stem follows each move of OP, also those by noise."
    return option_of(What.SERVICE, runs, note, likeliest=draws.likeliest)


def _as_now(
    what: What, now: Measures, note: str, settings: dict[str, float] | None = None
) -> Option:
    """Return an option that changes nothing."""
    interval = {key: (value, value) for key in KEYS if (value := getattr(now, key)) is not None}
    return Option(what, now, interval, note, settings or {})


def _retune(loop: RecordedLoop, draws: Draws, found: Identification, now: Measures) -> Option:
    tuning = UNCHANGED
    cause = found.outputs[loop.output].cause
    if cause is not None and cause.kind in RETUNED:
        tuning = best_tuning(loop, draws)
        note = tuning.note
    else:
        note = "Neither valve nor tuning is the cause: another tuning is not looked for."
    if tuning == UNCHANGED:
        return _as_now(What.RETUNE, now, note, tuning.settings)
    runs = loop.run(draws, tunings=tuning.applied(draws.tunings))
    return option_of(What.RETUNE, runs, note, tuning.settings, draws.likeliest)


def _embedding(loop: RecordedLoop, found: Identification, now: Measures) -> Option:
    """Return what the embedding does, in the ratio to what is recorded of the same rows.

    It lives by the jump of the stem, so that its figures are the medians over loops with all
    frictions that are possible, and not those of the likeliest one.
    """
    cause = found.outputs[loop.output].cause
    if not loop.estimate.verdict.has_friction or cause is None or cause.kind is not CauseKind.VALVE:
        note = "The record does not show a valve whose friction makes the loop cycle."
        return Option(What.EMBEDDING, None, {}, f"{note} Nothing is promised of embedding it.")
    draws = loop.possible(np.random.default_rng(SEED))
    kept = [k for k, run in enumerate(loop.run(draws)) if _repeats(now, run)]
    if len(kept) < FEWEST:
        note = (
            f"No more than {len(kept)} of {DRAWS} loops with possible frictions repeat the record."
        )
        return Option(What.EMBEDDING, None, {}, note)
    draws, part = draws.taken(kept), loop.embedding_part()
    try:
        design = EmbeddingDesign.of(loop)
        ratio = times_as_fast(loop, design.built(), draws)
        runs = [] if ratio > FASTEST else embedded(part, design, draws)
    except InputError as error:
        return Option(What.EMBEDDING, None, {}, f"It cannot be set up: {error}.")
    if not runs:
        note = (
            f"It would answer {ratio:.2g} times as fast as the recorded loop; how the process "
            "answers there the record does not show, so that nothing is said of it."
        )
        return Option(What.EMBEDDING, None, {}, note)
    note = f"A controller that knows the friction, on {len(runs)} simulated loops."
    weights = design.weights(loop.pv_scale, loop.op_scale)
    if gone := runs.count(None):
        note = f"{note} In {gone} of them the loop grows without end."
        return Option(What.EMBEDDING, None, {}, note, weights)
    return option_of(What.EMBEDDING, runs, note, weights).beside(now, part.now())


def option_of(
    what: What,
    runs: Sequence[Measures | None],
    note: str,
    settings: dict[str, float] | None = None,
    likeliest: int = 0,
) -> Option:
    """Return the option of its draws; one that grows in half of them is none.

    The mean of the ``likeliest`` draws at the begin is given; 0 gives the medians of all.
    """
    stable = [run for run in runs if run is not None]
    if 2 * len(stable) <= len(runs) or None in runs[:likeliest]:
        return Option(what, None, {}, f"{note} The simulated loop grows without end.")
    middle: dict[str, Any] = {}
    interval = {}
    for key in KEYS:
        values = [value for run in stable if (value := getattr(run, key)) is not None]
        middle[key] = None
        if values:
            given = float(np.mean(values[:likeliest]) if likeliest else np.median(values))
            low, high = map(float, np.percentile(values, ENDS))
            middle[key], interval[key] = given, (min(low, given), max(high, given))
    return Option(what, Measures(**middle), interval, note, settings or {})


def _ratio(one: float | None, other: float | None) -> float:
    """Return one over the other; 1 where there is nothing to compare."""
    if one is None or other is None or other <= 0.0:
        return 1.0
    return one / other
