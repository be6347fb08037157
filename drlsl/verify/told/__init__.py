"""Proofs of rules for any environment, whose facts a file of properties declares."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
