"""Leaves out what tests the learner where PyTorch is not installed, and says so."""

from __future__ import annotations

from tests.installed import TORCH

NEEDS_TORCH = ["learning", "study", "lowering/test_torch.py", "test_overtakings.py"]

collect_ignore = [] if TORCH else NEEDS_TORCH


def pytest_report_header() -> list[str]:
    """Say what is left out."""
    return [] if TORCH else [f"PyTorch is not installed; left out: {', '.join(NEEDS_TORCH)}"]
