"""What tests ask of an engine."""

from __future__ import annotations

from drlsl.logic import Engine


def values(engine: Engine, goal: str, name: str = "X") -> list[object]:
    return [solution[name] for solution in engine.query(goal)]
