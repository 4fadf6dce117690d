"""Which tags of a control system make up which loop: ``*.tags.yaml``."""

import dataclasses
import enum
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from stiction_ros.errors import InputError
from stiction_ros.loop.yaml_reading import Section, load_yaml

_ADDRESS = re.compile(r"opc\.tcp://(?:\[[\da-fA-F:.]+\]|[^\s/:\[\]]+)(?::([^\s/]*))?(?:/\S*)?")
HIGHEST_PORT = 65_535
WATCHDOG = 5.0  # s without a beat after which the other side is given up


class Use(enum.Enum):
    """What a tag is written for."""

    REQUEST = "request"
    BEAT = "beat"
    OP = "op"


def _said(read: Callable[[Section, str], object], default: object = dataclasses.MISSING) -> Any:
    """Declare a field that stands in the tag map under its own name, and what reads it there."""
    return dataclasses.field(default=default, metadata={"read": read})


def _read(kind: type[Any], section: Section) -> Any:
    """Return a ``kind`` of what a section says; InputError at what is wrong or unknown."""
    found = {
        field.name: field.metadata["read"](section, field.name)
        for field in dataclasses.fields(kind)
        if field.name in section or field.default is dataclasses.MISSING
    }
    section.finish()
    return kind(**found)


def _text(pattern: str, what: str, fix: str) -> Callable[[Section, str], str]:
    """Return a function that reads a text of this form; any other text is no ``what``."""

    def read(section: Section, key: str) -> str:
        text = section.text(key)
        if not re.fullmatch(pattern, text):
            raise InputError(f"{text!r} is no {what}", where=section.at(key), fix=fix)
        return text

    return read


_name = _text(r"[A-Za-z][A-Za-z0-9_]*", "name", "use letters, digits and _")
_node = _text(r"(ns=\d+;|nsu=[^;]+;)?[isgb]=.+", "node id", "write ns=2;s=FIC101.PV")


def _modes(section: Section, key: str) -> tuple[str, ...]:
    modes = section.raw(key)
    if not isinstance(modes, list) or not modes:
        raise InputError("is no list of modes", where=section.at(key), fix="write [RCAS]")
    return tuple(map(str, modes))


@dataclasses.dataclass(frozen=True)
class OutputTags:
    """Tags of one process variable; ``sp`` is empty where it has none."""

    name: str = _said(_name)
    pv: str = _said(_node)
    sp: str = _said(_node, "")


@dataclasses.dataclass(frozen=True)
class ValveTags:
    """Tags of one valve."""

    name: str = _said(_name)  # of the valve
    op_read: str = _said(_node)  # tag of the OP in force, %
    op: str = _said(_node, "")  # tag that a remote OP is written to, %; empty: nothing is written
    mode: str = _said(_node, "")  # tag of the mode of its controller; empty where it is not known
    limits: tuple[float, float] = _said(Section.ends, (0.0, 100.0))  # of what may be written, %
    # largest change of what is written, % per second of the plant's time
    rate: float = _said(lambda section, key: section.number(key, above=0.0), 1.0)
    low: str = _said(_node, "")  # low, high: tags of limits that the plant sets, %; empty for none
    high: str = _said(_node, "")


@dataclasses.dataclass(frozen=True)
class DisturbanceTag:
    """Tag of a measured disturbance; it is told in deviations from ``nominal``."""

    name: str = _said(_name)
    tag: str = _said(_node)
    nominal: float = _said(Section.number, 0.0)


@dataclasses.dataclass(frozen=True)
class GrantTags:
    """The handshake of a loop."""

    request: str = _said(_node)  # tag that says 1 while remote operation is asked for, else 0
    granted: tuple[str, ...] = _said(_modes)  # what the mode of each valve says while it is granted
    heartbeat: str = _said(_node)  # tag that we let rise; the plant takes over when it stands still
    alive: str = _said(_node, "")  # tag that the plant lets rise; empty for none
    # s of standing still after which either side gives the other up
    watchdog: float = _said(lambda section, key: section.number(key, low=0.2, high=600.0), WATCHDOG)


