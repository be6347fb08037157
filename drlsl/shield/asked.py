"""The goals that a shield asks of a rule program, and the actions that its clauses are about."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from drlsl.errors import UserError
from drlsl.logic import Engine, PrologError
from drlsl.logic.terms import Atom, Struct, Var, deref, format_term


def with_arguments(name: str, arity: int) -> str:
    """Return the problem with an action that is a term with arguments."""
    return (
        f"the rules name the action {name}/{arity}, a term with arguments; an action is a name alone, "
        f"such as {name}_left"
    )


@dataclass(frozen=True, slots=True)
class Asked:
    """A goal whose arguments are variables, each another; `action` is the place of the action."""

    name: str
    arity: int
    action: int = 0

    def __str__(self) -> str:
        return f"{self.name}/{self.arity}"


def read_asked(engine: Engine, text: str, parameter: str, variables: int) -> Asked:
    """Return the goal of `text`, the value of a `parameter`; one of its `variables` is `Action`, if several.

    Raises:
        UserError: it is no such goal.
    """
    shape = "offered(Action)" if variables == 1 else "objection(Action, Reason)"
    expected = f"expected a goal whose arguments are variables, such as {shape}"
    if not isinstance(text, str):
        raise UserError(f"{parameter} is {text!r}; {expected}")
    try:
        goal = deref(engine.read_goal(text).term)
    except PrologError as error:
        raise UserError(f"{parameter} is {text!r}, which is no goal: {str(error).splitlines()[0]}") from error
    arguments = [deref(each) for each in goal.args] if isinstance(goal, Struct) else []
    names = [each.name for each in arguments if isinstance(each, Var)]
    if not isinstance(goal, Struct) or len(names) != len(arguments) or len(names) != variables:
        raise UserError(f"{parameter} is {text!r}; {expected}")
    if len({id(each) for each in arguments}) < variables:
        raise UserError(f"{parameter} is {text!r}, in which two arguments are one; {expected}")
    if variables > 1 and "Action" not in names:
        raise UserError(f"{parameter} is {text!r}, in which no argument is called Action; {expected}")
    return Asked(goal.name, variables, names.index("Action") if variables > 1 else 0)


def clauses_about_others(
    engine: Engine, asked: Asked, problem_with: Callable[[str], str]
) -> Iterator[tuple[str, str]]:
    """Yield the place of each clause whose head names an action with a problem, and the problem.

    Nothing else would tell: a misspelt action is never offered, and an objection to it takes none away.
    """
    for clause in engine.clauses(asked.name, asked.arity):
        head = deref(clause.head)
        assert isinstance(head, Struct)
        action = deref(head.args[asked.action])
        if isinstance(action, Var):
            continue
        if isinstance(action, Struct):
            yield str(clause.span or "asserted"), f"{asked}: {with_arguments(action.name, len(action.args))}"
            continue
        name = action.name if isinstance(action, Atom) else format_term(action, engine.operators)
        if problem := problem_with(name):
            yield str(clause.span or "asserted"), f"{asked}: {problem}"
