from .margins import Floats, margin_of

__all__ = [
    "Floats",
    "margin_of",
]
