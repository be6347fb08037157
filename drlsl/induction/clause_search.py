"""The exact search for clauses, by clingo: no unsafe row covered, the most safe ones, and few literals."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from drlsl.errors import UserError
from drlsl.induction.search_problem import LearntClause, SearchProblem
from drlsl.traffic import Integers

if TYPE_CHECKING:
    import clingo

SECONDS: Final = 60.0
"""How long to search for a better choice of clauses, or for the proof that there is none [s]."""

_SLICE: Final = 0.2
"""How long to wait for clingo before looking whether the user has pressed Ctrl-C [s]."""

_CLAUSES: Final = """
clause(1..clauses).
{ used(C) } :- clause(C).
:- used(C), C > 1, not used(C-1).
{ least(C,Q,I) : I = 1..N } :- clause(C), limits(Q,N).
:- least(C,Q,I), I > 1, not least(C,Q,I-1).
:- least(C,Q,1), not used(C).
literal(C,Q) :- least(C,Q,1).
:- clause(C), #count { Q : literal(C,Q) } > literals.
misses(C,S) :- fails(S,Q,I), least(C,Q,I).
covered(S) :- safe(S,_), used(C), not misses(C,S).
asked(C,N) :- used(C), N = #count { I : least(C,first,I) }.
:- asked(C,N), asked(C+1,M), N < M.
#maximize { W@2,S : covered(S), safe(S,W) }.
#minimize { 1@1,C,Q : literal(C,Q) }.
#defined safe/2.
#defined fails/3.
#show least/3.
#show used/1.
"""
"""`least(C,Q,I)`: clause C asks the I-th limit of quantity Q, and those below it."""


@dataclass(frozen=True, slots=True)
class Found:
    """Clauses, best first, the number of safe rows that they cover, and whether no choice is better."""

    clauses: tuple[LearntClause, ...]
    safe: int
    optimal: bool
    seconds: float


def search(problem: SearchProblem, *, clauses: int, literals: int, seconds: float = SECONDS) -> Found:
    """Return the best choice found of at most `clauses` clauses of at most `literals` literals each.

    First the best clause is searched, then the best one for what is left, then the best one in place of each;
    what they cover is where the search for all clauses together begins, which ends after `seconds` [s].

    Raises:
        UserError: there can be no such clause, or clingo is not installed.
    """
    for number, word in ((clauses, "--clauses"), (literals, "--literals")):
        if number < 1:
            raise UserError(f"{word} {number}: expected 1 or more")
    begun = time.perf_counter()
    deadline = begun + seconds
    one_by_one = _OneByOne(problem, literals, deadline)
    chosen = one_by_one.choices(clauses)
    if not problem.safe_count - problem.contradicted:
        raise UserError(
            f"no safe example can be offered: each of the {problem.safe_count} is at most as easy, on "
            "every quantity, as an unsafe one; see whether the declared directions, more and less, are right"
        )
    if not chosen and not one_by_one.exhaustive:
        raise UserError(f"no clause was found within {seconds:g} s; allow more with --search-time")
    if not chosen:
        raise UserError(
            f"no clause of {literals} literal{'s' * (literals > 1)} leaves out all {problem.unsafe_count} "
            "unsafe examples and offers a safe one; allow more with --literals, or declare other "
            "quantities"
        )
    optimal = one_by_one.exhaustive and clauses == 1
    if not optimal:
        better, optimal = _together(problem, chosen, clauses, literals, deadline)
        chosen = better or chosen
    kept = [choice for choice in chosen if problem.covers(choice).any()]
    return Found(
        tuple(problem.clause(choice.tolist()) for choice in kept),
        _weight(problem, kept),
        optimal,
        time.perf_counter() - begun,
    )


def _weight(problem: SearchProblem, chosen: Sequence[Integers]) -> int:
    """Return the number of safe rows that some of the chosen clauses cover."""
    met = np.zeros(len(problem.safe), dtype=np.bool_)
    for choice in chosen:
        met |= problem.covers(choice)
    return int(problem.weights[met].sum())


class _OneByOne:
    """The best single clause for what the others leave, again and again until nothing changes."""

    def __init__(self, problem: SearchProblem, literals: int, deadline: float) -> None:
        self._problem = problem
        self._literals = literals
        self._deadline = deadline
        self.exhaustive = True
        """Whether each of the searches was finished."""

    def choices(self, clauses: int) -> list[Integers]:
        """Return the choices of at most so many clauses, each of which covers something."""
        chosen: list[Integers] = []
        while len(chosen) < clauses:
            best = self._best(chosen)
            if best is None:
                break
            chosen.append(best)
        at, unchanged = 0, 0
        while len(chosen) > 1 and unchanged < len(chosen) and self.exhaustive:
            others = chosen[:at] + chosen[at + 1 :]
            best = self._best(others)
            if best is not None and _weight(self._problem, [*others, best]) > _weight(self._problem, chosen):
                chosen[at], unchanged = best, 0
            else:
                unchanged += 1
            at = (at + 1) % len(chosen)
        return chosen

    def _best(self, others: Sequence[Integers]) -> Integers | None:
        """Return the clause that covers most of what the `others` do not; None if there is none."""
        left = np.ones(len(self._problem.safe), dtype=np.bool_)
        for choice in others:
            left &= ~self._problem.covers(choice)
        if not left.any():
            return None
        solving = _Solving(self._problem, left, 1, self._literals)
        best, exhausted = solving.best(self._deadline)
        self.exhaustive &= exhausted
        if best and (self._problem.covers(best[0]) & left).any():
            return best[0]
        return None


def _together(
    problem: SearchProblem, known: Sequence[Integers], clauses: int, literals: int, deadline: float
) -> tuple[list[Integers] | None, bool]:
    """Return the best choice of all clauses found, if as good as the `known` one, and if none is better."""
    solving = _Solving(problem, np.ones(len(problem.safe), dtype=np.bool_), clauses, literals)
    bound = -_weight(problem, known), sum(int((choice > 0).sum()) for choice in known)
    return solving.best(deadline, bound)


class _Solving:
    """A search by clingo over some patterns of safe rows."""

    def __init__(
        self, problem: SearchProblem, among: np.typing.NDArray[np.bool_], clauses: int, literals: int
    ) -> None:
        try:
            import clingo
        except ImportError as error:
            raise UserError("rules are learnt with clingo: pip install 'drlsl[learn]'") from error
        self._quantities = len(problem.limits)
        constants = {"clauses": clauses, "literals": literals, "first": 0}
        self._control = clingo.Control([f"--const={name}={value}" for name, value in constants.items()])
        self._control.add("base", [], _CLAUSES + "\n".join(_facts(problem, among)))
        self._control.ground([("base", [])])

    def best(
        self, deadline: float, bound: tuple[int, int] | None = None
    ) -> tuple[list[Integers] | None, bool]:
        """Return the best choice that is found before the `deadline`, if any, and if nothing was left to try.

        `bound`: only those at least as good, as costs of the two aims.
        """
        found = None
        if bound is not None:
            self._control.configuration.solve.opt_mode = f"opt,{bound[0]},{bound[1]}"  # type: ignore[union-attr]
        with self._control.solve(yield_=True, async_=True) as solving:
            while True:
                solving.resume()
                while not solving.wait(_SLICE):
                    if time.perf_counter() > deadline:
                        solving.cancel()
                        return found, False
                model = solving.model()
                if model is None:
                    return found, True
                found = self._choices(model)

    def _choices(self, model: clingo.Model) -> list[Integers]:
        """Return the number of limits that each used clause asks of each quantity."""
        found: dict[int, Integers] = {}
        for symbol in model.symbols(shown=True):
            clause, *rest = (argument.number for argument in symbol.arguments)
            asked = found.setdefault(clause, np.zeros(self._quantities, dtype=np.int64))
            if rest:
                asked[rest[0]] = max(asked[rest[0]], rest[1])
        return [found[clause] for clause in sorted(found)]


def _facts(problem: SearchProblem, among: np.typing.NDArray[np.bool_]) -> Iterator[str]:
    """Yield the facts of the patterns `among` the safe ones, and a constraint for each hardest unsafe row."""
    most = [len(limits) for limits in problem.limits]
    yield from (f"limits({quantity},{count})." for quantity, count in enumerate(most))
    for place, (row, weight) in enumerate(zip(problem.safe[among], problem.weights[among], strict=True)):
        yield f"safe({place},{weight})."
        for quantity, rank in enumerate(row.tolist()):
            if rank < most[quantity]:
                yield f"fails({place},{quantity},{rank + 1})."
    for row in problem.hardest.tolist():
        wanted = [f"not least(C,{q},{rank + 1})" for q, rank in enumerate(row) if rank < most[q]]
        yield f":- used(C), {', '.join(wanted)}."
