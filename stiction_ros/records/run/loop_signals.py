"""Collects the signals of the loops in a bag, and skips messages that nobody can use."""

import math
from collections import Counter
from typing import NamedTuple

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import BagMessage, last_part, stamp_ns
from stiction_ros.records.storage.bag_metadata import BagTopic

JOINT_STATE = "sensor_msgs/msg/JointState"
SIGNALS = ("pv", "sp", "op", "op_applied", "stem")


class Given(NamedTuple):
    """One usable message of a signal."""

    number: int  # its place in the log
    stamp: int  # ns
    values: tuple[float, ...]  # of the tags that were asked for


def is_signal(topic: BagTopic) -> bool:
    """Tell whether a topic is one of the loop's signals."""
    return topic.type == JOINT_STATE and last_part(topic.name)[1] in SIGNALS


class LoopSignals:
    """The signals of every loop in the bag ``where``, in the order of the log."""

    def __init__(self, where: str) -> None:
        self.where = where
        # number, stamp and value by tag of each usable message, by namespace and signal
        self._usable: dict[tuple[str, str], list[tuple[int, int, dict[str, float]]]] = {}
        self._bad: dict[tuple[str, str], Counter[str]] = {}

    def add(self, message: BagMessage, number: int) -> None:
        """Take one message of a topic that :func:`is_signal`; what is wrong with it is counted."""
        key = last_part(message.topic)
        try:
            names, values = message.message.name, message.message.position
            stamp, wrong = stamp_ns(message.message), _wrong(names, values)
        except (AttributeError, TypeError):
            raise InputError(
                f"the definition of {message.topic} is not that of {message.type}",
                where=self.where,
                fix="record it again with the one that ROS has",
            ) from None
        usable = self._usable.setdefault(key, [])
        if wrong:
            self._bad.setdefault(key, Counter())[wrong] += 1
        else:
            usable.append((number, stamp, dict(zip(map(str, names), values, strict=True))))

    def tags(self, space: str, signal: str) -> tuple[str, ...]:
        """Return the tags that most messages of a signal bear; empty without a usable one."""
        found = Counter(tuple(values) for *_, values in self._usable.get((space, signal), ()))
        return found.most_common(1)[0][0] if found else ()

    def given(self, space: str, signal: str, tags: tuple[str, ...]) -> list[Given]:
        """Return the messages of a signal that have a value for each of ``tags``."""
        return [
            Given(number, stamp, tuple(values[tag] for tag in tags))
            for number, stamp, values in self._usable.get((space, signal), ())
            if values.keys() >= set(tags)
        ]

    def skipped(self, space: str, signal: str, tags: tuple[str, ...]) -> str:
        """Return a sentence on the messages of a signal that are left out; empty for none."""
        key = (space, signal)
        wrong = Counter(self._bad.get(key, Counter()))
        lacking = len(self._usable.get(key, ())) - len(self.given(space, signal, tags))
        if lacking:
            wrong["without a value for every tag"] = lacking
        if not wrong:
            return ""
        count = sum(wrong.values())
        reasons = ", ".join(f"{number} {what}" for what, number in sorted(wrong.items()))
        return f"{count} bad message{'s' * (count > 1)} of {signal} left out: {reasons}"

    @property
    def loops(self) -> tuple[str, ...]:
        """Namespaces that have ``pv`` and an OP, such as ``/unit1``, empty for ``/``."""
        spaces = dict.fromkeys(space for space, _ in self._usable)
        ops = {s for s in spaces for op in ("op", "op_applied") if (s, op) in self._usable}
        return tuple(s for s in spaces if s in ops and (s, "pv") in self._usable)

    def op(self, space: str) -> str:
        """Return the signal whose tags are the valves: ``op``, else ``op_applied``."""
        return "op" if (space, "op") in self._usable else "op_applied"

    def loop(self, namespace: str | None) -> str:
        """Return the namespace of the loop that is meant; InputError for none or an open choice.

        Where none is chosen a loop with an ``op`` comes before those that were only listened to.
        """
        loops = list(self.loops)
        if namespace is not None:
            wanted = "/" + namespace.strip("/") if namespace.strip("/") else ""
            loops = [space for space in loops if space == wanted]
        else:
            loops = [space for space in loops if (space, "op") in self._usable] or loops
        if not loops:
            raise self._no_loop(namespace)
        if len(loops) > 1:
            raise InputError(
                f"holds {len(loops)} loops ({', '.join(space or '/' for space in sorted(loops))})",
                where=self.where,
                fix="choose one with --namespace",
            )
        return loops[0]

    def _no_loop(self, namespace: str | None) -> InputError:
        loops = sorted(space or "/" for space in self.loops)
        if namespace is not None and loops:
            return InputError(
                f"holds no loop in the namespace {namespace}",
                where=self.where,
                fix=f"its loops are {', '.join(loops)}",
            )
        there = ", ".join(f"{space}/{signal}" for space, signal in self._usable)
        return InputError(
            f"holds no pv with op (or op_applied) of {JOINT_STATE} in one namespace",
            where=self.where,
            fix=f"record pv and op of a loop{f', not only {there}' if there else ''}",
        )


def _wrong(names: list[str], values: list[float]) -> str:
    """Return what is wrong with a message; empty when nothing is."""
    if not len(names) and not len(values):
        return "empty"
    if len(names) != len(values):
        return "with another number of positions than names"
    if len(set(names)) != len(names):
        return "that name a tag twice"
    return "" if all(map(math.isfinite, values)) else "not finite"
