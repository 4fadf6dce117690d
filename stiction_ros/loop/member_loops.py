"""Loops that share one plant: which tags are whose, and how a cascade hangs together."""

import dataclasses
import re
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop.model import LoopModel

# behind the tag of an output: the OP of an outer loop, which is the set-point of this output
SET_POINT = ".SP"
_ENTRY = re.compile(r"\s*(?P<name>[A-Za-z]\w*)\s*:(?P<valves>[^>]+)->(?P<outputs>[^>]+)")


@dataclasses.dataclass(frozen=True)
class MemberLoop:
    """One of several loops of a plant."""

    name: str  # of the loop, which is the namespace of its nodes
    # what its OP moves: valves of the plant, or ``TAG.SP`` for the set-point of an output that
    # another loop controls
    valves: tuple[str, ...]
    outputs: tuple[str, ...]  # its PVs


def read_member_loops(entries: Sequence[str], model: LoopModel, where: str) -> list[MemberLoop]:
    """Return the loops of a plant by texts such as ``TC1: FV1 -> T1`` or ``LC1: F1.SP -> L1``.

    Several tags stand with commas. A text of another form, an unknown tag, and one that two loops
    have are refused.
    """
    loops: list[MemberLoop] = []
    for text in entries:
        found = _ENTRY.fullmatch(text)
        if found is None:
            fix = "write NAME: VALVE -> OUTPUT, such as TC1: FV1 -> T1"
            raise InputError(f"{text!r} is no loop", where=where, fix=fix)
        sides = [
            tuple(tag.strip() for tag in found[side].split(",")) for side in ("valves", "outputs")
        ]
        loops.append(MemberLoop(found["name"], *sides))
    outputs = set(model.outputs)
    inputs = {*model.valve_names, *(tag + SET_POINT for tag in outputs)}
    given = [tag for loop in loops for tag in loop.valves]
    _check(given, inputs, where)
    _check([tag for loop in loops for tag in loop.outputs], outputs, where)
    if loops and (idle := [tag for tag in model.valve_names if tag not in given]):
        raise InputError(f"nobody moves {', '.join(idle)}", where=where, fix="add its loop")
    return loops


def _check(tags: list[str], known: set[str], where: str) -> None:
    for tag in tags:
        if tag not in known or tags.count(tag) > 1:
            said = "belongs to two loops" if tag in known else "is not of the plant"
            raise InputError(f"{tag} {said}", where=where, fix=f"use {', '.join(sorted(known))}")


def is_set_point(tag: str) -> bool:
    """Tell whether an OP is the set-point of an inner loop and moves no valve of its own."""
    return tag.endswith(SET_POINT)


class Wiring:
    """Shares the signals of a plant out among its loops.

    The OP of an outer loop is the set-point of the inner one from the next sample on.
    """

    def __init__(self, model: LoopModel, loops: Sequence[MemberLoop]) -> None:
        """Start at rest: each OP at the stem's initial position, or at that of the PV it sets."""
        self.loops = tuple(loops)
        self._model = model
        at_rest = model.stem_start.tolist() + model.pv_start.tolist()
        tags = (*model.valve_names, *(tag + SET_POINT for tag in model.outputs))
        self._given = dict(zip(tags, at_rest, strict=True))
        cascaded = {tag for loop in loops for tag in loop.valves if is_set_point(tag)}
        self._set = [tag if tag + SET_POINT in cascaded else "" for tag in model.outputs]

    def op_of(self, loop: MemberLoop) -> FloatArray:
        """Return the OP of a loop in force."""
        return np.array([self._given[tag] for tag in loop.valves])

    def take(self, given: Sequence[FloatArray]) -> FloatArray:
        """Take in the OP of each loop, in their order, and return that of the plant, (m,), %."""
        for loop, op in zip(self.loops, given, strict=True):
            self._given.update(zip(loop.valves, map(float, op), strict=True))
        return np.array([self._given[tag] for tag in self._model.valve_names])

    def set_points(self, scheduled: FloatArray) -> FloatArray:
        """Return the set-points in force, (p,): those of outer loops in place of the schedule."""
        pairs = zip(self._set, scheduled, strict=True)
        return np.array([self._given[tag + SET_POINT] if tag else sp for tag, sp in pairs])

    def of(self, loop: MemberLoop, values: FloatArray) -> FloatArray:
        """Return what of the values of all outputs belongs to a loop; shape (…, p)."""
        return values[..., [self._model.outputs.index(tag) for tag in loop.outputs]]
