"""Numbers in sentences for people. Standard library only."""

from __future__ import annotations


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return a number and its noun, as in `1 gap` or `1,204 gaps`; `plural` is for nouns that take no s."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"


def listed(items: list[str], most: int = 5) -> str:
    """Return the first of some items, joined by commas."""
    return ", ".join(items[:most]) + (", …" if len(items) > most else "")
