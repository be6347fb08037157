"""The intermediate form: nodes, the schema of the facts, and what arithmetic means everywhere."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
