"""The documentation site, and what a maintainer is told."""

import ast
import code
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

import stiction_ros
import stiction_ros.effects
from stiction_ros.cli.main import main, parser

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
LINES_OF_README = 160
WORDS, WORDS_OF_PAGE = 36_000, 3_000
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
every_text = pytest.mark.parametrize(
    "path",
    [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES],
    ids=lambda path: str(path.relative_to(ROOT)),
)


def commands(text: str) -> Iterator[list[str]]:
    """Yield the words of every ``stiction …`` line in blocks of shell commands."""
    for language, block in BLOCK.findall(text):
        if language == "sh":
            lines = re.sub(r"<<'END'.*?^END$", "", block, flags=re.MULTILINE | re.DOTALL)
            for line in lines.replace("\\\n", " ").splitlines():
                words = shlex.split(line.removesuffix("&"), comments=True)
                if words and words[0].removeprefix(".venv/bin/") == "stiction":
                    yield words[1:]


def test_the_readme_and_the_pages_keep_their_limits() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= LINES_OF_README
    words = {page: len(page.read_text(encoding="utf-8").split()) for page in PAGES}
    assert not {name: count for name, count in words.items() if count > WORDS_OF_PAGE}
    assert sum(words.values()) <= WORDS


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_page_begins_with_what_it_is_for_and_ends_with_what_next(page: Path) -> None:
    parts = page.read_text(encoding="utf-8").strip().split("\n\n")
    assert parts[0].startswith("# ")
    assert parts[1][0].isalpha() or parts[1][0] == "`"
    last = page.read_text(encoding="utf-8").rpartition("\n## ")[2]
    assert last.startswith("Next\n\n")
    assert "](" in last


