"""Machine code says what the interpreter says, takes arrays as they come, and is kept from run to run."""

from __future__ import annotations

import logging
import math
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drlsl.driving import shield
from drlsl.driving.scene import EGO, SCHEMA, Scene, Vehicle
from drlsl.driving.shield import query_of
from drlsl.lowering.backends import (
    Floats1,
    Rows,
    Words1,
    compile_numba,
    compile_numpy,
    numba_compile,
    numba_operations,
    prefetch,
)
from drlsl.lowering.backends.batch_program import BatchResult
from drlsl.lowering.backends.loop_ops import CALLED
from drlsl.lowering.backends.numba_backend import NumbaProgram
from drlsl.lowering.backends.numba_compile import compiled_function
from drlsl.lowering.frontend import Lowered, Query, lower
from tests.lowering import programs
from tests.lowering.plain import compile_plain
from tests.lowering.test_lower import engine_of
from tests.lowering.test_rules import PROGRAMS, engine, facts
from tests.lowering.tiers import Facts, array_value, ask, columns_of, expected_value, to_rows
from tests.scenes import road, scenes

numba = pytest.importorskip("numba", reason="Numba is not installed")

ACTIONS = query_of(shield.ACTIONS)
DRIVING = tuple(
    query_of(one) for one in (shield.ACTIONS, shield.FREE, shield.SPEED, shield.STATE, shield.ENTRY)
)
LANE = query_of(shield.LANE)
VEHICLE, LANES = ("vehicle", 8), ("road_lane", 5)

Arrays = dict[tuple[str, int], Rows]


@cache
def lowered(program: str) -> Lowered:
    return lower(engine(program), SCHEMA, (*DRIVING, LANE) if program == "highway.pl" else DRIVING)


@cache
def machine_code(program: str = "highway.pl") -> NumbaProgram:
    return compile_numba(lowered(program))


def arrays(drawn: Sequence[Scene], program: Any = None) -> Arrays:
    return to_rows(program or machine_code(), SCHEMA, [facts(scene) for scene in drawn])


def assert_same(one: BatchResult[Any], other: BatchResult[Any]) -> None:
    """The same answers in the same form."""
    assert np.array_equal(one.undecided, other.undecided)
    for left, right in zip(one.answers, other.answers, strict=True):
        assert left.value.dtype == right.value.dtype
        assert left.value.shape == right.value.shape
        assert np.array_equal(left.fails | one.undecided, right.fails | one.undecided)
        there = ~(left.fails | one.undecided)
        assert np.array_equal(left.value[there], right.value[there])


SPECIAL = (0.0, -0.0, 1.0, -1.0, 1e-310, 1e308, math.inf, -math.inf, math.nan, 0, 1, -7, 2**61)


@pytest.mark.parametrize("name", ["lesser", "greater", "quotient", "choose"])
def test_operations_written_as_instructions_are_the_functions_of_their_names(name: str) -> None:
    numba_compile._make_known()
    function = CALLED[name]
    conds = [(True,), (False,)] if name == "choose" else [()]
    machine = numba.njit(lambda *args: function(*args), error_model="numpy")
    for args in ((*cond, one, other) for cond in conds for one in SPECIAL for other in SPECIAL):
        found, expected = machine(*args), function(*args)
        if name != "quotient" and isinstance(args[-1], int) and isinstance(args[-2], int):
            assert type(found) is int
        # a number of either type becomes a float
        assert struct.pack("d", found) == struct.pack("d", expected) or (
            found != found and expected != expected
        )


def crowd(count: int, *, spread: float = 3.0, on: int = 3) -> Scene:
    """`count` vehicles on three lanes; with no spread, in three heaps."""
    ways = road(0, on)
    others = tuple(
        Vehicle(f"v{n}", lane.id, spread * n - 60.0, lane.centre, 20.0 + n % 5, 0.1 * (n % 3 - 1), 4.6, 1.9)
        for n in range(count)
        for lane in (ways.lanes[n % on],)
    )
    ego = Vehicle(EGO, 2, 0.0, ways.lanes[1].centre, 25.0, 0.0, 4.6, 1.9)
    return Scene(ways, ego, others, 2)


