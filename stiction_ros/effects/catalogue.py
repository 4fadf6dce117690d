"""The catalogue of effects as a page of the documentation.

``python -m stiction_ros.effects.catalogue > docs/effects.md`` writes it.
"""

from __future__ import annotations

import inspect
import math
import re

from stiction_ros.effects import DEFAULT_LAW, Stiction, behaviours
from stiction_ros.effects.behaviour import Behaviour, Parameter

PLACES = {
    "valve": "Valves",
    "process": "Process",
    "load": "Loads",
    "disturbance": "Disturbances",
    "sensor": "Sensors",
    "data": "Data",
}
_HEAD = """# The catalogue of effects

Reference of everything that a loop model may hold and `stiction gap` may name. Made from the
classes by `python -m stiction_ros.effects.catalogue > docs/effects.md`.

An effect acts at a place, `KIND:TAG`:

| place | in the YAML | the signal it acts on |
|---|---|---|
| `valve:V1` | `valves: [{name: V1, effects: [...]}]` | OP in %, to the stem |
| `process:PV1` | `process: {outputs: [{name: PV1, effects: [...]}]}` | output less `pv0` |
| `load:V1` | `disturbances: [{load: V1, effect: ...}]` | 0, added to the stem in % |
| `disturbance:PV1` | `disturbances: [{output: PV1, effect: ...}]` | 0, added to PV |
| `sensor:PV1` | `sensors: [{name: PV1, effects: [...]}]` | PV with its noise |
| `data` | none; a wrong tuning is mended in `controller:` | the record |

Effects of one place stand in signal order. An effect on a process acts on the output without noise,
less the operating point `pv0`. A disturbance may name an input of the process in place of an
output: `input: F_B`. A load has the parameters of the disturbance of the same name. `time` is in s
since the first sample. *Confusable with* names what leaves nearly the same traces in OP and PV.
"""
_NEXT = """## Next

The laws of friction: [friction.md](friction.md). An effect of your own: `CONTRIBUTING.md` and its
page in the [API](api/effects.md). To find an effect: [discrepancy.md](discrepancy.md).
"""


def page() -> str:
    """Return the page, Markdown."""
    parts = [_HEAD]
    for place, title in PLACES.items():
        kinds = [kind for kind in behaviours() if place in kind.places]
        kinds.sort(key=lambda kind: (kind.effect != Stiction.effect, kind.law != DEFAULT_LAW))
        parts.append(f"## {title}\n\n" + "\n".join(_entry(kind, place) for kind in kinds))
    return "\n".join([*parts, _NEXT])


def _entry(kind: type[Behaviour], place: str) -> str:
    name = f"`{kind.effect}`" + (f", law `{kind.law}`" if kind.law else "")
    if place == "load":
        return f"### {name}\n\n{_summary(kind)}\n"
    rows = [f"| `{p.key}` | {p.unit} | {_range(p)} | {p.description} |" for p in kind.parameters()]
    head = f"### {name}\n\n{_summary(kind)}\n\n"
    table = "| parameter | unit | range | meaning |\n|---|---|---|---|\n" + "\n".join(rows)
    if kind.law not in (None, DEFAULT_LAW):
        return f"{head}{table}\n\nOtherwise as `{kind.effect}` above.\n"
    others = [other for other in kind.confusable if other != f"{place} {kind.effect}"]
    told = {
        "Signature": kind.signature,
        "Minimum data": kind.minimum_data,
        "Confusable with": ", ".join(others),
    }
    lines = [f"- {what}: {said}.\n" for what, said in told.items() if said]
    return f"{head}{table}\n" + ("\n" if lines else "") + "".join(lines)


def _summary(kind: type[Behaviour]) -> str:
    text = (inspect.getdoc(kind) or "").partition("\n\n")[0]
    text = re.sub(r":\w+:`~?(?:\w+\.)*(\w+)`", r"\1", text).replace("``", "`")
    return " ".join(text.split())


def _range(entry: Parameter) -> str:
    low, high = (f"{bound:g}" for bound in (entry.low, entry.high))
    if math.isfinite(entry.low) and math.isfinite(entry.high):
        return f"{low} … {high}"
    if math.isfinite(entry.low):
        return f"≥ {low}"
    return f"≤ {high}" if math.isfinite(entry.high) else "any"


if __name__ == "__main__":
    print(page(), end="")
