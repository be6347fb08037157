"""The file of learnt rules: clauses that a person can read and sign, each with what it rests on."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from drlsl.induction.examples import Examples
from drlsl.induction.search_problem import LearntClause, SearchProblem

_WIDTH = 130


@dataclass(frozen=True, slots=True)
class FileForm:
    """The words of a file of learnt rules around its clauses.

    `title` says in a line what the file is, `prelude` is Prolog that puts the clauses to use, `head` is their
    head and `about` says what it means.
    """

    title: str
    prelude: str
    head: str
    about: str


@dataclass(frozen=True, slots=True)
class FixedLimit:
    """A limit of a clause: its quantity, and the unsafe example that a looser one would cover.

    `example` is its place among the examples, None if the clause leaves out nothing by this limit alone.
    """

    clause: int
    quantity: int
    ease: int
    example: int | None


def fixed_limits(clauses: Sequence[LearntClause], examples: Examples) -> list[FixedLimit]:
    """Return every limit with the example that fixes it: of those that it alone leaves out, the easiest."""
    places = examples.unsafe_places
    eases = examples.eases[places]
    result = []
    for number, clause in enumerate(clauses):
        for quantity, ease in enumerate(clause.limits):
            if ease is None:
                continue
            without = tuple(None if q == quantity else limit for q, limit in enumerate(clause.limits))
            alone = LearntClause(without).covers(eases).nonzero()[0]
            example = None
            if alone.size:
                example = int(places[alone[np.argmax(eases[alone, quantity])]])
            result.append(FixedLimit(number, quantity, ease, example))
    return result


def clause_text(clause: LearntClause, examples: Examples, form: FileForm) -> str:
    """Return a learnt clause."""
    quantities = examples.bias.quantities
    literals = [
        one.literal(limit, f"V{number}")
        for number, (one, limit) in enumerate(
            ((one, limit) for one, limit in zip(quantities, clause.limits, strict=True) if limit is not None),
            start=1,
        )
    ]
    return f"{form.head} :-\n    " + ",\n    ".join(literals) + "."


def learnt_text(
    clauses: Sequence[LearntClause],
    examples: Examples,
    head: Sequence[str],
    name: str,
    bias: str,
    form: FileForm,
) -> str:
    """Return the text of the rule file `name` of these clauses, on top of the file `bias`.

    `head` are the sentences that introduce it.
    """
    lines = [f"% {name} - {form.title}", "%"]
    for sentence in head:
        lines += _comment(sentence)
    lines += ["", f":- ensure_loaded('{bias}').", "", form.prelude.rstrip(), ""]
    lines += _comment(form.about)
    fixed = fixed_limits(clauses, examples)
    safe = ~examples.unsafe
    before = np.zeros(len(safe), dtype=np.bool_)
    for number, clause in enumerate(clauses):
        own = clause.covers(examples.eases) & safe
        lines += [
            "",
            *_comment(
                f"Clause {number + 1} offers {own.sum():,} of the {safe.sum():,} safe examples, "
                f"{(own & ~before).sum():,} of them as the first; none of the {examples.unsafe.sum():,} "
                "unsafe ones."
            ),
        ]
        before |= own
        for limit in fixed:
            if limit.clause == number:
                lines += _comment(_why(limit, examples), indent="  ")
        lines.append(clause_text(clause, examples, form))
    return "\n".join(lines) + "\n"


def _why(limit: FixedLimit, examples: Examples) -> str:
    """Return the example that fixes a limit, in words."""
    bound = examples.bias.quantities[limit.quantity].bound(limit.ease)
    if limit.example is None:
        return f"{bound}: no unsafe example is left out by this alone"
    return f"{bound}: {examples.words(limit.example)}"


def contradiction_words(problem: SearchProblem, examples: Examples) -> str:
    """Return a safe example and an unsafe one that is as easy on every quantity; there must be such two."""
    assert problem.contradiction is not None
    safe, unsafe = problem.contradiction
    safe_words = examples.words(int((~examples.unsafe).nonzero()[0][safe]))
    unsafe_words = examples.words(int(examples.unsafe_places[unsafe]))
    return f"this one was safe ({safe_words}) and this one was not ({unsafe_words})"


def _comment(text: str, indent: str = "") -> Iterator[str]:
    first = f"% {indent}"
    yield from textwrap.wrap(
        text, _WIDTH, initial_indent=first, subsequent_indent=f"{first}  " if indent else first
    )
