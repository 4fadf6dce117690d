"""Which tags of a control system make up which loop: ``*.tags.yaml``."""

import dataclasses
import enum
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.loop.yaml_reading import Section, load_yaml

_NODE = re.compile(r"(ns=\d+;|nsu=[^;]+;)?[isgb]=.+")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
HIGHEST_PORT = 65_535
WATCHDOG = 5.0  # s without a beat after which the other side is given up


class Use(enum.Enum):
    """What a tag is written for."""

    REQUEST = "request"
    BEAT = "beat"
    OP = "op"


@dataclasses.dataclass(frozen=True)
class OutputTags:
    """Tags of one process variable; ``sp`` is empty where it has none."""

    name: str
    pv: str
    sp: str = ""


@dataclasses.dataclass(frozen=True)
class ValveTags:
    """Tags of one valve."""

    name: str  # of the valve
    op_read: str  # tag of the OP in force, %
    op: str = ""  # tag that a remote OP is written to, %; empty where nothing may be written
    mode: str = ""  # tag of the mode of its controller; empty where it is not known
    limits: tuple[float, float] = (0.0, 100.0)  # of what may be written, %
    rate: float = 1.0  # largest change of what is written, % per second of the plant's time
    low: str = ""  # low, high: tags of limits that the plant itself sets, %; empty for none
    high: str = ""


@dataclasses.dataclass(frozen=True)
class DisturbanceTag:
    """Tag of a measured disturbance; it is told in deviations from ``nominal``."""

    name: str
    tag: str
    nominal: float = 0.0


@dataclasses.dataclass(frozen=True)
class GrantTags:
    """The handshake of a loop."""

    request: str  # tag that says 1 while remote operation is asked for, else 0
    granted: tuple[str, ...]  # what the mode of each valve says while it is granted
    heartbeat: str  # tag that we let rise; the plant takes over when it stands still
    alive: str = ""  # tag that the plant lets rise; empty for none
    watchdog: float = WATCHDOG  # s of standing still after which either side gives the other up


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


def check_address(address: str, where: str) -> None:
    """Raise InputError unless ``address`` is one of OPC UA over TCP without a password in it."""
    if not re.fullmatch(r"opc\.tcp://[^\s/]+(/\S*)?", address):
        raise InputError("is no address of a server", where=where, fix="write opc.tcp://HOST:PORT")
    if "@" in address:
        raise InputError(
            "holds a user", where=where, fix="name user and password_file as parameters"
        )
    place = address.removeprefix("opc.tcp://").partition("/")[0]
    host, colon, port = place.rpartition(":")
    if place.endswith("]"):  # of an address of IPv6
        host, colon, port = place, "", ""
    if colon and not (port.isascii() and port.isdigit() and 0 < int(port[:9]) <= HIGHEST_PORT):
        raise InputError(f"{port!r} is no port", where=where, fix=f"use 1 to {HIGHEST_PORT}")
    bare = host if colon else place
    if not bare or (re.search(r"[\[\]:]", bare) and not re.fullmatch(r"\[[0-9a-fA-F:.]+\]", bare)):
        raise InputError("is no address of a server", where=where, fix="write opc.tcp://HOST:PORT")


def _loop(section: Section) -> LoopTags:
    name = _name(section, "loop")
    namespace = name
    if "namespace" in section:
        namespace = section.values["namespace"]
        if namespace and not _NAME.fullmatch(str(namespace)):
            raise InputError(f"{namespace!r} is no name", where=section.at("namespace"))
    sample_time = section.number("sample_time", above=0.0)
    outputs = tuple(_output(one) for one in section.sections("outputs"))
    valves = tuple(_valve(one) for one in section.sections("valves"))
    disturbances = tuple(_disturbance(one) for one in section.sections("disturbances", ()))
    grant = _grant(section.section("write")) if "write" in section else None
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


def _output(section: Section) -> OutputTags:
    found = OutputTags(_name(section, "name"), _node(section, "pv"), _node(section, "sp", ""))
    section.finish()
    return found


def _valve(section: Section) -> ValveTags:
    limits = section.numbers("limits", [0.0, 100.0], count=2)
    if not limits[0] < limits[1]:
        raise InputError("are not rising", where=section.at("limits"), fix="write [low, high]")
    found = ValveTags(
        _name(section, "name"),
        _node(section, "op_read"),
        _node(section, "op", ""),
        _node(section, "mode", ""),
        (float(limits[0]), float(limits[1])),
        section.number("rate", 1.0, above=0.0),
        _node(section, "low", ""),
        _node(section, "high", ""),
    )
    section.finish()
    return found


def _disturbance(section: Section) -> DisturbanceTag:
    found = DisturbanceTag(
        _name(section, "name"), _node(section, "tag"), section.number("nominal", 0.0)
    )
    section.finish()
    return found


def _grant(section: Section) -> GrantTags:
    granted = section.raw("granted")
    if not isinstance(granted, list) or not granted:
        raise InputError("is no list of modes", where=section.at("granted"), fix="write [RCAS]")
    found = GrantTags(
        _node(section, "request"),
        tuple(str(one) for one in granted),
        _node(section, "heartbeat"),
        _node(section, "alive", ""),
        section.number("watchdog", WATCHDOG, low=0.2, high=600.0),
    )
    section.finish()
    return found


def _name(section: Section, key: str) -> str:
    name = section.text(key)
    if not _NAME.fullmatch(name):
        raise InputError(
            f"{name!r} is no name", where=section.at(key), fix="use letters, digits and _"
        )
    return name


def _node(section: Section, key: str, default: str | None = None) -> str:
    """Return a node id such as ``ns=2;s=FIC101.PV`` or ``nsu=urn:plant;s=FIC101.PV``."""
    if default is not None and key not in section:
        return default
    node = section.text(key)
    if not _NODE.fullmatch(node):
        raise InputError(
            f"{node!r} is no node id", where=section.at(key), fix="write ns=2;s=FIC101.PV"
        )
    return node


def _once(names: list[str], where: str, what: str) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{what} {name!r} stands there {count} times", where=where)
