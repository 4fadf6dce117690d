"""Makes a bag whole again whose writer was killed, or whose files are damaged."""

import dataclasses
import enum
import shlex
import shutil
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.records.bag import finish
from stiction_ros.records.storage.files import METADATA, Listing, found_files, listing_notes
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
        _refuse_foreign(path)
    elif path.suffix in SUFFIXES:
        fix = f"unpack it with `zstd -d {shlex.quote(str(path))}` and repair what comes of it"
        raise InputError("is packed", where=str(path), fix=fix)
    files = found_files(path) if path.is_dir() else (path,)
    scans = [McapScan(file, salvage=True).read() for file in files]
    notes = [note for scan in scans for note in scan.notes]
    damaged = any(scan.damaged for scan in scans)
    ill = [number for number, scan in enumerate(scans) if scan.damaged or not scan.finished]
    caps = finish.log_time_caps(files) if ill else []
    for number in ill:
        file = files[number]
        if scans[number].damaged:
            shutil.copy2(file, file.with_suffix(".mcap.damaged"))
        scans[number] = finish.rewrite(McapScan(file, salvage=True, cap=caps[number]))
    counts: Counter[str] = Counter()
    for scan in scans:
        counts.update(scan.counts)
    listing = _listing_faults(path, counts)
    if path.is_dir() and (ill or listing):
        finish.write_listing(path, scans)
    status = RepairStatus.FINISHED if ill or listing else RepairStatus.WHOLE
    if damaged:
        status = RepairStatus.SALVAGED
    return Repair(status, tuple(file.name for file in files), dict(counts), (*notes, *listing))


def _refuse_foreign(directory: Path) -> None:
    """Raise InputError when a readable ``metadata.yaml`` tells of a bag of another kind."""
    try:
        listing = Listing(directory)
    except InputError:
        return  # it tells nothing
    listing.refuse_foreign()
    if listing.compression_mode.lower() == "file":
        fix = "unpack them with `zstd -d`, then repair each unpacked file"
        raise InputError("its files are packed", where=str(directory), fix=fix)


def _listing_faults(path: Path, counts: Mapping[str, int]) -> list[str]:
    """Return what is wrong with ``metadata.yaml``; nothing for a single file."""
    if path.is_dir() and not (path / METADATA).is_file():
        return [f"{METADATA} is missing"]
    try:
        return listing_notes(path, counts)
    except InputError as error:
        return [str(error)]
