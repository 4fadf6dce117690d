"""From paths to loops."""

import dataclasses
import itertools
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from stiction_ros.errors import InputError, foreign
from stiction_ros.intake.assembly import Found, loop_of, unread
from stiction_ros.intake.intake_options import CsvColumns, IntakeOptions
from stiction_ros.intake.loop import Loop, signals_of_records
from stiction_ros.intake.sheets.sheet import SUFFIXES, stem
from stiction_ros.intake.sheets.typed import open_sheets
from stiction_ros.intake.tables.block import Block
from stiction_ros.intake.tables.plan import Plan, plan_of
from stiction_ros.intake.tables.reading import blocks_of
from stiction_ros.intake.tables.tags import TagList, read_tag_list
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record
from stiction_ros.records.run.loop_runs import read_bag_loops, read_bag_parts
from stiction_ros.records.storage.files import listed_names, split_number

BARE = (".mcap", ".db3")  # ends of the names of files that are bags by themselves
OTHERS = 8  # names that an error or a remark lists
__all__ = ["CsvColumns", "is_bag", "read"]

NO_RECORD = (
    "give a Record: Record.from_arrays(time, op, pv), Record.from_dataframe(frame, op, pv), or "
    "the path of a file"
)
"""What helps where something else than a record was given."""


def loops(paths: Sequence[Path], options: IntakeOptions) -> Iterator[Loop]:
    """Yield the loops that files and folders hold, read one after the other.

    A loop that cannot be read comes with its ``problem`` and stops no other. Signals of one
    loop may stand in several files, which are then read together. No name comes twice: a
    later loop of one name gets its folder's as well.

    Args:
        paths: files and folders, folders by the names in them; files of one loop come first, in
            their order, then those of several.
        options: how to read them.

    Raises:
        InputError: the tag list cannot be read, or names a file that may be one of several.
    """
    tags = read_tag_list(options.tags)
    files: Iterable[Path] = _files(paths, options)
    if tags.rows:
        files = list(files)
        tags.refuse_ambiguous(files)
    yield from _with_names_of_their_own(_loops(files, options, tags))


def _loops(files: Iterable[Path], options: IntakeOptions, tags: TagList) -> Iterator[Loop]:
    tables: list[Plan] = []
    for file in files:
        told = Path(str(file).encode(errors="backslashreplace").decode())
        if told != file:  # no page and no list could hold it
            said = f"{told}: its name is not in UTF-8; rename it"
            yield Loop(stem(told), (told,), (), problem=said)
            continue
        if is_bag(file):
            yield from _bags(file, options)
            continue
        try:
            if os.path.exists(file) and not (os.path.isfile(file) or os.path.isdir(file)):
                raise InputError("is a pipe or a device", where=str(file), fix="save it as a file")
            way = tags.way_of(file, options)
            with foreign(file):
                sheets = open_sheets(file)
        except InputError as error:
            yield Loop(stem(file), (file,), (), problem=str(error))
            continue
        for sheet in sheets:
            try:
                with foreign(file):
                    plan = plan_of(sheet, way)
            except InputError as error:
                yield Loop(sheet.name, (file,), (), problem=str(error))
                continue
            if plan.single:
                yield from _read([plan])
            else:
                tables.append(plan)
    long = [table for table in tables if table.long is not None]
    wide = [table for table in tables if table.long is None]
    for group in (long, *_groups(wide)):
        yield from _read(group)


def strange_files(paths: Sequence[Path], options: IntakeOptions) -> list[str]:
    """Return the files that the tag list names and that are none of those below ``paths``."""
    return read_tag_list(options.tags).strange(list(_files(paths, options)))


