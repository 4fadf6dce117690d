"""What a process has opened to the network, as the kernel tells."""

from pathlib import Path

LISTEN = "0A"


def family_of(process: int) -> list[int]:
    """Return a process and all that it has started, directly or not, in other sessions too."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            told = entry.read_text()
        except OSError:  # it has ended meanwhile
            continue
        parents[int(entry.parent.name)] = int(told.rpartition(")")[2].split()[1])
    found = [process]
    for one in found:
        found += [child for child, parent in parents.items() if parent == one]
    return found


def environment_of(process: int) -> dict[str, str]:
    """Return the environment that a process was started with."""
    text = Path(f"/proc/{process}/environ").read_bytes().decode(errors="replace")
    return dict(entry.partition("=")[::2] for entry in text.split("\0") if entry)


def command_of(process: int) -> str:
    """Return the command line of a process."""
    return Path(f"/proc/{process}/cmdline").read_bytes().decode().replace("\0", " ").strip()


def listening_of(process: int, *, may_have_none: bool = False) -> list[str]:
    """Return the local addresses (hexadecimal) on which a process listens for TCP.

    Unless it ``may_have_none`` it must have some socket: else it was looked at too early or late.
    """
    owned = set()
    for entry in Path(f"/proc/{process}/fd").iterdir():
        if entry.is_symlink() and (target := str(entry.readlink())).startswith("socket:["):
            owned.add(target[len("socket:[") : -1])
    assert owned or may_have_none, "no sockets at all: looked at too early or too late"
    found = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{process}/net/{table}").read_text().splitlines()[1:]:
            cells = line.split()
            if cells[9] in owned and cells[3] == LISTEN:
                found.append(cells[1])
    return found
