"""Without the extra ``opcua`` each of its commands says in one sentence what to install."""

import importlib.util
from pathlib import Path
from typing import Any

import pytest

from stiction_ros.cli.main import main

URL = "opc.tcp://127.0.0.1:1"
CALLS = (
    ["demo", "opcua", "--out", "{}/out"],
    ["certificates", "make", "--out", "{}/own"],
    ["certificates", "pin", URL],
    ["browse-tags", URL, "--sample-time", "1", "--out", "{}/x.tags.yaml"],
    ["fetch-history", URL, "--tags", "x", "--from", "2026-01-01", "--to", "2026-01-02"],
)


@pytest.mark.parametrize("call", CALLS, ids=lambda call: " ".join(call[:2]))
def test_what_lacks_is_said(
    call: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    there = importlib.util.find_spec

    def without(name: str, *rest: Any) -> Any:
        return None if name == "asyncua" else there(name, *rest)

    monkeypatch.setattr(importlib.util, "find_spec", without)
    assert main([part.format(tmp_path) for part in call]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "pip install" in said
    assert list(tmp_path.iterdir()) == []
