"""The search: equal to brute force on small problems, and plain about what cannot be."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.induction import Found, LearntClause, Quantity, SearchProblem, covered, search
from drlsl.induction.quantities import EASIEST
from drlsl.traffic import Integers

QUANTITIES = tuple(
    Quantity(f"q{n}({{choice}}, {{number}})", "less" if n % 2 else "more", 1.0) for n in range(8)
)


def problem_of(safe: Integers, unsafe: Integers) -> SearchProblem:
    return SearchProblem(QUANTITIES[: safe.shape[1]], safe, unsafe)


def brute_force(safe: Integers, unsafe: Integers, clauses: int, literals: int) -> tuple[int, int]:
    """The most safe rows that can be covered, and the fewest literals that do."""
    round_limits = QUANTITIES[0].round_limits
    choices: list[list[int | None]] = []
    for column in unsafe.T:
        above = {
            int(round_limits[np.searchsorted(round_limits, ease, side="right")])
            for ease in column[column < EASIEST].tolist()
        }
        choices.append([None, *sorted(above)])
    single = [
        clause
        for limits in itertools.product(*choices)
        if (clause := LearntClause(limits)).literals <= literals and not clause.covers(unsafe).any()
    ]
    best = (0, 0)
    for count in range(1, clauses + 1):
        for several in itertools.combinations(single, count):
            met = int(covered(several, safe).sum())
            best = max(best, (met, -sum(clause.literals for clause in several)))
    return best[0], -best[1]


def random_rows(rng: np.random.Generator, count: int, quantities: int) -> Integers:
    rows = rng.integers(-4, 5, size=(count, quantities)) * 100 + rng.integers(-1, 2, size=(count, quantities))
    return np.where(rng.random((count, quantities)) < 0.1, EASIEST, rows)


def outcome(safe: Integers, unsafe: Integers, clauses: int, literals: int) -> Found | None:
    """What is found; None if nothing can be."""
    try:
        return search(problem_of(safe, unsafe), clauses=clauses, literals=literals)
    except UserError:
        return None


@pytest.mark.parametrize("part", range(4))
def test_the_search_equals_brute_force(part: int) -> None:
    """On 200 small random problems."""
    found_any = 0
    for seed in range(50 * part, 50 * part + 50):
        rng = np.random.default_rng(seed)
        quantities, clauses = int(rng.integers(1, 4)), int(rng.integers(1, 3))
        literals = int(rng.integers(1, quantities + 1))
        safe = random_rows(rng, int(rng.integers(1, 12)), quantities)
        unsafe = random_rows(rng, int(rng.integers(1, 5)), quantities)
        wanted = brute_force(safe, unsafe, clauses, literals)
        found = outcome(safe, unsafe, clauses, literals)
        if not wanted[0]:
            assert found is None, seed
            continue
        found_any += 1
        assert found is not None, seed
        assert found.optimal, seed
        assert not covered(found.clauses, unsafe).any(), seed
        assert found.safe == covered(found.clauses, safe).sum(), seed
        assert (found.safe, sum(one.literals for one in found.clauses)) == wanted, seed
    assert found_any > 15


def test_of_unsafe_rows_only_the_hardest_count() -> None:
    rng = np.random.default_rng(5)
    safe, unsafe = random_rows(rng, 60, 3), random_rows(rng, 40, 3)
    unsafe = unsafe[(unsafe < EASIEST).any(axis=1)]
    problem = problem_of(safe, unsafe)
    assert len(problem.hardest) < len(unsafe)
    few = problem_of(safe, unsafe[problem.hardest_rows])
    found = [search(one, clauses=2, literals=3, seconds=20.0) for one in (problem, few)]
    assert found[0].safe == found[1].safe
    assert not covered(found[1].clauses, unsafe).any()


def rows(*values: Sequence[int]) -> Integers:
    return np.array(values, dtype=np.int64)


def test_a_contradiction_of_a_declared_direction_is_named() -> None:
    problem = problem_of(rows((100, 100), (900, 900)), rows((300, 300)))
    assert problem.contradicted == 1
    assert problem.contradiction == (0, 0)


@pytest.mark.parametrize(
    ("safe", "unsafe", "clauses", "literals", "why"),
    [
        ([], [(100, 100)], 1, 1, "no safe example, only unsafe ones"),
        ([(100, 100)], [], 1, 1, "no unsafe example, only safe ones"),
        ([(100, 100)], [(300, 300)], 1, 2, "no safe example can be offered: each of the 1 is at most as"),
        (
            [(100, 100)],
            [(EASIEST, EASIEST)],
            1,
            1,
            "unsafe examples concern nothing that a declared",
        ),
        ([(900, 900)], [(100, EASIEST), (EASIEST, 100)], 1, 1, "no clause of 1 literal leaves out all 2"),
        ([(900, 900)], [(100, 100)], 0, 1, "--clauses 0: expected 1 or more"),
        ([(900, 900)], [(100, 100)], 1, 0, "--literals 0: expected 1 or more"),
    ],
)
def test_what_cannot_be_learnt_is_told(
    safe: list[tuple[int, int]], unsafe: list[tuple[int, int]], clauses: int, literals: int, why: str
) -> None:
    arrays = [np.array(one, dtype=np.int64).reshape(-1, 2) for one in (safe, unsafe)]
    with pytest.raises(UserError, match=why):
        search(problem_of(*arrays), clauses=clauses, literals=literals)


def test_a_search_that_is_cut_short_says_so() -> None:
    rng = np.random.default_rng(1)
    safe = rng.integers(-100, 100, size=(3000, 8)) * 10
    unsafe = rng.integers(-100, 60, size=(300, 8)) * 10
    found = search(problem_of(safe, unsafe), clauses=4, literals=4, seconds=2.0)
    assert not found.optimal
    assert found.safe > 0
    assert not covered(found.clauses, unsafe).any()
