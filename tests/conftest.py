"""Leaves out what tests the learner where PyTorch is not installed, and says so."""

from __future__ import annotations

import pytest

from tests.installed import TORCH

NEEDS_TORCH = ["learning", "study", "lowering/test_torch.py"]

collect_ignore = [] if TORCH else NEEDS_TORCH


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what was left out."""
    if not TORCH:
        terminalreporter.write_line(f"PyTorch is not installed; left out: {', '.join(NEEDS_TORCH)}")
