"""Rules exported to plain ISO Prolog answer in other systems as they do in the engine."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from drlsl.cli import run
from drlsl.driving.export import FORMATS, RuleProgram, decide_all, draw_scenes
from drlsl.driving.export.iso_prolog import foreign_builtins, iso_text
from drlsl.driving.export.prolog_files import prolog_files
from drlsl.logic import Engine, PrologError
from drlsl.logic.terms import Atom, Operators, Var, format_term
from drlsl.lowering.ir import NotLowerable
from tests.lowering import programs

ROOT = Path(__file__).parents[2]
RULES = ROOT / "rules"
PROGRAMS = ("highway.pl", "paper.pl", "un_r157.pl", "overtake_left.pl", "merge.pl")
SCENES: Final = 200

needs_swipl = pytest.mark.skipif(shutil.which("swipl") is None, reason="SWI-Prolog is not installed")
needs_gprolog = pytest.mark.skipif(shutil.which("gprolog") is None, reason="GNU Prolog is not installed")


@pytest.fixture(scope="module", params=PROGRAMS)
def exported(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = RuleProgram.of([RULES / request.param])
    folder = tmp_path_factory.mktemp("prolog")
    scenes = draw_scenes(SCENES, 12, seed=4, ends=program.knows_lane_ends)
    write(folder, prolog_files(program, decide_all(program, scenes)))
    return folder


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).write_text(text)


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", command], cwd=folder, capture_output=True, text=True, check=False, timeout=120
    )


@needs_swipl
def test_an_export_passes_its_check_in_swi_prolog(exported: Path) -> None:
    ran = shell(FORMATS["prolog"].check, exported)
    assert (ran.returncode, ran.stdout, ran.stderr) == (
        0,
        f"{SCENES} of {SCENES} decisions are the stored ones\n",
        "",
    )


@needs_gprolog
def test_an_export_passes_its_check_in_gnu_prolog(exported: Path) -> None:
    consulted = "--consult-file rules.pl --consult-file check.pl"
    ran = shell(f"GLOBALSZ=1000000 gprolog {consulted} --query-goal drlsl_check,halt", exported)
    assert f"{SCENES} of {SCENES} decisions are the stored ones\n" in ran.stdout
    assert "warning" not in ran.stdout


@needs_swipl
def test_a_check_fails_if_one_decision_is_another(exported: Path, tmp_path: Path) -> None:
    write(tmp_path, {path.name: path.read_text() for path in exported.iterdir()})
    check = (tmp_path / "check.pl").read_text()
    changed = re.sub(r"\], answer\(\[", "], answer([stop, ", check, count=1)
    assert changed != check
    (tmp_path / "check.pl").write_text(changed)
    ran = shell(FORMATS["prolog"].check, tmp_path)
    assert ran.returncode != 0
    assert "the first that differs is scene 1\n" in ran.stdout


def test_an_export_is_one_program_without_what_iso_prolog_lacks(exported: Path) -> None:
    text = (exported / "rules.pl").read_text()
    assert re.findall(r"^:- (?!dynamic\()", text, re.M) == []
    for word in ("include", "ensure_loaded", "abolish", "aggregate_all", "forall(", "succ_or"):
        assert not re.search(rf"(?<!drlsl_)\b{re.escape(word)}", text.partition("% ---")[0]), word
    engine = Engine()
    engine.consult_text(text)
    # a name of our own library is hidden by the program's own, so none of these is a builtin of any other
    assert not {key for key in engine.predicates() if not key[0].startswith("drlsl_")} & foreign_builtins()


def test_a_name_that_is_a_builtin_elsewhere_is_replaced_wherever_it_is_called() -> None:
    engine = Engine()
    engine.consult_text("offset(X, Y) :- Y is X + 1.\np(Y) :- findall(Z, offset(1, Z), [Y]).\n")
    assert ("offset", 2) in foreign_builtins()
    text = iso_text(engine)
    assert "% offset/2 by another name\nrule_offset(X, Y) :-" in text
    assert "findall(Z, rule_offset(1, Z), [Y])" in text


@pytest.mark.parametrize(
    "goal",
    [
        "aggregate_all(max(X, W), member(X-W, [1-a, 2-b, 2-c]), max(Y, Z))",
        "aggregate_all(min(X, W), member(X-W, [3-a, 2-b, 2-c]), M), M = min(Y, Z)",
        "aggregate_all(max(X), member(X, [1, 3, 2]), Y), Z = none",
        "aggregate_all(sum(X), member(X, []), Y), aggregate_all(bag(X), member(X, [1, 1]), Z)",
        "aggregate_all(count, member(_, [a, b]), Y), aggregate_all(count, fail, Z)",
        "aggregate_all(max(X, W), member(X-W, []), max(Y, Z))",
        "between(1, 3, Y), Y > 2, length([a, b], Z)",
        "append(Y, Z, [1, 2])",
        "min_list([2, 1], Y), max_list([2, 1.5], Z), memberchk(Z, [1, 2])",
        "ignore(fail), forall(member(X, [1, 2]), X > 0), sum_list([1, 2.5], Y), Z = ok",
    ],
)
def test_the_prelude_answers_as_the_library(goal: str) -> None:
    engine, exported = Engine(), Engine()
    engine.consult_text(f"p(Y, Z) :- {goal}.")
    text = iso_text(engine)
    assert "drlsl_" in text
    exported.consult_text(text)
    assert list(exported.query("p(Y, Z)")) == list(engine.query("p(Y, Z)"))


@pytest.mark.parametrize(
    ("clause", "reason"),
    [
        ("p(X) :- atom_length(abc, X).", "atom_length/2 is neither of ISO Prolog nor in the prelude"),
        ("p(X) :- X is erf(1.0).", "erf/1 is not evaluated alike by all systems"),
        ("p(X) :- aggregate_all(set(Y), member(Y, [1]), X).", "only count, sum, max, min and bag"),
    ],
)
def test_what_other_systems_lack_is_refused(clause: str, reason: str) -> None:
    engine = Engine()
    engine.consult_text(clause)
    with pytest.raises(NotLowerable, match=re.escape(reason)):
        iso_text(engine)


def test_the_command_names_the_clause_that_it_refuses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = tmp_path / "odd.pl"
    rules.write_text(
        ":- include('highway.pl').\n:- abolish(longitudinal_velocity/1).\n"
        "longitudinal_velocity(V) :- atom_length(ego, V).\n"
    )
    assert run(["rules", "export", str(rules), "--to", "prolog", "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "odd.pl:3" in line
    assert "atom_length/2 is neither of ISO Prolog nor in the prelude" in line
    assert not (tmp_path / "out").exists()


_ASK = """
ask(Name, Goal, X, Wanted) :-
    catch(findall(X, Goal, Found), error(_, _), Found = error),
    (   alike(Found, Wanted) -> true ; writeq(differs(Name, Found, Wanted)), nl ).

