"""Hypothesis strategies for rule programs over a small set of facts, and for the facts."""

from __future__ import annotations

from dataclasses import dataclass, field

from hypothesis import strategies as st

from drlsl.lowering.ir import Relation, Schema

SCHEMA = Schema(
    [
        Relation(
            "car", ("atom", "int", "float", "float"), key=0, first="ego", fields=("id", "slot", "x", "v")
        ),
        Relation("slot", ("int", "atom", "float"), key=0, capacity=8, fields=("slot", "side", "w")),
        Relation("seen", ("int", "float"), fields=("n", "z")),
        Relation("limit", ("float",), single=True),
        Relation("steps", ("int",), single=True),
    ]
)

TABLES = """
weight(near, 1.5). weight(far, 0.25). weight(gone, -2.0).
rank(a, 1). rank(b, 2). rank(b, 3).
mixed(1). mixed(2.5). mixed(2).
"""

FUNCTIONS = ("abs", "sqrt", "sign", "float", "floor", "round", "truncate", "ceiling", "exp", "atan")
NUMBERS = ("float", "int")


@dataclass
class Scope:
    """The variables bound so far in a clause, by kind, and how many were made."""

    bound: dict[str, list[str]] = field(
        default_factory=lambda: {"key": [], "int": [], "float": [], "side": []}
    )
    made: list[int] = field(default_factory=lambda: [0])

    def fresh(self) -> str:
        self.made[0] += 1
        return f"V{self.made[0]}"

    def inner(self) -> Scope:
        """A scope for goals whose bindings do not come out."""
        return Scope({kind: list(names) for kind, names in self.bound.items()}, self.made)


CONSTANTS = {
    "key": ("ego", "c1", "nobody"),
    "int": ("0", "1", "2", "-3"),
    "float": ("0.0", "1.0", "0.5", "-2.0", "3.25", "1.0e-31", "1.0e15"),
    "side": ("left", "right"),
}


@st.composite
def operands(draw: st.DrawFn, scope: Scope, kind: str) -> str:
    """A bound variable or a constant."""
    return draw(st.sampled_from([*scope.bound[kind], *CONSTANTS[kind]]))


@st.composite
def arguments(draw: st.DrawFn, scope: Scope, kind: str) -> str:
    """An argument of a goal: a fresh variable most of the time, which is bound from then on."""
    choice = draw(st.integers(0, 9))
    if choice < 6:
        name = scope.fresh()
        scope.bound[kind].append(name)
        return name
    if choice < 8:
        return "_"
    return draw(operands(scope, kind))


@st.composite
def expressions(draw: st.DrawFn, scope: Scope, depth: int = 2) -> str:
    """An arithmetic expression; it need not have a value."""
    kind = draw(st.sampled_from(NUMBERS))
    if depth == 0 or draw(st.integers(0, 2)) == 0:
        return draw(operands(scope, kind))
    left = draw(expressions(scope, depth - 1))
    name = draw(
        st.sampled_from([*"+-*+-*/", "min", "max", "//", "mod", "rem", "div", "**", "^", "-u", *FUNCTIONS])
    )
    if name in FUNCTIONS:
        return f"{name}({left})"
    if name == "-u":
        return f"-({left})"
    if name in ("**", "^"):
        return f"({left}) {name} {draw(st.sampled_from(['2', '3', '2.0', '0.5', '-0.5', '-2.0', '-1']))}"
    right = draw(expressions(scope, depth - 1))
    return f"{name}({left}, {right})" if name in ("min", "max") else f"({left}) {name} ({right})"


@st.composite
def facts_goals(draw: st.DrawFn, scope: Scope) -> str:
    """A goal of a fact relation or a table."""
    name, kinds = draw(
        st.sampled_from(
            [
                ("car", ("key", "int", "float", "float")),
                ("car", ("key", "int", "float", "float")),
                ("slot", ("int", "side", "float")),
                ("seen", ("int", "float")),
                ("limit", ("float",)),
                ("steps", ("int",)),
                ("weight", (None, "float")),
                ("rank", (None, "int")),
            ]
        )
    )
    args = [
        draw(arguments(scope, kind)) if kind else draw(st.sampled_from(["_", "b", "near"])) for kind in kinds
    ]
    return f"{name}({', '.join(args)})"


@st.composite
def calls(draw: st.DrawFn, scope: Scope, known: list[tuple[str, tuple[str, ...]]]) -> str:
    """A goal of a predicate defined before."""
    name, kinds = draw(st.sampled_from(known))
    args = [draw(arguments(scope, kind)) for kind in kinds]
    return f"{name}({', '.join(args)})" if args else name


@st.composite
def goals(draw: st.DrawFn, scope: Scope, known: list[tuple[str, tuple[str, ...]]], depth: int = 2) -> str:
    """Any goal."""
    choice = draw(st.integers(0, 19 if depth else 9))
    if choice < 4:
        return draw(facts_goals(scope))
    if choice < 6 and known:
        return draw(calls(scope, known))
    if choice < 8:
        sign = draw(st.sampled_from(["<", ">", "=<", ">=", "=:=", "=\\="]))
        return f"{draw(expressions(scope, 1))} {sign} {draw(expressions(scope, 1))}"
    if choice < 10:
        kind = draw(st.sampled_from(["key", "int", "float", "side"]))
        sign = draw(st.sampled_from(["=", "==", "\\==", "\\="]))
        return f"{draw(operands(scope, kind))} {sign} {draw(operands(scope, kind))}"
    if choice < 12:
        value = draw(expressions(scope))
        name = scope.fresh()
        # its kind depends on the facts: what comes after may be a type error
        scope.bound[draw(st.sampled_from(NUMBERS))].append(name)
        return f"{name} is {value}"
    return draw(nested(scope, known, depth - 1))


