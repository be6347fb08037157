"""Atoms: one object for one name as long as it is in use, and little left of those that are not."""

from __future__ import annotations

import copy
import gc
import pickle
import sys
import threading
import tracemalloc
import weakref
from typing import Any

import pytest

from drlsl.logic import Engine
from drlsl.logic.terms import NIL, Atom
from drlsl.logic.terms import term as terms

LOOPS = [
    "between(1, 300000, N), atom_number(A, N), atom_length(A, 0)",
    "between(1, 100000, N), atom_concat(joined, N, A), atom_length(A, 0)",
    "between(1, 100000, N), number_codes(N, L), atom_codes(A, [0'c|L]), atom_length(A, 0)",
    "between(1, 30000, N), atom_concat(read, N, A), term_to_atom(T, A), T = p(0)",
    "between(1, 30000, N), atom_concat(thrown, N, A), catch(throw(A), B, true), B = 0",
    "between(1, 30000, N), atom_concat(kept, N, A), assertz(kept(A)), retract(kept(A)), fail",
    "between(1, 30000, N), atom_concat(key, N, A), nb_setval(k, A), fail",
]


# Some atoms that are not in use may stay: about 1 MB of them.
MOST_LEFT = 10_000


def churn() -> None:
    """Make and drop enough atoms that those which are not in use are freed."""
    for number in range(300_000):
        Atom(f"churned {number}")


def living_atoms() -> int:
    gc.collect()
    return sum(type(each) is Atom for each in gc.get_objects())


@pytest.fixture
def engine() -> Engine:
    engine = Engine(flags={"iso": "false"})
    engine.consult_text(":- dynamic(kept/1).")
    return engine


@pytest.mark.parametrize("goal", LOOPS)
def test_a_loop_leaves_few_atoms_behind(engine: Engine, goal: str) -> None:
    assert not engine.holds(goal.replace("0000,", ","))
    before = living_atoms()
    assert not engine.holds(goal)
    assert living_atoms() < before + MOST_LEFT


@pytest.mark.parametrize(("length", "rounds"), [(20, 30_000), (100_000, 300)])
def test_a_loop_of_new_atoms_needs_little_memory(engine: Engine, length: int, rounds: int) -> None:
    engine.consult_text(f"long('{'a' * length}').", name="long")
    kept = [Atom(f"{number}{'b' * length}") for number in range(10)]
    goal = f"long(L), between(1, {rounds}, N), atom_concat(L, N, A), atom_length(A, 0)"
    tracemalloc.start()
    try:
        assert not engine.holds(goal)
        assert tracemalloc.get_traced_memory()[1] < 4_000_000
    finally:
        tracemalloc.stop()
    assert all(Atom(atom.name) is atom for atom in kept)


def test_atoms_in_use_are_the_same_ones_wherever_they_are_asked_for(engine: Engine) -> None:
    names = [f"kept {number}" for number in range(2_000)]
    engine.replace_facts("kept", 1, [(name,) for name in names])
    for _ in range(2):
        assert not engine.holds("between(1, 5000, N), atom_concat(kept, N, A), kept(A)")
        gc.collect()
        assert all(engine.holds(f'atom_codes(A, "{name}"), kept(A)') for name in names[::50])
        assert engine.holds("findall(A, kept(A), L), sort(L, M), length(M, 2000)")


def test_an_atom_lives_as_long_as_it_is_referred_to() -> None:
    name = "an atom that only this test knows"
    atom = Atom(name)
    assert Atom(name) is atom
    assert copy.copy(atom) is atom
    assert copy.deepcopy([atom])[0] is atom
    assert pickle.loads(pickle.dumps(atom)) is atom  # noqa: S301  (made here)
    watch = weakref.ref(atom)
    del atom
    churn()
    assert watch() is None
    assert Atom(name).name == name
    assert Atom("[]") is NIL


def test_atoms_asked_for_while_others_are_freed_are_the_right_ones() -> None:
    kept = [Atom(f"an atom that stays {number}") for number in range(100)]
    made: list[Atom] = []

    def ask(gone: weakref.ref[Atom]) -> None:
        made.append(Atom(names[gone]))
        made.extend(Atom(f"meanwhile {number}") for number in range(10))
        strange.extend(atom for atom in kept if Atom(atom.name) is not atom)

    strange: list[Atom] = []
    gone = [Atom(f"an atom that goes {number}") for number in range(100)]
    names = {weakref.ref(atom, ask): atom.name for atom in gone}
    del gone
    churn()
    assert len(made) == 1_100
    assert not strange
    assert all(Atom(atom.name) is atom for atom in [*kept, *made])
    churn()
    assert all(Atom(atom.name) is atom for atom in [*kept, *made])


def test_threads_agree_on_atoms_that_come_and_go() -> None:
    names = [f"common {number}" for number in range(300)]
    threads = 8
    start = threading.Barrier(threads)
    found: list[list[Atom]] = []
    strange: list[str] = []

    def work(own: int) -> None:
        start.wait()
        for round_ in range(40):
            mine = [Atom(name) for name in names]
            strange.extend(name for name, atom in zip(names, mine, strict=True) if Atom(name) is not atom)
            for number in range(500):
                Atom(f"{own} {round_} {number}")
            del mine
        start.wait()
        found.append([Atom(name) for name in names])

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        workers = [threading.Thread(target=work, args=(own,)) for own in range(threads)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
    finally:
        sys.setswitchinterval(before)
    assert not strange
    for atoms in zip(*found, strict=True):
        assert len(set(map(id, atoms))) == 1


def test_an_atom_made_by_two_threads_in_the_middle_of_a_sweep_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first thread rests where it makes the atom, while the second makes it too and sweeps."""
    table = terms._AtomTable()
    make, begun, swept = terms._new_atom, threading.Event(), threading.Event()
    made: list[Atom] = []

    def make_slowly(name: str) -> Atom:
        if not begun.is_set():
            begun.set()
            swept.wait(0.3)
        return make(name)

    class Passing(dict[str, weakref.ref[Atom]]):
        def items(self) -> Any:
            swept.set()
            other.join()
            return super().items()

    monkeypatch.setattr(terms, "_new_atom", make_slowly)
    monkeypatch.setattr(table, "_passing", Passing())
    other = threading.Thread(target=lambda: made.append(table.intern("twice")))
    other.start()
    begun.wait()
    mine = table.intern("twice")
    table._sweep()
    assert made == [mine]
    assert made[0] is mine is table.intern("twice")


def test_an_atom_with_a_long_name_is_one_while_it_is_used_and_freed_at_once() -> None:
    name = "long" * 10_000
    kept = Atom(name)
    assert Atom("".join(["long"] * 10_000)) is kept
    gone = weakref.ref(kept)
    del kept
    gc.collect()
    assert gone() is None
