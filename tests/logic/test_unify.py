"""Unification, the trail, the standard order and copies, on generated terms and on very deep ones."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.logic.core import (
    Trail,
    compare,
    copy_term,
    is_ground,
    sort_key,
    subsumes,
    term_variables,
    undo,
    unify,
    unify_occurs,
    variant,
)
from drlsl.logic.core.unification import UndoCall, compact, excerpt, occurs
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref, is_acyclic, make_list

_NAMES = st.sampled_from(["a", "b", "f", "g", "[]", "é", ""])
_NUMBERS = (
    st.sampled_from([0, 1, -1, 2**70, 0.0, 1.0, -2.5, 1e300]) | st.integers() | st.floats(allow_nan=False)
)


@st.composite
def groups(draw: st.DrawFn, size: int) -> list[Term]:
    """Terms that share variables, of which some are bound to each other."""
    variables = [Var(name) for name in "XYZW"]
    for index in draw(st.lists(st.integers(1, 3), max_size=2, unique=True)):
        variables[index].ref = variables[index - 1]
    leaves = st.sampled_from(variables) | _NAMES.map(Atom) | _NUMBERS | st.sampled_from(["", "a", "text"])
    inner = st.recursive(
        leaves,
        lambda parts: (
            st.builds(Struct, _NAMES, st.lists(parts, min_size=1, max_size=3).map(tuple))
            | st.builds(make_list, st.lists(parts, max_size=3), parts | st.just(NIL))
        ),
        max_leaves=6,
    )
    return [draw(inner) for _ in range(size)]


def shape(term: Term) -> object:
    """A term as it stands, each bound variable and each reference included."""
    if isinstance(term, Var):
        return id(term), None if term.ref is None else shape(term.ref)
    if isinstance(term, Struct):
        return id(term), term.name, tuple(map(shape, term.args))
    return type(term), term


def deep(size: int, end: Term) -> Term:
    for _ in range(size):
        end = Struct("s", (end,))
    return end


@given(groups(2))
def test_undo_after_unify_is_identity(terms: list[Term]) -> None:
    before = [shape(term) for term in terms]
    trail: Trail = [Var("older")]
    unify(terms[0], terms[1], trail)
    undo(trail, 1)
    assert [shape(term) for term in terms] == before
    assert len(trail) == 1


@given(groups(2))
def test_unify_is_symmetric(terms: list[Term]) -> None:
    left, right = terms
    trail: Trail = []
    forward = unify_occurs(left, right, trail)
    first = copy_term(Struct("-", (left, right)))
    undo(trail, 0)
    assert unify_occurs(right, left, trail) == forward
    if forward:
        assert variant(first, Struct("-", (left, right)))
    undo(trail, 0)


@given(groups(2))
def test_unified_terms_are_equal_and_acyclic(terms: list[Term]) -> None:
    left, right = terms
    if unify_occurs(left, right, []):
        assert compare(left, right) == 0
        assert variant(left, right)
        assert is_acyclic(left)
        assert is_acyclic(right)


@given(groups(2))
def test_occurs_check_only_refuses_cycles(terms: list[Term]) -> None:
    """The two ways to unify differ only where a cyclic term would come of it."""
    left, right = terms
    trail: Trail = []
    checked = unify_occurs(left, right, trail)
    undo(trail, 0)
    copied = copy_term(Struct("-", (left, right)))
    assert isinstance(copied, Struct)
    is_possible = unify(copied.args[0], copied.args[1], [])
    if checked:
        assert is_possible
        assert is_acyclic(copied)
    elif is_possible:
        assert not is_acyclic(copied)


@given(groups(2))
def test_terms_that_do_not_unify_have_no_common_instance(terms: list[Term]) -> None:
    left, right = terms
    if subsumes(left, right) and not set(term_variables(left)) & set(term_variables(right)):
        assert unify_occurs(left, right, [])


@given(groups(3), st.booleans())
def test_standard_order_is_total(terms: list[Term], iso: bool) -> None:
    first, second, third = terms
    for left in terms:
        assert compare(left, left, iso=iso) == 0
        for right in terms:
            assert compare(left, right, iso=iso) == -compare(right, left, iso=iso)
    if compare(first, second, iso=iso) <= 0 and compare(second, third, iso=iso) <= 0:
        assert compare(first, third, iso=iso) <= 0
    ordered = sorted(terms, key=sort_key(iso=iso))
    assert all(compare(left, right, iso=iso) <= 0 for left, right in pairwise(ordered))


@given(groups(2))
def test_identical_means_same_order(terms: list[Term]) -> None:
    """Terms of order 0 unify without a binding, and the other way round."""
    trail: Trail = []
    unified = unify(terms[0], terms[1], trail)
    bound = len(trail)
    undo(trail, 0)
    assert (compare(terms[0], terms[1]) == 0) == (unified and not bound)


@given(groups(1))
def test_copy_is_a_variant_with_fresh_variables(terms: list[Term]) -> None:
    copied = copy_term(terms[0])
    assert variant(copied, terms[0])
    assert not set(term_variables(copied)) & set(term_variables(terms[0]))
    assert is_ground(copied) == is_ground(terms[0]) == (not term_variables(terms[0]))
    assert subsumes(copied, terms[0])
    assert subsumes(terms[0], copied)


@given(groups(2))
def test_copies_share_a_renaming(terms: list[Term]) -> None:
    renaming: dict[Var, Term] = {}
    copies = [copy_term(term, renaming) for term in terms]
    assert variant(Struct("-", tuple(copies)), Struct("-", tuple(terms)))


@given(groups(2))
def test_subsumes_binds_nothing(terms: list[Term]) -> None:
    before = [shape(term) for term in terms]
    subsumes(terms[0], terms[1])
    assert [shape(term) for term in terms] == before


def test_standard_order_of_kinds() -> None:
    ordered: list[Term] = [
        Var(),
        -1.5,
        7.0,
        -3,
        2,
        Atom(""),
        Atom("a"),
        "a",
        Struct("z", (1,)),
        Struct("a", (1, 2)),
        Struct("a", (2, 1)),
        Struct("b", (0, 0)),
    ]
    shuffled = ordered[::2] + ordered[1::2]
    assert sorted(shuffled, key=sort_key()) == ordered
    by_value: list[Term] = [-3, -1.5, 2.0, 2, 7.0]
    shuffled = by_value[::2] + by_value[1::2]
    assert sorted(shuffled, key=sort_key(iso=False)) == by_value


@pytest.mark.parametrize(
    ("left", "right"),
    [
        (1, 1.0),
        (Atom("a"), "a"),
        (Atom("1"), 1),
        (Atom("f"), Struct("f", (1,))),
        (0, 0.0),
        (Atom("[]"), "[]"),
    ],
)
def test_values_of_unlike_kinds_never_unify(left: Term, right: Term) -> None:
    assert not unify(left, right, [])
    assert not unify_occurs(left, right, [])
    assert not unify(Struct("f", (left,)), Struct("f", (right,)), [])


def test_undo_goes_back_to_the_mark_newest_first() -> None:
    log: list[int] = []
    trail: Trail = []
    kept, taken_back = Var("X"), Var("Y")
    assert unify(kept, 1, trail)
    mark = len(trail)
    assert unify(taken_back, 2, trail)
    trail.extend(UndoCall(lambda number=number: log.append(number)) for number in (1, 2))  # type: ignore[misc]  # bound now
    undo(trail, mark)
    assert (deref(kept), taken_back.ref, log, len(trail)) == (1, None, [2, 1], mark)


def test_compact_drops_only_what_nobody_can_reach() -> None:
    reachable = Var("X")
    trail: Trail = []
    for variable in (Var("gone"), reachable, Var("gone")):
        unify(variable, 1, trail)
    # The loop's own variable still refers to the last one.
    variable = reachable
    ran: list[int] = []
    trail.append(UndoCall(lambda: ran.append(1)))
    assert compact(trail, 0, ()) == 2
    assert trail[0] is reachable
    undo(trail, 0)
    assert variable.ref is None
    assert ran == [1]


def test_compact_keeps_what_lies_before_a_choice_point() -> None:
    trail: Trail = []
    for _ in range(4):
        unify(Var(), 1, trail)
    assert compact(trail, 0, (1, 3)) == 1
    assert len(trail) == 3


def cyclic() -> Term:
    variable = Var("X")
    term = Struct("f", (variable, Atom("a")))
    assert unify(variable, term, [])
    return term


def test_walks_of_cyclic_terms_come_to_an_end() -> None:
    """As in SWI-Prolog, where two terms without end are equal that do not differ anywhere."""
    assert not is_acyclic(cyclic())
    assert unify(cyclic(), cyclic(), [])
    assert unify_occurs(cyclic(), cyclic(), [])
    assert compare(cyclic(), cyclic()) == 0
    assert variant(cyclic(), cyclic())
    assert is_ground(cyclic())
    assert term_variables(cyclic()) == []
    assert not occurs(Var(), cyclic())
    copied = copy_term(cyclic())
    assert not is_acyclic(copied)
    assert compare(copied, cyclic()) == 0
    other = cyclic()
    assert isinstance(other, Struct)
    other.args = (other.args[0], Atom("b"))
    assert not unify(cyclic(), other, [])
    assert compare(cyclic(), other) == -1


@pytest.mark.parametrize("leaf", [Atom("a"), 1, Var("X")], ids=str)
@pytest.mark.parametrize("bound", [False, True], ids=["cells", "variables"])
def test_a_shared_part_is_walked_once(leaf: Term, bound: bool) -> None:
    """200 cells that would be 2**200 as a tree."""

    def shared() -> Term:
        term = leaf
        for _ in range(200):
            if bound:
                variable = Var()
                variable.ref = term
                term = variable
            term = Struct("f", (term, term))
        return term

    left, right = shared(), shared()
    assert unify(left, right, [])
    assert unify_occurs(shared(), left, [])
    assert compare(left, right) == 0
    assert variant(left, right)
    assert is_acyclic(left)
    assert is_ground(left) == (type(leaf) is not Var)
    assert term_variables(left) == ([leaf] if type(leaf) is Var else [])
    assert not occurs(Var(), left)
    copied = copy_term(left)
    assert variant(copied, left)
    assert subsumes(copied, left)


def test_shared_parts_are_no_cycle() -> None:
    part = Struct("g", (Var(),))
    assert is_acyclic(Struct("f", (part, part, Struct("h", (part,)))))


def check_walks(make: object) -> None:
    assert callable(make)
    variable = Var("X")
    left, right, other = make(variable), make(Atom("end")), make(Atom("other"))
    assert occurs(variable, left)
    assert not is_ground(left)
    assert term_variables(left) == [variable]
    copied = copy_term(left)
    assert variant(copied, left)
    trail: Trail = []
    assert unify(left, right, trail)
    assert len(trail) == 1
    assert compare(left, right) == 0
    assert is_ground(left)
    undo(trail, 0)
    assert unify_occurs(left, right, trail)
    undo(trail, 0)
    assert not unify_occurs(variable, left, trail)
    assert not unify(right, other, trail)
    assert compare(right, other) == -1
    assert is_acyclic(left)
    assert subsumes(copied, right)


def test_deep_terms_need_no_python_stack() -> None:
    check_walks(lambda end: deep(100_000, end))


def test_long_lists_need_no_python_stack() -> None:
    check_walks(lambda end: make_list([end, *range(50_000)], end))


@pytest.mark.slow
def test_lists_of_a_million_elements_need_no_python_stack() -> None:
    check_walks(lambda end: make_list(range(1_000_000), end))


@given(groups(1), st.integers(0, 40))
def test_an_excerpt_equals_the_term_and_has_its_inner_parts(terms: list[Term], most: int) -> None:
    assert compare(excerpt(terms[0], most), terms[0]) == 0
    large = make_list([Atom("a")] * 100)
    assert isinstance(large, Struct)
    copied = excerpt(large, 2 * most)
    for _ in range(most):
        assert isinstance(copied, Struct)
        assert isinstance(large, Struct)
        assert copied is not large
        copied, large = copied.args[1], large.args[1]
    assert isinstance(copied, Struct)
    assert isinstance(large, Struct)
    assert copied.args is large.args


@given(groups(1))
def test_undoing_does_not_change_an_excerpt(terms: list[Term]) -> None:
    trail: Trail = []
    for variable in term_variables(terms[0]):
        assert unify(variable, Atom("bound"), trail)
    copied = excerpt(terms[0], 1_000)
    before = copy_term(terms[0])
    undo(trail, 0)
    assert variant(copied, before)
