"""Vectors of four numbers in a row of memory, each in one register: Numba by itself takes their numbers one by one."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

WIDE = 4
"""Numbers of a vector in memory; a line of the caches holds two vectors."""

INTERPRETED = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]
"""Whether Numba is set not to compile: registers cannot be interpreted, and do the same in NumPy then."""

VECTOR = ir.VectorType(ir.DoubleType(), WIDE)


def _place(context: Any, builder: Any, kind: Any, values: Any, at: Any) -> Any:
    data = context.make_array(kind)(context, builder, values).data
    return builder.bitcast(builder.gep(data, [at]), VECTOR.as_pointer())


def _times(context: Any, builder: Any, kind: Any, s: Any, values: Any, i: Any) -> Any:
    spread = ir.Constant(VECTOR, ir.Undefined)
    for lane in range(WIDE):
        spread = builder.insert_element(spread, s, ir.Constant(ir.IntType(32), lane))
    at = builder.mul(i, ir.Constant(ir.IntType(64), WIDE))
    return builder.fmul(builder.load(_place(context, builder, kind, values, at), align=8), spread, flags=("contract",))


def _scale(typingctx: Any, out: Any, at: Any, s: Any, a: Any, i: Any) -> Any:  # noqa: ARG001
    """``out[at] = s a[i]`` for vectors of `WIDE` numbers in a row, in one register each."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        value = _times(context, builder, signature.args[3], *args[2:5])
        first = builder.mul(args[1], ir.Constant(ir.IntType(64), WIDE))
        builder.store(value, _place(context, builder, signature.args[0], args[0], first), align=8)
        return context.get_dummy_value()

    return types.none(out, types.uint64, types.float64, a, types.uint64), build


def _blend(typingctx: Any, out: Any, at: Any, s: Any, a: Any, i: Any, t: Any, b: Any, j: Any) -> Any:  # noqa: ARG001
    """``out[at] = s a[i] + t b[j]``, likewise."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        one = _times(context, builder, signature.args[3], *args[2:5])
        two = _times(context, builder, signature.args[6], *args[5:8])
        first = builder.mul(args[1], ir.Constant(ir.IntType(64), WIDE))
        value = builder.fadd(one, two, flags=("contract",))
        builder.store(value, _place(context, builder, signature.args[0], args[0], first), align=8)
        return context.get_dummy_value()

    index, number = types.uint64, types.float64
    return types.none(out, index, number, a, index, number, b, index), build


def _transpose(typingctx: Any, values: Any, out: Any, apart_out: Any, at: Any, apart: Any) -> Any:  # noqa: ARG001
    """Rows of `WIDE` numbers at ``at``, ``at + apart``, .. become columns at ``out``, ``out + apart_out``, .."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        def place(first: Any, stride: Any, row: int) -> Any:
            index = builder.add(first, builder.mul(stride, ir.Constant(ir.IntType(64), row)))
            return _place(context, builder, signature.args[0], args[0], index)

        def mixed(one: Any, two: Any, lanes: tuple[int, ...]) -> Any:
            which = ir.Constant(ir.VectorType(ir.IntType(32), WIDE), lanes)
            return builder.shuffle_vector(one, two, which)

        a, b, c, d = (builder.load(place(args[3], args[4], row), align=8) for row in range(WIDE))
        low, high = (0, 4, 2, 6), (1, 5, 3, 7)
        pairs = mixed(a, b, low), mixed(a, b, high), mixed(c, d, low), mixed(c, d, high)
        left, right = (0, 1, 4, 5), (2, 3, 6, 7)
        for row, (one, two, lanes) in enumerate([(0, 2, left), (1, 3, left), (0, 2, right), (1, 3, right)]):
            builder.store(mixed(pairs[one], pairs[two], lanes), place(args[1], args[2], row), align=8)
        return context.get_dummy_value()

    return types.none(values, *[types.uint64] * 4), build


def _vector(values: Any, first: Any) -> Any:
    return values.reshape(-1)[int(first) :][:WIDE]


def _plain_scale(out: Any, at: Any, s: Any, a: Any, i: Any) -> None:
    _vector(out, WIDE * int(at))[:] = s * _vector(a, WIDE * int(i))


def _plain_blend(out: Any, at: Any, s: Any, a: Any, i: Any, t: Any, b: Any, j: Any) -> None:
    _vector(out, WIDE * int(at))[:] = s * _vector(a, WIDE * int(i)) + t * _vector(b, WIDE * int(j))


def _plain_transpose(values: Any, out: Any, apart_out: Any, at: Any, apart: Any) -> None:
    rows = np.stack([_vector(values, int(at) + row * int(apart)) for row in range(WIDE)])
    for row in range(WIDE):
        _vector(values, int(out) + row * int(apart_out))[:] = rows[:, row]


scale: Any = _plain_scale if INTERPRETED else intrinsic(_scale)
blend: Any = _plain_blend if INTERPRETED else intrinsic(_blend)
transpose: Any = _plain_transpose if INTERPRETED else intrinsic(_transpose)
