"""Loading as SWI-Prolog loads: byte order marks, files that name files, conditions, directives of others."""

from __future__ import annotations

import itertools
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.logic import Engine, PrologError
from drlsl.logic.loading import consult

BOM = "\ufeff"


def values(engine: Engine, goal: str = "p(X)") -> list[object]:
    return [solution["X"] for solution in engine.query(goal)]


def consulted(folder: Path, **files: str) -> Engine:
    """An engine that has loaded `main` of these files, written to a folder."""
    for name, text in files.items():
        (folder / f"{name}.pl").write_text(text, encoding="utf-8")
    engine = Engine()
    engine.consult(folder / "main.pl")
    return engine


def refused(folder: Path, **files: str) -> str:
    """What is said of a file that does not load."""
    with pytest.raises(PrologError) as caught:
        consulted(folder, **files)
    return str(caught.value)


def test_a_byte_order_mark_is_skipped_wherever_text_comes_from(tmp_path: Path) -> None:
    engine = consulted(
        tmp_path,
        main=f"{BOM}:- dynamic(p/1).\n:- include(other).\n:- consult(third).\n",
        other=f"{BOM}:- set_prolog_flag(double_quotes, atom).\nq(1).\n",
        third=f"{BOM}#! script\nr(1).\n",
    )
    assert engine.holds("predicate_property(p(_), dynamic), q(1), r(1)")
    assert engine.holds("current_prolog_flag(double_quotes, atom)")
    engine.consult_text(f"{BOM}:- dynamic(t/1).")
    assert engine.holds("\\+ t(_)")
    assert engine.holds(f"{BOM}q(1)")


def test_a_byte_order_mark_does_not_move_columns(tmp_path: Path) -> None:
    assert "main.pl:1:3:" in refused(tmp_path, main=f"{BOM}p )")


def test_lists_of_files_are_loaded(tmp_path: Path) -> None:
    engine = consulted(
        tmp_path, main=":- [one].\n:- [two, 'three.pl'].\n", one="p(1).", two="p2(2).", three="p3(3)."
    )
    assert engine.holds("p(1), p2(2), p3(3)")


@pytest.mark.parametrize("goal", ["consult(one)", "[one]", "ensure_loaded(one)", "load_files(one, [])"])
def test_files_are_loaded_by_goals(tmp_path: Path, goal: str) -> None:
    """Beside the file whose directive asks; a query looks in the working directory."""
    engine = consulted(tmp_path, main=f":- initialization((true, {goal})).", one="p(1).")
    assert values(engine) == [1]


def test_a_query_loads_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "one.pl").write_text("p(1).")
    monkeypatch.chdir(tmp_path)
    engine = Engine()
    assert engine.holds("consult(one), p(1)")
    (tmp_path / "one.pl").write_text("p(2).")
    assert engine.holds("[one], p(X), X == 2")
    assert engine.holds("catch(consult(nosuch), error(existence_error(source_sink, nosuch), _), true)")


def test_a_misspelt_file_is_told_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "limits.pl").write_text("limit(1).")
    engine = Engine()
    for name, meant in (
        ("higway.pl", "highway.pl"),
        ("higway", "highway.pl"),
        ("parts/limit", "parts/limits.pl"),
    ):
        (tmp_path / "main.pl").write_text(f":- ensure_loaded('{name}').")
        with pytest.raises(PrologError, match=rf"does not exist; did you mean {meant}\?, in ensure_loaded"):
            engine.consult(tmp_path / "main.pl")
    (tmp_path / "main.pl").write_text(":- ensure_loaded(nosuch).")
    with pytest.raises(PrologError) as caught:
        engine.consult(tmp_path / "main.pl")
    assert "did you mean" not in str(caught.value)


