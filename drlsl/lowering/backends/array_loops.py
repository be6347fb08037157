"""Loops over the rows of arrays: the text of one function that goes through scene after scene.

Every relation is a table for each scene: columns of shape (tables, rows), or (tables,) for a single relation,
a mask of the existing rows, and the index of each scene's table. A row is represented by its place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from drlsl.logic.core import Operation
from drlsl.lowering.backends.expressions import (
    ATOMIC,
    CHOICE,
    COMPARISON,
    OR,
    is_defined,
    lookup_value,
)
from drlsl.lowering.backends.loop_ops import CALLED, NO_INTEGER
from drlsl.lowering.backends.loops import Item
from drlsl.lowering.backends.place_loops import PlaceLoops
from drlsl.lowering.backends.python_text import PythonLoops
from drlsl.lowering.frontend import Form, Lowered, array_forms, atom_codes
from drlsl.lowering.ir import QUANTIFIERS, SMALL, Names, Node, Relation, reach, relation_of

Kind: TypeAlias = Literal["bool", "int", "float"]

_RESERVED: Final = (
    *CALLED,
    "abs",
    "answer",
    "float",
    "range",
    "scene",
    "scenes",
    "undecided",
)
_BLANKS: Final[dict[Kind, str]] = {"bool": "False", "int": "0", "float": "nan"}


@dataclass(frozen=True, slots=True)
class Parameter:
    """An array that the function takes or fills.

    `axes`: 1 for (tables,) or (scenes,), 2 for (tables, rows) or (scenes, `width`). `blank` fills it in a
    scene that is undecided.
    """

    name: str
    kind: Kind
    axes: int
    width: int = 0
    blank: str = ""


@dataclass(frozen=True, slots=True)
class Given:
    """The parameters for one relation."""

    relation: Relation
    columns: dict[int, Parameter]
    valid: Parameter
    index: Parameter
    table: str  # the variable for a scene's table

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters, in the order of the function's."""
        return (*self.columns.values(), self.valid, self.index)

    @property
    def shape(self) -> Parameter:
        """The array with the number of tables and rows."""
        return next(iter(self.columns.values()), self.valid)


