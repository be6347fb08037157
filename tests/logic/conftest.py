"""An engine, once without and once with compiled code."""

from __future__ import annotations

import pytest

from drlsl.logic import Engine
from drlsl.logic.jit import tiering as tiers


@pytest.fixture(params=["plain", "compiled"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Engine:
    """An engine of each kind; the compiled one compiles at the first call."""
    monkeypatch.setattr(tiers, "PATIENCE", 0)
    return Engine(compiled=request.param == "compiled")