alike(X, Y) :- var(X), !, Y == unbound.
alike(X, Y) :- number(X), !, number(Y), abs(X - Y) =< 1.0e-12 * max(abs(X), abs(Y)).
alike(X, Y) :- atomic(X), !, X == Y.
alike([X|Xs], [Y|Ys]) :- alike(X, Y), alike(Xs, Ys).
"""


def asks(engine: Engine, predicates: Sequence[tuple[str, int]]) -> str:
    """Goals that compare all solutions of each predicate with those of the engine."""
    lines = []
    for name, arity in predicates:
        variables = ", ".join(f"X{place}" for place in range(arity))
        goal = f"{name}({variables})" if arity else name
        try:
            found = [[one[f"X{place}"] for place in range(arity)] for one in engine.query(goal)]
            wanted = f"[{', '.join(map(row, found))}]"
        except PrologError:
            wanted = "error"
        lines.append(f":- initialization(ask({name}, {goal}, [{variables}], {wanted})).\n")
    return "".join(lines)


def row(values: Sequence[Any]) -> str:
    return f"[{', '.join(map(value_text, values))}]"


def value_text(value: Any) -> str:
    if isinstance(value, str | int | float):
        return format_term(Atom(value) if isinstance(value, str) else value, Operators(), quoted=True)
    assert isinstance(value, Var)
    return "unbound"


def differences(count: int, folder: Path) -> None:
    """Compare the answers of generated programs in the engine and, exported, in SWI-Prolog."""
    compared = 0

    @settings(
        max_examples=count,
        phases=[Phase.generate],
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(program=programs.programs(), facts=programs.facts())
    def compare(program: tuple[str, list[tuple[str, int]]], facts: Any) -> None:
        nonlocal compared
        text, predicates = program
        engine = Engine()
        engine.consult_text(text)
        told = []
        for (name, arity), rows in facts.items():
            engine.replace_facts(name, arity, rows)
            told += [f"{name}({row(values)[1:-1]}).\n" for values in rows]
        try:
            exported = iso_text(engine)
        except NotLowerable:
            return
        (folder / "session.pl").write_text("".join([exported, *told, _ASK, asks(engine, predicates)]))
        ran = shell("swipl -g halt session.pl", folder)
        assert ran.stdout == "", f"{text}\n{facts}\n{ran.stdout}"
        compared += 1

    compare()
    assert compared > count / 3


@needs_swipl
def test_generated_programs_answer_as_in_the_engine(tmp_path: Path) -> None:
    differences(30, tmp_path)


@needs_swipl
@pytest.mark.slow
def test_many_generated_programs_answer_as_in_the_engine(tmp_path: Path) -> None:
    differences(600, tmp_path)
