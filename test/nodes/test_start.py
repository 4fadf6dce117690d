import sys

import pytest

from stiction_ros.nodes.__main__ import NODES, main


@pytest.mark.parametrize("arguments", [[], ["pump"], ["--plant"]])
def test_anything_but_a_node_is_answered_with_the_names(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["nodes", *arguments])
    assert main() == 2
    answer = capsys.readouterr().err
    assert len(answer.splitlines()) == 1
    assert all(name in answer for name in NODES)


@pytest.mark.parametrize("arguments", [["--help"], ["-h"], ["controller", "--help"]])
def test_help_tells_how_a_node_is_started(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["nodes", *arguments])
    assert main() == 0
    answer = capsys.readouterr()
    assert answer.out.startswith("usage: python -m stiction_ros.nodes NODE")
    assert all(name in answer.out for name in (*NODES, "--params-file", "__ns:=/LOOP"))
    assert answer.err == ""