@every_text
def test_every_command_of_a_page_is_understood(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = path.read_text(encoding="utf-8")
    for words in commands(text):
        try:
            parser(words[0]).parse_args(words)
        except SystemExit:
            pytest.fail(f"stiction {shlex.join(words)}: {capsys.readouterr().err}")
    for inline in re.findall(r"`stiction ([a-z][\w-]*(?: [^`]*)?)`", BLOCK.sub("", text)):
        name, *rest = inline.split()
        if name.endswith("-…"):
            continue
        with pytest.raises(SystemExit):
            parser(name).parse_args([name, "--help"])
        shown = capsys.readouterr().out
        assert "usage: stiction " + name in shown
        for option in (word for word in rest if word.startswith("--")):
            assert option.partition("=")[0] in shown or name == "demo", inline


@every_text
def test_the_names_that_programs_of_a_page_import_exist(path: Path) -> None:
    for language, block in BLOCK.findall(path.read_text(encoding="utf-8")):
        if language == "python":
            tree = ast.parse(block)
            tree.body = [
                line for line in tree.body if isinstance(line, ast.Import | ast.ImportFrom)
            ]
            exec(compile(tree, path.name, "exec"), {})


def test_the_processes_that_the_page_of_loops_shows_are_read() -> None:
    text = (ROOT / "docs" / "api" / "loops.md").read_text(encoding="utf-8")
    blocks = [block for language, block in BLOCK.findall(text) if language == "yaml"]
    assert len(blocks) == 2
    for block in blocks:
        loop = {"loop": "shown", "sample_time": 1.0, "valves": [{"name": "V1", "effects": []}]}
        model = stiction_ros.LoopModel.from_mapping(loop | yaml.safe_load(block), "loops.md")
        assert model.process.linear(1.0).step_responses(60)[-1, 0, 0] == pytest.approx(
            0.8, abs=0.01
        )


@pytest.mark.trial
def test_the_tutorial_comes_out_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    model = re.search(r"cat > (\S+) <<'END'\n(.*?)^END$", text, re.MULTILINE | re.DOTALL)
    assert model is not None
    Path(model.group(1)).write_text(model.group(2), encoding="utf-8")
    shown = {}
    for words in commands(text):
        assert main(words) == 0
        shown[shlex.join(words)] = capsys.readouterr().out
    assert "sticky" in shown["identify flow.csv --out report"]
    assert "3.99" in shown["identify flow.csv --out report"]
    assert "nothing to repair is visible" in " ".join(shown["identify ideal.csv"].split())
    gap = shown["gap ideal.loop.yaml flow.csv --quick --out gap"]
    for figure in ("named", "3.9985", "3.9869 to 4.0054", "1.505", "1.4997 to 1.5102", "1702"):
        assert figure in gap
    for language, block in BLOCK.findall(text):
        if language == "python":
            exec(compile(block, "tutorial.md", "exec"), {})
    assert capsys.readouterr().out.startswith("sticky 3.99")


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    page = (tmp_path / "api" / "identification" / "index.html").read_text(encoding="utf-8")
    assert "stiction_ros.identification.methods.identify" in page
    assert ":class:" not in page
    assert ".. math::" not in page


def test_every_page_is_in_the_contents() -> None:
    contents = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    named = set(re.findall(r"[\w/]+\.md", str(contents)))
    assert named == {str(page.relative_to(ROOT / "docs")) for page in PAGES}


def test_every_public_name_has_its_page() -> None:
    shown = re.findall(
        r"^::: ([\w.]+)$",
        "\n".join(page.read_text(encoding="utf-8") for page in PAGES),
        re.MULTILINE,
    )
    homes = {".".join(home) for name, home in stiction_ros._HOMES.items() if name != "effects"}
    of_effects = [each for each in vars(stiction_ros.effects).values() if callable(each)]
    tools = {f"{each.__module__}.{each.__name__}" for each in of_effects}
    assert len(shown) == len(set(shown))
    assert homes <= set(shown) <= homes | tools
    wanted = ("parameter", "FrictionPair", "SlipJumpPair", "JumpForm", "Axis", "Seen", "register")
    assert {name.rpartition(".")[2] for name in shown} >= set(wanted)


@pytest.mark.parametrize(
    "path", [ROOT / "README.md", *ROOT.glob("[AC]*.md")], ids=lambda path: path.name
)
def test_files_and_links_that_are_named_exist(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#:]+)\)", text)
    files = re.findall(r"`((?:stiction_ros|examples|docs|tools|test|config)/[\w./]+\.\w+)`", text)
    missing = [name for name in (*links, *files) if not (ROOT / name).exists()]
    assert not missing


def test_the_maintainer_s_kit_is_there() -> None:
    for name in ("ARCHITECTURE", "CONTRIBUTING", "CHANGELOG"):
        assert len((ROOT / f"{name}.md").read_text(encoding="utf-8").splitlines()) > 20
    latest = re.search(r"^## (\d+\.\d+\.\d+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert latest is not None
    assert latest.group(1) == stiction_ros.__version__


def test_the_forge_runs_what_ci_runs() -> None:
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "checks.yml").read_text())
    steps = [step.get("run") for step in workflow["jobs"]["test"]["steps"]]
    assert ".ci/run" in steps
    assert "make docs" in steps


def test_the_first_program_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = next(block for language, block in BLOCK.findall(text) if language == "python")
    model = stiction_ros.LoopModel.load(stiction_ros.find_config("flow.loop.yaml"))
    monkeypatch.chdir(tmp_path)
    stiction_ros.write_csv(stiction_ros.simulate(model, samples=600), "history.csv")
    code.InteractiveInterpreter().runcode(code.compile_command(block, symbol="exec"))
    assert "\nV1: sticky" in capsys.readouterr().out


@pytest.mark.trial
def test_the_first_export_is_read_as_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "docs" / "first_loop.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    made, dry_run = list(commands(text))[:2]
    assert main(made) == 0
    capsys.readouterr()
    assert main(dry_run) == 0
    shown = next(block for language, block in BLOCK.findall(text) if not language)
    assert capsys.readouterr().out == shown
