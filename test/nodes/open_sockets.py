"""What a process has opened to the network, as the kernel tells."""

from __future__ import annotations

from pathlib import Path

LISTEN = "0A"


def listening_of(process: int) -> list[str]:
    """Return the local addresses (hexadecimal) on which a process listens for TCP."""
    owned = set()
    for entry in Path(f"/proc/{process}/fd").iterdir():
        if entry.is_symlink() and (target := str(entry.readlink())).startswith("socket:["):
            owned.add(target[len("socket:[") : -1])
    assert owned, "the process has no sockets at all, so it was looked at too early or too late"
    found = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{process}/net/{table}").read_text().splitlines()[1:]:
            cells = line.split()
            if cells[9] in owned and cells[3] == LISTEN:
                found.append(cells[1])
    return found