@pytest.mark.parametrize("program", PROGRAMS)
@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
@given(drawn=st.lists(scenes(), min_size=1, max_size=4))
def test_what_driving_asks(program: str, drawn: list[Scene]) -> None:
    code = machine_code(program)
    given = arrays(drawn, code)
    result = code(given)
    assert not result.undecided.any()
    assert_same(result, compile_numpy(lowered(program))(given))
    for answer, got in zip(lowered(program).answers, result.answers, strict=True):
        for n, scene in enumerate(drawn):
            wanted = expected_value(code, answer.query, ask(engine(program), answer.query, facts(scene)))
            assert array_value(code, answer.query, got.value[n], bool(got.fails[n])) == wanted


@pytest.mark.parametrize(
    "scene", [crowd(0), crowd(1), crowd(60), crowd(60, spread=0.0), crowd(3, spread=0.0)]
)
def test_many_vehicles_none_and_all_at_one_place(scene: Scene) -> None:
    given = arrays([scene, crowd(2)])
    result = machine_code()(given)
    assert not result.undecided.any()
    assert_same(result, compile_plain(lowered("highway.pl"))(given))
    assert_same(result, compile_numpy(lowered("highway.pl"))(given))


NUMBERS = """
p(A, B, C, D) :- steps(N), car(c1, K, _, _), A is K // N, B is K mod N, C is K div N, D is K rem N.
q(A, B, C, D) :-
    limit(X), A is round(X), B is truncate(X), C is ceiling(X), D is floor(X) + sign(truncate(X)).
r(A, B, C, D) :-
    limit(X), car(c1, _, Y, _),
    A is exp(X / 7.0), B is sin(Y) + atan(X), C is abs(X) ** 0.5, D is sqrt(X / Y).
s(C) :- aggregate_all(max(V, D), ( car(D, K, _, V), slot(K, left, _) ), max(_, C)).
t(S) :- aggregate_all(sum(Z), seen(_, Z), S).
u(M, N) :-
    aggregate_all(min(K), car(_, K, _, _), M), aggregate_all(count, ( car(_, K, _, _), slot(K, _, _) ), N).
v(W) :- car(C, K, X, _), X > 0.5, C \\== ego, slot(K, _, W).
"""


@cache
def number_programs() -> tuple[Lowered, NumbaProgram, Callable[..., Any], Callable[..., Any]]:
    asked = [
        Query(name, arity, "first") for name, arity in zip("pqrstuv", (4, 4, 4, 1, 1, 2, 1), strict=True)
    ]
    form = lower(engine_of(NUMBERS), programs.SCHEMA, asked)
    return form, compile_numba(form), compile_plain(form), compile_numpy(form)


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@given(told=st.lists(programs.facts(), min_size=1, max_size=5))
def test_every_kind_of_number(told: list[Facts]) -> None:
    _, code, plain, numpy = number_programs()
    given = to_rows(code, programs.SCHEMA, told)
    result = code(given)
    assert_same(result, plain(given))
    assert_same(result, numpy(given))


def test_one_query_at_a_time_agrees_with_the_interpreter_on_numbers() -> None:
    """Where one answer of a scene is undecided all are, so the program above seldom decides."""
    told: Facts = {
        ("car", 4): [("ego", 1, 0.0, 0.0), ("c1", -7, 2.0, 3.0), ("c2", 2, 0.7, 3.0)],
        ("slot", 3): [(2, "left", 3.25), (-7, "left", 1.5)],
        ("seen", 2): [(1, 0.1), (1, 0.2), (2, 0.3)],
        ("limit", 1): [(3.5,)],
        ("steps", 1): [(2,)],
    }
    form, code, _, _ = number_programs()
    result = code(to_rows(code, programs.SCHEMA, [told]))
    assert not result.undecided.any()
    for answer, got in zip(form.answers, result.answers, strict=True):
        wanted = expected_value(code, answer.query, ask(engine_of(NUMBERS), answer.query, told))
        assert array_value(code, answer.query, got.value[0], bool(got.fails[0])) == wanted


