"""Which samples a loop was not in automatic, by its column MODE."""

import dataclasses
import re
import shlex
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from stiction_ros.errors import InputError
from stiction_ros.intake.repairs import Rules
from stiction_ros.intake.sheets.cells import number
from stiction_ros.intake.tables.block import Block
from stiction_ros.intake.words import pattern_of
from stiction_ros.records.record import Quality
from stiction_ros.texts import plural

AUTOMATIC, MANUAL = pattern_of("automatic"), pattern_of("manual")
"""Words of modes; in tracking and initialisation OP follows something else than the controller."""

STILL = 0.02  # share of samples at which OP moves at most in manual, to tell modes that are numbers
BUSY = 0.2  # share of samples at which OP moves at least in automatic, for the same


def manual_marked(block: Block, rules: Rules, automatic: tuple[str, ...] | None) -> Block:
    """Return the block with samples in manual or tracking marked so, and without its mode.

    An empty mode goes on as before. Numbers are told apart by OP, which stands still in manual.
    What is shown in ``automatic`` may be said; None knows the usual words.

    Raises:
        InputError: modes of which it cannot be told which is automatic.
    """
    columns = dict(block.columns)
    column = next((columns.pop(key) for key in block.columns if key.signal == "mode"), None)
    if column is None:
        return block
    block = dataclasses.replace(block, columns=columns)
    there = np.flatnonzero(~column.blank & np.isfinite(column.values))
    if not len(there):
        return block
    before = np.searchsorted(there, np.arange(len(column.values)), side="right") - 1
    codes = column.values[there[np.maximum(before, 0)]].astype(np.intp)
    shown = {code: column.known[code] for code in np.unique(codes).tolist()}
    moved = _moves(block, codes, shown)
    off = _not_automatic(column.name, set(shown.values()), moved, automatic, rules)
    for word in shown.values():
        rules.modes[word] = "not automatic" if word in off else "automatic"
    marked = np.isin(codes, [code for code, word in shown.items() if word in off])
    if not marked.any():
        return block
    mask = block.own_mask()
    mask[marked & (mask != Quality.BAD)] = Quality.MANUAL
    count = plural(int(marked.sum()), "sample")
    rules.told.append(f"{count} not in automatic ({', '.join(sorted(off))}), cut out")
    return dataclasses.replace(block, mask=mask)


def _not_automatic(
    name: str,
    words: set[str],
    moved: Mapping[str, float],
    automatic: tuple[str, ...] | None,
    rules: Rules,
) -> set[str]:
    """Return the modes that are not automatic, of the ``words`` that a column shows."""
    if automatic is not None:
        wanted = {word.casefold() for word in automatic}
        return {word for word in words if not _alike(word, wanted)}
    off = {word for word in words if MANUAL.fullmatch(_bare(word))}
    unknown = sorted(word for word in words - off if not AUTOMATIC.fullmatch(_bare(word)))
    if not unknown:
        return off
    if len(words) == 1:
        rules.told.append(
            f"{name} shows {unknown[0]} alone, which is not known: taken as automatic; if it is "
            "not say --auto WORD, with the word that stands for automatic"
        )
        return off
    if all(number(word) is not None for word in words):
        still = {word for word, share in moved.items() if share <= STILL}
        busy = {word for word, share in moved.items() if share >= BUSY}
        if busy and still | busy == words:
            return still
    likely = max(unknown, key=lambda word: moved.get(word, 0.0))
    raise InputError(
        f"{name} shows {', '.join(sorted(words))}; it is not known which of them is automatic",
        fix=f"say which with --auto, such as --auto {shlex.quote(likely)}",
    )


def _bare(word: str) -> str:
    """Return a mode without what stands behind it in brackets, and without a full stop."""
    return re.sub(r"\s*[(\[].*", "", word).rstrip(".")


def _alike(word: str, wanted: set[str]) -> bool:
    value = number(word)
    return word.casefold() in wanted or (value is not None and value in map(number, wanted))


def _moves(block: Block, codes: NDArray[np.intp], shown: Mapping[int, str]) -> dict[str, float]:
    """Return by mode the share of samples at which the busiest OP moves."""
    shares: dict[str, float] = {}
    for column in block.of("op").values():
        rows = np.flatnonzero(~column.blank & np.isfinite(column.values))
        mode, moving = codes[rows], np.diff(column.values[rows]) != 0
        for code, word in shown.items():
            if (inside := (mode[1:] == code) & (mode[:-1] == code)).any():
                shares[word] = max(float(np.mean(moving[inside])), shares.get(word, 0.0))
    return shares
