"""Which files a bag is made of, and whether ``metadata.yaml`` tells the truth of them."""

import re
from collections.abc import Mapping
from pathlib import Path

import yaml

from stiction_ros.errors import InputError
from stiction_ros.records.storage.bag_metadata import VERSION
from stiction_ros.records.storage.packed import SUFFIXES, conversion

METADATA = "metadata.yaml"


class Listing:
    """What ``metadata.yaml`` of a bag tells; what cannot be read of it is an InputError.

    Attributes:
        files: its files; one that is there packed, or unpacked, in its place counts as well.
        counts: messages by topic.
        compression_mode: ``FILE``, ``MESSAGE`` or empty, in whatever letters.
    """

    def __init__(self, directory: Path) -> None:
        self.directory, self.where = directory, directory / METADATA
        try:
            document = yaml.safe_load(self.where.read_text(encoding="utf-8"))
            told = {**document["rosbag2_bagfile_information"]}
            self._version = int(told["version"])
            self._storage = str(told["storage_identifier"] or "")
            self.files = tuple(_there(directory, name) for name in told["relative_file_paths"])
            topics = told["topics_with_message_count"]
            self.counts = {
                str(entry["topic_metadata"]["name"]): int(entry["message_count"])
                for entry in topics
            }
            self.compression_mode = str(told.get("compression_mode") or "")
        except Exception as error:  # any text may stand there, and YAML's readers raise anything
            raise InputError(
                f"cannot be read ({type(error).__name__})",
                where=str(self.where),
                fix="make it anew with `stiction repair`",
            ) from None

    def refuse_foreign(self) -> None:
        """Raise where the bag is of another kind."""
        storage = self._storage
        if not storage.strip():  # rosbag2 looks at the files then
            storage = "sqlite3" if any(".db3" in file.name for file in self.files) else "mcap"
        if self._version > VERSION:
            said = f"has version {self._version}, newer than {VERSION}"
            raise InputError(said, where=str(self.where))
        if storage != "mcap" or self.compression_mode.lower() == "message":
            raise InputError(
                f"the storage is {storage} {self.compression_mode}".strip(),
                where=str(self.where),
                fix=conversion(self.directory),
            )


def _there(directory: Path, listed: object) -> Path:
    file = directory / Path(str(listed)).name
    plain = file.with_suffix("") if file.suffix in SUFFIXES else file
    packed = [plain.with_name(plain.name + end) for end in SUFFIXES]
    return next((one for one in (file, plain, *packed) if one.is_file()), file)


def listed_names(directory: Path) -> tuple[str, ...]:
    """Return the names of the files that ``metadata.yaml`` tells of; none where there is none."""
    try:
        return tuple(file.name for file in Listing(directory).files)
    except InputError:
        return ()


def split_number(path: Path) -> int:
    """Return the split number: ``bag_10.mcap`` comes after ``bag_9.mcap``; -1 without one."""
    found = re.search(r"_(\d+)$", path.stem)
    return int(found[1]) if found else -1


def storage_files(path: str | Path) -> tuple[Path, ...]:
    """Return the MCAP files of a bag, a directory or one file, in their order.

    Raises:
        InputError: no such bag, a file of it missing, another storage, a newer version.
    """
    path = Path(path)
    if path.is_file():
        return (path,)
    if not path.is_dir():
        raise InputError("no such bag", where=str(path), fix="check the path")
    if not (path / METADATA).is_file():
        return found_files(path)
    listing = Listing(path)
    listing.refuse_foreign()
    for file in listing.files:
        if not file.is_file():
            raise InputError(f"{file.name} is missing", where=str(path), fix="put it back")
    return listing.files


def found_files(directory: Path) -> tuple[Path, ...]:
    """Return the MCAP files in a directory, at least one, by the number that ends their names."""
    files = sorted(directory.glob("*.mcap"), key=lambda file: (split_number(file), file.name))
    if not files:
        raise InputError(
            "holds no .mcap file", where=str(directory), fix="give a rosbag2 directory"
        )
    return tuple(files)


def listing_notes(path: str | Path, counts: Mapping[str, int]) -> list[str]:
    """Return what differs between a bag and what it says of itself, one sentence each.

    These are numbers of messages by topic other than the ``counts`` that were read, files that are
    not listed, and missing numbers of splits. Nothing is compared for a single file.
    """
    path = Path(path)
    if not path.is_dir():
        return []
    there = sorted(path.glob("*.mcap"))
    if not (path / METADATA).is_file():
        numbers = [split_number(file) for file in there]
        missing = sorted(set(range(max(numbers) + 1)) - set(numbers)) if min(numbers) >= 0 else []
        return [f"the file with number {number} is missing" for number in missing]
    listed = Listing(path).counts
    unlisted = {file.name for file in there} - {file.name for file in storage_files(path)}
    notes = [f"{name} is not in {METADATA}, left out" for name in sorted(unlisted)]
    differing = [
        f"{counts.get(topic, 0)} of {listed.get(topic, 0)} on {topic}"
        for topic in sorted(listed.keys() | counts.keys())
        if listed.get(topic, 0) != counts.get(topic, 0)
    ]
    if differing:
        more = f" and on {len(differing) - 3} more topics" if len(differing) > 3 else ""
        said = f"the files hold other messages than {METADATA} says"
        notes.append(f"{said}: {', '.join(differing[:3])}{more}")
    return notes
