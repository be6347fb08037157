"""Measure a training in one library: python -m tests.interop.measure NAME prints a line of JSON."""

from __future__ import annotations

import json
import sys
from importlib import import_module
from importlib.metadata import version
from time import process_time

import drlsl  # noqa: F401  (registers the environment)
from tests.interop.taken import told

STEPS = 1000


def measure(name: str) -> dict[str, object]:
    """The steps, those not offered, and the steps per second of processor time; and what bypasses masks."""
    used = import_module(f"tests.interop.use_{name}")
    found: dict[str, object] = {"library": used.LIBRARY, "version": version(used.LIBRARY)}
    used.train(0, 100, vector=False)  # what is loaded and compiled once
    for kind in ("single", "vector"):
        began = process_time()
        with told() as taken:
            used.train(1, STEPS, vector=kind == "vector")
        steps = len(taken.actions)
        found[kind] = {
            "steps": steps,
            "not_offered": taken.refused,
            "steps_per_second": round(steps / (process_time() - began)),
        }
    bypasses = {}
    for title, bypass in used.BYPASSES.items():
        with told() as taken:
            bypass()
        bypasses[title] = f"{taken.refused} of {len(taken.actions)}"
    return {**found, "bypasses": bypasses}


if __name__ == "__main__":
    sys.__stdout__.write("\n" + json.dumps(measure(sys.argv[1])) + "\n")  # type: ignore[union-attr]  # there is one
