"""Claims that are false, each of which once came out proved."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.verify.claims import EGO_SPEED, outcome

ROOTS = {
    "the inverse of a root": "S is V * V, S > 0.0, S < 50.0, X is 1.0 / sqrt(S), X > 10.0",
    "a product of inverse roots": "V > 0.0, X is (1 / sqrt(V)) * (1 / sqrt(V)), X > 10",
    "a higher power of a root": "X is sqrt(V) * sqrt(V) * sqrt(V), X > 500.0",
    "an inverse under a root": "vehicle(ego, _, _, _, _, _, L, W), "
    "X is sqrt(1.0 / L) * V + sqrt(W), X < 1.0, V > 1.0",
    "a root only on another way": "( V < 30.0 -> X is sqrt(30.0 - V), X * V > 100.0 ; V > 60.0 )",
    "quotients only on another way": "vehicle(ego, _, _, _, _, Vy, L, _), "
    "( V > 0.0 -> X is max(1.0 / V, L / V), X * Vy > 1.0e9 * Vy * Vy + 1.0e9 ; true )",
    "a root in a choice on another way": "( V < 30.0 -> X is max(sqrt(30.0 - V), 1.0) * V ; X is V ), "
    "Y is X * 2.0, Y > 135.0",
}
"""Bodies of a violation that some speed V of the ego fulfils."""


@pytest.mark.parametrize("name", ROOTS)
def test_roots(tmp_path: Path, name: str) -> None:
    result = outcome(tmp_path, f"violates(p) :- {EGO_SPEED}, {ROOTS[name]}.")
    assert result.status == "refuted", result.reason


NAMES = {
    "given": "vehicle(truck, _, _, _, _, _, _, _)",
    "compared": "vehicle(Id, _, _, _, _, _, _, _), Id == truck",
    "in a disjunction": "vehicle(Id, _, _, _, V, _, _, _), ( Id = bus ; Id = truck ), V > 3.0",
    "in a list": "vehicle(Id, _, _, _, _, _, _, _), memberchk(Id, [bus, truck])",
    "in a table": "vehicle(Id, _, _, _, _, _, _, _), heavy(Id)",
    "in a closed world": "vehicle(Id, _, _, _, _, _, _, _), Id \\== ego, \\+ v_name(Id)",
    "two of them": "vehicle(truck, _, _, _, V, _, _, _), vehicle(bus, _, _, _, W, _, _, _), V < W",
    "of the one in focus": "focus(Id), Id == truck",
    "the model's own": "vehicle(v1, _, _, _, V, _, _, _), vehicle(v2, _, _, _, W, _, _, _), V > W",
    "only the second": "vehicle(v2, _, _, _, V, _, _, _), \\+ vehicle(v1, _, _, _, _, _, _, _), V > 1.0",
    "of a lane's direction": "vehicle(D, _, _, _, _, _, _, _), road_lane(1, D, _, _, _)",
    "of nothing": "vehicle(none, _, _, _, _, _, _, _)",
}


@pytest.mark.parametrize("name", NAMES)
def test_a_vehicle_may_have_any_name(tmp_path: Path, name: str) -> None:
    helpers = "heavy(bus). heavy(truck). v_name(v1). v_name(v2). v_name(v3). "
    result = outcome(tmp_path, f"{helpers}violates(p) :- {NAMES[name]}.", vehicles=2)
    assert result.status == "refuted", result.reason


def test_no_two_vehicles_have_one_name(tmp_path: Path) -> None:
    twice = (
        "vehicle(truck, L, _, _, V, _, _, _), vehicle(truck, M, _, _, W, _, _, _), ( L =\\= M ; V =\\= W )"
    )
    assert outcome(tmp_path, f"violates(p) :- {twice}.", vehicles=3).status == "proved"
    ego = "vehicle(Id, _, _, _, _, _, L, _), Id == ego, vehicle(ego, _, _, _, _, _, M, _), L =\\= M"
    assert outcome(tmp_path, f"violates(p) :- {ego}.", vehicles=3).status == "proved"


ERRORS = {
    "overflow of exp": "X is exp(20.0 * V)",
    "overflow of a power": "X is V ** 200.0",
    "overflow of a product": "X is V ** 16.0, Y is X ** 16.0",
    "arc cosine": "X is acos(V)",
    "arc sine": "X is asin(V)",
    "logarithm": "X is log(V - 1.0)",
    "hyperbolic sine": "X is sinh(V * 20.0)",
    "inverse hyperbolic cosine": "X is acosh(V)",
    "inverse hyperbolic tangent": "X is atanh(V)",
    "root": "X is sqrt(V - 1.0)",
    "division": "X is 1.0 / (V - 30.0)",
    "power of a negative number": "X is (V - 1.0) ** 0.5",
    "inverse power of zero": "X is V ** (-1.0)",
}
"""What raises an error at some speed; the violation behind it never comes about."""


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_on_the_way_refutes(tmp_path: Path, name: str) -> None:
    result = outcome(tmp_path, f"violates(p) :- {EGO_SPEED}, {ERRORS[name]}, fail.")
    assert result.status == "refuted", result.reason
    assert result.counterexample is not None
    assert result.counterexample.error is not None


HARMLESS = {
    "exp": "X is exp(V), X < 0.5",
    "power": "X is (V + 1.0) ** 100.0, X < 0.0",
    "arc tangent": "X is atan(V), X > 2.5",
    "tangent": "X is tan(V), X =:= 0.5, V > 80.0",
    "arc cosine in its range": "Y is min(V, 1.0), X is acos(Y), X < -1.0",
    "logarithm of a positive number": "X is log(V + 1.0), X < -0.5",
    "square root of a power": "X is V ** 2.0, X < -0.1",
    "half a power": "V > 1.0, X is V ** 0.5, X < 1.0",
}


@pytest.mark.parametrize("name", HARMLESS)
def test_functions_within_their_domain_raise_nothing(tmp_path: Path, name: str) -> None:
    result = outcome(tmp_path, f"violates(p) :- {EGO_SPEED}, {HARMLESS[name]}.")
    assert result.status.startswith("proved"), result.reason  # some only in real arithmetic
