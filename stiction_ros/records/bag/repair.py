"""Makes a bag whole again whose writer was killed, or whose files are damaged."""

import dataclasses
import enum
import shlex
import shutil
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.records.bag import finish
from stiction_ros.records.storage.bag_metadata import BagFile, joined
from stiction_ros.records.storage.files import METADATA, found_files, listing_notes, refuse_foreign
from stiction_ros.records.storage.mcap_scan import McapScan
from stiction_ros.records.storage.packed import SUFFIXES


class RepairStatus(enum.StrEnum):
    """What there was to do."""

    WHOLE = "whole"
    FINISHED = "finished"
    SALVAGED = "salvaged"


@dataclasses.dataclass(frozen=True)
class Repair:
    """What a repair found and did."""

    # ``whole``: nothing was wrong; ``finished``: files that their writer had not closed were
    # finished, or ``metadata.yaml`` was made anew; ``salvaged``: damaged records were left out
    status: RepairStatus
    files: tuple[str, ...]  # names of the storage files, in order
    messages: dict[str, int]  # messages by topic in the bag as it is now
    notes: tuple[str, ...]  # what was wrong, one sentence each


def repair_bag(path: str | Path) -> Repair:
    """Repair a bag, a rosbag2 directory or one ``.mcap`` file, in its place.

    A file that was damaged is kept beside the new one, as ``….mcap.damaged``. What the bag
    says of its run is kept. A whole bag is left as it is.

    Raises:
        InputError: no such bag, one of another kind, or a file that is no MCAP file at all.
        OSError: the storage refuses.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("no such bag", where=str(path), fix="check the path")
    if path.is_dir():
        refuse_foreign(path)
    elif path.suffix in SUFFIXES:
        fix = f"unpack it with `zstd -d {shlex.quote(str(path))}` and repair what comes of it"
        raise InputError("is packed", where=str(path), fix=fix)
    files = found_files(path) if path.is_dir() else (path,)
    contents = [_look(file) for file in files]
    scans = [content.scan for content in contents]
    notes = [note for scan in scans for note in scan.notes]
    ill = [scan.damaged or not scan.finished for scan in scans]
    caps = finish.log_time_caps(files) if any(ill) else [None] * len(files)
    for number, file in enumerate(files):
        if scans[number].damaged:
            shutil.copy2(file, file.with_suffix(".mcap.damaged"))
        if ill[number]:
            contents[number] = finish.rewrite(file, cap=caps[number], salvage=True)
    listing = _listing_faults(path, contents)
    if path.is_dir() and (any(ill) or listing):
        finish.write_listing(path, contents)
    status = RepairStatus.FINISHED if any(ill) or listing else RepairStatus.WHOLE
    if any(scan.damaged for scan in scans):
        status = RepairStatus.SALVAGED
    whole = joined([content.file for content in contents])
    names = tuple(file.name for file in files)
    return Repair(status, names, dict(whole.counts), (*notes, *listing))


def _look(path: Path) -> finish.FileContent:
    """Return what a file holds, damaged or not."""
    scan = McapScan(path, salvage=True)
    first: int | None = None
    last: int | None = None
    for message in scan.messages():
        time = message.log_time
        first = time if first is None else min(first, time)
        last = time if last is None else max(last, time)
    return finish.FileContent(BagFile(path.name, scan.counts, first, last), scan)


def _listing_faults(path: Path, contents: list[finish.FileContent]) -> list[str]:
    """Return what is wrong with ``metadata.yaml``; nothing for a single file."""
    if not path.is_dir():
        return []
    if not (path / METADATA).is_file():
        return [f"{METADATA} is missing"]
    try:
        return listing_notes(path, joined([content.file for content in contents]).counts)
    except InputError as error:
        return [str(error)]
