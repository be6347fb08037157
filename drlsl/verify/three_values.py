"""Truth of three values: true, false, and None where it is not known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from drlsl.lowering.ir import Node

Truth: TypeAlias = "bool | None"


def all_of(truths: Sequence[Truth]) -> Truth:
    """Return whether all hold."""
    if False in truths:
        return False
    return None if None in truths else True


def any_of(truths: Sequence[Truth]) -> Truth:
    """Return whether one holds."""
    if True in truths:
        return True
    return None if None in truths else False


def compound(node: Node, truth: Callable[[Node], Truth]) -> Truth:
    """Return the truth of a constant, or of a connective by that of its parts."""
    if node.op == "const":
        return bool(node.data)
    parts = [truth(arg) for arg in node.args]
    if node.op == "not":
        return None if parts[0] is None else not parts[0]
    return all_of(parts) if node.op == "and" else any_of(parts)
