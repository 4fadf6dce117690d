"""What becomes of the messages that go through a relay."""

from collections.abc import Callable
from typing import Any

Rule = Callable[[Any], list[Any]]
"""Turns each message into those that are handed on."""


def drop_all(_message: Any) -> list[Any]:
    """Lose every message."""
    return []


def late_by(count: int) -> Rule:
    """Hand every message on ``count`` messages later."""
    held: list[Any] = []

    def rule(message: Any) -> list[Any]:
        held.append(message)
        return [held.pop(0)] if len(held) > count else []

    return rule


def swapped() -> Rule:
    """Exchange every two messages."""
    held: list[Any] = []

    def rule(message: Any) -> list[Any]:
        held.append(message)
        if len(held) < 2:
            return []
        both = held[::-1]
        held.clear()
        return both

    return rule


def instead(values: Callable[[list[float]], list[float]], limit: int) -> Rule:
    """Change the values of the next ``limit`` messages."""
    seen = 0

    def rule(message: Any) -> list[Any]:
        nonlocal seen
        seen += 1
        if seen <= limit:
            message.position = values(list(message.position))
        return [message]

    return rule


def every(count: int) -> Rule:
    """Lose every message of which the number is a multiple of ``count``."""
    seen = 0

    def rule(message: Any) -> list[Any]:
        nonlocal seen
        seen += 1
        return [] if seen % count == 0 else [message]

    return rule


def as_it_is(message: Any) -> list[Any]:
    """Hand every message on."""
    return [message]