@pytest.mark.parametrize(
    ("key", "place", "value"),
    [
        (VEHICLE, 2, np.nan),
        (VEHICLE, 6, np.inf),
        (VEHICLE, 3, 1e16),
        (VEHICLE, 1, 2**60),
        (VEHICLE, 1, -(2**63)),
        (LANES, 4, np.nan),
        (("time_step", 1), 0, np.nan),
        (("time_step", 1), 0, 0.0),
        (("target_lane", 1), 0, 2**60),
    ],
)
def test_facts_out_of_bounds_leave_one_scene_undecided(
    key: tuple[str, int], place: int, value: float
) -> None:
    given = arrays([crowd(5), crowd(5), crowd(5)])
    column = given[key].columns[place]
    assert column is not None
    column[(1, 1) if column.ndim == 2 else 1] = value
    result = machine_code()(given)
    assert result.undecided.tolist() == [False, True, False]
    for answer in result.answers:
        assert answer.fails[1] or not answer.value[1]
        assert (
            answer.value.dtype == np.bool_
            or answer.value.dtype == np.int64
            or np.isnan(answer.value[1]).all()
        )
    assert_same(result, compile_numpy(lowered("highway.pl"))(given))


def test_what_is_not_there_may_hold_anything() -> None:
    given = arrays([crowd(5), crowd(2)])
    wanted = machine_code()(given)
    for column in given[VEHICLE].columns[1:]:
        assert column is not None
        column[1, 3:] = np.nan if column.dtype == np.float64 else -(2**63)
    assert_same(machine_code()(given), wanted)


def test_keys_that_are_not_unique_and_an_ego_that_is_not_there() -> None:
    given = arrays([crowd(3), crowd(3), crowd(3)])
    lanes = given[LANES].columns[0]
    assert lanes is not None
    lanes[0, 1] = lanes[0, 0]
    valid = given[VEHICLE].valid
    assert valid is not None
    valid[2, 0] = False
    result = machine_code()(given)
    assert result.undecided.tolist() == [True, False, True]
    assert_same(result, compile_numpy(lowered("highway.pl"))(given))


@pytest.mark.parametrize("count", [0, 1, 2, 257])
def test_sizes_of_batches(count: int) -> None:
    made = [crowd(n % 7) for n in range(max(count, 1))]
    given = {key: part(rows, slice(0, count)) for key, rows in arrays(made).items()}
    result = machine_code()(given)
    assert result.undecided.shape == (count,)
    assert_same(result, compile_numpy(lowered("highway.pl"))(given))


def part(rows: Rows, scenes: slice) -> Rows:
    columns = [column if column is None else column[scenes] for column in rows.columns]
    return Rows(columns, None if rows.valid is None else rows.valid[scenes])


def changed(rows: Rows, change: Callable[[Any], Any]) -> Rows:
    return Rows(
        [change(column) for column in rows.columns], None if rows.valid is None else change(rows.valid)
    )


def read_only(column: Any) -> Any:
    column = column.copy()
    column.flags.writeable = False
    return column


def every_other(column: Any) -> Any:
    return np.repeat(column, 2, axis=-1)[..., ::2]


def narrow(column: Any) -> Any:
    return column.astype(np.int32) if column.dtype == np.int64 else column


@pytest.mark.parametrize("change", [np.asfortranarray, read_only, every_other, narrow])
def test_arrays_of_every_make(change: Callable[[Any], Any]) -> None:
    given = arrays([crowd(n) for n in (4, 2, 0)])
    wanted = machine_code()(given)
    assert not wanted.undecided.any()
    assert_same(machine_code()({key: changed(rows, change) for key, rows in given.items()}), wanted)


