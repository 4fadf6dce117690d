"""Settings that every node has."""

from __future__ import annotations

import dataclasses

from stiction_ros.settings import setting


@dataclasses.dataclass(frozen=True)
class NodeSettings:
    """Start-up of a node."""

    autostart: bool = setting(True, "configure and activate without being told", fixed=True)
    wait_for: tuple[str, ...] = setting(
        (), "nodes that must have matched before this one begins", fixed=True
    )
