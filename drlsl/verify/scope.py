"""The number of vehicles that a scene needs to break a property: small scenes that stand for all.

The same holds for the rows of any relation of which there may be any number (`OpenRelation`); below, vehicles
stand for them.

From a scene that breaks a property, vehicles are removed one after another. A statement that no vehicle has
some quality stays true, and a statement that some vehicle has it stays true as long as one of those is kept.
So the scene with one vehicle left for each such statement, and one for each least or greatest value or first
match that the property compares, breaks the property as well. `witnesses` counts them: a property that holds
with that number of vehicles holds with any number. All statements about the vehicle that `focus/1` names are
about the same one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

from drlsl.driving.scene import EGO
from drlsl.logic.terms import Atom
from drlsl.lowering.frontend import Answer
from drlsl.lowering.ir import QUANTIFIERS, Node, Relation, relation_of
from drlsl.verify.names import VEHICLE, OpenRelation
from drlsl.verify.smt import FOCUS


class NoBound(Exception):
    """No number of vehicles is known to be sufficient."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A vehicle that a quantifier chooses among `rows`: any, or the first, or by `values` the least."""

    rows: tuple[Node, Node]
    kind: str
    values: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Need:
    """Vehicles that must be kept: those of the choices in `named`, `more` besides, and the one in focus.

    `more` has the relation of each such row, once for each.
    """

    named: frozenset[Choice] = frozenset()
    more: tuple[Relation, ...] = ()
    focus: bool = False

    def rows(self) -> Counter[Relation]:
        """Return the number of rows that must be kept, by relation."""
        # the least of some rows is also one of them
        sharp = {choice.rows for choice in self.named if choice.kind != "any"}
        named = [choice for choice in self.named if choice.kind != "any" or choice.rows not in sharp]
        relations = [relation_of(choice.rows[0]) for choice in named]
        return Counter([*relations, *self.more, *([VEHICLE] if self.focus else [])])

    def __len__(self) -> int:
        return self.rows().total()

    def __or__(self, other: Need) -> Need:
        return Need(self.named | other.named, self.more + other.more, self.focus or other.focus)


NONE: Final = Need()
_KINDS: Final = {"min_of": "least", "argmin": "least", "max_of": "greatest", "argmax": "greatest"}
_Fixed: TypeAlias = frozenset[Node]


def witnesses(answer: Answer) -> int | None:
    """Return a sufficient number of vehicles for a scene in which the answer holds; None: unknown."""
    try:
        return max(len(_truth(root, True, frozenset())) for root in (answer.found, answer.undecided))
    except NoBound:
        return None


def rows_needed(answer: Answer) -> Counter[Relation] | None:
    """Return a sufficient number of rows of each relation with any number of them; None: unknown."""
    try:
        needs = [_truth(root, True, frozenset()) for root in (answer.found, answer.undecided)]
    except NoBound:
        return None
    return needs[0].rows() | needs[1].rows()


def _either(one: Need, other: Need) -> Need:
    """Return what is sufficient for either of two statements."""
    for large, small in ((one, other), (other, one)):
        more = Counter(large.more) >= Counter(small.more)
        if large.named >= small.named and more and large.focus >= small.focus:
            return large
    return Need(more=_listed((one.rows() | other.rows()).elements()))


def _listed(relations: Iterable[Relation]) -> tuple[Relation, ...]:
    return tuple(sorted(relations, key=lambda relation: (relation.name, relation.arity)))


def _truth(node: Node, holds: bool, fixed: _Fixed) -> Need:
    """Return the vehicles that keep a statement true, or false, when others are removed."""
    if node.op == "const":
        return NONE
    if node.op == "not":
        return _truth(node.args[0], not holds, fixed)
    if node.op in ("and", "or"):
        parts = [_truth(arg, holds, fixed) for arg in node.args]
        result = NONE
        # which part holds may differ from row to row
        all_count = (node.op == "and") is holds or not node.free <= fixed
        for part in parts:
            result = result | part if all_count else _either(result, part)
        return result
    if node.op == "any":
        return _some(node, fixed) if holds else _none(node, fixed)
    args = node.args
    if node.op == "eq" and any(_is_focus(a) and (_is_name(b) or _is_ego_or_focus(b)) for a, b in _both(node)):
        # a kept vehicle is in focus or is not; the ego never is
        args = tuple(arg for arg in args if not _is_focus(arg))
    result = NONE
    for arg in args:
        result = result | _value(arg, fixed)
    return result