def test_a_text_finds_the_programs_that_ship(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    engine = Engine()
    engine.consult_text(":- ensure_loaded('highway.pl').")
    assert engine.defines("safe_actions", 1)
    (tmp_path / "highway.pl").write_text("own.")
    engine = Engine()
    engine.consult_text(":- ensure_loaded('highway.pl').")
    assert engine.predicates() == [("own", 0)], "a file of the user's comes first"


@pytest.mark.parametrize("goal", ["[user]", "consult(user)", "consult([user])"])
def test_the_terminal_is_no_file(tmp_path: Path, goal: str) -> None:
    with pytest.raises(PrologError, match=r"permission error: .*user.*terminal"):
        Engine().once(goal)
    assert "terminal" in refused(tmp_path, main=f":- {goal}.")


@pytest.mark.parametrize("directive", ["include", "consult", "[...]"])
@pytest.mark.parametrize("length", [1, 2, 3])
def test_circles_end_as_one_error(tmp_path: Path, directive: str, length: int) -> None:
    names = ["main", "b", "c"][:length]
    files = {
        name: f"p_{name}.\n:- {directive.replace('...', after)}."
        if directive == "[...]"
        else f"p_{name}.\n:- {directive}({after})."
        for name, after in zip(names, [*names[1:], "main"], strict=True)
    }
    message = refused(tmp_path, **files)
    assert len(message.splitlines()) == 1
    assert "main.pl" in message
    assert "circle" in message


def test_files_may_ask_for_each_other_with_ensure_loaded(tmp_path: Path) -> None:
    engine = consulted(
        tmp_path, main=":- ensure_loaded(b).\np(1).", b=":- ensure_loaded(main).\nq(1) :- p(1)."
    )
    assert engine.holds("q(1)")


def test_no_endless_chain_of_includes(tmp_path: Path) -> None:
    files = {f"f{number}": f":- include(f{number + 1})." for number in range(400)}
    assert "more than" in refused(tmp_path, main=":- include(f0).", **files)


@pytest.mark.parametrize("directive", ["include", "consult", "ensure_loaded"])
@pytest.mark.parametrize("text", ["root:x:0:0:secret:/root:/bin/sh\n", "secret.\nsecret(X).\n", "a(secret,"])
def test_a_file_that_is_no_rule_file_is_not_echoed(tmp_path: Path, directive: str, text: str) -> None:
    (tmp_path / "passwd").write_text(text)
    (tmp_path / "main.pl").write_text(f":- {directive}('{tmp_path}/passwd').\n:- foo(secret")
    engine = Engine()
    with pytest.raises(PrologError) as caught:
        engine.consult(tmp_path / "main.pl")
    named = [line for line in str(caught.value).splitlines() if "passwd" in line]
    assert all("secret" not in line for line in named)
    assert str(caught.value).count("secret") <= 2  # main.pl's own line


def test_no_message_sends_control_characters_to_the_terminal() -> None:
    engine = Engine(flags={"iso": "false"})
    for text in (
        "p('\x1b[31m', .",
        "p(\x1b[31m)",
        "p :- 'a\x07b'(1) 'c\x9bd'.",
        ":- 'no\x1bsuch'(1).",
        ":- include('\x1b[2J').",
    ):
        with pytest.raises(PrologError) as caught:
            engine.consult_text(text)
        assert all(char.isprintable() or char == "\n" for char in str(caught.value)), ascii(str(caught.value))
    with pytest.raises(PrologError) as caught:
        engine.once("atom_length(f('\\e[31m'), _)")
    assert str(caught.value).isprintable()
    assert engine.holds("writeq('\\e[31m'), format(atom(A), '~q', ['\\e']), A == '\\'\\\\x1b\\\\\\''")


IF = """
:- if(fail).
p(1).
p(2) :- ) 'what .
:- elif(Y = 1).
p(3) :- a,
    ) .
:- if(fail).
p(4).
:- else.
p(5).
:- endif.
:- elif(throw(never)).
p(6).
:- else.
p(7).
:- endif.
p(8).
"""


def test_conditions_choose_clauses() -> None:
    engine = Engine()
    engine.consult_text(IF.replace("p(3) :- a,\n    ) .\n", "p(3).\n"))
    assert values(engine) == [3, 5, 8]


def test_a_skipped_branch_may_hold_anything_that_ends() -> None:
    engine = Engine()
    engine.consult_text(":- if(fail).\np(1) :- ) .\n:- op(700, xfx, ===>).\np((a ===> b)).\n:- endif.\np(2).")
    assert values(engine) == [2]
    assert not engine.warnings


@pytest.mark.parametrize(
    ("text", "place", "what"),
    [
        ("p(1).\n:- if(true).\np(2).\n", "text:2", "endif"),
        ("p(1).\n:- endif.\n", "text:2", "without :- if"),
        ("p(1).\n\n:- else.\n", "text:3", "without :- if"),
        (":- elif(true).\n", "text:1", "without :- if"),
        (":- if(true).\n:- else.\n:- else.\n:- endif.\n", "text:3", "after :- else"),
        (":- if(true).\n:- else.\n:- elif(true).\n:- endif.\n", "text:3", "after :- else"),
        (":- if(X).\n:- endif.\n", "text:1", "instantiat"),
        ("\n:- if(nosuch).\n:- endif.\n", "text:2", "nosuch/0"),
        (":- if(throw(x)).\n:- else.\n:- endif.\n", "text:1", "x"),
    ],
)
def test_conditions_out_of_balance_are_errors(text: str, place: str, what: str) -> None:
    engine = Engine()
    with pytest.raises(PrologError) as caught:
        engine.consult_text(text)
    assert place in str(caught.value)
    assert what in str(caught.value)


def test_each_file_balances_its_own_conditions(tmp_path: Path) -> None:
    message = refused(tmp_path, main=":- include(other).\n:- endif.\n", other=":- if(true).\n")
    assert "other.pl:1" in message
    assert "main.pl:2" in message
    engine = consulted(
        tmp_path, main=":- if(fail).\n:- include(other).\n:- endif.\np(1).", other=":- if(true).\n"
    )
    assert values(engine) == [1]


def test_conditions_ask_for_the_system() -> None:
    engine = Engine()
    engine.consult_text(
        ":- if(current_prolog_flag(dialect, swi)).\np(swi).\n:- elif(current_prolog_flag(dialect, D)).\n"
        "p(D) :- current_prolog_flag(dialect, D).\n:- endif.\n"
        ":- if(exists_source(library(lists))).\np(lists).\n:- endif.\n"
        ":- if(\\+ exists_source(library(clpfd))).\np(no_clpfd).\n:- endif.\n"
        ":- if(\\+ catch(current_predicate(foo/1), _, fail)).\np(no_foo).\n:- endif.\n"
    )
    assert engine.holds("p(lists), p(no_clpfd), p(no_foo), \\+ p(swi)")


_BLOCKS = st.recursive(
    st.just("p."),
    lambda inner: st.tuples(
        st.sampled_from(["true", "fail"]),
        st.lists(inner, max_size=3),
        st.lists(st.tuples(st.sampled_from(["true", "fail"]), st.lists(inner, max_size=2)), max_size=2),
        st.none() | st.lists(inner, max_size=2),
    ),
    max_leaves=12,
)


def _program(blocks: list[Any], numbers: itertools.count[int]) -> str:
    lines = []
    for block in blocks:
        if isinstance(block, str):
            lines.append(f"p({next(numbers)}).")
            continue
        condition, body, others, last = block
        lines += [f":- if({condition}).", _program(body, numbers)]
        for other, inner in others:
            lines += [f":- elif({other}).", _program(inner, numbers)]
        if last is not None:
            lines += [":- else.", _program(last, numbers)]
        lines.append(":- endif.")
    return "\n".join(lines)


def _expected(blocks: list[Any], numbers: itertools.count[int], *, taken: bool) -> list[int]:
    found: list[int] = []
    for block in blocks:
        if isinstance(block, str):
            number = next(numbers)
            found += [number] * taken
            continue
        condition, body, others, last = block
        open_ = taken
        for holds, inner in [(condition, body), *others, ("true", last or [])]:
            found += _expected(inner, numbers, taken=open_ and holds == "true")
            open_ = open_ and holds != "true"
    return found


@settings(max_examples=100, deadline=None)
@given(blocks=st.lists(_BLOCKS, max_size=4))
def test_nested_conditions(blocks: list[object]) -> None:
    engine = Engine()
    engine.consult_text(":- dynamic(p/1).\n" + _program(blocks, itertools.count()))
    assert values(engine) == _expected(blocks, itertools.count(), taken=True)


def test_directives_without_a_meaning_here_warn_once() -> None:
    engine = Engine()
    engine.consult_text(
        ":- mode p(+).\n:- mode(q(+)).\n:- meta_predicate p(0).\n:- meta_predicate(q(0)).\n"
        ":- public p/1.\n:- public(q/1).\n:- module_transparent p/1.\n:- license(mit).\n"
        ":- set_prolog_flag(verbose, silent).\n:- encoding(utf8).\np(1).\nq(1)."
    )
    messages = [warning.message for warning in engine.warnings]
    for name in ("mode/1", "meta_predicate/1", "public/1"):
        assert sum(name in message for message in messages) == 1
    assert len(messages) == len(set(messages)) <= 7
    assert values(engine) == [1]


def test_a_program_may_define_such_a_predicate_itself() -> None:
    engine = Engine()
    engine.consult_text("mode(X) :- assertz(p(X)).\n:- mode(1).")
    assert values(engine) == [1]
    assert not engine.warnings


def test_modules_are_one_name_space(tmp_path: Path) -> None:
    engine = consulted(
        tmp_path,
        main=":- module(main, [p/1]).\n:- use_module(other).\n:- use_module(library(lists)).\n"
        ":- use_module(library(apply), [maplist/3]).\n:- reexport(other).\np(X) :- q(X).",
        other=":- module(other, [q/1]).\nq(1).",
    )
    assert values(engine) == [1]


def test_module_names_before_heads_indicators_and_goals_are_dropped() -> None:
    engine = Engine()
    engine.consult_text(
        ":- dynamic(user:p/1).\n:- discontiguous user:q/1, r/1.\n"
        "user:p(1).\nuser:q(X) :- lists:member(X, [1, 2]).\nuser:(r(X) :- q(X), X > 1).\nuser:s --> [a].\n"
        ":- user:assertz(p(2)).\n:- initialization(user:assertz(p(3)))."
    )
    assert values(engine) == [1, 2, 3]
    assert engine.holds("user:r(2), \\+ r(1), phrase(s, [a]), retract(user:p(1)), assertz(user:p(4)), p(4)")
    assert not engine.warnings
    with pytest.raises(PrologError):
        engine.consult_text("X:p(5).")


SWIPL_CASES = [
    IF.replace("p(3) :- a,\n    ) .\n", "p(3).\n").replace("'what ", ""),
    f"{BOM}:- dynamic p/1.\np(1).",
    ":- if(fail).\n:- if(true).\np(5).\n:- else.\np(6).\n:- endif.\n:- else.\np(7).\n:- endif.\n",
]


@pytest.mark.skipif(shutil.which("swipl") is None, reason="SWI-Prolog is not installed")
@pytest.mark.parametrize("text", SWIPL_CASES)
def test_as_swi_prolog_loads(tmp_path: Path, text: str) -> None:
    path = tmp_path / "main.pl"
    path.write_text(text, encoding="utf-8")
    goal = "forall(p(X), (write(X), nl))"
    done = subprocess.run(
        ["swipl", "-q", "-g", goal, "-t", "halt", str(path)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    engine = Engine()
    engine.consult(path)
    assert [str(value) for value in values(engine)] == done.stdout.split()


@pytest.mark.parametrize("directive", ["dynamic([{}])", "discontiguous([{}])", "table([{}])"])
def test_a_directive_may_list_any_number_of_predicates(directive: str) -> None:
    engine = Engine()
    engine.consult_text(f":- {directive.format(', '.join(f'p{n}/1' for n in range(3000)))}.\np2999(1).\n")
    assert engine.holds("p2999(1)")


def test_a_file_that_never_ends_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(consult, "LARGEST_FILE", 2**20)
    with pytest.raises(OSError, match="it is larger than 1 MiB"):
        Engine().consult("/dev/zero")
