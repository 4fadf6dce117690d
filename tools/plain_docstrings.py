"""Docstrings for the documentation site: what Sphinx would read, as Markdown.

Roles (``:class:`.Record```) become code, ``.. math::`` becomes a block of TeX as it is written,
a paragraph that ends in ``::`` begins a block of code by its indent, and an entry ``a, b: …`` of
arguments or attributes becomes one entry for each.
"""

import inspect
import re
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|attr|data|exc):`~?\.?([^`]+)`")
MATH = re.compile(r"^( *)\.\. math::\n\n?((?:\1 +.*\n?|\n)+)", re.MULTILINE)
SECTION = re.compile(r"^(?:Args|Attributes):\n(?:(?: +.*)?(?:\n|$))+", re.MULTILINE)
SHARED = re.compile(r"^    (\w+(?:, \w+)+):(.*\n?(?:^     .*\n?)*)", re.MULTILINE)
BLOCK = re.compile(r"::\n(?=\n)")


def plain(text: str) -> str:
    """Return a docstring without what only Sphinx understands."""
    text = inspect.cleandoc(MATH.sub(_fenced, text))
    text = SECTION.sub(lambda section: SHARED.sub(_each, section.group()), text)
    return BLOCK.sub(":\n", ROLE.sub(r"`\1`", text))


def _fenced(found: re.Match[str]) -> str:
    indent, body = found.groups()
    return f"{indent}```tex\n{body.strip(chr(10))}\n{indent}```\n"


def _each(found: re.Match[str]) -> str:
    names, text = found.groups()
    text = text if text.endswith("\n") else text + "\n"
    return "".join(f"    {name}:{text}" for name in names.split(", "))


class PlainDocstrings(griffe.Extension):
    """Rewrites every docstring once it is collected."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        if obj.docstring is not None:
            obj.docstring.value = plain(obj.docstring.value)