def test_shared_rows_masks_left_out_and_columns_that_are_not_read() -> None:
    given = arrays([crowd(4), crowd(4, spread=9.0), crowd(4, spread=1.0)])
    wanted = machine_code()(given)
    shared = {
        key: Rows([c[:1] for c in columns_of(given[key])])
        for key in given
        if key not in (VEHICLE, ("target_lane", 1))
    }
    vehicles = Rows([None, *given[VEHICLE].columns[1:]])
    assert_same(machine_code()({**given, **shared, VEHICLE: vehicles}), wanted)
    one = {key: part(rows, slice(1, 2)) for key, rows in given.items()}
    columns = columns_of(given[VEHICLE])
    mixed = Rows([*columns[:2], *(c[:1] for c in columns[2:])], given[VEHICLE].valid)
    wide = Rows([None if c is None else np.broadcast_to(c, (3, 5)) for c in mixed.columns], mixed.valid)
    assert_same(machine_code()({**given, VEHICLE: mixed}), machine_code()({**given, VEHICLE: wide}))
    assert machine_code()(one).undecided.shape == (1,)


def test_a_mask_left_out_where_no_column_is_read() -> None:
    """How many scenes there are, then only the columns say that the rules do not read."""
    form = lower(engine_of("p :- steps(_)."), programs.SCHEMA, [Query("p", 0, "holds")])
    for code in (compile_numba(form), compile_plain(form)):
        for count in (1, 3):
            result = code({("steps", 1): Rows([np.arange(count)])})
            assert result.answers[0].value.tolist() == [True] * count


def test_roads_by_index() -> None:
    made = [crowd(n, on=2 + n % 2) for n in range(6)]
    given = arrays(made)
    index = np.array([3, 2, 3, 0, 5, 1])
    roads = [key for key in given if key not in (VEHICLE, ("target_lane", 1))]
    gathered = {key: changed(given[key], lambda column: column[index]) for key in roads}
    indexed = {key: Rows(given[key].columns, given[key].valid, index) for key in roads}
    wanted = machine_code()({**given, **gathered})
    assert not wanted.undecided.all()
    assert_same(machine_code()({**given, **indexed}), wanted)
    assert_same(compile_numpy(lowered("highway.pl"))({**given, **indexed}), wanted)
    assert_same(compile_plain(lowered("highway.pl"))({**given, **indexed}), wanted)
    loose = {key: Rows(rows.columns, rows.valid, index.astype(np.int32)) for key, rows in indexed.items()}
    assert_same(machine_code()({**given, **loose}), wanted)


@pytest.mark.parametrize("bad", [[0, 1, 3], [0, -1, 2], [0, 1]])
def test_an_index_beyond_the_tables(bad: list[int]) -> None:
    given = arrays([crowd(2), crowd(3), crowd(1)])
    given[LANES] = Rows(given[LANES].columns, given[LANES].valid, np.array(bad))
    for program in (machine_code(), compile_numpy(lowered("highway.pl"))):
        with pytest.raises(ValueError, match=r"index beyond|scenes"):
            program(given)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({LANES: None}, "no facts of road_lane/5"),
        ({LANES: Rows([np.ones((3, 1))] * 2)}, "road_lane/5: 2 columns"),
        ({LANES: Rows([np.ones(3, dtype=int)] * 5)}, "a column of shape"),
        ({VEHICLE: Rows([None, None, *[np.ones((3, 1))] * 6])}, "column 1 of vehicle/8"),
        ({LANES: Rows([np.ones((2, 1), dtype=int)] * 5)}, "scenes"),
        ({LANES: Rows([np.full((3, 1), 1.5)] * 5)}, "float64"),
    ],
)
def test_arrays_that_do_not_fit(change: dict[tuple[str, int], Rows | None], message: str) -> None:
    given = {**arrays([crowd(2), crowd(3), crowd(1)]), **change}
    with pytest.raises(ValueError, match=message):
        machine_code()({key: rows for key, rows in given.items() if rows is not None})


