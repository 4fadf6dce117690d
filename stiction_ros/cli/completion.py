"""``stiction completion``: what a shell asks for, so that Tab ends commands and options."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterator
from typing import Any

SHELLS = ("bash", "zsh", "fish")

BASH = """\
_stiction() {
    local word at path words files
    word=${COMP_WORDS[COMP_CWORD]} path=stiction words= files=yes
    for ((at = 1; at < COMP_CWORD; at++)); do
        case "$path ${COMP_WORDS[at]}" in
            @PATHS@) path="$path ${COMP_WORDS[at]}" ;;
        esac
    done
    case "$path ${COMP_WORDS[COMP_CWORD - 1]}" in
@CHOICES@
    esac
    if [ -z "$words" ]; then
        case "$path" in
@WORDS@
        esac
    else
        files=
    fi
    COMPREPLY=()
    [ -z "$files" ] || COMPREPLY=($(compgen -f -- "$word"))
    COMPREPLY+=($(compgen -W "$words" -- "$word"))
}
complete -o filenames -F _stiction stiction
"""

ZSH = "autoload -U +X bashcompinit && bashcompinit\n"


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "completion",
        description="Print a script that completes commands and options at Tab. For bash: "
        'eval "$(stiction completion bash)", in ~/.bashrc to have it always; zsh the same in '
        "~/.zshrc; for fish: stiction completion fish | source.",
    )
    parser.add_argument("shell", choices=SHELLS, help="the shell")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the script."""
    from stiction_ros.cli.main import parser  # imports every command

    known = list(_known(parser(), ()))
    print(_fish(known) if options.shell == "fish" else _bash(known, options.shell), end="")
    return 0


@dataclasses.dataclass(frozen=True)
class _Command:
    """A command or an action of one, by its path of names.

    Attributes:
        path: its names, the command first; empty for ``stiction`` itself.
        actions: names and help of what may follow.
        options: long options and help.
        choices: by option what it takes, where that is a few words.
        positional: words that it takes without an option.
    """

    path: tuple[str, ...]
    actions: dict[str, str]
    options: dict[str, str]
    choices: dict[str, tuple[str, ...]]
    positional: tuple[str, ...]


def _known(parser: argparse.ArgumentParser, path: tuple[str, ...]) -> Iterator[_Command]:
    """Yield a parser and those below it."""
    below: dict[str, argparse.ArgumentParser] = {}
    actions: dict[str, str] = {}
    options: dict[str, str] = {}
    choices: dict[str, tuple[str, ...]] = {}
    positional: list[str] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            below = dict(action.choices)
            actions = {one.dest: one.help or "" for one in action._choices_actions}
            actions |= getattr(parser, "texts", {})  # of the commands themselves
            continue
        words = tuple(map(str, action.choices or ()))
        if not action.option_strings:
            positional += words
        for name in action.option_strings:
            if name.startswith("--") and action.help is not argparse.SUPPRESS:
                options[name] = (action.help or "").replace("%%", "%")
                if words:
                    choices[name] = words
    yield _Command(path, actions, options, choices, tuple(positional))
    for name, child in below.items():
        yield from _known(child, (*path, name))


def _bash(known: list[_Command], shell: str) -> str:
    paths = [f'"{_spelt(one)}"' for one in known if one.path]
    words = [
        f'            "{_spelt(one)}") words="{" ".join(_words(one))}"{_no_files(one)} ;;'
        for one in known
    ]
    choices = [
        f'        "{_spelt(one)} {name}") words="{" ".join(taken)}" ;;'
        for one in known
        for name, taken in one.choices.items()
    ]
    script = BASH.replace("@PATHS@", " | ".join(paths))
    script = script.replace("@WORDS@", "\n".join(words)).replace("@CHOICES@", "\n".join(choices))
    return (ZSH if shell == "zsh" else "") + script


def _spelt(command: _Command) -> str:
    return " ".join(("stiction", *command.path))


def _words(command: _Command) -> tuple[str, ...]:
    return (*command.actions, *command.positional, *command.options)


def _no_files(command: _Command) -> str:
    return " files=" if command.actions or command.positional else ""


def _fish(known: list[_Command]) -> str:
    lines = []
    for one in known:
        seen = [f"__fish_seen_subcommand_from {name}" for name in one.path]
        here = "; and ".join(seen) or "__fish_use_subcommand"
        if one.actions:
            others = " ".join(one.actions)
            first = (
                here if not one.path else f"{here}; and not __fish_seen_subcommand_from {others}"
            )
            lines += [
                f"complete -c stiction -f -n '{first}' -a {name} -d {_quoted(text)}"
                for name, text in one.actions.items()
            ]
        if one.positional:
            words = " ".join(one.positional)
            lines.append(f"complete -c stiction -n '{here}' -a {_quoted(words)}")
        for name, text in one.options.items():
            takes = f" -x -a {_quoted(' '.join(one.choices[name]))}" if name in one.choices else ""
            lines.append(
                f"complete -c stiction -n '{here}' -l {name[2:]}{takes} -d {_quoted(text)}"
            )
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """Return a text between quotes as fish reads them."""
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
