from .forms import Form, array_forms, atom_codes
from .lowering import Answer, Lowered, Mode, Query, lower
from .unfold import deep_recursion

__all__ = [
    "Answer",
    "Form",
    "Lowered",
    "Mode",
    "Query",
    "array_forms",
    "atom_codes",
    "deep_recursion",
    "lower",
]
