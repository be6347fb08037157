"""Modules that have moved: an import from the old place works, or says in one line where to."""

from __future__ import annotations

from importlib import import_module

import pytest

from drlsl.moved import MOVED


@pytest.mark.parametrize("old", MOVED)
def test_an_old_module_says_where_it_went(old: str) -> None:
    parts = old.split(".")
    first = next(name for name in map(".".join, (parts[:n] for n in range(1, 9))) if name in MOVED)
    with pytest.raises(ModuleNotFoundError) as refused:
        import_module(old)
    assert str(refused.value) == f"{first} has moved; import from {MOVED[first]} instead"
    assert refused.value.name == first
    import_module(MOVED[old])


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("drlsl", "Shield"),
        ("drlsl.driving", "HighwayVectorEnv"),
        ("drlsl.driving.scene", "Scene"),
        ("drlsl.driving.shield", "Shield"),
        ("drlsl.driving.shield", "RuleFailure"),
        ("drlsl.logic", "Engine"),
    ],
)
def test_what_the_readme_of_0_1_imports_is_still_there(module: str, name: str) -> None:
    assert getattr(import_module(module), name).__name__ == name


def test_a_module_that_never_was_is_not_found_as_ever() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"No module named 'drlsl\.driving\.nowhere'"):
        import_module("drlsl.driving.nowhere")
