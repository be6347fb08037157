"""The back end for many scenes at once: the text of one function over arrays, without any loop over scenes.

A value that depends on rows is an array with an axis for each relation's rows and, last, one for the scenes;
a value of the scene alone has the last axis only. A quantifier is a reduction along its rows under a mask.
The text calls a small set of operations (`numpy_backend.Ops`) so that another array library can stand in for
NumPy.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

from drlsl.logic.core import NODES, Operation
from drlsl.logic.terms import Atom
from drlsl.lowering.backends.expressions import ATOMIC, COMPARISON, UNARY, bracketed
from drlsl.lowering.backends.sparse import Conjunctions, mask_parts, plan_sparse
from drlsl.lowering.frontend import Lowered, array_forms, atom_codes
from drlsl.lowering.ir import QUANTIFIERS, SMALL, Names, Node, Pool, Relation, conjuncts, reach, relation_of

_JOINTS: Final = {"both": ("&", 9), "or": ("|", 7)}
_REDUCTIONS: Final = {
    "any": "exists",
    "count": "count",
    "first": "first",
    "min_of": "least",
    "max_of": "greatest",
    "argmin": "where_least",
    "argmax": "where_greatest",
    "sum": "total",
}
_LOOSE: Final = 0
_STACKABLE: Final = frozenset({"add", "and", "any", "both", "div", "max", "min", "mul", "select", "sub"})
_WORTH_STACKING: Final = 4
_LEAVES: Final = frozenset({"const", "loop", "facts", "others", "row"})


class ArrayPrinter:
    """Writes the function for one lowered program.

    `codes` gives the integer of each atom of the program. `columns` are those that the function reads, by
    relation. `shapes` says for each `first` query whether its numbers are all integers or atoms, and whether
    it is one number instead of several.
    """

    def __init__(self, lowered: Lowered) -> None:
        self.lowered = lowered
        self.pool: Pool = lowered.pool
        self.columns: dict[Relation, set[int]] = {}  # the inputs of the function
        forms = array_forms(lowered)
        self.shapes = {
            str(form.query): (form.exact, form.plain) for form in forms if form.query.mode == "first"
        }
        self._names = Names(("xp", "tables", "answer"))
        self._lines: list[str] = []
        self._known: dict[Node, str] = {}
        undecided = self.pool.or_(answer.undecided for answer in lowered.answers)
        self._groups = [[undecided], *(list(form.roots) for form in forms)]
        self._results = [root for group in self._groups for root in group]
        self.codes = atom_codes(lowered, self._results)
        self._sparse = plan_sparse(self.pool, self._results)
        self._masks = Conjunctions(self.pool, self._results, self._sparse)
        self._twins = self._find_twins()
        self._selections: dict[Node, str] = {}  # the names of rows picked out by a mask
        self._gathered: dict[tuple[Node, Node], str] = {}  # a mask and a value, of the rows picked out by it
        self._flat = False  # whether rows and scenes are one axis
        self._order = self._reach(self._results)
        self._uses: Counter[Node] = Counter(self._results)
        for node in self._order:
            self._uses.update(self._operands(node))

    def _operands(self, node: Node) -> tuple[Node, ...]:
        """Return the nodes in the text of a node."""
        if node.op == "and":
            return (self._masks.of(conjuncts(node)),)
        if node in self._sparse:
            return (self._mask(node), *self._sparse[node].inputs)
        if node in self._twins:
            return (self._twins[node],)
        if node.op in QUANTIFIERS:
            return (self._mask(node), *node.args[2:], *self._picked(node.args[0]))
        if node.op == "where":
            return (self._mask(node),)
        if node.op == "col":
            index = node.args[0]
            return self._picked(index) if index.op == "loop" else () if index.op == "row" else (index,)
        if node.op == "valid":
            return (*self._picked(node.args[0]), *self._selected(node.args[0]))
        return () if node.op in _LEAVES else node.args

    def _picked(self, loop: Node) -> tuple[Node, ...]:
        """Return the rows that were picked out for a loop, if they were."""
        rows = loop.args[0]
        return (rows,) if rows.op == "where" and _is_small(rows) else ()

    def _selected(self, loop: Node) -> tuple[Node, ...]:
        """Return the mask of the rows that a loop visits, unless they were picked out."""
        rows = loop.args[0]
        return (rows,) if rows.op == "where" and not _is_small(rows) else ()

    def _mask(self, node: Node) -> Node:
        parts = self._sparse[node].prefix if node in self._sparse else mask_parts(self.pool, node)
        return self._masks.of(parts)

    def _find_twins(self) -> dict[Node, Node]:
        """Return for existential quantifiers the extreme over the same rows, finite if there is one."""
        # an extreme whose value depends on further rows has one for each of them
        extremes = {
            (node.free, mask_parts(self.pool, node)): node
            for node in reach(self._results)
            if node.op == "min_of" and node.kind == "float" and node not in self._sparse
        }
        alike = {
            node: extremes.get((node.free, mask_parts(self.pool, node)))
            for node in reach(self._results)
            if node.op == "any" and node not in self._sparse
        }
        return {node: extreme for node, extreme in alike.items() if extreme is not None}

    def _reach(self, roots: Iterable[Node]) -> list[Node]:
        found: dict[Node, None] = {}

        def visit(node: Node) -> None:
            if node not in found:
                for operand in self._operands(node):
                    visit(operand)
                found[node] = None

        for root in roots:
            visit(root)
        return list(found)

    def module(self) -> str:
        """Return the text of the function."""
        for node in self._order:
            if node.op in _LEAVES or node in self._known:
                continue
            if node.op == "col" and node.args[0].op in ("loop", "row") and not self._operands(node):
                self._column(node)
            elif node in self._sparse:
                self._assign_sparse(node)
            elif self._uses[node] > 1 or node.op == "where":
                self._assign(node)
        for group in self._groups:
            self._stack(group)
            self._line(
                f"yield {', '.join(self._text(node, _LOOSE) for node in group)}," if group else "yield ()"
            )
        return "\n".join(["def answer(xp, tables):", *self._forgetting(), ""])

    def _line(self, text: str) -> None:
        self._lines.append(f"    {text}")

    def _assign(self, node: Node) -> None:
        text = self._text(node, _LOOSE)
        if text.isidentifier():
            self._known[node] = text
            return
        name = self._names.new(self.pool.names.get(node, _HINTS.get(node.op, "value")))
        self._known[node] = name
        self._line(f"{name} = {text}")

    def _stack(self, results: Sequence[Node]) -> None:
        """Compute similar results at once, as the rows of one array."""
        alike: dict[object, list[Node]] = {}
        for node in dict.fromkeys(results):
            if node not in self._known and node.op == "select" and not node.free:
                alike.setdefault(self._shape(node), []).append(node)
        for nodes in alike.values():
            if len(nodes) >= _WORTH_STACKING:
                name = self._names.new("stacked")
                self._line(f"{name} = {self._stacked(nodes, {})}")
                for place, node in enumerate(nodes):
                    self._known[node] = f"{name}[{place}]"

    def _shape(self, node: Node) -> object:
        """Return a key that is equal for values computed by the same operations."""
        if node in self._known or node.free or node.op not in _STACKABLE:
            return node if node.is_const else node.kind
        return node.op, node.data, tuple(self._shape(arg) for arg in self._operands(node))

    def _stacked(self, nodes: Sequence[Node], known: dict[tuple[Node, ...], str]) -> str:
        """Return the text of similar values, one per row; a common value stays one row."""
        first, key = nodes[0], tuple(nodes)
        if all(node is first for node in nodes):
            return self._text(first, ATOMIC)
        if key not in known:
            if first in self._known or first.op not in _STACKABLE or first.free:
                known[key] = self._names.new("rows_of")
                self._line(
                    f"{known[key]} = xp.stack({', '.join(self._text(node, _LOOSE) for node in nodes)})"
                )
                return known[key]
            args = [self._stacked(args, known) for args in zip(*map(self._operands, nodes), strict=True)]
            known[key] = self._combined(first, args)
        return known[key]

    def _combined(self, node: Node, args: Sequence[str]) -> str:
        """Return the operation of a node on the texts of its operands."""
        if _is_by_constant(node):
            return f"xp.divide({', '.join(args)})"
        if node.op in NODES:
            return bracketed(*_operation(NODES[node.op], args), ATOMIC)
        if node.op in _JOINTS:
            return f"({f' {_JOINTS[node.op][0]} '.join(args)})"
        if node in self._twins:
            return f"({args[0]} < xp.inf)"
        if node.op == "and":
            return args[0]
        return f"xp.choose({', '.join(args)})"

    def _assign_sparse(self, node: Node) -> None:
        """Assign a quantifier whose costly parts are computed only for rows that pass the cheap ones."""
        plan, mask = self._sparse[node], self._mask(node)
        rows = self._selections.get(mask)
        if rows is None:
            text = self._text(mask, _LOOSE)
            rows = self._selections[mask] = self._names.new("rows")
            self._line(f"{rows} = xp.select({text})")
        for given in plan.inputs:
            if (mask, given) not in self._gathered and not given.is_const:
                text = self._text(given, _LOOSE)
                name = self._names.new(self._known.get(given, "value"))
                self._gathered[mask, given] = name
                self._line(f"{name} = {rows}.{'spread' if not given.free else 'gather'}({text})")
        outside = self._known
        self._known = {
            **outside,
            **{given: name for (own, given), name in self._gathered.items() if own is mask},
        }
        self._flat = True
        beside = [other for other in self._sparse.values() if self._masks.of(other.prefix) is mask]
        uses = Counter(part for other in beside for part in other.heavy)
        for part in plan.private:
            uses.update(part.args)
        for part in plan.private:
            if uses[part] > 1 and part not in self._known:
                self._assign(part)
                self._gathered[mask, part] = self._known[part]
        heavy = [self._text(part, _LOOSE) for part in plan.heavy]
        self._flat = False
        self._known = outside
        name = self._known[node] = self._names.new(self.pool.names.get(node, _HINTS.get(node.op, "value")))
        conds = " & ".join(f"({text})" for text in heavy[: len(plan.heavy) - len(node.args[2:])])
        arguments = ", ".join([conds or "None", *heavy[len(plan.heavy) - len(node.args[2:]) :]])
        self._line(f"{name} = {rows}.{_REDUCTIONS[node.op]}({arguments})")

    def _forgetting(self) -> list[str]:
        """Return the lines, with every array deleted after its last use, so that the others fit the cache."""
        last: dict[str, int] = {}
        for number, line in enumerate(self._lines):
            for word in _words(line):
                last[word] = number
        names = set(self._known.values())
        result = []
        for number, line in enumerate(self._lines):
            result.append(line)
            gone = sorted(name for name in names & set(_words(line)) if last[name] == number)
            if gone and number + 1 < len(self._lines):
                result.append(f"    del {', '.join(gone)}")
        return result

    def _column(self, node: Node) -> None:
        relation, column = node.data
        index = node.args[0]
        field = (
            relation.fields[column] if relation.fields else self.pool.names.get(node, f"column_{column + 1}")
        )
        self._known[node] = self._names.new(f"{relation.first or ''}_{field}" if index.op == "row" else field)
        rows = "0" if index.op == "row" else "1:" if _ranges_over_others(index) else ":"
        self._line(f"{self._known[node]} = {self._full_column(relation, column)}[{rows}]")

    def _full_column(self, relation: Relation, column: int) -> str:
        self.columns.setdefault(relation, set()).add(column)
        return f"tables[{relation.name!r}, {relation.arity}].column({column})"

    def _axes(self, node: Node) -> tuple[Node, ...]:
        return tuple(sorted(node.free, key=lambda loop: loop.data))

    def _aligned(self, node: Node, target: Sequence[Node], strength: int) -> str:
        """Return an operand with an axis of length 1 for each missing axis behind an existing one."""
        own = self._axes(node)
        if self._flat:
            return self._text(node, strength)
        while target and target[0] not in own:
            target = target[1:]
        if len(own) == len(target):
            return self._text(node, strength)
        places = ", ".join(":" if loop in own else "None" for loop in target)
        return f"{self._text(node, ATOMIC)}[{places}]"

    def _text(self, node: Node, strength: int) -> str:
        name = self._known.get(node)
        return bracketed(*self._expression(node), strength) if name is None else name

    def _expression(self, node: Node) -> tuple[str, int]:
        if node.op == "const":
            return self._constant(node)
        if node.op == "and" and self._flat:
            return " & ".join(self._text(arg, 10) for arg in node.args), 9
        if node.op == "and":
            return self._expression_or_name(self._masks.of(conjuncts(node)))
        if node in self._twins:
            return f"{self._text(self._twins[node], COMPARISON + 1)} < xp.inf", COMPARISON
        if node.op in QUANTIFIERS:
            return self._reduction(node), ATOMIC
        if node.op == "where":
            mask = self._mask(node)
            if _is_small(node):
                return f"xp.pick({self._text(mask, _LOOSE)})", ATOMIC
            return self._expression_or_name(mask)
        if node.op == "valid":
            return self._valid(node.args[0])
        if node.op == "col":
            return self._gather(node), ATOMIC
        if node.op == "row":
            return "0", ATOMIC
        if node.op == "loop":
            valid = self._text(self.pool.make("valid", "bool", (node,)), _LOOSE)
            return f"xp.positions({valid}, {int(_ranges_over_others(node))})", ATOMIC
        axes = self._axes(node)
        if node.op == "div" and node.args[1].is_const and math.frexp(node.args[1].data)[0] == 0.5:
            # by a power of two: the product is the same number, and is faster
            return f"{self._text(node.args[0], 12)} * {1.0 / node.args[1].data!r}", 12
        if _is_by_constant(node):
            return f"xp.divide({', '.join(self._aligned(arg, axes, _LOOSE) for arg in node.args)})", ATOMIC
        if node.op in NODES:
            row = NODES[node.op]
            infix = not row.arrays and row.infix
            strengths = [infix[1] + place for place in (0, 1)] if infix else [_LOOSE] * row.arity
            parts = zip(node.args, strengths[: row.arity], strict=True)
            return _operation(row, [self._aligned(arg, axes, strength) for arg, strength in parts])
        if node.op in _JOINTS:
            sign, own = _JOINTS[node.op]
            first, *others = node.args
            texts = [self._aligned(first, axes, own), *(self._aligned(arg, axes, own + 1) for arg in others)]
            return f" {sign} ".join(texts), own
        if node.op == "select":
            args = ", ".join(self._aligned(arg, axes, _LOOSE) for arg in node.args)
            constants = node.kind == "float" and all(arg.is_const for arg in node.args[1:])
            return f"xp.{'constants' if constants else 'choose'}({args})", ATOMIC
        return self._truth(node, axes)

    def _expression_or_name(self, node: Node) -> tuple[str, int]:
        name = self._known.get(node)
        return (name, ATOMIC) if name is not None else self._expression(node)

    def _truth(self, node: Node, axes: Sequence[Node]) -> tuple[str, int]:
        if node.op == "within":
            return f"xp.within({self._text(node.args[0], _LOOSE)}, {node.data!r})", ATOMIC
        compared = node.args[0] if node.op == "not" else node
        if compared.op in ("lt", "eq") and (compared is node or compared not in self._known):
            sign = {"lt": ("<", ">="), "eq": ("==", "!=")}[compared.op][compared is not node]
            left, right = (self._aligned(arg, axes, COMPARISON + 1) for arg in compared.args)
            return f"{left} {sign} {right}", COMPARISON
        assert node.op == "not", node.op
        return f"~{self._text(node.args[0], UNARY)}", UNARY

    def _constant(self, node: Node) -> tuple[str, int]:
        if isinstance(node.data, Atom):
            return str(self.codes[node.data.name]), ATOMIC
        if isinstance(node.data, bool):
            return f"xp.{str(node.data).lower()}", ATOMIC
        return repr(node.data), ATOMIC if node.data >= 0 else UNARY

    def _reduction(self, node: Node) -> str:
        loop, mask, values = node.args[0], self._mask(node), node.args[2:]
        axes = tuple(sorted(mask.free.union(*(value.free for value in values)), key=lambda loop: loop.data))
        args = [self._aligned(node, axes, _LOOSE) for node in (mask, *values[:1])]
        outer = [other for other in axes if other is not loop]
        args.extend(self._aligned(start, outer, _LOOSE) for start in values[1:])
        text = f"xp.{_REDUCTIONS[node.op]}({', '.join(args)}, {axes.index(loop)})"
        if node.kind != "index":
            return text
        picked = self._picked(loop)
        if picked:
            text = f"xp.take({self._text(picked[0], ATOMIC)}.index, {text})"
        return f"{text} + 1" if _ranges_over_others(loop) else text

    def _valid(self, loop: Node) -> tuple[str, int]:
        picked, selected = self._picked(loop), self._selected(loop)
        if picked:
            return f"{self._text(picked[0], ATOMIC)}.valid", ATOMIC
        if selected:
            return self._expression_or_name(selected[0])
        relation = relation_of(loop)
        self.columns.setdefault(relation, set())
        rows = "1:" if _ranges_over_others(loop) else ":"
        return f"tables[{relation.name!r}, {relation.arity}].valid[{rows}]", ATOMIC

    def _gather(self, node: Node) -> str:
        index = node.args[0]
        column = self._full_column(*node.data)
        if index.op == "loop":
            rows = self._text(self._picked(index)[0], ATOMIC)
            offset = " + 1" if _ranges_over_others(index) else ""
            return f"xp.take({column}, {rows}.index{offset})"
        return f"xp.take({column}, {self._text(index, _LOOSE)})"


_HINTS: Final = {
    "any": "found",
    "first": "chosen",
    "where": "rows",
    "min_of": "least",
    "max_of": "greatest",
    "both": "mask",
}


def _operation(row: Operation, args: Sequence[str]) -> tuple[str, int]:
    """Return an arithmetic operation on the texts of its arguments, and its precedence."""
    if row.arrays:
        return f"xp.{row.arrays}({', '.join(args)})", ATOMIC
    if row.infix is None:
        return f"xp.function({row.node!r}, {', '.join(args)})", ATOMIC
    sign, own = row.infix
    return (f"{args[0]} {sign} {args[1]}" if row.arity == 2 else f"{sign}{args[0]}"), own


def _is_small(rows: Node) -> bool:
    return relation_of(rows).capacity <= SMALL


def _is_by_constant(node: Node) -> bool:
    """Return whether a division has a constant operand, which some libraries treat differently."""
    return node.op == "div" and any(arg.is_const for arg in node.args)


def _ranges_over_others(index: Node) -> bool:
    while index.op not in ("facts", "others"):
        index = index.args[0]
    return index.op == "others"


def _words(line: str) -> list[str]:
    return "".join(c if c.isalnum() or c == "_" else " " for c in line).split()
