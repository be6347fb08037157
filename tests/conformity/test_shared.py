"""The shared ISO conformity cases, judged by their own judge.

`known_failures.txt` lists each case that fails, with the reason; one that begins to pass must leave the list.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import pytest

from tests.conformity.adapter import Adapter

# How many cases pass. These only ever rise.
FLOOR_AGREED: Final = 558
FLOOR_ALL: Final = 588

_SHARED = os.environ.get("DRLSL_SHARED")
_KNOWN = Path(__file__).parent / "known_failures.txt"

pytestmark = [
    pytest.mark.shared,
    pytest.mark.skipif(_SHARED is None, reason="needs the shared folder named by DRLSL_SHARED"),
]


def _judge(folder: Path) -> ModuleType:
    sys.path.insert(0, str(folder))
    try:
        spec = importlib.util.spec_from_file_location("judge", folder / "judge.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(folder))
    return module


@pytest.fixture(scope="module")
def cases() -> list[dict[str, Any]]:
    assert _SHARED is not None
    found: list[dict[str, Any]] = _judge(Path(_SHARED) / "conformity").load()
    return found


@pytest.fixture(scope="module")
def results(cases: list[dict[str, Any]]) -> dict[str, tuple[str, str]]:
    assert _SHARED is not None
    judged: dict[str, tuple[str, str]] = _judge(Path(_SHARED) / "conformity").run_all(Adapter(), cases)
    return judged


def _known_failures() -> dict[str, str]:
    lines = _KNOWN.read_text(encoding="utf-8").splitlines()
    parts = (line.partition(" ") for line in lines if line and not line.startswith("#"))
    return {identifier: reason for identifier, _, reason in parts}


def test_exactly_the_known_cases_fail(
    cases: list[dict[str, Any]], results: dict[str, tuple[str, str]]
) -> None:
    failed = {case["id"]: results[case["id"]][1] for case in cases if results[case["id"]][0] != "pass"}
    known = _known_failures()
    assert {key: failed[key] for key in failed.keys() - known.keys()} == {}
    assert sorted(known.keys() - failed.keys()) == []


def test_floors(cases: list[dict[str, Any]], results: dict[str, tuple[str, str]]) -> None:
    passed = [case for case in cases if results[case["id"]][0] == "pass"]
    assert len(passed) >= FLOOR_ALL
    assert sum(case["agreed"] for case in passed) >= FLOOR_AGREED


def test_every_known_failure_has_a_reason() -> None:
    assert all(len(reason.split()) > 3 for reason in _known_failures().values())
