"""The house in figures: lines, numeric constants, documentation, public names, examples.

Run from anywhere: ``python tools/house.py [--check]``. With ``--check`` the exit code is 1 when a
figure misses its aim. Judged are functions and methods of the public names, which the package says
are all that it promises; those of the floors below, docstrings and comments are shown. Lines and
numeric constants have ceilings, which ``test/packaging/test_ceilings.py`` holds.
"""

import argparse
import ast
import dataclasses
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "stiction_ros"
STUDIES = "studies/stiction_studies"
EXPLAINED = 0.6
NAMES, EXAMPLES = 25, 10
DOCUMENTS = ("ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", f"{PACKAGE}/py.typed")

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclasses.dataclass(frozen=True)
class Source:
    """One module, read once.

    Attributes:
        path: relative to the root.
        lines, docstring, comment: numbers of lines; a comment behind code counts as one.
        functions: public functions and methods that take arguments, by qualified name, and
            whether each of their arguments is explained.
    """

    path: Path
    lines: int
    docstring: int
    comment: int
    functions: dict[str, bool]


@dataclasses.dataclass(frozen=True)
class Row:
    """One figure, what it should be, and whether it is; None where it is not judged."""

    what: str
    found: str
    aim: str = ""
    met: bool | None = None


def read(root: Path, path: Path) -> Source:
    """Return what is counted of one file."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return Source(
        path.relative_to(root),
        len(text.splitlines()),
        sum(_docstring_lines(node) for node in ast.walk(tree)),
        sum(token.type == tokenize.COMMENT for token in tokens),
        dict(_functions(tree.body, "")),
    )


def _docstring_lines(node: ast.AST) -> int:
    if not isinstance(node, ast.Module | ast.ClassDef | Function) or not node.body:
        return 0
    first = node.body[0]
    if ast.get_docstring(node) is None or not isinstance(first, ast.Expr):
        return 0
    return (first.end_lineno or first.lineno) - first.lineno + 1


def _functions(body: list[ast.stmt], inside: str) -> Iterator[tuple[str, bool]]:
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from _functions(node.body, f"{inside}{node.name}.")
        elif isinstance(node, Function) and not node.name.startswith("_"):
            names = arguments(node)
            if names:
                yield f"{inside}{node.name}", explained(ast.get_docstring(node) or "", names)


def arguments(node: Function) -> list[str]:
    """Return the names of the arguments, ``self`` and ``cls`` left out."""
    spec = node.args
    names = [arg.arg for arg in (*spec.posonlyargs, *spec.args, *spec.kwonlyargs)]
    names += [arg.arg for arg in (spec.vararg, spec.kwarg) if arg is not None]
    return [name for name in names if name not in ("self", "cls")]


def explained(text: str, names: list[str]) -> bool:
    """Return whether a docstring says of each argument what it is.

    An entry of ``Args:`` counts (``a, b: …`` for two), and so does a name in double backquotes in
    a sentence.
    """
    section = re.search(r"^Args:\n((?: +.*\n?|\n)+)", text, re.MULTILINE)
    entries = re.findall(r"^ {4}([\w, *]+):", section.group(1), re.MULTILINE) if section else []
    told = {name.strip(" *") for entry in entries for name in entry.split(",")}
    told |= set(re.findall(r"``(\w+)``", text))
    return all(name in told for name in names)


def public_homes(root: Path) -> dict[str, tuple[str, str]]:
    """Return of each public name the module that has it, and its name there."""
    stub = ast.parse((root / PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    return {
        alias.asname or "find_gap": (str(node.module).removeprefix(f"{PACKAGE}."), alias.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def public_functions(root: Path, sources: list[Source]) -> dict[str, bool]:
    """Return the functions and methods behind the public names, and whether each is explained."""
    by_module = {".".join(s.path.with_suffix("").parts[1:]): s for s in sources}
    found: dict[str, bool] = {}
    for name, (module, there) in public_homes(root).items():
        source = by_module.get(module)
        for function, told in source.functions.items() if source is not None else ():
            if function == there or function.startswith(f"{there}."):
                found[function.replace(there, name, 1)] = told
    return found


def lines_of(folder: Path) -> int:
    """Return the lines of all modules below a folder, as ``wc -l`` counts them."""
    return sum(path.read_bytes().count(b"\n") for path in folder.rglob("*.py"))


def numeric_constants(folder: Path) -> int:
    """Return how many names of constants all modules below a folder give to numbers."""
    texts = (path.read_text(encoding="utf-8") for path in folder.rglob("*.py"))
    return sum(len(constants(ast.parse(text))) for text in texts)


def constants(tree: ast.Module) -> list[str]:
    """Return the upper-case names to which a module assigns a number or a tuple of numbers.

    Signs and arithmetic of numbers are numbers; each name of ``A, B = 1, 2`` counts.
    """
    found: list[str] = []
    for node in tree.body:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                found += _constants(target, node.value)
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            found += _constants(node.target, node.value)
    return found


def _constants(target: ast.expr, value: ast.expr) -> list[str]:
    if isinstance(target, ast.Tuple):
        if not isinstance(value, ast.Tuple) or len(value.elts) != len(target.elts):
            return []
        pairs = zip(target.elts, value.elts, strict=True)
        return [name for pair in pairs for name in _constants(*pair)]
    named = isinstance(target, ast.Name) and re.fullmatch(r"_*[A-Z][A-Z0-9_]*", target.id)
    return [ast.unparse(target)] if named and _is_number(value) else []


def _is_number(value: ast.expr) -> bool:
    """Tell whether it is a number or a tuple of such, signs and arithmetic included."""
    if isinstance(value, ast.Tuple):
        return bool(value.elts) and all(map(_is_number, value.elts))
    if isinstance(value, ast.UnaryOp):
        return isinstance(value.op, ast.UAdd | ast.USub) and _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return _is_number(value.left) and _is_number(value.right)
    return isinstance(value, ast.Constant) and type(value.value) in (int, float, complex)


def rows(root: Path) -> list[Row]:
    """Return the table of a tree."""
    sources = [read(root, path) for path in sorted((root / PACKAGE).rglob("*.py"))]
    lines = sum(source.lines for source in sources)
    functions = [told for source in sources for told in source.functions.values()]
    public = public_functions(root, sources)
    names, examples = len(public_homes(root)), len(list((root / "examples").glob("*.py")))
    there = [name for name in DOCUMENTS if (root / name).is_file()]
    return [
        Row("modules, lines", f"{len(sources)}, {lines}"),
        Row("lines of the studies", f"{lines_of(root / STUDIES)}"),
        Row("numeric constants", f"{numeric_constants(root / PACKAGE)}"),
        Row("docstring lines", _share(sum(source.docstring for source in sources), lines)),
        Row("comment lines", _share(sum(source.comment for source in sources), lines)),
        Row(
            "arguments explained, public names",
            _share(sum(public.values()), len(public)),
            f"≥ {EXPLAINED:.0%}",
            bool(public) and sum(public.values()) >= EXPLAINED * len(public),
        ),
        *(Row(f"  {name}", "not explained") for name, told in public.items() if not told),
        Row("arguments explained, all functions", _share(sum(functions), len(functions))),
        Row("public names", f"{names}", f"≥ {NAMES}", names >= NAMES),
        Row("examples", f"{examples}", f"≥ {EXAMPLES}", examples >= EXAMPLES),
        Row("documents", ", ".join(there), "all", len(there) == len(DOCUMENTS)),
    ]


def _share(part: int, whole: int) -> str:
    return f"{part / max(whole, 1):.1%} ({part} of {whole})"


def main(given: list[str] | None = None) -> int:
    """Print the table; see the module."""
    parser = argparse.ArgumentParser(description="The house in figures.")
    parser.add_argument("--root", type=Path, default=ROOT, metavar="DIR", help="another tree")
    parser.add_argument("--check", action="store_true", help="exit code 1 when an aim is missed")
    options = parser.parse_args(given)
    table = rows(options.root)
    width = max(len(row.what) for row in table)
    for row in table:
        verdict = "" if row.met is None else f"  {row.aim}: {'met' if row.met else 'missed'}"
        print(f"{row.what:{width}}  {row.found}{verdict}")
    return int(options.check and any(row.met is False for row in table))


if __name__ == "__main__":
    sys.exit(main())
