"""Explanations of success and failure: proofs, and their presentation."""

from drlsl.logic.explain.explanation import Explanation
from drlsl.logic.explain.proof import MAX_DEPTH, explain

__all__ = [
    "MAX_DEPTH",
    "Explanation",
    "explain",
]
