"""The page of the catalogue says what the classes are."""

import math
from pathlib import Path

import pytest

from stiction_ros.effects import Behaviour, Parameter, behaviours

PAGE = Path(__file__).resolve().parents[2] / "docs" / "effects.md"
PLACES = {
    "valve": "Valves",
    "process": "Process",
    "load": "Loads",
    "disturbance": "Disturbances",
    "sensor": "Sensors",
    "data": "Data",
}
every_behaviour = pytest.mark.parametrize("kind", behaviours(), ids=lambda kind: kind.title())


def row(entry: Parameter) -> str:
    low, high = f"{entry.low:g}", f"{entry.high:g}"
    bounds = f"{low} … {high}" if math.isfinite(entry.high) else f"≥ {low}"
    if not math.isfinite(entry.low):
        bounds = f"≤ {high}" if math.isfinite(entry.high) else "any"
    return f"| `{entry.key}` | {entry.unit} | {bounds} | {entry.description} |"


@every_behaviour
def test_the_page_has_every_effect_with_its_parameters(kind: type[Behaviour]) -> None:
    assert kind.places
    title = f"### `{kind.effect}`" + (f", law `{kind.law}`" if kind.law else "") + "\n"
    for place in kind.places:
        _, _, rest = PAGE.read_text(encoding="utf-8").partition(f"\n## {PLACES[place]}\n")
        _, found, entry = rest.partition("\n## ")[0].partition(title)
        assert found, f"docs/effects.md has no {kind.title()} among its {PLACES[place]}"
        told = [line for line in entry.partition("\n### ")[0].splitlines() if "| `" in line]
        assert told == ([] if place == "load" else [row(each) for each in kind.parameters()])


def test_names_of_one_place_are_one_effect() -> None:
    for place in PLACES:
        here = [kind for kind in behaviours() if place in kind.places]
        assert len({(kind.effect, kind.law) for kind in here}) == len(here)