def test_no_room_for_a_vehicle() -> None:
    given = arrays([crowd(2), crowd(3)])
    given[VEHICLE] = changed(given[VEHICLE], lambda column: column[:, :0])
    assert machine_code()(given).undecided.all()


def test_a_bound_program_reads_its_arrays_anew() -> None:
    given = arrays([crowd(3), crowd(5)])
    bound = machine_code().bind(given)
    before = bound()
    assert_same(before, machine_code()(given))
    assert before.answers[1].value.tolist() == machine_code()(given).answers[1].value.tolist()
    columns_of(given[VEHICLE])[2][...] = 500.0
    after = bound()
    assert after is before
    assert after.answers[1].value.all()
    assert_same(after, machine_code()(given))


def test_a_bound_program_takes_no_array_that_it_would_have_to_copy() -> None:
    given = arrays([crowd(3), crowd(5)])
    given[VEHICLE] = changed(given[VEHICLE], np.asfortranarray)
    with pytest.raises(ValueError, match=r"vehicle_lane cannot be read in place"):
        machine_code().bind(given)
    given[VEHICLE] = machine_code().table("vehicle", 8, given[VEHICLE])
    assert not machine_code().bind(given)().undecided.any()


def test_a_bound_program_notices_an_index_that_went_wrong() -> None:
    given = arrays([crowd(3), crowd(5)])
    index = np.array([1, 0])
    given[LANES] = Rows(given[LANES].columns, given[LANES].valid, index)
    bound = machine_code().bind(given)
    index[1] = 2
    with pytest.raises(ValueError, match="index"):
        bound()


SMALL = """
import logging, sys
from pathlib import Path
logging.basicConfig(level=logging.WARNING)
from drlsl.lowering import Query, lower
from drlsl.lowering import Rows, compile_numba
from tests.lowering.test_lower import SCHEMA, engine_of
import numpy as np
form = lower(engine_of("p(X) :- limit(L), X is exp(L) + 1."), SCHEMA, [Query("p", 1, "first")])
program = compile_numba(form, Path(sys.argv[1]))
assert program({("limit", 1): Rows([np.array([0.0, 1e16])])}).answers[0].value[0] == 2.0
hits = getattr(program._function, "stats").cache_hits
print(sum(hits.values()))
"""


def run_small(folder: Path) -> tuple[int, str]:
    """In another process: how often machine code was loaded, and what was logged."""
    done = subprocess.run(
        [sys.executable, "-c", SMALL, str(folder)],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[2],
    )
    return int(done.stdout), done.stderr


def test_machine_code_is_kept_and_a_damaged_copy_made_anew(tmp_path: Path) -> None:
    assert run_small(tmp_path / "rules") == (0, "")
    assert run_small(tmp_path / "rules") == (1, "")
    kept = [path for path in (tmp_path / "rules").rglob("*") if path.suffix in (".nbi", ".nbc")]
    assert {path.suffix for path in kept} == {".nbi", ".nbc"}
    for path in kept:
        content = bytearray(path.read_bytes())
        # One bit in the middle: in the code itself, it would be run.
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
        hits, logged = run_small(tmp_path / "rules")
        assert hits == 0
        assert f"{path}: damaged machine code, made anew" in logged
        assert run_small(tmp_path / "rules") == (1, "")


