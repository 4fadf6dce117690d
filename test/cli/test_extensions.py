"""What the studies bring to the command, and what is said where they are not installed."""

import pytest

from stiction_ros.cli import extensions
from stiction_ros.cli.main import COMMANDS, main
from stiction_studies.commands import COMMANDS as BROUGHT


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The core as it is installed without the studies."""
    monkeypatch.setattr(extensions, "brought", dict)


def test_the_core_knows_what_the_studies_bring() -> None:
    assert set(extensions.OF_STUDIES) == set(BROUGHT) == set(extensions.brought())
    assert not set(BROUGHT) & set(COMMANDS)


@pytest.mark.usefixtures("alone")
def test_help_of_the_core_alone_lists_only_what_works(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    listed = {line.split()[0] for line in capsys.readouterr().err.splitlines() if line.strip()}
    assert set(COMMANDS) <= listed
    assert not {name for name in BROUGHT if " " not in name} & listed
    with pytest.raises(SystemExit):
        main(["demo", "--help"])
    said = capsys.readouterr().out
    assert not [word for word in ("opcua", "--compare") if word in said]


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("name", extensions.OF_STUDIES)
def test_what_is_not_installed_says_what_brings_it(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(name.split()) == 2
    said = capsys.readouterr().err
    assert said.startswith(
        f"stiction: stiction {name}: comes with the distribution stiction-studies"
    )
    assert len(said.splitlines()) == 1
