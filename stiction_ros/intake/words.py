"""The words of exports, as ``words.yaml`` beside this file lists them."""

import re
from collections.abc import Mapping
from importlib import resources
from typing import Any

import yaml

WORDS: Mapping[str, Any] = yaml.safe_load(
    resources.files("stiction_ros.intake").joinpath("words.yaml").read_text(encoding="utf-8")
)


def by_word(section: str) -> dict[str, Any]:
    """Return each word of a section with what it is listed under."""
    return {word: key for key, words in WORDS[section].items() for word in words}


def pattern_of(section: str) -> re.Pattern[str]:
    """Return an expression that one of the words of a section matches as a whole."""
    return re.compile("|".join(WORDS[section]), re.IGNORECASE)
