"""Operations that Numba writes as an instruction or two, where it would compile and inline a function.

Generated code calls them a hundred times and more: as functions they take a fifth of the time to compile it.
Their meaning is that of the functions of the same names.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable

from drlsl.logic.core import NODES
from drlsl.lowering.backends.loop_ops import choose
from drlsl.lowering.backends.prefetching import prefetch

_LESSER, _GREATER, _QUOTIENT = (NODES[node].compute for node in ("min", "max", "div"))

_LINE: Final = 64
"""Bytes of a line of the processor's cache."""


@cache
def make_operations_known() -> Sequence[Callable[..., Any]]:
    """Register the operations with Numba, and return the functions that it need not compile."""
    for function, arity, emit in _WRITTEN:
        _make_known(function, arity, emit)
    type_callable(prefetch)(lambda _context: lambda _words, _begin, _end: types.none)
    lower_builtin(prefetch, types.Array, types.Integer, types.Integer)(_prefetch)  # type: ignore[no-untyped-call]  # Numba's
    return [*(function for function, _, _ in _WRITTEN), prefetch]


def _make_known(function: Callable[..., Any], arity: int, emit: Callable[..., Any]) -> None:
    def typed(_context: Any) -> Callable[..., Any]:
        if arity == 3:
            return lambda _cond, then, els: _common(then, els)
        return lambda left, right: types.float64 if function is _QUOTIENT else _common(left, right)

    def lowered(context: Any, builder: Any, signature: Any, values: Sequence[Any]) -> Any:
        kind = signature.return_type
        pairs = list(zip(values, signature.args, strict=True))
        conds = [context.cast(builder, value, own, types.boolean) for value, own in pairs[:-2]]
        return emit(builder, kind, *conds, *(context.cast(builder, *pair, kind) for pair in pairs[-2:]))

    type_callable(function)(typed)
    lower_builtin(function, *[types.Any] * arity)(lowered)  # type: ignore[no-untyped-call]  # Numba's


def _common(one: Any, other: Any) -> Any:
    """Return the type that holds the numbers, or truth values, of both types."""
    kinds = {getattr(kind, "literal_type", kind) for kind in (one, other)}
    if len(kinds) == 1:
        return kinds.pop()
    return types.float64 if types.float64 in kinds else types.int64


def _choose(builder: Any, _kind: Any, cond: Any, then: Any, els: Any) -> Any:
    return builder.select(cond, then, els)


def _lesser(builder: Any, kind: Any, left: Any, right: Any) -> Any:
    return builder.select(_compared(builder, kind, "<", left, right), left, right)


def _greater(builder: Any, kind: Any, left: Any, right: Any) -> Any:
    return builder.select(_compared(builder, kind, ">=", left, right), left, right)


def _compared(builder: Any, kind: Any, sign: str, left: Any, right: Any) -> Any:
    compare = builder.fcmp_ordered if kind is types.float64 else builder.icmp_signed
    return compare(sign, left, right)


def _quotient(builder: Any, _kind: Any, left: Any, right: Any) -> Any:
    there = builder.fcmp_unordered("!=", right, right.type(0.0))
    return builder.select(there, builder.fdiv(left, right), right.type(math.nan))


def _prefetch(context: Any, builder: Any, signature: Any, values: Sequence[Any]) -> Any:
    """Write a prefetch of each line of a part of an array, to be read, and kept in all caches."""
    array, *ends = values
    kind, *whole = signature.args
    begin, end = (context.cast(builder, one, own, types.intp) for one, own in zip(ends, whole, strict=True))
    data = context.make_array(kind)(context, builder, array).data
    word, number = cgutils.voidptr_t, cgutils.int32_t
    kinds = ir.FunctionType(ir.VoidType(), [word, number, number, number])
    fetch = cgutils.get_or_insert_function(builder.module, kinds, "llvm.prefetch.p0")  # type: ignore[no-untyped-call]  # Numba's
    step = context.get_constant(types.intp, _LINE // (kind.dtype.bitwidth // 8))
    with cgutils.for_range_slice(builder, begin, end, step, inc=True) as (place, _):
        address = builder.bitcast(builder.gep(data, [place]), word)
        builder.call(fetch, [address, number(0), number(3), number(1)])
    return context.get_dummy_value()


_WRITTEN: Final[Sequence[tuple[Callable[..., Any], int, Callable[..., Any]]]] = [
    (choose, 3, _choose),
    (_LESSER, 2, _lesser),
    (_GREATER, 2, _greater),
    (_QUOTIENT, 2, _quotient),
]
