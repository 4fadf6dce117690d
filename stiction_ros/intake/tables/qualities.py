"""What columns of qualities tell of the values beside them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from stiction_ros.intake.sheets.cells import BAD_WORDS, Words, number
from stiction_ros.intake.sheets.names import quality_kind
from stiction_ros.intake.words import WORDS, pattern_of

_BAD, _GOOD = tuple(WORDS["bad_beginnings"]), pattern_of("good_words")
_YES, _NO = tuple(WORDS["yes_words"]), tuple(WORDS["no_words"])


def bad_qualities(read: Words, name: str) -> tuple[set[str], str]:
    """Return which words of a column of qualities tell of bad values, and a note on others.

    Args:
        read: the column.
        name: of it, which tells what a number or a yes means.
    """
    kind = quality_kind(name) or "code"
    told = {word: word.strip().casefold() for word in read.known if word.strip()}
    codes = {word: code for word, text in told.items() if (code := number(text)) is not None}
    judged = {word: _is_bad(text, kind) for word, text in told.items() if word not in codes}
    judged |= _bad_codes(codes, kind)
    bad = {word for word, verdict in judged.items() if verdict}
    counts = np.bincount(read.codes(), minlength=len(read.known))
    strange = [f"{counts[read.known[w]]} {told[w]!r}" for w, v in judged.items() if v is None]
    note = (
        f"{name} shows {', '.join(strange[:4])}, of which it is not known whether they are good: "
        "taken as good; numbers are known in columns that are called Good or Bad"
    )
    return bad, note if strange else ""


def all_of_quality(words: Collection[str]) -> bool:
    """Return whether all words of a column tell of qualities, and one of them of a good one."""
    told = {word.strip().casefold() for word in words} - {""}
    known = all(_GOOD.fullmatch(t) or t.startswith(_BAD) or BAD_WORDS.fullmatch(t) for t in told)
    return known and any(map(_GOOD.fullmatch, told))


def _is_bad(text: str, kind: str) -> bool | None:
    """Return whether a word tells of a bad value; None when it is not known."""
    if text in _YES or text in _NO:
        return (text in _YES) == (kind == "bad")
    if text.startswith(_BAD) or BAD_WORDS.fullmatch(text) or text in ("b", "u"):
        return True
    return False if _GOOD.fullmatch(text) else None


def _bad_codes(codes: dict[str, float], kind: str) -> dict[str, bool | None]:
    """Return which numbers tell of bad values; None for those not known.

    A value that is surer to be bad than good, below half of the whole, is bad.
    """
    most = max(codes.values(), default=0.0)
    if kind in ("good", "bad"):
        return {word: (code != 0.0) == (kind == "bad") for word, code in codes.items()}
    if most == 100.0 or (kind == "sure" and most < 100.0):
        half = 50.0 if most > 1.0 else 0.5
        return {word: code < half for word, code in codes.items()}
    if most >= WORDS["opc_ua_uncertain"]:
        return {word: code >= WORDS["opc_ua_uncertain"] for word, code in codes.items()}
    if most >= WORDS["opc_good"]:
        return {word: code < WORDS["opc_good"] for word, code in codes.items()}
    return dict.fromkeys(codes)
