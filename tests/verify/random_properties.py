"""Property programs made at random, some true, some not: the prover has to find out."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, TypeAlias

RULES: Final = ":- dynamic(vehicle/8).\n:- dynamic(focus/1).\n"
"""Rules that say nothing: the properties speak of the facts alone."""

HELPERS: Final = (
    "ego(V, Y, Vy, L, W) :- vehicle(ego, _, _, Y, V, Vy, L, W).\n"
    "other(Id, D, V, L) :- vehicle(ego, _, X0, _, _, _, _, _), "
    "vehicle(Id, _, X, _, V, _, L, _), Id \\== ego, D is X - X0.\n"
    "kind(V, slow) :- V < 20.0, !.\n"
    "kind(V, medium) :- V < 45.0, !.\n"
    "kind(_, fast).\n"
    "nearest(D) :- aggregate_all(min(A), ( other(_, X, _, _), A is abs(X) ), D).\n"
    "fastest(V) :- aggregate_all(max(W), other(_, _, W, _), V).\n"
    "count_ahead(N) :- aggregate_all(count, ( other(_, D, _, _), D > 0.0 ), N).\n"
    "capped(X, C, Y) :- X > C, !, Y = C.\n"
    "capped(X, _, X).\n"
    "ordered(A, B, A, B) :- A =< B.\n"
    "ordered(A, B, B, A) :- A > B.\n"
)

Interval: TypeAlias = "tuple[float, float]"

EGO: Final[dict[str, Interval]] = {"V": (0, 70), "Vy": (-10, 10), "L": (1, 30), "W": (0.5, 3)}
OTHER: Final[dict[str, Interval]] = {"D": (-300, 300), "U": (-70, 70), "K": (1, 30)}


@dataclass
class Program:
    """A body in the making: its goals, and the variables bound so far with what they may be."""

    rng: random.Random
    goals: list[str] = field(default_factory=list)
    bound: dict[str, Interval] = field(default_factory=dict)

    def new(self, interval: Interval) -> str:
        name = f"X{len(self.bound)}"
        self.bound[name] = interval
        return name

    def leaf(self) -> tuple[str, Interval]:
        if self.rng.random() < 0.25:
            edges = [edge for interval in self.bound.values() for edge in interval if abs(edge) < 1e4]
            value = self.rng.choice([0.0, 0.5, 1.0, 2.0, 3.0, 10.0, -1.0, *edges])
            return number(value), (round(float(value), 6),) * 2
        name = self.rng.choice(list(self.bound))
        return name, self.bound[name]

    def expression(self, depth: int) -> tuple[str, Interval]:
        """An expression that has a value wherever its variables have, and bounds on it."""
        if depth == 0:
            return self.leaf()
        (a, x), (b, y) = (
            self.expression(self.rng.randrange(depth)),
            self.expression(self.rng.randrange(depth)),
        )
        makers: list[Callable[[], tuple[str, Interval]]] = [
            lambda: (f"({a} + {b})", (x[0] + y[0], x[1] + y[1])),
            lambda: (f"({a} - {b})", (x[0] - y[1], x[1] - y[0])),
            lambda: (f"({a} * {b})", _corners([i * j for i in x for j in y])),
            lambda: (f"({a} * {a})", (_least_square(x), max(x[0] * x[0], x[1] * x[1]))),
            lambda: (f"min({a}, {b})", (min(x[0], y[0]), min(x[1], y[1]))),
            lambda: (f"max({a}, {b})", (max(x[0], y[0]), max(x[1], y[1]))),
            lambda: (f"abs({a})", (_least_square(x) ** 0.5, max(abs(x[0]), abs(x[1])))),
            lambda: (f"sqrt(abs({a}))", (_least_square(x) ** 0.25, max(abs(x[0]), abs(x[1])) ** 0.5)),
            lambda: self._quotient(a, b, x, y),
            lambda: self._power(a, x),
        ]
        return self.rng.choice(makers)()

    def _quotient(self, a: str, b: str, x: Interval, y: Interval) -> tuple[str, Interval]:
        """A quotient; its divisor is seldom one that may be 0."""
        if y[0] <= 0 <= y[1] and self.rng.random() < 0.9:
            b, y = f"({b} * {b} + 1.0)", (_least_square(y) + 1.0, max(y[0] * y[0], y[1] * y[1]) + 1.0)
        if y[0] <= 0 <= y[1]:
            return f"({a} / {b})", (-1e9, 1e9)
        return f"({a} / {b})", _corners([i / j for i in x for j in y])

    def _power(self, a: str, x: Interval) -> tuple[str, Interval]:
        exponent = self.rng.choice([2.0, 3.0, 0.5, -1.0, -0.5, 1.5])
        if exponent in (2.0, 3.0):
            ends = [x[0] ** exponent, x[1] ** exponent]
            low = _least_square(x) if exponent == 2.0 else min(ends)
            return f"({a} ** {exponent})", (low, max(ends))
        base, low, high = f"(abs({a}) + 0.5)", _least_square(x) ** 0.5 + 0.5, max(abs(x[0]), abs(x[1])) + 0.5
        return f"({base} ** ({exponent}))", _corners([low**exponent, high**exponent])

    def define(self, depth: int) -> str:
        """Bind a variable to a new value, in one of many ways."""
        rng = self.rng
        (a, x), (b, y) = self.expression(depth), self.expression(depth)
        both = (min(x[0], y[0]), max(x[1], y[1]))
        match rng.choice(["is", "is", "if", "cap", "or", "order"]):
            case "is":
                name = self.new(x)
                self.goals.append(f"{name} is {a}")
            case "if":
                cond = self.comparison(1)
                name = self.new(both)
                self.goals.append(f"( {cond} -> {name} is {a} ; {name} is {b} )")
            case "cap":
                plain, limit = self.new(x), self.new(y)
                name = self.new((min(x[0], y[0]), min(x[1], y[1])))
                self.goals += [f"{plain} is {a}", f"{limit} is {b}", f"capped({plain}, {limit}, {name})"]
            case "or":
                name = self.new(both)
                self.goals.append(f"( {name} is {a} ; {name} is {b} )")
            case _:
                one, two = self.new(x), self.new(y)
                low, name = self.new(both), self.new(both)
                self.goals += [f"{one} is {a}", f"{two} is {b}", f"ordered({one}, {two}, {low}, {name})"]
        return name

    def comparison(self, depth: int) -> str:
        """Any comparison."""
        (a, x), (b, _) = self.expression(depth), self.leaf()
        if self.rng.random() < 0.6:
            share = self.rng.choice([0.0, 0.1, 0.5, 0.9, 1.0])
            b = number(x[0] + share * (x[1] - x[0]))
        return f"{a} {self.rng.choice(['<', '>', '=<', '>='])} {b}"

    def claim(self, name: str) -> str:
        """A comparison that holds seldom: at, within or beyond the bounds of a value."""
        rng, (low, high) = self.rng, self.bound[name]
        room = (high - low) * rng.choice([0.0, 0.0, 0.001, 0.05, 0.3, -0.001, -0.05, -0.2])
        if rng.random() < 0.5:
            return f"{name} {rng.choice(['>', '>='])} {number(high - room)}"
        return f"{name} {rng.choice(['<', '=<'])} {number(low + room)}"


def number(value: float) -> str:
    """A float as Prolog writes it."""
    return f"{value:.6f}"


def _corners(values: list[float]) -> Interval:
    return min(values), max(values)


def _least_square(x: Interval) -> float:
    return 0.0 if x[0] <= 0 <= x[1] else min(x[0] * x[0], x[1] * x[1])


def _rewritten(program: Program) -> tuple[str, str]:
    """An expression, and another that is equal to it, or would be but for a slip."""
    rng = program.rng
    (a, _), (b, _), (c, _) = (program.expression(1) for _ in range(3))
    s, t = f"sqrt(abs({a}) + 1.0)", f"sqrt(abs({b}) + 1.0)"
    d = f"({b} * {b} + 1.0)"
    pairs = [
        (f"({a} + {b}) * {c}", f"{a} * {c} + {b} * {c}"),
        (f"({a} - {b}) * ({a} + {b})", f"{a} * {a} - {b} * {b}"),
        (f"min({a}, {b})", f"-max(-({a}), -({b}))"),
        (f"max({a}, {b}) + min({a}, {b})", f"{a} + {b}"),
        (f"max({a}, {b}) - min({a}, {b})", f"abs({a} - {b})"),
        (f"max({a} + {c}, {b} + {c})", f"max({a}, {b}) + {c}"),
        (f"abs({a}) * abs({b})", f"abs({a} * {b})"),
        (f"{s} * {s}", f"abs({a}) + 1.0"),
        (f"1.0 / {s}", f"{s} / (abs({a}) + 1.0)"),
        (f"(1.0 / {s}) * (1.0 / {s})", f"1.0 / (abs({a}) + 1.0)"),
        (f"{s} * {t}", f"sqrt((abs({a}) + 1.0) * (abs({b}) + 1.0))"),
        (f"({a}) / {d} + ({c}) / {d}", f"({a} + {c}) / {d}"),
        (f"(({a}) / {d}) * {d}", f"{a}"),
        (f"1.0 / (1.0 / {d})", d),
        (f"sqrt({a} * {a})", f"abs({a})"),
        (f"({d}) ** 0.5", f"sqrt({d})"),
        (f"({d}) ** (-1.0)", f"1.0 / {d}"),
        (f"{s} ** 3.0", f"{s} * (abs({a}) + 1.0)"),
    ]
    return rng.choice(pairs)


def _slip(rng: random.Random, text: str) -> str:
    """A text with one sign, function or constant changed."""
    slips = [
        ("+", "-"),
        ("max", "min"),
        ("1.0", "1.01"),
        ("abs", "+"),
        (" * ", " + "),
        ("sqrt", "abs"),
        ("-", "+"),
    ]
    rng.shuffle(slips)
    for old, new in slips:
        places = [n for n in range(len(text)) if text.startswith(old, n)]
        if places:
            place = rng.choice(places)
            return text[:place] + new + text[place + len(old) :]
    return text


def _identity(program: Program) -> list[str]:
    left, right = _rewritten(program)
    if program.rng.random() < 0.4:
        right = _slip(program.rng, right)
    margin = program.rng.choice([0.0, 1e-6, 0.01, 1.0])
    return [f"{left} {program.rng.choice(['<', '>'])} {right} {program.rng.choice('+-')} {number(margin)}"]


def _of_many(program: Program) -> list[str]:
    """A claim about all vehicles at once: least and greatest values, counts, none and every."""
    choice = program.rng.choice
    bound = number(choice([-70, -20, 0, 5, 30, 69, 70]))
    return choice(
        [
            ["nearest(N)", f"other(_, F, _, _), abs(F) < N + {choice([0.0, 0.0, -1.0, 1.0])!r}"],
            ["fastest(N)", f"other(_, _, G, _), G > N - {choice([0.0, 0.0, -1.0, 1.0])!r}"],
            ["nearest(N)", f"\\+ ( other(_, F, _, _), abs(F) =< N + {choice([0.0, 0.0, -1.0, 1.0])!r} )"],
            [
                "count_ahead(N)",
                f"N {choice(['>', '<', '=:='])} {choice([0, 1, 2, 3])}",
                "nearest(M)",
                "M > 290.0",
            ],
            ["count_ahead(N)", f"N > {choice([0, 1, 2])}", "\\+ ( other(_, F, _, _), F > 0.0 )"],
            [f"\\+ ( other(_, _, G, _), G < {bound} )", f"other(_, _, H, _), H < {bound}"],
            [f"forall(other(_, _, G, _), G > {bound})", f"fastest(H), H < {bound}"],
            [
                "aggregate_all(max(G - H), ( other(_, F, G, H), F > 0.0 ), M)",
                f"M > {choice([69.0, 69.5, 71.0])!r}",
            ],
            [
                "aggregate_all(min(F, I), ( other(I, E, _, _), F is E * E ), min(M, J))",
                "other(J, P, _, _)",
                f"P * P {choice(['<', '>', '=:='])} M",
            ],
            [
                f"kind(V, {choice(['slow', 'medium', 'fast'])})",
                f"V {choice(['<', '>=', '>'])} {choice([20.0, 45.0])!r}",
            ],
            [
                "kind(V, Kind)",
                f"other(_, _, G, _), kind(G, Kind), G {choice(['<', '>'])} V + {choice([25.0, 90.0])!r}",
            ],
        ]
    )


def random_program(seed: int) -> str:
    """The text of a file of properties with one property, `p`; the same for the same seed."""
    rng = random.Random(seed)
    clauses = []
    for _ in range(rng.choice([1, 1, 1, 2])):
        program = Program(rng, ["ego(V, _, Vy, L, W)"], dict(EGO))
        kind = rng.choice(["bounds", "bounds", "identity", "many", "mixed"])
        if kind != "many" and rng.random() < 0.4:
            program.goals.append("other(_, D, U, K)")
            program.bound.update(OTHER)
        if rng.random() < 0.3:
            program.goals.append(program.comparison(1))
        if kind == "many":
            program.goals += _of_many(program)
        elif kind == "identity":
            program.goals += _identity(program)
        else:
            for _ in range(rng.choice([1, 1, 2])):
                name = program.define(2)
            program.goals.append(program.claim(name))
            if kind == "mixed":
                program.goals += _of_many(program)
        clauses.append(f"violates(p) :-\n    {', '.join(program.goals)}.\n")
    return f"property(p, 'made at random').\n{HELPERS}{''.join(clauses)}"
