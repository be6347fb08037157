"""Definite clause grammars: ``-->`` rules as clauses.

Source: ISO/IEC TS 13211-3.
"""

from __future__ import annotations

from drlsl.logic.core.nesting import Deep, run_deep
from drlsl.logic.errors import instantiation_error, type_error
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref


def translate_rule(rule: Struct) -> Struct:
    """Return the clause of ``Head --> Body``; `Head` may push a list back: ``Head, PushBack --> Body``."""
    head, body = deref(rule.args[0]), rule.args[1]
    before, after = Var("S0"), Var("S")
    if type(head) is Struct and head.name == "," and len(head.args) == 2:
        middle = Var("S1")
        head, push_back = head.args
        goal = Struct(
            ",", (translate_body(body, before, middle), _terminals(deref(push_back), after, middle))
        )
        return Struct(":-", (_nonterminal(head, before, after), goal))
    return Struct(":-", (_nonterminal(head, before, after), translate_body(body, before, after)))


def translate_body(body: Term, before: Term, after: Term) -> Term:
    """Return the goal of a grammar body, between two states of the list."""
    return run_deep(_translate(body, before, after))


def _translate(body: Term, before: Term, after: Term) -> Deep[Term]:
    body = deref(body)
    if type(body) is Var:
        return Struct("phrase", (body, before, after))
    if type(body) is str:
        return _terminals(body, before, after)
    if body is NIL:
        return Struct("=", (before, after))
    if type(body) is Atom and body.name == "!":
        return Struct(",", (body, Struct("=", (before, after))))
    if type(body) is Struct:
        special = yield _translate_control(body, before, after)
        if special is not None:
            return special  # type: ignore[no-any-return]  # a term
    return _nonterminal(body, before, after)


def _translate_control(body: Struct, before: Term, after: Term) -> Deep[Term | None]:
    name, args = body.name, body.args
    if name == "." and len(args) == 2:
        return _terminals(body, before, after)
    if len(args) == 2 and name in (",", "->"):
        middle = Var("S1")
        left = yield _translate(args[0], before, middle)
        right = yield _translate(args[1], middle, after)
        return Struct(name, (left, right))
    if len(args) == 2 and name in (";", "|"):
        left = yield _translate(args[0], before, after)
        right = yield _translate(args[1], before, after)
        return Struct(";", (left, right))
    if name == "\\+" and len(args) == 1:
        inner = yield _translate(args[0], before, Var())
        return Struct(",", (Struct("\\+", (inner,)), Struct("=", (before, after))))
    if name == "{}" and len(args) == 1:
        return Struct(",", (args[0], Struct("=", (before, after))))
    if name == "call":
        return Struct("call", (*args, before, after))
    return None


def _nonterminal(head: Term, before: Term, after: Term) -> Term:
    head = deref(head)
    if type(head) is Struct:
        return Struct(head.name, (*head.args, before, after))
    if type(head) is Atom:
        return Struct(head.name, (before, after))
    raise instantiation_error() if type(head) is Var else type_error("callable", head)


def _terminals(terminals: Term, before: Term, after: Term) -> Term:
    """Return the goal that ``before`` is the list of terminals followed by ``after``."""
    if type(terminals) is str:
        items: list[Term] = [ord(character) for character in terminals]
    else:
        items = []
        rest = deref(terminals)
        while type(rest) is Struct and rest.name == "." and len(rest.args) == 2:
            items.append(rest.args[0])
            rest = deref(rest.args[1])
        if rest is not NIL:
            raise instantiation_error() if type(rest) is Var else type_error("list", terminals)
    result: Term = after
    for item in reversed(items):
        result = Struct(".", (item, result))
    return Struct("=", (before, result))