def one_loop(path: Path, options: IntakeOptions, name: str | None = None) -> Loop:
    """Return the one loop of a file, a bag or a folder of files, or the one of that ``name``.

    Raises:
        InputError: the loop cannot be read, there is none, or there are several.
    """
    found, names = [], []
    for loop in _bags(path, options) if is_bag(path) else loops([path], options):
        names.append(loop.name)
        if name is None or loop.name.casefold() == name.casefold():
            found.append(loop)
        if name is None and len(found) > OTHERS:
            break
    if not names:
        raise InputError("holds no file of a loop", where=str(path), fix="check the path")
    if len(found) != 1:
        if name is None and is_bag(path):
            read_bag_parts(path)  # tells how to choose one
        listed = ", ".join(names[:OTHERS]) + (" and others" if len(names) > OTHERS else "")
        what = "holds several loops" if name is None else f"has no loop {name}"
        raise InputError(f"{what}: {listed}", where=str(path), fix="choose one with --loop NAME")
    if found[0].problem is not None:
        raise InputError(found[0].problem)
    return found[0]


def is_bag(path: str | Path) -> bool:
    """Tell whether ``path`` is a bag: a ``.mcap`` or ``.db3`` file, packed or not, or a folder.

    A folder is a bag where its ``metadata.yaml`` names its files, or where it holds no other file
    of a loop than the ``.mcap`` of one bag: a single one, or ``x_0.mcap``, ``x_1.mcap``, ….
    """
    path = Path(path)
    try:
        if not path.is_dir():
            return path.name.lower().removesuffix(".zst").removesuffix(".zstd").endswith(BARE)
        if listed_names(path):
            return True
        inside = list(filter(_may_hold_loops, path.iterdir()))
    except OSError:
        return False
    numbers = [split_number(file) for file in inside]
    bases = {file.stem.rpartition("_")[0] for file in inside}
    one = len(inside) == 1 or (len(bases) == 1 and min(numbers) == 0)
    return one and all(f.suffix == ".mcap" and os.path.isfile(f) for f in inside)


_Signals = tuple[Plan, Block]  # signals of a loop, and the table that they stand in


def _files(paths: Sequence[Path], options: IntakeOptions) -> Iterator[Path]:
    """Yield the files of loops; folders give those with a known suffix, the tag list none."""
    seen = set() if options.tags is None else {os.path.realpath(options.tags)}
    waiting = list(reversed(paths))
    while waiting:
        path = waiting.pop()
        real = os.path.realpath(path)
        if real in seen:
            continue
        seen.add(real)
        if not os.path.isdir(path):
            yield path
            continue
        try:
            inside = sorted(path.iterdir(), key=lambda file: (file.is_symlink(), file.name))
        except OSError:
            yield path  # whoever opens it tells why it cannot be read
            continue
        if is_bag(path):
            names = listed_names(path) or [file.name for file in inside if file.suffix == ".mcap"]
            parts = {os.path.realpath(path / name) for name in names}
            if not parts <= seen:
                yield path
            seen |= parts
        waiting += filter(_may_hold_loops, reversed(inside))


def _may_hold_loops(path: Path) -> bool:
    known = path.suffix.lower() in SUFFIXES or os.path.isdir(path)
    return known and not path.name.startswith((".", "~$"))


def _bags(path: Path, options: IntakeOptions) -> Iterator[Loop]:
    """Yield the loops of a bag: all, or the one of the namespace that was chosen."""
    found: Mapping[str, tuple[Record, ...] | InputError]
    try:
        with foreign(path):
            if options.namespace is None:
                found = read_bag_loops(path)
            else:
                found = {"": read_bag_parts(path, namespace=options.namespace)}
    except InputError as error:
        found = {"": error}
    for space, read in found.items():
        name = stem(path) + (space if len(found) > 1 else "")
        if isinstance(read, InputError):
            yield Loop(name, (path,), (), problem=str(read))
            continue
        notes = tuple(dict.fromkeys(note for part in read for note in part.notes))
        yield Loop(name, (path,), read, notes, signals=signals_of_records(read))


def _with_names_of_their_own(found: Iterator[Loop]) -> Iterator[Loop]:
    """Yield loops; a name that was there already gets its folder, and if need be a number."""
    seen: set[str] = set()
    for loop in found:
        folder = loop.files[0].parent.name
        others = (f"{loop.name} ({folder} {number})" for number in itertools.count(2))
        names = itertools.chain([loop.name, f"{loop.name} ({folder})"], others)
        name = next(name for name in names if name not in seen)
        seen.add(name)
        yield loop if name == loop.name else dataclasses.replace(loop, name=name)