@dataclasses.dataclass(frozen=True)
class LoopTags:
    """Tags of one loop."""

    loop: str  # its name
    namespace: str  # of its topics below that of the node; empty for the node's own
    sample_time: float  # s
    outputs: tuple[OutputTags, ...]  # outputs, valves, disturbances: in the order of the messages
    valves: tuple[ValveTags, ...]
    disturbances: tuple[DisturbanceTag, ...] = ()
    grant: GrantTags | None = None  # how writing is granted; None where nothing may be written
    uncertain: bool = False  # whether values of uncertain quality count

    def read_tags(self) -> tuple[str, ...]:
        """Return the tags that are listened to, each once."""
        found = [tag for output in self.outputs for tag in (output.pv, output.sp)]
        found += [tag for v in self.valves for tag in (v.op_read, v.mode, v.low, v.high)]
        found += [one.tag for one in self.disturbances]
        if self.grant is not None:
            found += [self.grant.heartbeat, self.grant.alive]
        return tuple(dict.fromkeys(tag for tag in found if tag))

    def uses(self) -> Iterator[tuple[str, Use]]:
        """Yield the tags that may be written, each with what for."""
        if self.grant is not None:
            yield self.grant.request, Use.REQUEST
            yield self.grant.heartbeat, Use.BEAT
            yield from ((valve.op, Use.OP) for valve in self.valves)

    @property
    def sample_ns(self) -> int:
        """From one sample to the next, ns."""
        return round(self.sample_time * 1e9)


@dataclasses.dataclass(frozen=True)
class TagMap:
    """The loops of one server."""

    server: str  # its address, ``opc.tcp://HOST:PORT/PATH``; empty when it is given elsewhere
    loops: tuple[LoopTags, ...]  # in the order of the file

    @classmethod
    def load(cls, path: Path | str) -> "TagMap":
        """Read a ``*.tags.yaml``; anything missing, unknown or written by two is an InputError."""
        top = Section(load_yaml(path), str(path))
        server = top.text("server") if "server" in top else ""
        loops = tuple(_loop(section) for section in top.sections("loops"))
        top.finish()
        if not loops:
            raise InputError("has no loops", where=str(path), fix="add one below loops:")
        if server:
            check_address(server, f"{path}: server")
        _once([loop.loop for loop in loops], f"{path}: loops", "loop")
        _once([loop.namespace for loop in loops], f"{path}: loops", "namespace")
        written = [tag for loop in loops for tag, _ in loop.uses()]
        _once(written, f"{path}: loops", "written tag")
        return cls(server, loops)

    def chosen(self, names: Sequence[str], where: str) -> tuple[LoopTags, ...]:
        """Return the loops of these names, each once, or all; an unknown one is an InputError."""
        known = {loop.loop: loop for loop in self.loops}
        for name in names:
            if name not in known:
                fix = f"use {', '.join(known)}"
                raise InputError(f"no loop {name!r} in the tag map", where=where, fix=fix)
        return tuple(known[name] for name in dict.fromkeys(names or known))


def check_address(address: str, where: str) -> None:
    """Raise InputError unless ``address`` is one of OPC UA over TCP without a password in it."""
    if "@" in address:
        raise InputError(
            "holds a user", where=where, fix="name user and password_file as parameters"
        )
    found = _ADDRESS.fullmatch(address)
    if found is None:
        raise InputError("is no address of a server", where=where, fix="write opc.tcp://HOST:PORT")
    port = found[1]
    if port is None:
        return
    if not (port.isascii() and port.isdigit() and 0 < int(port[:9]) <= HIGHEST_PORT):
        raise InputError(f"{port!r} is no port", where=where, fix=f"use 1 to {HIGHEST_PORT}")


def _loop(section: Section) -> LoopTags:
    name = _name(section, "loop")
    namespace = name
    if "namespace" in section:
        namespace = section.values["namespace"] and _name(section, "namespace")
    sample_time = section.number("sample_time", above=0.0)
    outputs = tuple(_read(OutputTags, one) for one in section.sections("outputs"))
    valves = tuple(_read(ValveTags, one) for one in section.sections("valves"))
    upsets = section.sections("disturbances", ())
    disturbances = tuple(_read(DisturbanceTag, one) for one in upsets)
    grant = _read(GrantTags, section.section("write")) if "write" in section else None
    uncertain = section.choice("uncertain", ("bad", "good"), "bad") == "good"
    section.finish()
    if not outputs or not valves:
        raise InputError("needs outputs and valves", where=section.where)
    in_force = {valve.op_read for valve in valves}
    for i, valve in enumerate(valves):
        if valve.op in in_force:
            raise InputError(
                f"op is {valve.op}, which is the op_read of a valve as well",
                where=f"{section.at('valves')}[{i}]",
                fix="name the tag that takes a remote OP",
            )
    _once([one.name for one in outputs], section.at("outputs"), "name")
    _once([one.name for one in valves], section.at("valves"), "name")
    if grant is not None:
        for i, valve in enumerate(valves):
            for key in ("op", "mode"):
                if not getattr(valve, key):
                    raise InputError(
                        f"lacks {key!r}, and the loop has a section write",
                        where=f"{section.at('valves')}[{i}]",
                        fix=f"add {key}: or leave out write:",
                    )
    return LoopTags(name, namespace, sample_time, outputs, valves, disturbances, grant, uncertain)


def _once(names: list[str], where: str, what: str) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{what} {name!r} stands there {count} times", where=where)
