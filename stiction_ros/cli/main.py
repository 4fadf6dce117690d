"""The command ``stiction``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

# Two cores are shared with the nodes: linear algebra gets one thread unless told otherwise.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from stiction_ros import __version__
from stiction_ros.cli import (
    bench,
    browse_tags,
    certificates,
    convert,
    demo,
    example,
    experiment,
    faults,
    fetch_history,
    fit_linear,
    gap,
    identify,
    listen,
    repair,
    replay,
    report,
    soak,
    study,
    study_change,
    study_control,
    study_monitor,
)
from stiction_ros.errors import InputError

DONE, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130

COMMANDS = (
    demo,
    identify,
    fit_linear,
    gap,
    example,
    experiment,
    convert,
    replay,
    report,
    repair,
    study,
    study_change,
    study_control,
    study_monitor,
    faults,
    soak,
    certificates,
    browse_tags,
    fetch_history,
    listen,
    bench,
)


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    top = argparse.ArgumentParser(
        prog="stiction",
        description="Find, quantify and compensate valve stiction in MPC loops.",
    )
    top.add_argument("--version", action="version", version=f"stiction_ros {__version__}")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for module in COMMANDS:
        module.add(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns:
        0 done, 1 failed, 2 unusable input, 130 interrupted.
    """
    options = parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except InputError as error:
        print(f"stiction: {error}", file=sys.stderr)
        return USAGE
    except BrokenPipeError:
        sys.stdout = None  # the reader has gone
        return DONE
    except KeyboardInterrupt:
        print("stiction: interrupted", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    raise SystemExit(main())
