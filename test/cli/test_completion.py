from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from stiction_ros.cli import extensions
from stiction_ros.cli.main import COMMANDS, main


def script(shell: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "ended"),
    [
        ("stiction ident", "identify"),
        ("stiction identify --name", "--namespace"),
        ("stiction identify --dates m", "mdy"),
        ("stiction identify expo", "export.csv"),
        ("stiction certificates p", "pin"),
        ("stiction certificates pin --fing", "--fingerprint"),
        ("stiction completion f", "fish"),
    ],
)
def test_bash_ends_what_is_typed(
    typed: str, ended: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash")
    (tmp_path / "export.csv").touch()
    (tmp_path / "fish").touch()  # files are no answer where a word is asked for
    words = " ".join(f"'{word}'" for word in typed.split())
    asked = f"COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _stiction"
    text = f'{script("bash", capsys)}\n{asked}; printf "%s\\n" "${{COMPREPLY[@]}}"'
    done = subprocess.run([bash, "-c", text], cwd=tmp_path, capture_output=True, text=True)
    assert done.stderr == ""
    assert done.stdout.split() == [ended]


def test_every_shell_knows_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    for shell in ("bash", "zsh", "fish"):
        told = script(shell, capsys)
        assert all(name in told for name in (*COMMANDS, *extensions.commands()))
        assert "--op-unit" in told or "-l op-unit" in told
