"""What a replay needs of a bag: the signals in their order, the settings, what was published."""

import dataclasses
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from stiction_ros.control import ControlMode
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.online.input.samples import picked
from stiction_ros.records.bag.messages import BagMessage, last_part, read_messages, stamp_ns
from stiction_ros.records.bag.run_metadata import mapping_of
from stiction_ros.records.run import events
from stiction_ros.records.run.bag_runs import tell_runs
from stiction_ros.records.run.loop_signals import JOINT_STATE, LoopSignals
from stiction_ros.records.storage.bag_metadata import BagTopic
from stiction_ros.texts import finite

PARAMETER_EVENT = "rcl_interfaces/msg/ParameterEvent"
_INPUTS = ("pv", "op", "op_applied", "sp", "dv")
DOCUMENTS = ("identification", "look", "finding")
_KIND_BY_PARAMETER = {"confirmations": "estimator", "horizon": "controller"}


@dataclasses.dataclass(frozen=True)
class Signal:
    """One message of a signal, such as ``pv`` or ``op_applied``: stamp in ns, tags, values.

    ``by`` is the full name of the node whose OP it is; empty where that is not told.
    """

    kind: str
    stamp: int
    names: tuple[str, ...]
    values: tuple[float, ...]
    by: str = ""

    def of(self, names: Sequence[str]) -> FloatArray | None:
        """Return the values of ``names``, shape (len(names),); None when one is missing."""
        return picked(self.names, self.values, names)


@dataclasses.dataclass(frozen=True)
class PublishedModel:
    """One message of ``loop_model``, and how many ``op`` came before it in the bag."""

    document: Mapping[str, Any]
    ops_before: int


@dataclasses.dataclass(frozen=True)
class NodeConfig:
    """What a node told on ``~/config``: its name, version, parameters and loop model."""

    node: str
    version: str
    parameters: Mapping[str, Any]
    model: Mapping[str, Any] | None


@dataclasses.dataclass(frozen=True)
class ReplayBag:
    """A bag, ready to be replayed."""

    name: str  # of the bag
    namespace: str  # of the loop's topics
    signals: tuple[Signal, ...]  # in the order of the bag
    estimator: NodeConfig | None  # estimator, controller: configurations, None when there is none
    controller: NodeConfig | None
    # by the end of their windows, ns: what :func:`fit_told` returns of the messages of ``stiction``
    fits: Mapping[int, dict[str, Any]]
    # likewise the statuses in ``/diagnostics``, by the key of their document (:data:`DOCUMENTS`)
    told: Mapping[str, Mapping[int, dict[str, Any]]]
    models: Mapping[str, PublishedModel]  # messages of ``loop_model`` by ``valid_from``, as text
    modes: tuple[events.ModeChange, ...]  # changes of mode in ``/diagnostics``, with the first mode
    # a stamp in ns and how many samples the estimator had taken in up to it; None when the bag does
    # not tell
    counted: tuple[int, int] | None
    notes: tuple[str, ...]  # what was left out or stands in the way, one sentence each

    def stamps(self, kind: str) -> list[int]:
        """Return the stamps of one signal in ascending order, each once, ns."""
        return sorted({signal.stamp for signal in self.signals if signal.kind == kind})


def read_replay_bag(path: str | Path, *, namespace: str | None = None) -> ReplayBag:
    """Read what a replay needs from a bag, in one pass.

    The ``namespace`` of the loop is needed when the bag holds several. A damaged bag, or one
    without ``pv`` and ``op``, is refused.
    """
    notes: list[str] = []
    messages = list(read_messages(path, wanted=_wanted, notes=notes))
    space = _loop(messages, namespace, str(path))
    inside = events.of_loop(messages, space)
    configs = _configs(inside, space, notes)
    notes += _changed_parameters(messages, configs.values())
    signals = tuple(_signals(inside))
    stamps = [signal.stamp for signal in signals if signal.kind == "pv"]
    runs = tell_runs(stamps, range(len(stamps))).runs
    if len(runs) > 1:
        notes.append(f"holds {len(runs)} runs, a replay needs one run from its first sample")
    return ReplayBag(
        name=Path(path).name,
        namespace=space,
        signals=signals,
        estimator=configs.get("estimator"),
        controller=configs.get("controller"),
        fits=dict(_fits(inside)),
        told={
            key: {end: read_status(keys) for end, keys, _ in events.documents(inside, key)}
            for key in DOCUMENTS
        },
        models=dict(_models(inside)),
        modes=events.mode_changes(inside),
        counted=_counted(inside, configs.get("estimator")),
        notes=tuple(notes),
    )


def _wanted(topic: BagTopic) -> bool:
    name = last_part(topic.name)[1]
    signal = topic.type == JOINT_STATE and name in _INPUTS
    return signal or events.tells_of_run(topic) or topic.type == PARAMETER_EVENT


