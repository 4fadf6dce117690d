"""What columns of qualities tell of the values beside them."""

import re
from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np

from stiction_ros.intake.sheets.cells import BAD_WORDS, Cells, Words, number
from stiction_ros.intake.sheets.names import folded, quality_kind, read_tag, without_quality
from stiction_ros.intake.tables.clock import kind_of, repeats
from stiction_ros.intake.words import WORDS, pattern_of

_BAD, _GOOD = tuple(WORDS["bad_beginnings"]), pattern_of("good_words")
_YES, _NO = tuple(WORDS["yes_words"]), tuple(WORDS["no_words"])


def bad_qualities(read: Words, name: str) -> tuple[set[str], str]:
    """Return which words of a column of qualities, by its name, are bad, and a note on others."""
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


def qualities_of(
    header: Sequence[str], top: Sequence[Cells], signals: set[int], taken: Collection[int | None]
) -> tuple[dict[int, tuple[int, ...]], tuple[int, ...]]:
    """Return columns of qualities: those of each signal, and those of whole rows.

    One that names a signal is its; of several with one name each is of the signal before it. What
    stands at the ``top`` of columns tells it, too, but for ``signals`` and what is ``taken``.
    """
    places = quality_places(header, top, {*signals, *taken})
    plain = [re.sub(r"[\s._]*\d+$", "", name).casefold() for name in header]
    names = Counter(plain[k] for k in places)
    signal = {tag: k for k in signals if (tag := read_tag(header[k])) is not None}
    beside: dict[int, tuple[int, ...]] = {}
    whole: list[int] = []
    names_at = {folded(name): k for k, name in enumerate(header) if k not in places}
    for place in places:
        named, of = read_tag(header[place]), names_at.get(folded(without_quality(header[place])))
        if named is not None:
            of = signal.get(named._replace(quality=False), of)
        if of not in signals and (of is not None or (named is not None and named.loop)):
            continue  # of a signal that is none of these
        if of is None and (names[plain[place]] > 1 or len(signals) == 1):
            of = max((k for k in signals if k < place), default=None)
        if of is None:
            whole.append(place)
        else:
            beside[of] = (*beside.get(of, ()), place)
    return beside, tuple(whole)


def quality_places(
    header: Sequence[str], top: Sequence[Cells], taken: Collection[int | None] = ()
) -> list[int]:
    """Return the columns that tell of qualities by their words, or by name and few values."""
    found = []
    for index, (name, cells) in enumerate(zip(header, top, strict=True)):
        few = kind_of(cells) in ("text", "") or repeats(cells)
        named = quality_kind(name) is not None and few
        if index not in taken and (named or _all_of_quality(cells)):
            found.append(index)
    return found


def _all_of_quality(cells: Cells) -> bool:
    """Return whether all words of a column tell of qualities, and one of them of a good one."""
    if isinstance(cells, np.ndarray):
        return False
    told = {word.strip().casefold() for word in set(cells)} - {""}
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
    """Return which numbers tell of bad values; None for those not known."""
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
