"""The figures of a run: signals around the swap and of all, estimates, step responses."""

from collections.abc import Mapping

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.pages.frame import text, words
from stiction_ros.pages.plot import Curve, over_time
from stiction_ros.pages.signals import ALL, Units, over_record
from stiction_ros.report.run.identified import responses
from stiction_ros.report.run.story import Story


def end_of_cycle(story: Story) -> str:
    """Return four cycles on either side of the swap."""
    cycle, swap = story.phases.cycle, story.log.swap_sample
    if swap is None or cycle is None:
        return ""
    reach = round(4 * cycle.period)
    rows = slice(max(swap - reach, 0), min(swap + reach, len(story.record)))
    return (
        "<h2>The end of the limit cycle</h2><p>Four periods of the cycle before the swap and the "
        f"same time after it.</p>{_signals(story, rows)}"
    )


def whole_run(story: Story) -> str:
    """Return all signals over the whole run."""
    return f"<h2>The whole run</h2>{_signals(story, ALL)}"


def estimates(story: Story) -> str:
    """Return the estimates of f_S and f_D over time, what was trusted, and the truth."""
    record, log = story.record, story.log
    if not log.fits:
        return ""
    end, drawn = float(record.time[-1]), []
    for valve in record.valves:
        for column, (key, symbol) in enumerate((("f_s", "f_S"), ("f_d", "f_D"))):
            name = f"{valve}.{key}"
            every = {f.stamp: f.friction(valve, key) for f in log.fits}
            told = {stamp: found for stamp, found in every.items() if np.isfinite(found[0])}
            trusted = {f.stamp: (f.trusted.get(name, np.nan),) for f in log.fits}
            if not told:
                continue
            at = sorted(trusted)
            time = np.array([0.0, *map(log.seconds, at), end])
            value, low, high = _held(at, told, 3)
            curves = [
                Curve("95 % interval", "whole", low, steps=True),
                Curve("95 % interval", "whole", high, steps=True),
                Curve("fit", "pv", value, steps=True),
                Curve("trusted", "stem", _held(at, trusted, 1)[0], steps=True),
            ]
            truth = story.true_friction(valve)
            if truth is not None:
                curves.append(Curve("simulated", "sp", np.full(len(time), truth[column])))
            title = f"{symbol} of {valve}: each fit from the end of its window to the next one."
            drawn.append(
                over_time(
                    title, time, curves, f"{words(symbol)}, %", record.start, marks=_swaps(story)
                )
            )
    return (
        "<h2>Friction found over time</h2><p>The controller works with what the estimator "
        f"trusts.</p>{''.join(drawn)}"
    )


def step_responses(story: Story) -> str:
    """Return the identified step responses, beside the true ones where known."""
    drawn = responses(story.identified.get("outputs", []), story.record, _units(story), story.truth)
    return f"<h2>Response to a step of the stem</h2>{drawn}" if drawn else ""


def _signals(story: Story, rows: slice) -> str:
    marks, shade = _swaps(story), _aware(story)
    known = " The dashed line is the swap." if marks else ""
    modes = dict.fromkeys(one.mode for one in story.log.modes if one.mode != "unaware")
    shaded = f" Shaded: mode {text(' or '.join(modes))}." if shade else ""
    stem, units = story.log.stem_estimate, _units(story)
    drawn = over_record(story.record, stem, units, rows, marks=marks, shade=shade)
    return f"<p>{known}{shaded}</p>{''.join(drawn)}"


def _swaps(story: Story) -> tuple[float, ...]:
    return () if story.swap_time is None else (story.swap_time,)


def _aware(story: Story) -> tuple[tuple[float, float], ...]:
    """Return begin and end of each stretch in which the mode was not unaware, s."""
    log, end = story.log, float(story.record.time[-1])
    begins = [max(log.seconds(change.stamp), 0.0) for change in log.modes]
    spans = zip(log.modes, begins, [*begins[1:], end], strict=False)
    return tuple((first, last) for change, first, last in spans if change.mode != "unaware")


def _held(at: list[int], told: Mapping[int, tuple[float, ...]], width: int) -> FloatArray:
    """Return values that hold from each stamp on, one row each; NaN before the first."""
    now, rows = (np.nan,) * width, [(np.nan,) * width]
    for stamp in at:
        now = told.get(stamp, now)
        rows.append(now)
    return np.array([*rows, now]).T


def _units(story: Story) -> Units:
    return Units(outputs={k: text(v) for k, v in story.units.items()})
