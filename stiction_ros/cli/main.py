"""The command ``stiction``."""

import argparse
import contextlib
import importlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import FrameType
from typing import Any

# Two cores are shared with the nodes: linear algebra gets one thread unless told otherwise.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from stiction_ros import __version__
from stiction_ros.cli import extensions
from stiction_ros.errors import InputError

DONE, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130

COMMANDS = {
    "identify": "is it the valve: friction, cause, process",
    "gap": "which effect a simulation lacks",
    "report": "a page of a record or of a recorded run",
    "gain": "what service or retuning would bring",
    "valve-test": "a test in manual: its moves, its verdict",
    "simulate": "run a loop model, closed or by moves of OP",
    "fit-linear": "fit a linear model for a controller",
    "replay": "decide over a bag as the nodes did live",
    "demo": "a live loop: cycle, identify, swap, report",
    "listen": "fill the windows of all loops of the graph",
    "convert": "turn a CSV file into a bag, or back",
    "repair": "finish or salvage a damaged bag",
    "survey": "rank all loops by what to service first",
    "fetch-history": "read history over OPC UA into CSV files",
    "browse-tags": "make a tag map by browsing over OPC UA",
    "certificates": "make and pin certificates of OPC UA",
}
"""What ``--help`` says of each command; its module bears its name and is loaded when called."""

DESCRIPTION = "Find, measure and control valves that stick."

GROUPS = {
    "find: what is wrong with this loop": ("identify", "gap", "report"),
    "decide: what to do about it": ("gain", "valve-test", "simulate"),
    "act: control a valve that sticks": ("fit-linear", "replay"),
    "live: loops on ROS 2 and their bags": ("demo", "listen", "convert", "repair"),
    "plant: all loops and their control system": (
        *("survey", "fetch-history", "browse-tags", "certificates"),
    ),
}
"""Commands by what they are for; all others are for the makers."""
COMPILER = "llvmlite"
"""Package whose functions are not broken off: machine code calls some of them back.

An exception in such a function is lost, and a lock stays taken.
"""

AGAIN = 0.05  # s, until it is asked again


@contextlib.contextmanager
def waiting_for_compiler() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt as soon as the main thread has left the compiler."""
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    if not _compiles(frame):
        raise KeyboardInterrupt
    later = threading.Timer(AGAIN, signal.raise_signal, (number,))
    later.daemon = True
    later.start()


def _compiles(frame: FrameType | None) -> bool:
    while frame is not None:
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] == COMPILER:
            return True
        frame = frame.f_back
    return False


def _known(command: str | None) -> Mapping[str, tuple[str, str]]:
    """Return module and help of every command; of other distributions where they are needed."""
    own = {
        name: (f"stiction_ros.cli.{name.replace('-', '_')}", text)
        for name, text in COMMANDS.items()
    }
    return own if command in own else {**own, **extensions.commands()}


class _OnError(logging.Handler):
    """Shows what the package logs as the commands show what is not their answer."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print one line on standard error."""
        print(f"stiction: {self.format(record)}", file=sys.stderr)


class _Parser(argparse.ArgumentParser):
    """A parser that tells with its own usage what it does not know, and what may be meant."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Return what was parsed; a command leaves nothing to others."""
        found, spare = super().parse_known_args(args, namespace)
        if spare and self._subparsers is None:
            self.error(self._unknown(spare))
        return found, spare

    def _unknown(self, spare: Sequence[str]) -> str:
        words = [word.partition("=")[0] for word in spare if word.startswith("-")]
        for word in words:
            if (part := f"{self.prog.rpartition(' ')[2]} {word}") in extensions.OF_STUDIES:
                extensions.refuse(part)
        if words:
            told = [f"{word}{_meant(word, self._option_string_actions)}" for word in words]
            return f"unknown option {', '.join(told)}"
        many = any(action.dest == "record" for action in self._actions)
        fix = "; it takes one record, stiction survey PATH … judges several" if many else ""
        return f"unexpected {' '.join(spare)}{fix}"


class _Top(_Parser):
    """The parser of all commands, which lists them in groups."""

    def __init__(self, texts: Mapping[str, str]) -> None:
        super().__init__(prog="stiction")
        self.texts = texts

    def format_help(self) -> str:
        """Return usage, the commands in groups, and where their options are."""
        named = {name for names in GROUPS.values() for name in names}
        rest = tuple(name for name in self.texts if name not in named)
        lines = ["usage: stiction COMMAND …", "", DESCRIPTION]
        for title, names in {**GROUPS, "makers: study and measure this package": rest}.items():
            lines += ["", title, *(f"  {name:13}  {self.texts[name]}" for name in names)]
        lines += ["", "stiction COMMAND --help lists the options of a command.", ""]
        return "\n".join(lines)


def _meant(word: str, known: Iterable[str]) -> str:
    """Return what a misspelt word may mean, as the end of a sentence."""
    import difflib  # only where something is wrong

    near = difflib.get_close_matches(word, list(known), n=2)
    return f": did you mean {' or '.join(near)}?" if near else ""


def parser(only: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of all commands, with the options of ``only`` one, or of all."""
    known = _known(only)
    top = _Top({name: text for name, (_, text) in known.items()})
    top.add_argument("--version", action="version", version=f"stiction_ros {__version__}")
    commands = top.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)
    for name, (module, _) in known.items():
        if only is None or name == only:
            importlib.import_module(module).add(commands)
        else:
            commands.add_parser(name)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns:
        0 done, 1 failed, 2 unusable input, 130 interrupted.
    """
    log = logging.getLogger("stiction_ros")
    if not any(isinstance(handler, _OnError) for handler in log.handlers):
        log.addHandler(_OnError())
        log.setLevel(logging.INFO)
    given = sys.argv[1:] if arguments is None else list(arguments)
    command = next((word for word in given if not word.startswith("-")), "")
    if not given:
        parser("").print_help(sys.stderr)
        return USAGE
    try:
        known = _known(command)
        if command and command not in known:
            if command in extensions.OF_STUDIES:
                extensions.refuse(command)
            parser("").error(f"there is no command {command}{_meant(command, known)}")
        options = parser(command).parse_args(given, argparse.Namespace(words=given))
        run = options.run
        if getattr(options, "dry_run", False):
            from stiction_ros.cli.shared.intake_options import dry_run as run
        with waiting_for_compiler():
            return int(run(options))
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
