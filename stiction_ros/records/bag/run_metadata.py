"""What a bag says of the run that it holds, in MCAP metadata records named ``stiction_run``.

So it survives splitting, cutting and conversion. While a bag grows each record tells what is new.
"""

import struct
from collections.abc import Iterable, Mapping
from typing import Any

import yaml

RUN = "stiction_run"  # name of the metadata records

_LENGTH = struct.Struct("<I")
_HEAD = 4  # bytes of the CDR encapsulation


def merged(records: Iterable[tuple[str, Mapping[str, str]]]) -> dict[str, str]:
    """Return the records of the run as one, the last text of each key."""
    run: dict[str, str] = {}
    for name, mapping in records:
        if name == RUN:
            run.update(mapping)
    return run


def news(topic: str, type_name: str, data: bytes) -> dict[str, str]:
    """Return what a serialised message tells of the run, a configuration or model, else empty."""
    node, _, name = topic.rpartition("/")
    if type_name != "std_msgs/msg/String" or name not in ("config", "loop_model"):
        return {}
    text = string_of(data)
    if text is None:
        return {}
    if name == "loop_model":
        return {f"loop_model:{topic}": text}
    told = mapping_of(text)
    return {f"config:{node}": text} | {k: str(told[k]) for k in ("seed", "version") if k in told}


def custom_data(run: Mapping[str, str]) -> dict[str, str]:
    """Return the short texts of ``run`` that ``metadata.yaml`` repeats."""
    return {key: text for key, text in run.items() if ":" not in key}


def string_of(data: bytes) -> str | None:
    """Return the text of a serialised ``std_msgs/msg/String``; None when it is none."""
    order = "<I" if len(data) > 1 and data[1] & 1 else ">I"
    try:
        (length,) = struct.unpack_from(order, data, _HEAD)
        raw = data[_HEAD + _LENGTH.size : _HEAD + _LENGTH.size + length]
        return raw.decode().rstrip("\0") if len(raw) == length else None
    except (struct.error, UnicodeDecodeError):
        return None


def mapping_of(text: str) -> dict[str, Any]:
    """Return the mapping that a published YAML text holds; empty when it holds none."""
    try:
        document = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):  # a date such as 2026-13-45, 1000 brackets
        return {}
    return document if isinstance(document, dict) else {}
