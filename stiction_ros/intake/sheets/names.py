"""Names of tags and columns: which loop they belong to, and which of its signals they are."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from stiction_ros.intake.words import WORDS, by_word

TIME_NAMES, TAG_NAMES, VALUE_NAMES, UNIT_NAMES = (
    tuple(WORDS["columns"][what]) for what in ("time", "tag", "value", "unit")
)

_QUALITIES = by_word("qualities")
_KINDS = {word.replace(" ", ""): kind for word, kind in _QUALITIES.items()}
_TELLING = re.compile(r"quality|qualit[äé]|qualitaet|validity|confidence|questionable")
"""Words that tell of a quality wherever they stand in a name."""

SIGNALS: Mapping[str, str] = by_word("signals")  # last part of a tag to its signal
OR_ROW = "(or a row for this file in --tags)"  # where an option would hold for all files

_ATTRIBUTE = re.compile(r"(?i)[./](cv|f_cv|val|value|act|actual|target|measured)$")
_BLOCK = re.compile(r"(?i)[./](pid\w*|regctl\w*|daca\w*|pic|fic_block|pidx|ctrl)$")
_QUALITY = re.compile(rf"(?i)[ ._:/-]({'|'.join(_QUALITIES).replace(' ', '[ _]?')})$")
_OP_UNITS = (*by_word("op_units"), *WORDS["several"])
_UNIT = re.compile(rf"(?i)(?:[\s_]+|\s*[\[(])({'|'.join(map(re.escape, _OP_UNITS))})[\])]?$")
_WORDS = "|".join(sorted(map(re.escape, SIGNALS), key=len, reverse=True))
_TAG = re.compile(rf"(?i)(.+?)\s*(?:[._:/\\ -]|::)\s*({_WORDS})")


class Tag(NamedTuple):
    """What a name says: a signal or its quality, of a loop; that is empty for a bare ``PV``."""

    loop: str
    signal: str
    quality: bool = False


def read_tag(name: str) -> Tag | None:
    """Return what a tag or a column's name says; None when it says nothing.

    ``FIC101.PV``, ``FIC101/PID1/OUT.CV``, ``FIC101_SP``, ``FIC101.PIDA.MODE``, ``PV``.
    """
    bare = " ".join(name.split())
    quality = _QUALITY.search(bare)
    bare = _ATTRIBUTE.sub("", _QUALITY.sub("", bare))
    signal = SIGNALS.get(bare.casefold())
    if signal is not None:
        return Tag("", signal, quality is not None)
    found = _TAG.fullmatch(bare)
    if found is None:
        unit = _UNIT.search(bare)
        return read_tag(bare[: unit.start()]) if unit else None
    loop = _BLOCK.sub("", found[1])
    return Tag(loop, SIGNALS[found[2].casefold()], quality is not None)


def unit_in(name: str) -> str:
    """Return the unit of an OP at the end of a name, empty for none: ``OP_psig``, ``OP [V]``."""
    found = _UNIT.search(name)
    return found[1] if found else ""


def without_quality(name: str) -> str:
    """Return what stands before the word of a quality: ``FT101`` of ``FT101.Quality``."""
    return _QUALITY.sub("", name)


def quality_kind(name: str) -> str | None:
    """Return what a number in a column of qualities is, see ``words.yaml``; None for others."""
    tag, whole = read_tag(name), folded(name)
    told = _QUALITY.search(whole) if tag is not None and tag.quality else None
    bare = re.sub(r"[\W_]|\d+\W*$", "", told[1] if told else whole)
    telling = _TELLING.search(bare)
    return _KINDS.get(bare, _QUALITIES.get(telling[0], "code") if telling else None)


def folded(name: str) -> str:
    """Return a name in small letters, with single spaces."""
    return " ".join(name.split()).casefold()


def is_name(name: str) -> bool:
    """Return whether a cell looks like the name of a column."""
    known = (*TIME_NAMES, *TAG_NAMES, *VALUE_NAMES, *UNIT_NAMES)
    return folded(name) in known or quality_kind(name) is not None or read_tag(name) is not None