def _conditions(node: Node) -> list[tuple[Node, Node]]:
    """Return the conditions on a quantifier's row, each with the index that it binds: its own, its rows'."""
    conditions = [(node.args[1], node.args[0])]
    rows = node.args[0].args[0]
    while rows.op == "where":
        rows, loop, cond = rows.args
        conditions.append((cond, loop))
    return conditions


def _some(node: Node, fixed: _Fixed) -> Need:
    """Return the needs of "some row meets the condition": that row is kept."""
    result = NONE
    for cond, loop in _conditions(node):
        result = result | _truth(cond, True, fixed | {loop})
    return result | _row(node, fixed)


def _none(node: Node, fixed: _Fixed) -> Need:
    """Return the needs of "no row meets the condition": nothing, if each kept row fails it by itself."""
    result = NONE
    for cond, loop in _conditions(node):
        own = _truth(cond, False, fixed - {loop} if _over_vehicles(node) else fixed | {loop})
        if not _over_vehicles(node) and len(own):
            own = _for_each_row(own, loop)
        result = result | own
    return result


def _for_each_row(need: Need, rows: Node) -> Need:
    """Return what is needed if each row of a relation with few of them has needs of its own."""
    return Need(more=_listed(need.rows().elements()) * relation_of(rows).capacity)


def _row(node: Node, fixed: _Fixed) -> Need:
    """Return the needs of the vehicle that a quantifier chooses."""
    if not _over_vehicles(node):
        return NONE
    if any(_of_another(cond, loop) is False for cond, loop in _conditions(node)):
        return Need(focus=True)
    if not node.free <= fixed:
        raise NoBound
    if node.free:
        return Need(more=(relation_of(node.args[0]),))
    kind = _KINDS.get(node.op, node.op)
    return Need(frozenset({Choice((node.args[0], node.args[1]), kind, node.args[2:])}))


def _of_another(cond: Node, loop: Node) -> bool | None:
    """Return the truth of a condition for a row that is neither ego nor focus; None: it depends."""
    if cond.op == "const":
        return bool(cond.data)
    if cond.op == "not":
        inner = _of_another(cond.args[0], loop)
        return None if inner is None else not inner
    if cond.op in ("and", "or"):
        parts = [_of_another(arg, loop) for arg in cond.args]
        dominant = cond.op == "or"
        if dominant in parts:
            return dominant
        return None if None in parts else not dominant
    if cond.op == "eq" and any(
        _is_name(one) and one.args[0] is loop and _is_ego_or_focus(other) for one, other in _both(cond)
    ):
        return False
    return None


def _both(equation: Node) -> tuple[tuple[Node, Node], tuple[Node, Node]]:
    left, right = equation.args
    return (left, right), (right, left)


def _is_name(node: Node) -> bool:
    return node.op == "col" and node.data == (VEHICLE, VEHICLE.key)


def _is_focus(node: Node) -> bool:
    return node.op == "col" and node.data[0] == FOCUS


def _is_ego_or_focus(node: Node) -> bool:
    if node.op == "const":
        return bool(node.data == Atom(EGO))
    return _is_focus(node)


def _over_vehicles(node: Node) -> bool:
    relation = relation_of(node.args[0])
    return relation == VEHICLE or isinstance(relation, OpenRelation)


def _value(node: Node, fixed: _Fixed) -> Need:
    """Return the vehicles that keep a number, an atom or a choice of row unchanged."""
    if node.kind == "bool":
        return _truth(node, True, fixed) | _truth(node, False, fixed)
    if node.op in QUANTIFIERS:
        return _chosen(node, fixed)
    if node.op == "loop":
        return NONE
    if _is_focus(node):
        return Need(focus=True)
    result = NONE
    for arg in node.args:
        result = result | _value(arg, fixed)
    return result


def _chosen(node: Node, fixed: _Fixed) -> Need:
    """Return the needs of a least or greatest value, or a first match: its row is kept."""
    if node.op in ("count", "sum") and _over_vehicles(node):
        raise NoBound
    result = NONE
    for cond, loop in _conditions(node):
        inner = fixed - {loop} if _over_vehicles(node) else fixed | {loop}
        result = result | _value(cond, inner)
    for value in node.args[2:]:
        result = result | _value(
            value, fixed - {node.args[0]} if _over_vehicles(node) else fixed | {node.args[0]}
        )
    if not _over_vehicles(node) and len(result):
        result = _for_each_row(result, node)
    return result | _row(node, fixed)
