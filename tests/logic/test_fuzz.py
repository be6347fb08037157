"""Nothing but a PrologError comes of any text: token soup, mutated files, and coverage-guided fuzzing."""

from __future__ import annotations

import importlib.util
import io
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drlsl.logic.jit import tiering as tiers

ROOT = Path(__file__).parents[2]
CORPUS = Path(__file__).parent / "corpus"


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("fuzz_targets", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


targets = _load(ROOT / "fuzz" / "targets.py")

_TOKENS = """
a b p q foo [] {} ! X Y _ _Z 0 1 2 17 1.5 1.0e10 0'a 0x1F 0b1 "str" `back` 'q a' '' '\\n' '\\x41\\' ( ) [ ]
{ } , |
; -> *-> :- --> \\+ = \\= == @< =.. is + - * / // mod rem abs max < =:= >= ^ . . . % /* */ ?- \\ : $ § é 日
member append call catch throw findall bagof setof forall once ignore not assertz retract clause atom_length
atom_codes sub_atom functor arg copy_term number_codes atom_chars msort sort keysort between succ nb_setval
b_getval format write writeq print write_canonical read_term term_to_atom op dynamic discontiguous
phrase maplist foldl aggregate_all count max bag string_concat split_string setup_call_cleanup repeat halt
fail true nl tab atom number var error type_error compare unify_with_occurs_check listing numbervars $VAR
"""
TOKENS = _TOKENS.split()
FILES = sorted([*CORPUS.rglob("*.pl"), *(ROOT / "rules").glob("*.pl")])


@pytest.fixture(autouse=True)
def _compile_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tiers, "PATIENCE", 0)
    monkeypatch.setattr("sys.stdin", io.StringIO("a. b(X) :- c.\n"))


def soups(longest: int) -> st.SearchStrategy[str]:
    """Tokens in any order, with and without layout between them."""
    token = st.sampled_from(TOKENS) | st.text(max_size=2)
    return st.lists(st.tuples(token, st.sampled_from([" ", "", "\n"])), max_size=longest).map(
        lambda pairs: "".join(token + layout for token, layout in pairs)
    )


# Terms that are goals more often than soup is.
_LEAVES = "X Y Z a [] 0 1 -1 1.5 'A' foo(X) [a,b|T] \"s\" p(1) _ (a,b) (X=1;Y=2) {a} '$VAR'(1)"
_ARGUMENTS = st.recursive(
    st.sampled_from(_LEAVES.split()),
    lambda inner: (
        st.builds("[{}]".format, inner)
        | st.builds("f({},{})".format, inner, inner)
        | st.builds("{}-{}".format, inner, inner)
        | st.builds("({},{})".format, inner, inner)
        | st.builds("[{}|{}]".format, inner, inner)
    ),
    max_leaves=3,
)


@st.composite
def goals(draw: st.DrawFn) -> str:
    """A conjunction of calls of builtins, with arguments of any kind."""
    engine_names = draw(st.lists(st.sampled_from(_builtins()), min_size=1, max_size=3))
    calls = []
    for name, arity in engine_names:
        args = ", ".join(draw(_ARGUMENTS) for _ in range(arity))
        calls.append(f"'{name}'({args})" if arity else f"'{name}'")
    text = ", ".join(calls)
    return f"catch(({text}), error(_, _), true)" if draw(st.booleans()) else text


def _builtins() -> list[tuple[str, int]]:
    from drlsl.logic.core import builtin_table as registry
    from drlsl.logic.loading import library

    known = {*registry.builtin_indicators(), *library().exports}
    # Backslashes would need quoting; these would end the process's input, or take files.
    skipped = ("$", "read", "see", "open", "consult", "length", "numlist", "include", "tab", "sleep", "shell")
    return sorted((name, arity) for name, arity in known if "\\" not in name and not name.startswith(skipped))


@settings(max_examples=300, deadline=None)
@given(soups(25))
@example("a" * 5_000 + "(" * 5_000)
@example('X = "\\')
@example("0'")
@example("\ud800".encode("utf-8", "replace").decode())
def test_reading_token_soup(text: str) -> None:
    targets.read(text)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(FILES), st.data())
def test_reading_mutated_files(path: Path, data: st.DataObject) -> None:
    text = path.read_text(encoding="utf-8")
    start = data.draw(st.integers(0, len(text)), label="start")
    end = data.draw(st.integers(start, min(len(text), start + 40)), label="end")
    window = text[max(0, start - 600) : end + 600]
    cut = min(start, 600)
    targets.read(window[:cut] + data.draw(soups(4), label="in place") + window[cut + end - start :])


@settings(max_examples=150, deadline=None)
@given(soups(30), soups(12), st.booleans())
def test_loading_and_asking_token_soup(program: str, goal: str, compiled: bool) -> None:
    targets.consult(program, goal, compiled=compiled)


@settings(max_examples=300, deadline=None)
@given(goals(), st.booleans())
def test_builtins_with_arguments_of_any_kind(goal: str, compiled: bool) -> None:
    targets.consult("p(1). p(2). q(X) :- p(X), X > 1. f(X, Y) :- p(X), Y = X.", goal, compiled=compiled)


@settings(max_examples=150, deadline=None)
@given(st.lists(goals(), min_size=1, max_size=3), st.booleans())
def test_clauses_that_call_builtins(bodies: list[str], compiled: bool) -> None:
    program = "p(1). p(2). " + " ".join(f"r(X, Y) :- {body}." for body in bodies)
    targets.consult(program, "r(A, B)", compiled=compiled)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fuzz_reader", "fuzz_consult"])
def test_coverage_guided(name: str, tmp_path: Path) -> None:
    pytest.importorskip("atheris", reason="atheris is not installed: pip install 'drlsl[fuzz]'")
    for path in FILES:
        (tmp_path / path.name).write_bytes(path.read_bytes()[:4_000])
    command = [sys.executable, str(ROOT / "fuzz" / f"{name}.py"), str(tmp_path), "-max_total_time=20"]
    limits = ["-timeout=30", "-rss_limit_mb=2048", f"-artifact_prefix={tmp_path}/", "-max_len=2000"]
    done = subprocess.run([*command, *limits], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout[-3_000:] + done.stderr[-3_000:]
