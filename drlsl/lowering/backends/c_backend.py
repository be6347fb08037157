"""The back end for one scene in C99: no allocation, no recursion, and every loop bounded by a constant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from drlsl.logic.terms import Atom, Struct
from drlsl.lowering.backends.answer_lists import results_of
from drlsl.lowering.backends.curly import CurlyLoops, constant, field_name, support
from drlsl.lowering.backends.expressions import ATOMIC, CHOICE, lookup_value
from drlsl.lowering.frontend import Answer, Lowered, Query, atom_codes
from drlsl.lowering.ir import (
    FLOAT_BOUND,
    INT_BOUND,
    Bag,
    Emit,
    Node,
    NotLowerable,
    Relation,
    Sym,
    emitted,
    relation_of,
    resolve,
)

_TYPES: Final[dict[str, str]] = {
    "bool": "bool",
    "index": "int32_t",
    "atom": "int32_t",
    "int": "double",
    "float": "double",
    "number": "double",
}


@dataclass(frozen=True, slots=True)
class CProgram:
    """A lowered program in C: the types and functions whose names begin with `prefix`.

    `PREFIX_answer(PREFIX_facts *, PREFIX_answers *)` returns whether it could decide. Facts have for each
    relation of `relations` an array of that name, and the number of its rows, NAME_count; the last
    element is for the function to use. Answers have for each query of `queries` a member of that name:
    a bool, or the `count` of its solutions, how many more were left out, and for each solution the
    number of its pattern and its values. `patterns` has by query the terms of each pattern, in which
    nodes stand for the values. Atoms are the numbers in `codes`, which are negative; all others are 0
    or more.
    """

    prefix: str
    types: str
    functions: str
    relations: Mapping[Relation, str]
    queries: Mapping[Query, str]
    patterns: Mapping[Query, Sequence[tuple[Sym, ...]]]
    codes: Mapping[str, int]


def c_program(
    lowered: Lowered,
    prefix: str,
    rows: Mapping[str, int],
    solutions: Mapping[str, int],
    atoms: Sequence[str] = (),
) -> CProgram:
    """Return the program in C; its text needs `c_support`.

    `rows` is how many rows a relation has at most, by name, and `solutions` how many a query of mode all has,
    beyond which they are counted and left out. The codes of `atoms` are -1, -2 and so on, in order.

    Raises:
        NotLowerable: a query's answers hold a list of solutions.
    """
    return _Printer(lowered, prefix, rows, solutions, atoms).program()


def c_support(texts: Sequence[str]) -> str:
    """Return the functions that the texts of programs need."""
    return support("c", texts)


class _Printer(CurlyLoops):
    """Writes the types and functions for one lowered program."""

    infinity, equal, unequal = "INFINITY", "==", "!="
    counter, fixed = "int32_t", "const int32_t"

    def __init__(
        self,
        lowered: Lowered,
        prefix: str,
        most_rows: Mapping[str, int],
        most_solutions: Mapping[str, int],
        atoms: Sequence[str],
    ) -> None:
        super().__init__(lowered, _results(lowered))
        self.prefix = prefix
        constants = [
            name for answer in lowered.answers for leaf in emitted(answer.tree) for name in _names(leaf.terms)
        ]
        codes = atom_codes(lowered, self.reached)
        self.codes = {
            name: -1 - place for place, name in enumerate(dict.fromkeys([*atoms, *codes, *constants]))
        }
        self.most_rows = {
            relation: 1 if relation.single else most_rows[relation.name] for relation in self.rows
        }
        self.queries = {answer.query: self.names.new(answer.query.name) for answer in lowered.answers}
        self.most_solutions = {
            answer.query: _most(answer, most_solutions)
            for answer in lowered.answers
            if answer.query.mode != "holds"
        }
        self.patterns: dict[Query, list[tuple[Sym, ...]]] = {query: [] for query in self.most_solutions}
        self._query: Query | None = None

    def program(self) -> CProgram:
        """Return the program."""
        function = self._function()
        return CProgram(
            self.prefix,
            self._types(),
            "\n".join([*map(self._check, self.rows), *self._finds(function), function]),
            self.rows,
            self.queries,
            self.patterns,
            self.codes,
        )

    def _types(self) -> str:
        lines = []
        for relation, name in self.rows.items():
            lines.append("typedef struct {")
            for place, kind in enumerate(relation.columns):
                lines.append(f"    {_TYPES[kind]} {field_name(relation, place)};")
            lines.append(f"}} {self.prefix}_{name}_row;\n")
        lines.append("typedef struct {")
        for relation, name in self.rows.items():
            lines.append(f"    {self.prefix}_{name}_row {name}[{self.most_rows[relation] + 1}];")
            lines.append(f"    int32_t {name}_count;")
        if not self.rows:
            lines.append("    int32_t none;")
        lines.append(f"}} {self.prefix}_facts;\n")
        lines.append("typedef struct {")
        for query, name in self.queries.items():
            if query.mode == "holds":
                lines.append(f"    bool {name};")
                continue
            width = max([1, *(len(_values(terms)) for terms in self.patterns[query])])
            lines.append("    struct {\n        int32_t count;\n        int32_t left_out;")
            lines.append(f"        int32_t pattern[{self.most_solutions[query]}];")
            lines.append(f"        double value[{self.most_solutions[query]}][{width}];\n    }} {name};")
        lines.append(f"}} {self.prefix}_answers;\n")
        return "\n".join(lines)

    def _check(self, relation: Relation) -> str:
        """Return the function that tells whether the rows conform to the schema."""
        name = self.rows[relation]
        most = self.most_rows[relation]
        low = 1 if relation.single or relation.first is not None else 0
        tests = [f"count >= {low}", f"count <= {most}"]
        if relation.first is not None:
            key = field_name(relation, relation.key or 0)
            tests.append(f"rows[0].{key} == {self.atom(relation.first)}")
        lines = [
            f"static bool {self.prefix}_{name}_are_sound(",
            f"    const {self.prefix}_{name}_row *rows, int32_t count)",
            "{",
            f"    bool sound = {' && '.join(tests)};",
        ]
        inner = []
        for place in self.columns()[relation]:
            value = f"rows[place].{field_name(relation, place)}"
            if relation.columns[place] == "float":
                inner.append(f"        sound = sound && fabs({value}) <= {FLOAT_BOUND!r};")
            elif relation.columns[place] == "int":
                inner.append(f"        sound = sound && fabs({value}) < {float(INT_BOUND)!r};")
        if relation.key is not None:
            value = field_name(relation, relation.key)
            inner.append("        for (int32_t other = 0; other < place; other += 1) {")
            inner.append(f"            sound = sound && rows[other].{value} != rows[place].{value};")
            inner.append("        }")
        if inner:
            lines += ["    for (int32_t place = 0; sound && place < count; place += 1) {", *inner, "    }"]
        else:
            lines.append("    (void)rows;")
        return "\n".join([*lines, "    return sound;", "}", ""])

    def _finds(self, function: str) -> list[str]:
        """Return the functions that search the place of a row by its key."""
        return [
            f"static int32_t {self.prefix}_find_{name}(const {self.prefix}_{name}_row *rows, int32_t count, "
            f"{_TYPES[relation.columns[relation.key]]} key)\n"
            "{\n"
            "    for (int32_t place = 0; place < count; place += 1) {\n"
            f"        if (rows[place].{field_name(relation, relation.key)} == key) {{\n"
            "            return place;\n"
            "        }\n"
            "    }\n"
            "    return count;\n"
            "}\n"
            for relation, name in self.rows.items()
            if relation.key is not None and f"find_{name}(" in function
        ]

    def _function(self) -> str:
        prefix = self.prefix
        for relation, name in self.rows.items():
            row = self.pool.make("row", "index", (), relation)
            self.known[row] = "0"
            self.write(f"{prefix}_{name}_row *const {name} = facts->{name};")
            self.write(f"const int32_t {name}_count = facts->{name}_count;")
        for name in self.rows.values():
            self.write(f"if (!{prefix}_{name}_are_sound({name}, {name}_count)) {{")
            self.write("    return false;")
            self.write("}")
        for relation, name in self.rows.items():
            self.write(f"{name}[{name}_count] = {self._blank(relation)};")
        if not self.rows:
            self.write("(void)facts;")
        self.sweep()
        if self.undecided is not self.pool.false:
            self.share([self.undecided])
            with self.block(self.test(self.text(self.undecided, CHOICE))):
                self.write("return false;")
        self.share(self.roots)
        for answer in self.lowered.answers:
            self._answer(answer)
        self.write("return true;")
        head = f"static bool {prefix}_answer({prefix}_facts *facts, {prefix}_answers *answers)"
        return "\n".join([head, "{", *self.lines, "}", ""])

    def _blank(self, relation: Relation) -> str:
        zeros = ", ".join("0" if kind == "atom" else "0.0" for kind in relation.columns)
        return f"({self.prefix}_{self.rows[relation]}_row){{{zeros}}}"

    def declare(self, name: str, text: str, kind: str) -> None:
        self.write(f"{_TYPES[kind]} {name} = {text};")

    def declare_places(self, name: str, relation: Relation) -> None:
        self.write(f"int32_t {name}[{self.most_rows[relation]}];")

    def atom(self, name: str) -> str:
        return str(self.codes[name])

    def double(self, value: float) -> str:
        return constant(value, "NAN", "INFINITY")

    def no_value(self, value: Node, *, greatest: bool) -> str:
        return self.infinity if greatest else f"-{self.infinity}"

    def search(self, node: Node) -> str:
        rows = self.rows[relation_of(node.args[0])]
        return f"{self.prefix}_find_{rows}({rows}, {rows}_count, {self.text(lookup_value(node), CHOICE)})"

    def _answer(self, answer: Answer) -> None:
        query, name = answer.query, self.queries[answer.query]
        if query.mode == "holds":
            self.write(f"answers->{name} = {self.text(answer.found, CHOICE)};")
            return
        self._query = query
        self.write(f"answers->{name}.count = 0;")
        self.write(f"answers->{name}.left_out = 0;")
        if answer.found is self.pool.false:
            return
        if query.mode == "first" and answer.terms is not None:
            with self.block(self.test(self.text(answer.found, CHOICE))):
                self.emit(answer.terms, name)
        elif query.mode == "set" and answer.choices is not None:
            for value, cond in answer.choices:
                with self.block(self.test(self.text(cond, CHOICE))):
                    self.emit((value,), name)
        else:
            self.collect(answer.tree, name)

    def emit(self, terms: Sequence[Sym], name: str) -> None:
        assert self._query is not None
        known, values = self.patterns[self._query], _values(terms)
        pattern = tuple(terms)
        numbers = [place for place, other in enumerate(known) if _alike(other, pattern)]
        if not numbers:
            known.append(pattern)
        number = numbers[0] if numbers else len(known) - 1
        for node in values:
            self.nested_quantifiers(node)
        count = f"answers->{name}.count"
        with self.block(self.test(f"{count} < {self.most_solutions[self._query]}")):
            self.write(f"answers->{name}.pattern[{count}] = {number};")
            for place, node in enumerate(values):
                cast = "(double)" if node.kind in ("atom", "bool") else ""
                text = self.text(node, ATOMIC if cast else CHOICE)
                self.write(f"answers->{name}.value[{count}][{place}] = {cast}{text};")
            self.put(count, f"{count} + 1")
        with self.block("else"):
            self.put(f"answers->{name}.left_out", f"answers->{name}.left_out + 1")


def _most(answer: Answer, given: Mapping[str, int]) -> int:
    """Return the number of solutions for which there is room."""
    if answer.query.mode == "first":
        return 1
    if answer.query.mode == "set" and answer.choices is not None:
        return max(1, len(answer.choices))
    return given[answer.query.name]


def _results(lowered: Lowered) -> Iterator[tuple[Node, Node]]:
    """Yield the nodes of the answers, each with the condition under which it is used."""
    for answer in lowered.answers:
        if answer.query.mode == "set" and answer.choices is not None:
            for _, cond in answer.choices:
                yield cond, lowered.pool.true
            continue
        for leaf in emitted(answer.tree):
            _check_terms(answer.query, leaf)
        yield from results_of(lowered.pool, [answer])


def _check_terms(query: Query, leaf: Emit) -> None:
    if any(isinstance(part, Bag) for part in _parts(leaf.terms)):
        raise NotLowerable(str(query), None, "its answer holds a list of solutions")


def _values(terms: Sequence[Sym]) -> list[Node]:
    """Return the nodes in the terms of a solution, from left to right."""
    return [part for part in _parts(terms) if isinstance(part, Node)]


def _names(terms: Sequence[Sym]) -> list[str]:
    """Return the atoms in the terms of a solution."""
    return [part.name for part in _parts(terms) if isinstance(part, Atom)]


def _parts(terms: Sequence[Sym]) -> Iterator[Sym]:
    """Yield what is not compound in the terms of a solution, from left to right."""
    for term in map(resolve, terms):
        if isinstance(term, Struct):
            yield from _parts(term.args)
        else:
            yield term


def _alike(one: Sequence[Sym], other: Sequence[Sym]) -> bool:
    """Return whether solutions differ in the values of nodes alone."""

    def same(left: Sym, right: Sym) -> bool:
        left, right = resolve(left), resolve(right)
        if isinstance(left, Node) and isinstance(right, Node):
            return left.kind == right.kind
        if isinstance(left, Struct) and isinstance(right, Struct):
            return (
                left.name == right.name
                and len(left.args) == len(right.args)
                and all(map(same, left.args, right.args))
            )
        return type(left) is type(right) and not isinstance(left, Node | Struct) and bool(left == right)

    return len(one) == len(other) and all(map(same, one, other))
