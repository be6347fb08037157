from .intervals import Columns
from .margins import Floats, margin_of
from .rounding import between

__all__ = [
    "Columns",
    "Floats",
    "between",
    "margin_of",
]
