"""Which samples a loop was not in automatic, by its column MODE."""

from __future__ import annotations

import dataclasses
import re
import shlex

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.intake.repairs import Rules, plural
from stiction_ros.intake.sheets.cells import number
from stiction_ros.intake.tables.block import Block, Column, FlagArray, Key
from stiction_ros.intake.words import pattern_of
from stiction_ros.records.quality import Quality

AUTOMATIC, MANUAL = pattern_of("automatic"), pattern_of("manual")
"""Words of modes; in tracking and initialisation OP follows something else than the controller."""

STILL = 0.02
"""Share of samples at which OP moves at most in manual, to tell modes that are numbers."""

BUSY = 0.2
"""Share of samples at which OP moves at least in automatic, for the same."""


def mode_column(block: Block) -> tuple[Key, Column] | None:
    """Return the column of the mode; None when there is none."""
    return next(((k, c) for k, c in block.columns.items() if k.signal == "mode"), None)


def manual_marked(
    block: Block, rules: Rules, automatic: tuple[str, ...] | None, *, told: bool = True
) -> Block:
    """Return the block with samples in manual or tracking marked so, and without its mode.

    An empty mode goes on as before. Numbers are told apart by OP, which stands still in manual.

    Args:
        block: one row a sample or a stamp.
        rules: what is cut is noted there.
        automatic: what is shown in automatic; None knows the usual words.
        told: whether a word that is not known is noted.

    Raises:
        InputError: modes of which it cannot be told which is automatic.
    """
    found = mode_column(block)
    if found is None:
        return block
    key, column = found
    rest = {k: c for k, c in block.columns.items() if k != key}
    block = dataclasses.replace(block, columns=rest)
    codes, shown = _held_codes(column)
    if not shown:
        return block
    off = _not_automatic(block, column.name, codes, shown, automatic)
    rules.modes.update(
        {word: "not automatic" if word in off else "automatic" for word in shown.values()}
    )
    if told and automatic is None and (alone := _alone(shown)) is not None:
        rules.told.append(
            f"{column.name} shows {alone} alone, which is not known: taken as automatic; if it is "
            "not say --auto WORD, with the word that stands for automatic"
        )
    marked = np.isin(codes, [code for code, word in shown.items() if word in off])
    if not marked.any():
        return block
    mask = np.zeros(len(codes), dtype=np.uint8) if block.mask is None else np.array(block.mask)
    mask[marked & (mask != Quality.BAD)] = Quality.MANUAL
    words = ", ".join(sorted(off))
    rules.told.append(f"{plural(int(marked.sum()), 'sample')} not in automatic ({words}), cut out")
    return dataclasses.replace(block, mask=mask)


def _held_codes(column: Column) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], dict[int, str]]:
    """Return the mode of each row, empty ones as before, and the words of those that occur."""
    there = np.flatnonzero(~column.blank & np.isfinite(column.values))
    if not len(there):
        return np.zeros(len(column.values), dtype=np.intp), {}
    before = np.searchsorted(there, np.arange(len(column.values)), side="right") - 1
    codes = column.values[there[np.maximum(before, 0)]].astype(np.intp)
    shown = {code: column.known[code].strip() for code in np.unique(codes).tolist()}
    return codes, shown


def _not_automatic(
    block: Block,
    name: str,
    codes: np.ndarray[tuple[int], np.dtype[np.intp]],
    shown: dict[int, str],
    automatic: tuple[str, ...] | None,
) -> set[str]:
    """Return the modes that are not automatic, as they are shown."""
    words = set(shown.values())
    if automatic is not None:
        wanted = {word.casefold() for word in automatic}
        return {word for word in words if not _alike(word, wanted)}
    known_off = {word for word in words if MANUAL.fullmatch(_bare(word))}
    unknown = {word for word in words - known_off if not AUTOMATIC.fullmatch(_bare(word))}
    if not unknown or len(words) == 1:
        return known_off
    if all(number(word) is not None for word in words):
        told = _by_movement(block, codes, shown)
        if told is not None:
            return told
    moved = _moves(block, codes, shown)
    likely = max(sorted(unknown), key=lambda word: max(moved.get(word, [0.0])))
    raise InputError(
        f"{name} shows {', '.join(sorted(words))}, of which it is not known which is automatic",
        where=str(block.path),
        fix=f"say which with --auto, such as --auto {shlex.quote(likely)}",
    )


def _alone(shown: dict[int, str]) -> str | None:
    """Return the one word of a mode that says nothing of what it means; None for any other."""
    words = set(shown.values())
    (word,) = words if len(words) == 1 else ("a",)
    known = AUTOMATIC.fullmatch(_bare(word)) or MANUAL.fullmatch(_bare(word))
    return None if known else word


def _bare(word: str) -> str:
    """Return a mode without what stands behind it in brackets, and without a full stop."""
    return re.sub(r"\s*[(\[].*", "", word).rstrip(".")


def _alike(word: str, wanted: set[str]) -> bool:
    value = number(word)
    return word.casefold() in wanted or (
        value is not None and any(number(other) == value for other in wanted)
    )


def _by_movement(
    block: Block, codes: np.ndarray[tuple[int], np.dtype[np.intp]], shown: dict[int, str]
) -> set[str] | None:
    """Return the modes in which OP stands still while it moves in others; None when unclear."""
    shares = _moves(block, codes, shown)
    still = {word for word, moved in shares.items() if max(moved) <= STILL}
    busy = {word for word, moved in shares.items() if max(moved) >= BUSY}
    return still if busy and still | busy == set(shown.values()) else None


def _moves(
    block: Block, codes: np.ndarray[tuple[int], np.dtype[np.intp]], shown: dict[int, str]
) -> dict[str, list[float]]:
    """Return the share of samples at which each OP moves, by mode."""
    shares: dict[str, list[float]] = {}
    for key, column in block.columns.items():
        if key.signal != "op":
            continue
        rows = np.flatnonzero(~column.blank & np.isfinite(column.values))
        modes = codes[rows]
        moving: FlagArray = np.diff(column.values[rows], prepend=column.values[rows[:1]]) != 0
        inside = ~np.insert(np.diff(modes) != 0, 0, True)
        for code, word in shown.items():
            if (chosen := inside & (modes == code)).any():
                shares.setdefault(word, []).append(float(np.mean(moving[chosen])))
    return shares