class ArrayLoopPrinter(PythonLoops, PlaceLoops):
    """Writes the function for one lowered program.

    `codes` gives the integer of each atom. `given` are the parameters for the facts, by relation; they are
    followed by `undecided` and `outputs`: for each form its value and, unless it is `holds`, the mask of the
    scenes in which it fails. Last come `buffers`, known after `module`: each for the places of all rows of a
    table of its relation.
    """

    def __init__(self, lowered: Lowered) -> None:
        self.forms = array_forms(lowered)
        roots = [root for form in self.forms for root in form.roots]
        super().__init__(lowered, Names(_RESERVED), [(root, lowered.pool.true) for root in roots])
        self.codes = atom_codes(lowered, self.reached)
        read = self.columns()
        relations = [relation for relation in lowered.schema.relations.values() if relation in read]
        self.given = {relation: self._given(relation, read[relation]) for relation in relations}
        self.outputs = [self._output(form) for form in self.forms]
        self.buffers: list[tuple[Parameter, Relation]] = []
        self._counts: dict[Node, str] = {}  # of the rows that were chosen

    def _given(self, relation: Relation, used: Sequence[int]) -> Given:
        name = self.names.new(relation.name)
        axes = 1 if relation.single else 2

        def parameter(hint: str, kind: Kind, axes: int) -> Parameter:
            return Parameter(self.names.new(f"{name}_{hint}"), kind, axes)

        columns = {
            place: parameter(
                relation.fields[place] if relation.fields else f"column_{place + 1}",
                "float" if relation.columns[place] == "float" else "int",
                axes,
            )
            for place in used
        }
        valid, index = parameter("valid", "bool", axes), parameter("index", "int", 1)
        return Given(relation, columns, valid, index, self.names.new(f"{name}_table"))

    def _output(self, form: Form) -> tuple[Parameter, ...]:
        name = self.names.new(form.query.name)
        if form.query.mode == "holds":
            return (Parameter(name, "bool", 1, blank="False"),)
        kind: Kind = "bool" if form.query.mode != "first" else "int" if form.exact else "float"
        value = Parameter(name, kind, 1 if form.plain else 2, len(form.values), _BLANKS[kind])
        return value, Parameter(self.names.new(f"{name}_fails"), "bool", 1, blank="True")

    @property
    def results(self) -> Sequence[Parameter]:
        """The parameters that the function fills, in order."""
        undecided = Parameter("undecided", "bool", 1, blank="True")
        return [undecided, *(parameter for output in self.outputs for parameter in output)]

    @property
    def parameters(self) -> Sequence[Parameter]:
        """All the parameters of the function, in order; `module` adds the last."""
        taken = (parameter for given in self.given.values() for parameter in given.parameters)
        return [*taken, *self.results, *(buffer for buffer, _ in self.buffers)]

    def module(self) -> str:
        """Return the text of the function."""
        self._check_shapes()
        self.write("scenes = undecided.shape[0]")
        for given in self.given.values():
            self.write(f"if not fits({given.shape.name}.shape[0], {given.index.name}, scenes):")
            self.write("    return False")
        prelude, self.lines = self.lines, []
        with self.block("for scene in range(scenes)"):
            self._scene()
        names = ", ".join(parameter.name for parameter in self.parameters)
        return "\n".join([f"def answer({names}):", *prelude, *self.lines, "    return True", ""])

    def _check_shapes(self) -> None:
        for given in self.given.values():
            shape = given.shape.name
            others = [each for each in (*given.columns.values(), given.valid) if each is not given.shape]
            if given.relation.single:
                tests = [f"{each.name}.size == {shape}.size" for each in others]
            else:
                tests = [f"{shape}.shape[1] > 0", *(f"{each.name}.shape == {shape}.shape" for each in others)]
            if tests:
                self.write(f"if not ({' and '.join(tests)}):")
                self.write("    return False")

    def _scene(self) -> None:
        for result in self.results:
            if result.axes == 1:
                self.write(f"{result.name}[scene] = {result.blank}")
            else:
                self.write(f"blank({result.name}, scene, {result.blank})")
        for given in self.given.values():
            self.write(f"{given.table} = table_of(scene, {given.shape.name}.shape[0], {given.index.name})")
        self._check_facts()
        for relation in self.given:
            row = self.pool.make("row", "index", (), relation)
            if row in self.reached:
                self.known[row] = "0"
                self.unpack(row)
        self.sweep()
        if self.undecided is not self.pool.false:
            self.share([self.undecided])
            with self.block(f"if {self.text(self.undecided, CHOICE)}"):
                self.write("continue")
        self.share(self.roots)
        for form, output in zip(self.forms, self.outputs, strict=True):
            self._answer(form, output)
        self.write("undecided[scene] = False")

    def _check_facts(self) -> None:
        for given in self.given.values():
            tests = list(self._tests(given))
            if given.columns and not given.relation.single:
                tests.insert(0, self._rows_are_sound(given))
            if tests:
                self.write(f"if not ({' and '.join(tests)}):")
                self.write("    continue")

    def _tests(self, given: Given) -> Iterator[str]:
        """Yield the tests of a relation's facts, but that of each row."""
        relation, valid, table = given.relation, given.valid.name, given.table
        if relation.single:
            yield f"{valid}[{table}]"
            for column in given.columns.values():
                yield _is_sound(column, table)
            return
        if relation.first is not None:
            yield f"{valid}[{table}, 0]"
        if relation.key in given.columns:
            key = given.columns[relation.key].name
            yield f"keys_differ({key}, {valid}, {table})"
            if relation.first is not None:
                yield f"{key}[{table}, 0] == {self.atom(relation.first)}"

    def _rows_are_sound(self, given: Given) -> str:
        """Write the loop that checks a relation's rows; return the variable for whether all are."""
        sound, row = self.names.new("sound"), self.names.new("row")
        place = f"{given.table}, {row}"
        self.write(f"{sound} = True")
        with self.block(f"for {row} in range({given.shape.name}.shape[1])"):
            # in one loop, and without a jump: an array of few rows is passed many times
            tests = " & ".join(_is_sound(column, place) for column in given.columns.values())
            self.write(f"{sound} &= (not {given.valid.name}[{place}]) | ({tests})")
        return sound

    def _answer(self, form: Form, output: tuple[Parameter, ...]) -> None:
        value = output[0].name
        if form.query.mode == "holds":
            self.write(f"{value}[scene] = {self.text(form.found, CHOICE)}")
            return
        fails = output[1].name
        places = ["scene"] if form.plain else [f"scene, {place}" for place in range(len(form.values))]
        if form.query.mode == "first":
            found = form.found is not self.pool.true and self.text(form.found, OR)
            with self.block(f"if {found or True}"):
                for place, node in zip(places, form.values, strict=True):
                    self.write(f"{value}[{place}] = {self.text(node, CHOICE)}")
                self.write(f"{fails}[scene] = False")
            return
        for place, node in zip(places, form.values, strict=True):
            with self.block(f"if {self.text(node, CHOICE)}"):
                self.write(f"{value}[{place}] = True")
                self.write(f"{fails}[scene] = False")

    def head(self, rows: Node, row: str) -> Sequence[str]:
        if rows.op == "where":
            place = self.names.new("place")
            return f"for {place} in range({self._counts[rows]})", f"{row} = {self.known[rows]}[{place}]"
        given = self.given[relation_of(rows)]
        if given.relation.single:
            return (f"for {row} in range(1)",)
        first = "1, " if rows.op == "others" else ""
        return (
            f"for {row} in range({first}{given.shape.name}.shape[1])",
            f"if not {given.valid.name}[{given.table}, {row}]:",
            "    continue",
        )

    def unpack(self, index: Node) -> None:
        for place in self.given[relation_of(index)].columns:
            relation = relation_of(index)
            node = self.pool.make("col", relation.columns[place], (index,), (relation, place))
            if node in self.reached:
                text = self.column(self.known[index], relation, place)
                self.known[node] = self.column_name(node)
                self.write(f"{self.known[node]} = {text}")

    def choose_rows(self, name: str, node: Node) -> Callable[[str], None]:
        self.buffers.append((Parameter(name, "int", 1), relation_of(node)))
        count = self._counts[node] = self.names.new(f"{name}_count")
        self.write(f"{count} = 0")

        def add(row: str) -> None:
            self.write(f"{name}[{count}] = {row}")
            self.write(f"{count} += 1")

        return add

    def no_row(self, relation: Relation) -> str:
        return "-1"

    def is_none(self, name: str, relation: Relation) -> str:
        return f"{name} < 0"

    def no_value(self, value: Node, *, greatest: bool) -> str:
        if value.kind == "int":
            return str(NO_INTEGER if greatest else -NO_INTEGER)
        return super().no_value(value, greatest=greatest)

    def leaves(self, loop: Node) -> bool:
        return relation_of(loop).capacity > SMALL

    def visit(self, items: Sequence[Item]) -> None:
        # Which conditions a row meets is hard to predict, and a wrong guess costs the processor more than
        # computing what is not needed: only what all items have in common is worth a jump.
        if not self._is_flat(items):
            super().visit(items)
            return
        common = [cond for cond in items[0].conds if all(cond in item.conds for item in items)]
        if not common or len(items) == 1:
            self._update_all(items)
            return
        self.share(common)
        with self.block(f"if {self._all_of(common)}"):
            self._update_all([item.without(common) for item in items])

    def _is_flat(self, items: Sequence[Item]) -> bool:
        """Return whether it is cheap to compute the values that the items need in every row."""
        if len(items) == 1 and items[0].node.op in ("any", "first") and self.leaves(items[0].node.loop):
            return False
        parts = reach([node for item in items for node in (*item.conds, *item.values)], self.known)
        return all(relation_of(part.args[0]).capacity <= SMALL for part in parts if part.op in QUANTIFIERS)

    def _update_all(self, items: Sequence[Item]) -> None:
        self.share(node for item in items for node in (*item.conds, *item.values))
        for item in items:
            if item.node.op == "where":
                with self.block(f"if {self._all_of(item.conds)}"):
                    item.act()
            else:
                self._update(item, self._all_of(item.conds))

    def _all_of(self, conds: Sequence[Node]) -> str:
        strength = 10 if len(conds) > 1 else CHOICE
        return " & ".join(self.text(cond, strength) for cond in conds) or "True"

    def _update(self, item: Item, cond: str) -> None:
        """Perform an item if the condition holds, without a jump."""
        node, name = item.node, self.known[item.node]
        both = "" if cond == "True" else f"({cond}) & "
        if node.op == "any":
            self.write(f"{name} |= {cond}")
        elif node.op == "count":
            self.write(f"{name} += choose({cond}, 1, 0)")
        elif node.op == "sum":
            self.write(f"{name} += choose({cond}, {self.text(node.args[2], CHOICE)}, 0)")
        elif node.op == "first":
            self.write(f"{name} = choose({both}({name} < 0), {self.known[node.loop]}, {name})")
        else:
            value = self.known.get(node.args[2]) or self.assign(node.args[2])
            better = self.names.new("better")
            self.write(
                f"{better} = {both}({value} {'<' if node.op in ('min_of', 'argmin') else '>'} {item.best})"
            )
            self.write(f"{item.best} = choose({better}, {value}, {item.best})")
            if item.best != name:
                self.write(f"{name} = choose({better}, {self.known[node.loop]}, {name})")

    def truth(self, node: Node) -> tuple[str, int]:
        # cheap values are computed rather than jumped over: fewer blocks compile sooner, and are as fast
        if node.op in ("and", "or"):
            sign, own = (" & ", 9) if node.op == "and" else (" | ", 7)
            return sign.join(self.text(arg, own + 1) for arg in node.args), own
        if node.op == "within":
            return f"abs({self.text(node.args[0], CHOICE)}) <= {node.data!r}", COMPARISON
        return super().truth(node)

    def repeats(self, node: Node) -> bool:
        return False

    def operation(self, row: Operation, node: Node) -> tuple[str, int]:
        # some divisors of integers make the processor trap
        if row.infix and (not row.guard or (node.kind == "float" and is_defined(row, node))):
            return self.infix(row, node)
        return self.call(row, node)

    def choice(self, cond: Node, then: Node, els: Node) -> tuple[str, int]:
        return f"choose({', '.join(self.text(part, CHOICE) for part in (cond, then, els))})", ATOMIC

    def atom(self, name: str) -> str:
        return str(self.codes[name])

    def column(self, index: str, relation: Relation, column: int) -> str:
        given = self.given[relation]
        place = given.table if relation.single else f"{given.table}, {index}"
        return f"{given.columns[column].name}[{place}]"

    def is_some(self, place: str, relation: Relation) -> str:
        return f"{place} >= 0"

    def search(self, node: Node) -> str:
        given = self.given[relation_of(node.args[0])]
        key = given.columns[given.relation.key or 0].name
        value = self.text(lookup_value(node), CHOICE)
        return f"place_of({value}, {key}, {given.valid.name}, {given.table})"


def _is_sound(column: Parameter, place: str) -> str:
    return f"is_sound_{'float' if column.kind == 'float' else 'integer'}({column.name}[{place}])"