def _groups(tables: Sequence[Plan]) -> list[list[Plan]]:
    """Return tables that have loops in common together, in the order of the first of each."""
    groups: dict[int, list[Plan]] = {}
    owner: dict[str, int] = {}
    for place, table in enumerate(tables):
        first, *others = sorted({owner.get(name, place) for name in table.loops})
        joining = [*itertools.chain(*(groups.pop(other, []) for other in others)), table]
        groups.setdefault(first, []).extend(joining)
        owner.update((name, first) for member in joining for name in member.loops)
    return list(groups.values())


def _read(group: Sequence[Plan]) -> Iterator[Loop]:
    """Yield the loops of tables that belong together."""
    found: dict[str, list[_Signals]] = {}
    for table in group:
        path = table.sheet.path
        try:
            with foreign(path):
                read = blocks_of(table)
                if not read and table.long is not None:
                    raise InputError(
                        "has no tag such as FIC101.PV or FIC101/OP in column "
                        f"{table.sheet.layout.given[table.long.tag]}",
                        fix="say which belong together with --tags F, or name the columns with "
                        "--long TAG,TIME,VALUE",
                    )
        except InputError as error:
            for name in table.loops or [table.sheet.name]:
                yield Loop(name, (path,), (), problem=str(error))
            continue
        for name, blocks in read.items():
            found.setdefault(name, []).extend((table, block) for block in blocks)
    for name in list(found):
        yield _loop(name, found.pop(name))


def _loop(name: str, read: Sequence[_Signals]) -> Loop:
    """Return a loop of tables, with its problem where it cannot be made into records."""
    tables, blocks = zip(*read, strict=True)
    single, named = tables[0].single, all(table.named for table in tables)
    found = Found(name, blocks[0].path.name if single else name, blocks, named, not single)
    try:
        with foreign(found.files[0]):
            return loop_of(found, _options_of(name, read))
    except InputError as error:
        return unread(found, str(error))


def _options_of(name: str, read: Sequence[_Signals]) -> IntakeOptions:
    """Return the options of a loop, of which several files may hold signals."""
    units = {table.way.op_unit(name) for table, block in read if block.of("op")}
    steps = {table.way.options.sample_time for table, _ in read}
    for what, said in (("unit of OP", units), ("sample time", steps)):
        if len(said) > 1:
            raise InputError(
                f"the {what} of {name} is not the same in all its files",
                fix="say it in a row of --tags for each of them",
            )
    first = read[0][0].way.options
    return dataclasses.replace(
        first, op_unit=next(iter(units), first.op_unit), sample_time=next(iter(steps))
    )


def record_of(given: Record | str | os.PathLike[str]) -> Record:
    """Return a record, read from a file where its path is given; InputError for anything else."""
    if isinstance(given, Record):
        return given
    if isinstance(given, str | os.PathLike):
        return read(os.fspath(given))
    raise InputError(f"{type(given).__name__} is no record", where="record", fix=NO_RECORD)


def read(
    path: str | Path,
    columns: CsvColumns = CsvColumns(),  # noqa: B008 (frozen)
    *,
    namespace: str | None = None,
) -> Record:
    """Read a record from an export or a bag: of one with gaps the longest good part.

    Args:
        path: a CSV file or another export of one loop, a rosbag2 directory or a ``.mcap`` file.
        columns: which column is what, for files only; None of them for t, OP, PV, SP, STEM.
        namespace: of the loop's topics, for bags that hold several loops.

    Returns:
        OP and stem in %, shape (N, m); PV and SP in engineering units, shape (N, p). What was
        left out or mended stands in its ``notes``.

    Raises:
        InputError: no such file or column, columns that cannot be told apart, no good samples.

    Examples:
        >>> from stiction_ros import LoopModel, find_config, read, simulate, write_csv
        >>> write_csv(simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=9), "f.csv")
        >>> record = read("f.csv")
        >>> len(record), record.valves, record.sample_time
        (9, ('V1',), 1.0)
    """
    options = IntakeOptions(columns=columns, namespace=namespace)
    return longest_part(one_loop(Path(path), options).parts)
