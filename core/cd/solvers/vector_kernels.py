"""Vectors of the processor in kernels: the inner loops of dense blocks that are three columns wide.

The loops of small dense blocks are too short for the compiler's own vectoriser, and it would have to prove that the columns read
and the columns written do not overlap. Here the vectors are spelled out; where a processor has shorter ones, the compiler splits
them. Products and sums are fused where the processor can, lane by lane and in a fixed order: the same bits at each call.

Blocks are given by an array and the position of their first entry; columns lie one after another, ``ld`` entries apart.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

# The arguments of an intrinsic are types; the code that it builds reads their values elsewhere.
# ruff: noqa: ARG001


LANES = 4
"""Rows of the shortest block of rows; columns are padded to a multiple of it."""

LINE = 8
"""Numbers in a line of the cache."""

_tools: Any = cgutils
_types: Any = types

_DOUBLE, _LONG, _INT = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_FUSED = ("contract",)


class _Vectors:
    """Instructions on vectors of ``lanes`` numbers."""

    def __init__(self, context: Any, builder: Any, lanes: int) -> None:
        self.context, self.builder, self.lanes = context, builder, lanes
        self.kind = ir.VectorType(_DOUBLE, lanes)
        self.zero = ir.Constant(self.kind, [0.0] * lanes)

    def base(self, kind: Any, array: Any) -> Any:
        return self.context.make_array(kind)(self.context, self.builder, array).data

    def _at(self, base: Any, index: Any) -> Any:
        return self.builder.bitcast(self.builder.gep(base, [index]), self.kind.as_pointer())

    def load(self, base: Any, index: Any) -> Any:
        return self.builder.load(self._at(base, index), align=8)

    def store(self, value: Any, base: Any, index: Any) -> None:
        self.builder.store(value, self._at(base, index), align=8)

    def spread(self, number: Any) -> Any:
        """The number in every lane."""
        one = self.builder.insert_element(self.zero, number, ir.Constant(_INT, 0))
        return self.builder.shuffle_vector(
            one, self.zero, ir.Constant(ir.VectorType(_INT, self.lanes), [0] * self.lanes)
        )

    def less(self, total: Any, a: Any, b: Any) -> Any:
        """``total - a b``."""
        return self.builder.fsub(total, self.builder.fmul(a, b, flags=_FUSED), flags=_FUSED)

    def more(self, total: Any, a: Any, b: Any) -> Any:
        """``total + a b``."""
        return self.builder.fadd(total, self.builder.fmul(a, b, flags=_FUSED), flags=_FUSED)


def _plus(builder: Any, *terms: Any) -> Any:
    total = terms[0]
    for term in terms[1:]:
        total = builder.add(total, term)
    return total


def _long(value: int) -> Any:
    return ir.Constant(_LONG, value)


def _tile(lanes: int, parts: int, *, fresh: bool) -> Callable[..., None]:
    """Kernel for ``lanes parts`` rows; ``fresh``: what was there before is forgotten, as if it had been 0."""

    @intrinsic
    def tile(typingctx: Any, target: Any, t: Any, t_ld: Any, source: Any, s: Any, b: Any, ld: Any, count: Any) -> Any:
        def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            to, at, to_ld, source, rows, factors, ld, count = args
            vectors = _Vectors(context, builder, lanes)
            to = vectors.base(signature.args[0], to)
            source = vectors.base(signature.args[3], source)
            places = [
                [_plus(builder, at, builder.mul(to_ld, _long(c)), _long(lanes * part)) for part in range(parts)]
                for c in range(3)
            ]
            totals = [[_tools.alloca_once(builder, vectors.kind) for _ in range(parts)] for _ in range(3)]
            for c in range(3):
                for part in range(parts):
                    start = vectors.zero if fresh else vectors.load(to, places[c][part])
                    builder.store(start, totals[c][part])
            with _tools.for_range(builder, count) as loop:
                column = builder.mul(ld, loop.index)
                factor = builder.add(factors, column)
                by = [
                    vectors.spread(builder.load(builder.gep(source, [builder.add(factor, _long(c))]))) for c in range(3)
                ]
                for part in range(parts):
                    a = vectors.load(source, _plus(builder, rows, column, _long(lanes * part)))
                    for c in range(3):
                        builder.store(vectors.less(builder.load(totals[c][part]), a, by[c]), totals[c][part])
            for c in range(3):
                for part in range(parts):
                    vectors.store(builder.load(totals[c][part]), to, places[c][part])
            return context.get_dummy_value()

        return _types.void(target, _types.int64, _types.int64, source, *[_types.int64] * 4), build

    kernel: Callable[..., None] = tile
    return kernel


ROWS = 16
"""Rows of the tallest tile: with its three columns it fills the registers of processors with vectors of four."""

downdate_16 = _tile(8, 2, fresh=False)
"""``target[t:, :3] -= source[s:, :count] source[b : b + 3, :count]'`` for 16 rows; the arguments are ``target, t, t_ld, source, s,
b, ld, count``."""
downdate_8 = _tile(8, 1, fresh=False)
downdate_4 = _tile(4, 1, fresh=False)
negative_16 = _tile(8, 2, fresh=True)
"""``target[t:, :3] = - source[s:, :count] source[b : b + 3, :count]'`` for 16 rows."""
negative_8 = _tile(8, 1, fresh=True)
negative_4 = _tile(4, 1, fresh=True)


