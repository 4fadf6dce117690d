"""Which files a bag is made of, and whether ``metadata.yaml`` tells the truth of them."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from stiction_ros.errors import InputError
from stiction_ros.records.storage.bag_metadata import VERSION
from stiction_ros.records.storage.packed import SUFFIXES, conversion

METADATA = "metadata.yaml"


def listed_names(directory: Path) -> tuple[str, ...]:
    """Return the names of the files that ``metadata.yaml`` tells of; none where there is none."""
    try:
        names = _information(directory)["relative_file_paths"]
        return tuple(_there(directory, name).name for name in names)
    except (InputError, TypeError, KeyError):
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
    if (path / METADATA).is_file():
        return _listed_files(path, _information(path))
    return found_files(path)


def refuse_foreign(directory: Path) -> None:
    """Raise InputError when a readable ``metadata.yaml`` tells of a bag of another kind."""
    where = directory / METADATA
    if not where.is_file():
        return
    try:
        information = _information(directory)
    except InputError:
        return  # unreadable, so it tells nothing
    if "version" in information and "storage_identifier" in information:
        _refuse_foreign(information, directory)
        if str(information.get("compression_mode") or "").lower() == "file":
            raise InputError(
                "its files are packed",
                where=str(directory),
                fix="unpack them with `zstd -d`, then repair each unpacked file",
            )


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
    information = _information(path)
    listed_files = {file.name for file in _listed_files(path, information)}
    unlisted = {file.name for file in there} - listed_files
    notes = [f"{name} is not in {METADATA}, left out" for name in sorted(unlisted)]
    return notes + _differences(_listed_counts(path, information), counts)


def _differences(listed: Mapping[str, int], counts: Mapping[str, int]) -> list[str]:
    """Return one sentence when ``metadata.yaml`` lists other counts than the files hold."""
    differing = [
        f"{counts.get(topic, 0)} of {listed.get(topic, 0)} on {topic}"
        for topic in sorted(listed.keys() | counts.keys())
        if listed.get(topic, 0) != counts.get(topic, 0)
    ]
    if not differing:
        return []
    more = f" and on {len(differing) - 3} more topics" if len(differing) > 3 else ""
    return [f"the files hold other messages than {METADATA} says: {', '.join(differing[:3])}{more}"]


def _information(path: Path) -> Mapping[str, Any]:
    where = path / METADATA
    try:
        information = yaml.safe_load(where.read_text(encoding="utf-8"))[
            "rosbag2_bagfile_information"
        ]
        return {**information}
    except Exception as error:  # any text may stand there, and YAML's readers raise anything
        raise _unreadable(where, error) from None


def _refuse_foreign(information: Mapping[str, Any], directory: Path) -> None:
    where = directory / METADATA
    try:
        version = int(information["version"])
        storage = str(information["storage_identifier"] or "")
    except (ValueError, TypeError, KeyError) as error:
        raise _unreadable(where, error) from None
    if not storage.strip():  # rosbag2 looks at the files then
        names = listed_names(directory)
        storage = "sqlite3" if any(".db3" in name for name in names) else "mcap"
    mode = str(information.get("compression_mode") or "")
    if version > VERSION:
        raise InputError(f"has version {version}, newer than {VERSION}", where=str(where))
    if storage != "mcap" or mode.lower() == "message":
        raise InputError(
            f"the storage is {storage} {mode}".strip(), where=str(where), fix=conversion(directory)
        )


def _unreadable(where: Path, error: Exception) -> InputError:
    return InputError(
        f"cannot be read ({type(error).__name__})",
        where=str(where),
        fix="make it anew with `stiction repair`",
    )


def _listed_files(path: Path, information: Mapping[str, Any]) -> tuple[Path, ...]:
    where = str(path / METADATA)
    _refuse_foreign(information, path)
    try:
        files = tuple(_there(path, name) for name in information["relative_file_paths"])
    except (TypeError, KeyError) as error:
        raise _unreadable(path / METADATA, error) from None
    for file in files:
        if not file.is_file():
            raise InputError(f"{file.name} is missing", where=str(path), fix="put it back")
    if not files:
        raise InputError("lists no file", where=where)
    return files


def _there(directory: Path, listed: object) -> Path:
    """Return a listed file; one that is there packed, or unpacked, in its place counts as well."""
    file = directory / Path(str(listed)).name
    plain = file.with_suffix("") if file.suffix in SUFFIXES else file
    packed = [plain.with_name(plain.name + end) for end in SUFFIXES]
    return next((one for one in (file, plain, *packed) if one.is_file()), file)


def _listed_counts(path: Path, information: Mapping[str, Any]) -> dict[str, int]:
    """Return messages by topic in ``metadata.yaml``."""
    try:
        return {
            str(entry["topic_metadata"]["name"]): int(entry["message_count"])
            for entry in information["topics_with_message_count"]
        }
    except (ValueError, TypeError, KeyError) as error:
        raise _unreadable(path / METADATA, error) from None
