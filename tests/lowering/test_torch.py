"""Torch beside NumPy: the same bits, whatever the facts look like and wherever they are."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from drlsl.benchmarks import random_scenes
from drlsl.driving.scene import SCHEMA, Scene, road_facts, scene_facts
from drlsl.driving.shield import ACTIONS, FREE, SPEED, STATE, query_of
from drlsl.logic import Engine
from drlsl.lowering.backends import Rows, compile_numpy, compile_torch, numpy_ops, torch_ops
from drlsl.lowering.backends.batch_program import BatchResult, Precision
from drlsl.lowering.backends.torch_backend import TorchProgram
from drlsl.lowering.frontend import Lowered, Query, lower
from drlsl.lowering.ir import FLOAT32_BOUND, INT_BOUND, NotLowerable, Relation, Schema
from tests.lowering import programs
from tests.lowering.test_lower import engine_of
from tests.lowering.tiers import Program, columns_of, to_rows

RULES = Path(__file__).parents[2] / "rules"
CPU = torch.device("cpu")
DEVICES = [
    "cpu",
    pytest.param(
        "cuda",
        marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="Torch finds no CUDA device"),
    ),
]
PRECISIONS: tuple[Precision, ...] = ("float64", "float32")

Facts = dict[tuple[str, int], Rows]


@cache
def lowered(program: str) -> Lowered:
    engine = Engine()
    engine.consult(RULES / program)
    return lower(engine, SCHEMA, [query_of(one) for one in (ACTIONS, FREE, SPEED, STATE)])


def rows_of(program: Program, scenes: Sequence[Scene]) -> Facts:
    return to_rows(program, SCHEMA, [{**road_facts(scene.road), **scene_facts(scene)} for scene in scenes])


def changed(facts: Facts, change: Callable[[Any], Any]) -> Facts:
    """The same facts with every array in another form."""
    return {
        key: Rows(
            [column if column is None else change(column) for column in rows.columns],
            rows.valid if rows.valid is None else change(rows.valid),
        )
        for key, rows in facts.items()
    }


def host(tensor: Any) -> np.ndarray[Any, Any]:
    return tensor.cpu().numpy() if isinstance(tensor, torch.Tensor) else np.asarray(tensor)


def assert_same(left: BatchResult[Any], right: BatchResult[Any]) -> None:
    """Equal in every bit that means something."""
    undecided = host(left.undecided)
    assert np.array_equal(undecided, host(right.undecided))
    for mine, other in zip(left.answers, right.answers, strict=True):
        assert host(mine.value).dtype == host(other.value).dtype
        assert np.array_equal(host(mine.fails)[~undecided], host(other.fails)[~undecided])
        counts = ~undecided & ~host(mine.fails)
        assert host(mine.value).shape == host(other.value).shape
        assert np.array_equal(host(mine.value)[counts], host(other.value)[counts])


def mixed_scenes(count: int) -> list[Scene]:
    """Scenes with 60 vehicles, with 7 and with none."""
    kinds = [random_scenes(count, vehicles, seed=vehicles) for vehicles in (60, 7, 0)]
    return [kinds[n % 3][n] for n in range(count)]


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("dtype", PRECISIONS)
@pytest.mark.parametrize("program", ["highway.pl", "paper.pl"])
def test_the_bits_are_those_of_numpy(program: str, dtype: Precision, device: str) -> None:
    code = lowered(program)
    ours, theirs = compile_torch(code, dtype, device), compile_numpy(code, dtype)
    scenes = mixed_scenes(257)
    facts = rows_of(ours, scenes)
    assert_same(ours(facts), theirs(facts))
    alone = changed(facts, lambda array: array[:1])
    assert_same(ours(alone), theirs(alone))
    roads = {key: rows for key, rows in alone.items() if key != ("vehicle", 8)}
    none = {**facts, **roads, ("vehicle", 8): Rows([c[:0] for c in columns_of(facts["vehicle", 8])])}
    for result in (ours(none), theirs(none)):
        assert result.undecided.shape == (0,)
        observed = 21 if program == "highway.pl" else 10
        assert [tuple(answer.value.shape) for answer in result.answers] == [(0, 3), (0,), (0,), (0, observed)]
    shared = {**facts, **{key: rows for key, rows in roads.items() if key != ("target_lane", 1)}}
    assert_same(ours(shared), theirs(shared))


FORMS: Mapping[str, Callable[[Any], Any]] = {
    "fortran": np.asfortranarray,
    "backwards": lambda array: array[..., ::-1].copy()[..., ::-1],
    "every second": lambda array: np.repeat(array, 2, axis=-1)[..., ::2],
    "read only": lambda array: np.frombuffer(array.tobytes(), array.dtype).reshape(array.shape),
    "tensor": torch.tensor,
    "transposed tensor": lambda array: torch.tensor(array.T.copy()).movedim(0, -1),
    "strided tensor": lambda array: torch.tensor(np.repeat(array, 2, axis=0))[::2],
    "narrow": lambda array: array.astype(np.int32) if array.dtype == np.int64 else array,
    "with a gradient": lambda array: torch.tensor(array, requires_grad=array.dtype == np.float64),
}


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("form", FORMS)
def test_facts_in_any_form(form: str, device: str) -> None:
    code = lowered("highway.pl")
    ours, theirs = compile_torch(code, device=device), compile_numpy(code)
    facts = rows_of(ours, mixed_scenes(5))
    result = ours(changed(facts, FORMS[form]))
    assert_same(result, theirs(facts))
    tensors = [
        result.undecided,
        *(part for answer in result.answers for part in (answer.value, answer.fails)),
    ]
    assert {tensor.device.type for tensor in tensors} == {device}
    assert not any(tensor.requires_grad for tensor in tensors)


@pytest.mark.parametrize("device", DEVICES)
def test_tensors_on_the_device_are_not_copied(device: str) -> None:
    program = compile_torch(lowered("highway.pl"), device=device)
    facts = changed(rows_of(program, mixed_scenes(5)), lambda array: torch.tensor(array, device=device))
    given = facts["vehicle", 8]
    before = [column.clone() for column in columns_of(given)]
    table = program.table("vehicle", 8, given)
    assert table.column(2).data_ptr() == columns_of(given)[2].data_ptr()
    assert table.valid.data_ptr() == given.valid.data_ptr()  # type: ignore[union-attr]  # not None
    program({**facts, ("vehicle", 8): table})
    assert all(map(torch.equal, before, columns_of(given)))


@pytest.mark.parametrize("device", DEVICES)
def test_scenes_that_share_tables_by_an_index(device: str) -> None:
    code = lowered("highway.pl")
    ours, theirs = compile_torch(code, device=device), compile_numpy(code)
    facts = rows_of(ours, mixed_scenes(4))
    lanes = facts["road_lane", 5]
    columns = [np.concatenate([column[:1], column[:1] + 1]) for column in columns_of(lanes)]
    for index in (np.array([1, 0, 1, 1]), torch.tensor([1, 0, 1, 1], device=device)):
        given = {**facts, ("road_lane", 5): Rows(columns, None, index)}
        apart = {**facts, ("road_lane", 5): Rows([column[[1, 0, 1, 1]] for column in columns])}
        assert_same(ours(given), theirs(apart))
    for beyond in (2, -1):
        given = {**facts, ("road_lane", 5): Rows(columns, None, np.array([0, 0, beyond, 0]))}
        with pytest.raises(ValueError, match="road_lane/5: an index beyond its 2 tables"):
            ours(given)


UNSOUND = [
    (("vehicle", 8), 2, math.nan),
    (("vehicle", 8), 2, -math.inf),
    (("vehicle", 8), 4, 1.1e15),
    (("vehicle", 8), 1, INT_BOUND + 1),
    (("vehicle", 8), 1, -(2**63)),
    (("road_lane", 5), 0, 4),  # there is a lane 4 already
    (("radar_range", 1), 0, math.nan),
]


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("ready", [False, True])
@pytest.mark.parametrize(("key", "place", "value"), UNSOUND)
def test_unsound_facts_are_left_to_the_interpreter(
    key: tuple[str, int], place: int, value: float, ready: bool, device: str
) -> None:
    code = lowered("highway.pl")
    ours, theirs = compile_torch(code, device=device), compile_numpy(code)
    facts = rows_of(ours, random_scenes(4, 9))
    column, valid = facts[key].columns[place], facts[key].valid
    assert column is not None
    assert valid is not None
    if SCHEMA.relations[key].single:
        column[1] = value
    else:
        column[1, 2] = value
        column[2, 2] = value  # in a row that is not there, which is no matter
        valid[2, 2] = False
    assert_undecided(ours, facts, [1], ready=ready)
    assert_same(ours(facts), theirs(facts))


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("ready", [False, True])
def test_missing_facts_are_left_to_the_interpreter(ready: bool, device: str) -> None:
    code = lowered("highway.pl")
    ours, theirs = compile_torch(code, device=device), compile_numpy(code)
    for key, here in ((("vehicle", 8), (1, 0)), (("target_lane", 1), (1,))):
        facts = rows_of(ours, random_scenes(4, 9))
        facts[key].valid[here] = False  # type: ignore[index]  # there is one
        assert_undecided(ours, facts, [1], ready=ready)
        assert_same(ours(facts), theirs(facts))
    nobody = Rows([column[:, :0] for column in facts["vehicle", 8].columns if column is not None])
    assert_undecided(ours, {**facts, ("vehicle", 8): nobody}, [0, 1, 2, 3], ready=ready)


def assert_undecided(program: TorchProgram, facts: Facts, scenes: list[int], *, ready: bool) -> None:
    given: dict[tuple[str, int], Any] = dict(facts)
    if ready:
        given = {key: program.table(*key, rows) for key, rows in facts.items() if key in program.reads}
    assert host(program(given).undecided).nonzero()[0].tolist() == scenes


KEYED = Schema([Relation("car", ("atom", "float"), key=0), Relation("spot", ("int",))])


@pytest.mark.parametrize("device", DEVICES)
def test_keys_that_repeat(device: str) -> None:
    engine = engine_of("p(C) :- car(C, X), X > 0.0.")
    ours = compile_torch(lower(engine, KEYED, [Query("p", 1, "first")]), device=device)
    keys = np.array([[3, 5, 3], [3, 5, 3], [5, 3, 4], [0, 0, 0], [0, 0, 0]])
    valid = np.array([[1, 1, 1], [1, 1, 0], [1, 1, 1], [0, 0, 0], [0, 1, 1]], dtype=np.bool_)
    result = ours({("car", 2): Rows([keys, np.array([[0.0, 1.0, 1.0]] * 5)], valid)})
    assert host(result.undecided).tolist() == [True, False, False, False, True]
    assert host(result.answers[0].fails).tolist() == [False, False, False, True, False]
    assert host(result.answers[0].value)[1:3].tolist() == [5, 3]


class NothingFromTheHost(torch.utils._python_dispatch.TorchDispatchMode):
    """Refuses tensors of the processor, other than the single numbers that a device takes as arguments."""

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        for value in torch.utils._pytree.tree_leaves((args, kwargs)):
            if isinstance(value, torch.Tensor) and value.device.type == "cpu" and value.ndim > 0:
                raise AssertionError(f"{func} takes a tensor of the processor")
        return func(*args, **(kwargs or {}))


KINDS = {"atom": torch.int64, "int": torch.int64, "float": torch.float64}


def assert_never_waits(code: Lowered) -> None:
    """A tensor on the meta device has no data: reading one, or a shape that depends on data, is an error."""
    device = torch.device("meta")
    program = TorchProgram(code, "float64", device)
    facts = {}
    for key, relation in code.schema.relations.items():
        shape = (8,) if relation.single else (8, 5)
        columns = [torch.empty(shape, dtype=KINDS[kind], device=device) for kind in relation.columns]
        facts[key] = Rows(columns, torch.empty(shape, dtype=torch.bool, device=device))
    with NothingFromTheHost():  # type: ignore[no-untyped-call]  # PyTorch's own __init__
        result = program(facts)
    assert result.undecided.shape == (8,)
    assert {answer.value.device.type for answer in result.answers} == {"meta"}


def test_a_device_is_never_waited_for() -> None:
    for program in ("highway.pl", "paper.pl"):
        assert_never_waits(lowered(program))


def all_lowered(program: tuple[str, list[tuple[str, int]]]) -> list[Lowered]:
    text, predicates = program
    engine = engine_of(text)
    found = []
    for name, arity in predicates:
        for mode in ("holds",) if arity == 0 else ("first", "all"):
            try:
                code = lower(engine, programs.SCHEMA, [Query(name, arity, mode)])  # type: ignore[arg-type]  # str
                compile_numpy(code)
            except NotLowerable:
                continue
            found.append(code)
    return found


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.too_slow])
@given(program=programs.programs(), scenes=st.lists(programs.facts(), min_size=1, max_size=4))
def test_generated_programs_give_the_bits_of_numpy(
    program: tuple[str, list[tuple[str, int]]], scenes: list[Any]
) -> None:
    for code in all_lowered(program):
        for dtype in PRECISIONS:
            ours, theirs = compile_torch(code, dtype), compile_numpy(code, dtype)
            assert_same(
                ours(to_rows(ours, code.schema, scenes)), theirs(to_rows(theirs, code.schema, scenes))
            )
        assert_never_waits(code)


def both_ops(dtype: Precision, scenes: int, device: str = "cpu") -> tuple[torch_ops.Ops, numpy_ops.Ops]:
    kind = torch.float64 if dtype == "float64" else torch.float32
    return (
        torch_ops.Ops(kind, torch.device(device), scenes, {}),
        numpy_ops.Ops(np.dtype(dtype), scenes),
    )


def assert_ops_agree(name: str, *values: Any, dtype: Precision = "float64", device: str = "cpu") -> None:
    ours, theirs = both_ops(dtype, max(np.shape(value)[-1] for value in values if np.ndim(value)), device)
    tensors = [torch.tensor(v, device=device) if isinstance(v, np.ndarray) else v for v in values]
    with np.errstate(all="ignore"):
        expected = getattr(theirs, name)(*values)
    result = host(getattr(ours, name)(*tensors))
    assert result.dtype == expected.dtype
    assert np.array_equal(result, expected, equal_nan=expected.dtype.kind == "f"), name


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("dtype", PRECISIONS)
def test_operations_on_many_numbers_have_the_bits_of_numpy(dtype: Precision, device: str) -> None:
    rng = np.random.default_rng(0)
    shape = (3, 20_001)
    left, right = (rng.uniform(-50.0, 50.0, shape).astype(dtype) for _ in range(2))
    for array in (left, np.asfortranarray(left), left[:, ::2]):
        assert_ops_agree("sqrt", abs(array), dtype=dtype, device=device)
    for constant in (12.0, 0.7, 3.0):
        assert_ops_agree("divide", left, constant, dtype=dtype, device=device)
        assert_ops_agree("divide", constant, left, dtype=dtype, device=device)
        assert_ops_agree("minimum", constant, left, dtype=dtype, device=device)
        assert_ops_agree("maximum", left, constant, dtype=dtype, device=device)
    for name in ("minimum", "maximum"):
        assert_ops_agree(name, left, right, dtype=dtype, device=device)
    for name in ("floor", "ceiling", "truncate", "rounded"):
        assert_ops_agree(name, left, dtype=dtype, device=device)
        assert_ops_agree(name, np.round(left * 2) / 2, dtype=dtype, device=device)
    mask = left > 10.0
    for name in ("least", "greatest", "where_least", "where_greatest"):
        assert_ops_agree(name, mask & mask.any(axis=0), left, 0, dtype=dtype, device=device)
    assert_ops_agree("choose", mask, left, 0.1, dtype=dtype, device=device)
    assert_ops_agree("constants", mask, 0.1, -0.7, dtype=dtype, device=device)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("dtype", PRECISIONS)
def test_sums_are_added_in_order(dtype: Precision, device: str) -> None:
    rng = np.random.default_rng(1)
    values = (rng.uniform(-1.0, 1.0, (60, 500)) * 10.0 ** rng.integers(-9, 9, (60, 500))).astype(dtype)
    mask = rng.random((60, 500)) < 0.7
    assert_ops_agree("total", mask, values, 0.0, 0, dtype=dtype, device=device)
    assert_ops_agree("total", mask, values, values[7], 0, dtype=dtype, device=device)
    expected = np.zeros(500, dtype)
    for row, here in zip(values, mask, strict=True):
        expected[here] += row[here]
    ours, _ = both_ops(dtype, 500, device)
    total = ours.total(torch.tensor(mask, device=device), torch.tensor(values, device=device), 0.0, 0)
    assert np.array_equal(host(total), expected)


WHOLE = st.sampled_from([0, 1, -1, 2, -2, 3, -3, 7, 2**53, -(2**53), 2**63 - 1, -(2**63)])


@pytest.mark.parametrize("device", DEVICES)
@settings(deadline=None)
@given(
    left=arrays.arrays(np.int64, 6, elements=WHOLE),
    right=arrays.arrays(np.int64, 6, elements=WHOLE),
    constant=WHOLE.filter(lambda value: value != 0),
)
def test_integer_division_is_total(device: str, left: Any, right: Any, constant: int) -> None:
    counts = right != 0
    for name in ("floor_divide", "remainder", "truncated"):
        ours, _ = both_ops("float64", 6, device)
        tensors = torch.tensor(left, device=device), torch.tensor(right, device=device)
        getattr(ours, name)(*tensors)  # no divisor is an error
        assert_ops_agree(name, left[counts], right[counts], device=device)
        assert_ops_agree(name, left, constant, device=device)


@pytest.mark.parametrize("device", DEVICES)
@settings(deadline=None)
@given(
    mask=arrays.arrays(np.bool_, (5, 4, 3)),
    value=arrays.arrays(np.float64, (5, 4, 3), elements=st.sampled_from([0.0, 1.0, -1.0])),
    axis=st.integers(0, 1),
)
def test_the_first_of_equal_rows_counts(device: str, mask: Any, value: Any, axis: int) -> None:
    ours, theirs = both_ops("float64", 3, device)
    tensor, tensors = torch.tensor(mask, device=device), torch.tensor(value, device=device)
    some = mask.any(axis=axis)
    assert np.array_equal(host(ours.first(tensor, axis))[some], theirs.first(mask, axis)[some])
    for name in ("where_least", "where_greatest"):
        place = host(getattr(ours, name)(tensor, tensors, axis))
        assert np.array_equal(place[some], getattr(theirs, name)(mask, value, axis)[some])
        assert ((place >= 0) & (place < mask.shape[axis])).all()
    assert_ops_agree("count", mask, axis, device=device)
    assert_ops_agree("exists", mask, axis, device=device)


SPEED_TOLERANCE = 1e-3  # m/s
OBSERVATION_TOLERANCE = 1e-5


@pytest.mark.parametrize("device", ["numpy", *DEVICES])
@pytest.mark.parametrize("program", ["highway.pl", "paper.pl"])
def test_float32_is_near_float64(program: str, device: str) -> None:
    code = lowered(program)
    narrow: Program = (
        compile_numpy(code, "float32") if device == "numpy" else compile_torch(code, "float32", device)
    )
    exact = compile_numpy(code)
    scenes = [scene for vehicles in (0, 5, 40) for scene in random_scenes(300, vehicles, seed=vehicles + 2)]
    facts = rows_of(exact, scenes)
    near, right = narrow(facts), exact(facts)
    assert not host(near.undecided).any()
    for mine, true in zip(near.answers[:2], right.answers[:2], strict=True):
        assert np.array_equal(host(mine.value), true.value)
    assert host(near.answers[2].value).dtype == host(near.answers[3].value).dtype == np.float32
    np.testing.assert_allclose(
        host(near.answers[2].value), right.answers[2].value, rtol=0, atol=SPEED_TOLERANCE
    )
    np.testing.assert_allclose(
        host(near.answers[3].value), right.answers[3].value, rtol=0, atol=OBSERVATION_TOLERANCE
    )


SINGLE = Schema([Relation("limit", ("float",), single=True), Relation("spot", ("int", "float"))])


@pytest.mark.parametrize("compiled", [compile_numpy, compile_torch])
@pytest.mark.parametrize(
    ("text", "unsure"),
    [
        ("p(X) :- limit(L), X is exp(L).", [False, False, True, True, True, True]),
        ("p(X) :- limit(L), X is L + 1.0.", [False, False, False, True, True, True]),
    ],
)
def test_what_float32_cannot_hold_is_left_to_the_interpreter(
    text: str, unsure: list[bool], compiled: Any
) -> None:
    code = lower(engine_of(text), SINGLE, [Query("p", 1, "first")])
    limits = np.array([1.0, 80.0, 90.0, FLOAT32_BOUND + 2.0, 1e300, -math.inf])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = compiled(code, "float32")({("limit", 1): Rows([limits])})
    assert host(result.undecided).tolist() == unsure


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("dtype", PRECISIONS)
@pytest.mark.parametrize("expression", ["3.0 / L", "L / 12.0", "sqrt(L) / 0.7", "L * L + 1.0 / L"])
def test_quotients_are_rounded_once(expression: str, dtype: Precision, device: str) -> None:
    code = lower(engine_of(f"p(X) :- limit(L), X is {expression}."), SINGLE, [Query("p", 1, "first")])
    facts = {("limit", 1): Rows([np.random.default_rng(3).uniform(0.1, 99.0, 5001)])}
    assert_same(compile_torch(code, dtype, device)(facts), compile_numpy(code, dtype)(facts))


def test_a_device_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match="device cuda:0: Torch finds no CUDA device; use cpu"):
        compile_torch(lowered("highway.pl"), device="cuda:0")


@pytest.mark.parametrize("compiled", [compile_numpy, compile_torch])
def test_a_precision_that_there_is_not(compiled: Any) -> None:
    with pytest.raises(ValueError, match="float16: expected float64 or float32"):
        compiled(lowered("highway.pl"), "float16")


@pytest.mark.parametrize(
    ("place", "column", "message"),
    [
        (0, torch.zeros((2, 3)), "column 0 of spot/2 .* int, and is given as torch.float32"),
        (1, torch.zeros((2, 3), dtype=torch.bool), "given as torch.bool"),
        (1, torch.zeros((2, 3), dtype=torch.complex64), "given as torch.complex64"),
        (1, np.zeros((2, 3), dtype=object), "given as object"),
        (1, torch.zeros((2, 4)), "spot/2: arrays for 3 and 4 rows"),
        (1, torch.zeros((5, 3)), "spot/2: arrays for 2 and 5 scenes"),
        (1, torch.zeros(6), r"a column of shape \(6,\)"),
    ],
)
def test_facts_that_do_not_fit(place: int, column: Any, message: str) -> None:
    engine = engine_of("p :- spot(N, X), N > 1, X > 0.5.")
    program = compile_torch(lower(engine, SINGLE, [Query("p", 0, "holds")]))
    columns: list[Any] = [torch.zeros((2, 3), dtype=torch.int64), torch.zeros((2, 3))]
    columns[place] = column
    with pytest.raises(ValueError, match=message):
        program({("spot", 2): Rows(columns)})


def test_a_number_of_more_than_64_bits_has_no_form_in_arrays() -> None:
    engine = engine_of("p :- spot(N, _), N \\= 100000000000000000000000.")
    code = lower(engine, SINGLE, [Query("p", 0, "holds")])
    for compiled in (compile_numpy, compile_torch):
        with pytest.raises(NotLowerable, match="more than 64 bits"):
            compiled(code)