def _loop(messages: Iterable[BagMessage], namespace: str | None, where: str) -> str:
    """Return the namespace of the loop to replay."""
    signals = LoopSignals(where)
    for number, message in enumerate(messages):
        if message.type == JOINT_STATE and last_part(message.topic)[1] in _INPUTS:
            signals.add(message, number)
    space = signals.loop(namespace)
    if signals.op(space) != "op":
        raise InputError(
            "was recorded while only listening (op_applied, no op): no controller's OP to replay",
            where=where,
            fix="identify, report, convert and gap take it",
        )
    return space


def _signals(messages: Iterable[BagMessage]) -> Iterator[Signal]:
    for message in messages:
        kind = last_part(message.topic)[1]
        if message.type == JOINT_STATE and kind in _INPUTS:
            state = message.message
            values = tuple(float(value) for value in state.position)
            names, by = tuple(map(str, state.name)), str(state.header.frame_id)
            yield Signal(kind, stamp_ns(state), names, values, by)


def _fits(messages: Iterable[BagMessage]) -> Iterator[tuple[int, dict[str, Any]]]:
    for message in events.on_topic(messages, JOINT_STATE, "stiction"):
        state = message.message
        if state.header.frame_id == ControlMode.VALVE_TEST:
            continue  # no fit
        columns = (state.name, state.position, state.velocity, state.effort)
        rows = {str(name): [float(v) for v in row] for name, *row in zip(*columns, strict=False)}
        yield stamp_ns(state), fit_told(rows, str(state.header.frame_id))


def fit_told(rows: Mapping[str, Sequence[float]], token: str) -> dict[str, Any]:
    """Return what ``stiction`` tells of a fit, as a document.

    It holds value, lower and upper end by ``V1.f_s``, none for an unusable window, and ``token``,
    which is ``valid_from`` of the loop model in force.
    """
    ends = ("value", "lower end", "upper end")
    shown = {name: finite(dict(zip(ends, row, strict=True))) for name, row in rows.items()}
    return {"names": ", ".join(shown), "stiction": shown, "model in force": token}


def read_status(keys: Mapping[str, str]) -> dict[str, Any]:
    """Return the keys and values of a status with its documents read, but for their wall time."""
    read: dict[str, Any] = dict(keys)
    for key in DOCUMENTS:
        if key in read:
            read[key] = json.loads(read[key])
            read[key].pop("seconds", None)  # another each time
    return read


def _models(messages: Iterable[BagMessage]) -> Iterator[tuple[str, PublishedModel]]:
    ops: set[int] = set()  # stamps: a sample that was shown again was answered again
    for message in messages:
        name = last_part(message.topic)[1]
        if message.type == JOINT_STATE and name == "op":
            ops.add(stamp_ns(message.message))
        elif message.type == events.STRING and name == "loop_model":
            document = mapping_of(str(message.message.data))
            yield str(document.get("valid_from", 0)), PublishedModel(document, len(ops))


def _configs(messages: Iterable[BagMessage], space: str, notes: list[str]) -> dict[str, NodeConfig]:
    """Return the configurations of estimator and controller, told apart by their parameters."""
    found: dict[str, NodeConfig] = {}
    for message in events.on_topic(messages, events.STRING, "config"):
        document = mapping_of(str(message.message.data))
        parameters, model = document.get("parameters"), document.get("model")
        if not isinstance(parameters, dict):
            continue
        kind = next((k for key, k in _KIND_BY_PARAMETER.items() if key in parameters), None)
        if kind is None:
            continue
        config = NodeConfig(
            str(document.get("node", f"{space}/{kind}")),
            str(document.get("version", "")),
            parameters,
            model if isinstance(model, dict) else None,
        )
        if kind in found and found[kind] != config:
            notes.append(f"{config.node} was started more than once, the first start is replayed")
            continue
        found.setdefault(kind, config)
    return found


def _changed_parameters(messages: Iterable[BagMessage], configs: Iterable[NodeConfig]) -> list[str]:
    """Return a note per node whose parameters were changed while it ran."""
    nodes = {config.node for config in configs}
    changed: dict[str, dict[str, None]] = {}
    for message in messages:
        if message.type == PARAMETER_EVENT and message.message.node in nodes:
            names = [str(parameter.name) for parameter in message.message.changed_parameters]
            changed.setdefault(message.message.node, {}).update(dict.fromkeys(names))
    return [
        f"{node}: {', '.join(names)} changed while it ran; the values at its start are replayed"
        for node, names in changed.items()
        if names
    ]


def _counted(
    messages: Iterable[BagMessage], estimator: NodeConfig | None
) -> tuple[int, int] | None:
    """Return a stamp and the estimator's count of samples at it."""
    name = "estimator" if estimator is None else estimator.node.strip("/")
    for message in events.on_topic(messages, events.DIAGNOSTICS, "diagnostics"):
        for status in message.message.status:
            if status.name != f"{name}: status":
                continue
            count = {item.key: item.value for item in status.values}.get("sample", "")
            if count.isdecimal() and int(count) > 0:
                return stamp_ns(message.message), int(count)
    return None
