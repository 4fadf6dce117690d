"""What may be done about a loop in words: what it changes of the mean |PV − SP|, or why not."""

from collections.abc import Mapping
from typing import Any

from stiction_ros.survey.entry import Entry
from stiction_ros.survey.pages.words import signed_percent

HEADS = {
    "service": "|PV−SP| after service",
    "embedding": "|PV−SP| with friction known",
    "retune": "|PV−SP| after retuning",
}
"""Heading of each thing that may be done, wherever people read it."""

WHY = (
    ("do not agree", "draws disagree"),
    ("repeat the record", "does not repeat"),
    ("times as fast", "faster than shown"),
    ("Not simulated", "not simulated"),
    ("grows without end", "unstable"),
    ("No other tuning", "none helps"),
    ("another tuning is not looked for", "not looked for"),
    ("Nothing is promised", "valve makes no cycle"),
    ("cannot be set up", "cannot be set up"),
)
"""What a note of ``gain`` says, and that in a word or two; the first that fits."""

NOTHING = -0.005  # change from which up another tuning is none that helps


def change(entry: Entry, what: str) -> float | None:
    """Return what an option changes of the mean |PV − SP|: −.75 leaves a quarter of it."""
    gain = entry.gain or {}
    before = _of(gain, "now").get("iae_per_hour")
    after = _of(gain, what).get("iae_per_hour")
    if not before or after is None:
        return None
    return float(after) / float(before) - 1.0


def in_words(entry: Entry, what: str) -> str:
    """Return the change, or why there is none; nothing for a valve that needs nothing."""
    if not entry.found:
        return ""
    changed, note = change(entry, what), note_of(entry, what)
    if changed is None:
        return _short(note) or "not simulated"
    if what == "retune" and changed >= NOTHING:
        return _short(note) or "none helps"
    return signed_percent(changed)


def note_of(entry: Entry, what: str) -> str:
    """Return what ``gain`` says of an option; empty where it was not asked."""
    return str(_of(entry.gain or {}, what).get("note", ""))


def _short(note: str) -> str:
    return next((word for said, word in WHY if said in note), "")


def _of(gain: Mapping[str, Any], what: str) -> Mapping[str, Any]:
    found = gain.get(what)
    return found if isinstance(found, Mapping) else {}
