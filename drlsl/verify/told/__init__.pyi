from .declared import Declared, declared_facts
from .facts_proof import FactsResult, declares_facts, verify_facts

__all__ = [
    "Declared",
    "FactsResult",
    "declared_facts",
    "declares_facts",
    "verify_facts",
]
