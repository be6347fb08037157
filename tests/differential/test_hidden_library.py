"""A program's own definition of a library predicate or builtin is what every tier takes, or is refused."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from drlsl.logic import Engine, PrologError
from drlsl.logic.core import CONTROL_BUILTINS, builtin_indicators
from drlsl.logic.loading import library
from drlsl.logic.loading.consult import STANDARD
from drlsl.lowering.backends import Rows, compile_numpy, compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.frontend.goals import RULES
from drlsl.lowering.ir import Relation, Schema

SPEED = Relation("speed", ("float",), single=True)
SCHEMA = Schema([SPEED])
ASK = Query("ask", 0, "holds")

QUALIFIED = (":", 2)  # before a head it is the name of a module, and the clause is one of what follows
CONTROL = sorted({*CONTROL_BUILTINS, ("|", 2)} - {QUALIFIED})
OTHERS = sorted({*builtin_indicators(), *RULES, *library().exports} - {*CONTROL, QUALIFIED})


def goal(name: str, arity: int) -> str:
    quoted = "'" + name.replace("\\", "\\\\").replace("'", "\\'") + "'"
    return f"{quoted}({', '.join(f'a{n}' for n in range(arity))})" if arity else quoted


def engine_with(name: str, arity: int) -> Engine:
    engine = Engine()
    engine.consult_text(
        f":- dynamic(speed/1).\n\n{goal(name, arity)} :- speed(V), V > 20.0.\nask :- {goal(name, arity)}.\n",
        "program",
    )
    return engine


def answers(engine: Engine, speed: float) -> dict[str, bool]:
    """What each tier says, the interpreter cold and compiled."""
    result = {}
    engine.replace_facts("speed", 1, [(speed,)])
    prepared = engine.prepare("ask")
    result["interpreter"] = prepared.holds()
    for _ in range(60):
        result["compiled"] = prepared.holds()
    lowered = lower(engine, SCHEMA, [ASK])
    (result["scalar"],) = compile_scalar(lowered)({("speed", 1): [(speed,)]})
    arrays = compile_numpy(lowered)({("speed", 1): Rows([np.array([speed])])})
    result["arrays"] = bool(arrays.answers[0].value[0])
    pytest.importorskip("z3", reason="the extra verify")
    from drlsl.verify.smt import Algebra, Formula, Row

    algebra = Algebra()
    row = Row(algebra.booleans.true, (algebra.ring.const(Fraction(speed)),))
    truth = Formula(algebra, {("speed", 1): [row]}).truth(lowered.answers[0].found)
    result["proofs"] = truth.op == "true"
    return result


@pytest.mark.parametrize(("name", "arity"), CONTROL, ids=lambda part: str(part))
def test_control_constructs_are_not_defined_anew(name: str, arity: int) -> None:
    with pytest.raises(PrologError) as refusal:
        engine_with(name, arity)
    assert "permission" in str(refusal.value)
    assert "program:3" in str(refusal.value)


@pytest.mark.parametrize(("name", "arity"), OTHERS, ids=lambda part: str(part))
def test_every_tier_takes_the_programs_own(name: str, arity: int) -> None:
    if f"{name}/{arity}" in STANDARD:
        with pytest.raises(PrologError, match="permission"):
            engine_with(name, arity)
        return
    engine = engine_with(name, arity)
    for speed, expected in ((30.0, True), (10.0, False)):
        found = answers(engine, speed)
        assert set(found.values()) == {expected}, found


def test_the_library_keeps_its_own() -> None:
    """A library clause calls the library's memberchk/2, and what is passed to it is the program's."""
    engine = Engine()
    engine.consult_text(
        ":- dynamic(speed/1).\n"
        "memberchk(_, _) :- speed(V), V > 20.0.\n"
        "ask :- subtract([a, b], [b], L), L == [a], maplist(memberchk(x), [y, z]).\n"
    )
    for speed, expected in ((30.0, True), (10.0, False)):
        found = answers(engine, speed)
        assert set(found.values()) == {expected}, found


@pytest.mark.parametrize(
    ("clauses", "expected"),
    [
        ("p(G) :- G. p(_) :- speed(_). ask :- p(( speed(V), !, V > 99.0 )).", True),
        ("p(G) :- ( G ; speed(_) ). ask :- p(( speed(V) -> V > 99.0 )).", True),
        ("p(G) :- ( speed(_), G ; speed(_) ). ask :- p(( !, fail )).", True),
        ("p(G) :- call(( member(X, [1, 2]), G, X > 1 )). ask :- p(!).", False),
    ],
)
def test_a_cut_in_a_variable_is_local(clauses: str, expected: bool) -> None:
    engine = Engine()
    engine.consult_text(":- dynamic(speed/1).\n" + clauses)
    assert set(answers(engine, 30.0).values()) == {expected}
