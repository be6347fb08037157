from .gaps import Answer, Change, Finding, what_if

__all__ = [
    "Answer",
    "Change",
    "Finding",
    "what_if",
]
