"""Options of the searches, and which search a command calls: the floors' own, or the paper's."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from stiction_ros.effects import Stiction, behaviours
from stiction_ros.errors import InputError, storing

if TYPE_CHECKING:
    from stiction_ros.identification import Identification, IdentificationOptions
    from stiction_ros.loop import LoopModel
    from stiction_ros.records.record import Record

T = TypeVar("T", int, float)

# The modules that give these words their meaning load slowly, and a mistyped option should be
# told at once; test/cli/test_choices.py holds both together.
LOOP_KINDS = ("flow", "pressure", "level", "temperature", "analyser")
PAPER_METHODS = ("nlp", "nlp_printed", "grid")
METHODS = ("exact", "evidence", *PAPER_METHODS)
CRITERIA = ("aic", "bic")
SUBSPACE_METHODS = ("n4sid", "cva", "predictor")

# Option: where its value goes, and the methods that have it; of orders one for each channel.
OWNERS = {
    "--na": ("output_order", PAPER_METHODS),
    "--nb": ("input_order", PAPER_METHODS),
    "--friction-limit": ("friction_limit", ("exact", "evidence", *PAPER_METHODS)),
    "--starts": ("starts", ("nlp", "nlp_printed")),
    "--grid-step": ("grid_step", ("grid",)),
}
ORDERS = ("output_order", "input_order")


def laws() -> tuple[str, ...]:
    """Return the friction laws that can be identified."""
    return tuple(kind.law for kind in behaviours() if issubclass(kind, Stiction) and kind.law)


def add_law(parser: Any) -> None:
    """Add the option of the friction law that is identified to a parser."""
    parser.add_argument(
        "--law",
        default="auto",
        metavar="LAW",
        help=f"friction law: {' | '.join(laws())}, or auto: for each valve he, or another that "
        "explains PV clearly better (default: auto; with other methods than evidence: he)",
    )


def add_delay(parser: Any, what: str) -> None:
    """Add the option of the delays from OP to PV to a parser."""
    parser.add_argument(
        "--delay",
        type=delay_range,
        default=(0, 10),
        metavar="LO:HI",
        help=f"{what}, samples (0:10)",
    )


def delay_range(text: str) -> tuple[int, int]:
    """Return ``LO:HI`` (or one number) as a range."""
    low, _, high = text.partition(":")
    try:
        return int(low), int(high or low)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no range, write LO:HI") from None


def write_model(target: str, made: "Callable[[str], LoopModel]") -> None:
    """Write the loop model that is made for a name: that of its file."""
    name = Path(target).name.removesuffix(".yaml").removesuffix(".loop")
    with storing(target):
        made(name or "loop").save(target)


def add_search_options(parser: Any) -> None:
    """Add the options of single searches to a parser."""
    parser.add_argument(
        "--friction-limit",
        type=friction_limit,
        metavar="F[,F]",
        help="largest friction to try, %%: one for all valves or one for each (default: the range "
        "of OP; methods of the paper: the range of its cycle)",
    )
    parser.add_argument(
        "--starts",
        type=int,
        metavar="M",
        help="starts for each delay, for methods nlp and nlp_printed (default: 7)",
    )
    parser.add_argument(
        "--grid-step", type=float, metavar="S", help="step of method grid in %% (default: 0.5)"
    )


def friction_limit(text: str) -> float | tuple[float, ...]:
    """Return one number, or one for each valve, from ``F`` or ``F,F``."""
    return _each(text, float, "number, write F or F,F")


def output_orders(text: str) -> int | tuple[int, ...]:
    """Return one order, or one for each output, from ``N`` or ``N,N``."""
    return _each(text, int, "order, write N or N,N")


def _each(text: str, kind: type[T], wanted: str) -> T | tuple[T, ...]:
    try:
        values = tuple(kind(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no {wanted}") from None
    return values[0] if len(values) == 1 else values


def input_orders(text: str) -> int | tuple[int | tuple[int, ...], ...]:
    """Return one order, or a row of one or one for each valve for each output, from ``N,N/N,N``."""
    rows = tuple(output_orders(row) for row in text.split("/"))
    return rows[0] if len(rows) == 1 and isinstance(rows[0], int) else rows


def search_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of single searches that were given; the method at hand must have them.

    Orders are among them where they differ by channel.
    """
    chosen: dict[str, Any] = {}
    for option, (key, methods) in OWNERS.items():
        value = getattr(options, key, None)
        if value is None or (key in ORDERS and isinstance(value, int)):
            continue
        if options.method not in methods:
            what = "order for each channel" if key in ORDERS else "such option"
            raise InputError(
                f"method {options.method} has no {what}",
                where=option,
                fix=f"add --method {' or '.join(methods)}",
            )
        chosen[key] = value
    return chosen


def identify_by(
    method: str, options: "IdentificationOptions", chosen: dict[str, Any]
) -> "Callable[[Record, Callable[[float], None]], Identification]":
    """Return what identifies a record by one of :data:`METHODS`, as ``chosen``."""
    if method in PAPER_METHODS:
        from stiction_ros.paper.methods import identify as identify_as_paper
        from stiction_ros.paper.paper_options import PaperOptions

        settings = PaperOptions.of(options, method, **chosen)
        return lambda record, progress: identify_as_paper(record, settings, progress)
    import dataclasses

    from stiction_ros.identification import identify

    own = dataclasses.replace(options, method=method, **chosen)
    return lambda record, progress: identify(record, own, progress)
