from .declared import Declared, declared_facts
from .facts_proof import FactsResult, load_told, verify_facts

__all__ = [
    "Declared",
    "FactsResult",
    "declared_facts",
    "load_told",
    "verify_facts",
]