@intrinsic
def _divide(typingctx: Any, a: Any, at: Any, ld: Any, i0: Any, i1: Any, i2: Any, l10: Any, l20: Any, l21: Any) -> Any:
    """Four rows of three columns times the inverse of a lower triangle, transposed.

    Arguments are the array, the position, ``ld``, the inverses of the triangle's diagonal and its entries below.
    """

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vectors = _Vectors(context, builder, LANES)
        data = vectors.base(signature.args[0], args[0])
        at, ld = args[1], args[2]
        i0, i1, i2, l10, l20, l21 = (vectors.spread(number) for number in args[3:])
        places = [at, builder.add(at, ld), _plus(builder, at, ld, ld)]
        x0, x1, x2 = (vectors.load(data, place) for place in places)
        x0 = builder.fmul(x0, i0)
        x1 = builder.fmul(vectors.less(x1, x0, l10), i1)
        x2 = builder.fmul(vectors.less(vectors.less(x2, x0, l20), x1, l21), i2)
        for value, place in zip((x0, x1, x2), places, strict=True):
            vectors.store(value, data, place)
        return context.get_dummy_value()

    return _types.void(a, _types.int64, _types.int64, *[_types.float64] * 6), build


@intrinsic
def _subtract_product(
    typingctx: Any, w: Any, i: Any, a: Any, at: Any, ld: Any, x0: Any, x1: Any, x2: Any, count: Any
) -> Any:
    """``w[i:] -= a[at:, :3] (x0, x1, x2)`` for ``count`` times four rows."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vectors = _Vectors(context, builder, LANES)
        w, i, data, at, ld = args[:5]
        w, data = vectors.base(signature.args[0], w), vectors.base(signature.args[2], data)
        x = [vectors.spread(number) for number in args[5:8]]
        columns = [at, builder.add(at, ld), _plus(builder, at, ld, ld)]
        with _tools.for_range(builder, args[8]) as loop:
            row = builder.mul(loop.index, _long(LANES))
            place = builder.add(i, row)
            total = vectors.load(w, place)
            for column, factor in zip(columns, x, strict=True):
                total = vectors.less(total, vectors.load(data, builder.add(column, row)), factor)
            vectors.store(total, w, place)
        return context.get_dummy_value()

    return _types.void(w, _types.int64, a, _types.int64, _types.int64, *[_types.float64] * 3, _types.int64), build


@intrinsic
def _three_products(typingctx: Any, a: Any, at: Any, ld: Any, w: Any, i: Any, count: Any) -> Any:
    """``a[at:, :3]' w[i:]`` over ``count`` times four rows, as three numbers."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vectors = _Vectors(context, builder, LANES)
        data, at, ld, w, i, count = args
        data, w = vectors.base(signature.args[0], data), vectors.base(signature.args[3], w)
        columns = [at, builder.add(at, ld), _plus(builder, at, ld, ld)]
        totals = [_tools.alloca_once_value(builder, vectors.zero) for _ in columns]
        with _tools.for_range(builder, count) as loop:
            row = builder.mul(loop.index, _long(LANES))
            factor = vectors.load(w, builder.add(i, row))
            for column, total in zip(columns, totals, strict=True):
                a = vectors.load(data, builder.add(column, row))
                builder.store(vectors.more(builder.load(total), a, factor), total)
        sums = []
        for total in totals:
            value = builder.load(total)
            lanes = [builder.extract_element(value, ir.Constant(_INT, lane)) for lane in range(LANES)]
            sums.append(builder.fadd(builder.fadd(lanes[0], lanes[1]), builder.fadd(lanes[2], lanes[3])))
        return context.make_tuple(builder, signature.return_type, sums)

    triple = _types.UniTuple(_types.float64, 3)
    return triple(a, _types.int64, _types.int64, w, _types.int64, _types.int64), build


@intrinsic
def _fetch(typingctx: Any, a: Any, at: Any, count: Any) -> Any:
    """Have ``a[at : at + count]`` brought to the cache, wherever that lies: nothing is read."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = _Vectors(context, builder, LANES).base(signature.args[0], args[0])
        byte, flag = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, flag, flag, flag])
        fetch = _tools.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        # To be read, kept in all caches, data.
        how = [ir.Constant(flag, value) for value in (0, 3, 1)]
        end = builder.add(args[1], args[2])
        with _tools.for_range_slice(builder, args[1], end, _long(LINE)) as (index, _):
            builder.call(fetch, [builder.bitcast(builder.gep(data, [index]), byte), *how])
        return context.get_dummy_value()

    return _types.void(a, _types.int64, _types.int64), build


divide: Callable[..., None] = _divide
subtract_product: Callable[..., None] = _subtract_product
fetch: Callable[..., None] = _fetch
three_products: Callable[..., tuple[float, float, float]] = _three_products
