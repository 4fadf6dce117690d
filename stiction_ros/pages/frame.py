"""The frame of every page: one file with its style, and nothing that is fetched."""

import html
import re
from collections.abc import Iterable
from importlib import resources
from string import Template

from stiction_ros import __version__

STYLE = resources.files("stiction_ros.pages").joinpath("frame.css").read_text("utf-8")

SCROLLED = '<div class="wide" tabindex="0" role="group" aria-label="wide table or picture">'
"""What is wider than a phone is scrolled in, also by the keyboard."""

_PAGE = Template(
    """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>$title</title>
<style>
$style</style>
</head>
<body>
<main$kind>
$body
<footer>$footer</footer>
</main>$script
</body>
</html>
"""
)


def framed(title: str, parts: Iterable[str], script: str = "", *, full: bool = False) -> str:
    """Return a whole page; ``parts`` are HTML, ``title`` is words, ``full`` takes a wide window."""
    return _PAGE.substitute(
        title=text(title),
        style=STYLE,
        kind=' class="full"' * full,
        body="\n".join(part for part in parts if part),
        footer=f"stiction_ros {__version__}",
        script=f"\n<script>\n{script}</script>" if script else "",
    )


def text(value: object) -> str:
    """Return ``value`` for HTML."""
    return html.escape(str(value), quote=True)


def words(value: object) -> str:
    """Return ``value`` for HTML with f_S and f_D set as symbols, code and lines kept."""
    return (
        re.sub("`([^`]+)`", r"<code>\1</code>", text(value))
        .replace("f_S", "f<sub>S</sub>")
        .replace("f_D", "f<sub>D</sub>")
        .replace("\n", "<br>")
    )


def listed(lines: Iterable[object]) -> str:
    """Return lines of words as a list."""
    return "<ul>" + "".join(f"<li>{text(line)}</li>" for line in lines) + "</ul>"