def test_a_folder_that_cannot_be_written(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    form = lower(engine_of("p :- true."), programs.SCHEMA, [Query("p", 0, "holds")])
    with caplog.at_level(logging.WARNING):
        program = compile_numba(form, tmp_path / "file" / "rules")
    assert program({}).answers[0].value.tolist() == [True]
    assert "cannot be kept there" in caplog.text


def test_compiling_is_told_and_loading_is_not(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Also of a plain function, such as the loops of the world."""
    forget()
    form = lower(engine_of("p :- true."), programs.SCHEMA, [Query("p", 0, "holds")])
    for told in (["compiling rules to machine code, once", "compiling added to machine code, once"], []):
        caplog.clear()
        with caplog.at_level(logging.INFO):
            program = compile_numba(form, tmp_path)
            function = compiled_function(added, tmp_path)
        assert program({}).answers[0].value.tolist() == [True]
        assert function(2, np.array([0.5, 1.0])) == 2.0
        assert [record.getMessage() for record in caplog.records] == told
        forget()


def forget() -> None:
    """Forget what was compiled in this process."""
    for name in [name for name in sys.modules if name.startswith(("rules_", "added_"))]:
        del sys.modules[name]


FACTOR = 0.5


def added(count: int, numbers: Floats1) -> float:
    return sum_of(numbers) * FACTOR * count + 0.5


def sum_of(numbers: Floats1) -> float:
    total = 0.0
    for number in numbers:
        total += number
    return total


def test_a_function_is_compiled_anew_when_a_constant_or_what_it_calls_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = np.array([0.5, 1.0])
    assert compiled_function(added, tmp_path)(2, numbers) == 2.0
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 2.0)
    assert compiled_function(added, tmp_path)(2, numbers) == 6.5
    monkeypatch.setattr(sys.modules[__name__], "sum_of", least_of)
    assert compiled_function(added, tmp_path)(2, numbers) == 2.5


def least_of(numbers: Floats1) -> float:
    return float(min(numbers[0], numbers[1]))


def test_a_function_in_a_folder_that_cannot_be_written(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    forget()
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    assert compiled_function(added, tmp_path / "file" / "code")(2, np.array([0.5, 1.0])) == 2.0
    assert "cannot be kept there" in caplog.text


def test_a_function_of_other_types_is_refused(tmp_path: Path) -> None:
    def texts(one: str) -> None:
        """Take what machine code cannot."""

    with pytest.raises(TypeError, match="one is str, no type"):
        compiled_function(texts, tmp_path)


def last_fetched(words: Words1, begin: int, end: int) -> int:
    prefetch(words, begin, end)
    return int(words[end - 1])


def test_words_are_fetched_ahead_line_by_line(tmp_path: Path) -> None:
    words = np.arange(100, dtype=np.int32)
    fetching = compiled_function(last_fetched, tmp_path)
    for begin, end in ((0, 100), (3, 4), (99, 100), (0, 17)):
        assert fetching(words, begin, end) == last_fetched(words, begin, end) == end - 1
    (text,) = compiled_function(last_fetched, None).inspect_llvm().values()  # type: ignore[attr-defined]
    assert "call void @llvm.prefetch" in text


def test_code_that_fetches_ahead_depends_on_how_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled_function(last_fetched, tmp_path)
    for path in tmp_path.iterdir():
        path.unlink() if path.is_file() else shutil.rmtree(path)
    compiled_function(last_fetched, tmp_path)
    assert not list(tmp_path.glob("last_fetched_*.py")), "it is known in this process"
    changed = tmp_path / "numba_operations.py"
    changed.write_text(Path(str(numba_operations.__file__)).read_text() + "\n# another way\n")
    monkeypatch.setattr(numba_operations, "__file__", str(changed))
    compiled_function(last_fetched, tmp_path)
    assert len(list(tmp_path.glob("last_fetched_*.py"))) == 1


def zeros_of(count: int) -> float:
    return float(np.zeros(count)[0])


def test_a_function_that_makes_an_array_is_refused(tmp_path: Path) -> None:
    """Machine code counts no references, so that nothing would ever free the array."""
    with pytest.raises(numba.core.errors.NumbaError, match="function zeros"):
        compiled_function(zeros_of, tmp_path)


def test_machine_code_has_no_parts_that_nobody_uses() -> None:
    """Counting references to arrays, and calls from C, took a quarter of the time of the compiler."""
    (text,) = machine_code()._function.inspect_llvm().values()
    assert "@cfunc." not in text
    assert "NRT_" not in text
