"""Why a goal succeeds or fails: proofs, and what they say."""

from drlsl.logic.explain.explanation import Explanation
from drlsl.logic.explain.proof import MAX_DEPTH, explain

__all__ = [
    "MAX_DEPTH",
    "Explanation",
    "explain",
]
