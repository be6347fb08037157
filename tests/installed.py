"""What is installed, and so can be tested: all but PyTorch is needed."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

TORCH = find_spec("torch") is not None

TIERS = ("interpreter", "scalar", "numpy", "numba", *(["torch"] if TORCH else []))
"""What can run the rules here."""

needs_torch = pytest.mark.skipif(not TORCH, reason="PyTorch, the extra 'train', is not installed")