@st.composite
def nested(draw: st.DrawFn, scope: Scope, known: list[tuple[str, tuple[str, ...]]], depth: int) -> str:
    """A goal made of goals."""
    form = draw(
        st.sampled_from(
            ["not", "if", "or", "once", "ignore", "forall", "count", "min", "max", "sum", "member", "soft"]
        )
    )
    inner = scope.inner()
    first = draw(bodies(inner, known, depth, most=2))
    if form == "not":
        return f"\\+ ( {first} )"
    if form in ("once", "ignore"):
        scope.bound = inner.bound if form == "once" else scope.bound
        return f"{form}(( {first} ))"
    if form == "forall":
        return f"forall(( {first} ), ( {draw(bodies(inner, known, 0, most=1))} ))"
    if form in ("if", "or", "soft"):
        then = draw(bodies(inner, known, depth, most=1))
        other = draw(bodies(scope.inner(), known, depth, most=1))
        arrow = {"if": "->", "soft": "*->", "or": ","}[form]
        cuts = draw(st.sampled_from([("", ""), ("", ""), (", !", ""), ("", ", !")]))
        if form != "or" and draw(st.booleans()):
            return f"( {first} {arrow} {then}{cuts[0]} )"
        return f"( {first} {arrow} {then}{cuts[0]} ; {other}{cuts[1]} )"
    name = scope.fresh()
    scope.bound["int" if form == "count" else "float"].append(name)
    if form == "member":
        return f"member({name}, [1.0, 2.5, -1.0])"
    value = draw(operands(inner, "float"))
    if form in ("min", "max") and draw(st.booleans()):
        witness = draw(operands(inner, "key"))
        return f"aggregate_all({form}({value}, {witness}), ( {first} ), {form}({name}, _))"
    return f"aggregate_all({'count' if form == 'count' else f'{form}({value})'}, ( {first} ), {name})"


@st.composite
def bodies(
    draw: st.DrawFn, scope: Scope, known: list[tuple[str, tuple[str, ...]]], depth: int, most: int = 4
) -> str:
    """A conjunction."""
    return ", ".join(draw(goals(scope, known, depth)) for _ in range(draw(st.integers(1, most))))


@st.composite
def clauses(
    draw: st.DrawFn, name: str, kinds: tuple[str, ...], known: list[tuple[str, tuple[str, ...]]]
) -> str:
    """A clause whose head gets its arguments from the body."""
    scope = Scope()
    parts = [draw(goals(scope, known)) for _ in range(draw(st.integers(1, 3)))]
    if draw(st.integers(0, 2)) == 0:
        parts.insert(draw(st.integers(0, len(parts))), "!")
    head = [draw(operands(scope, kind)) for kind in kinds]
    return f"{name}({', '.join(head)}) :- {', '.join(parts)}." if head else f"{name} :- {', '.join(parts)}."


@st.composite
def programs(draw: st.DrawFn) -> tuple[str, list[tuple[str, int]]]:
    """The text of a program and its predicates."""
    known: list[tuple[str, tuple[str, ...]]] = []
    text = [TABLES]
    for number in range(draw(st.integers(1, 3))):
        kinds = tuple(draw(st.lists(st.sampled_from(["float", "int", "key"]), max_size=2)))
        for _ in range(draw(st.integers(1, 3))):
            text.append(draw(clauses(f"p{number}", kinds, known)))
        known.append((f"p{number}", kinds))
    return "\n".join(text), [(name, len(kinds)) for name, kinds in known]


_SMALL = st.sampled_from([0.0, 1.0, -1.0, 0.5, 2.5, 1.5, 3.25, -0.0, 1e-3])
_FLOATS = st.one_of(_SMALL, st.floats(-50.0, 50.0, allow_nan=False))
_INTS = st.integers(-2, 4)


@st.composite
def facts(draw: st.DrawFn, most: int = 4) -> dict[tuple[str, int], list[tuple[object, ...]]]:
    """Facts of the schema, with many equal values."""
    names = ["ego", *(f"c{n}" for n in range(draw(st.integers(0, most))))]
    slots = draw(st.lists(_INTS, unique=True, max_size=3))
    return {
        ("car", 4): [(name, draw(_INTS), draw(_FLOATS), draw(_FLOATS)) for name in names],
        ("slot", 3): [
            (slot, draw(st.sampled_from(["left", "right", "middle"])), draw(_FLOATS)) for slot in slots
        ],
        ("seen", 2): draw(st.lists(st.tuples(_INTS, _FLOATS), max_size=3)),
        ("limit", 1): [(draw(_FLOATS),)],
        ("steps", 1): [(draw(_INTS),)],
    }
