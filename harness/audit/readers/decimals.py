"""Rows of decimals in bytes of ASCII as float64, each rounded as `float` rounds it; what is anything else is left to the caller.

Up to 19 digits are one integer w; the number is w 10^q. Where w <= 2^53 and -22 <= q <= 22, one product or quotient of exact numbers is
rounded once. Else the product of w and 128 bits of 5^q decides, as D. Lemire shows ("Number parsing at a gigabyte per second", Software:
Practice and Experience 51, 2021, algorithm 1). Longer numbers, subnormal ones and those that overflow are left to `float`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.compile import inline_kernel, kernel

Bits = NDArray[np.uint64]
LOWEST, HIGHEST = -342, 308
"""Powers of ten in the table."""
EXACT_RECIPROCAL = -27
"""Powers from here on, at which a product of 64 bits may be halfway, have reciprocals rounded up in the last of the 128 bits."""
EXACT = 22
"""Largest power of ten that is a float64."""
U1, U2, U9, U63 = (np.uint64(each) for each in (1, 2, 9, 63))
U10, U32, U52, U55 = (np.uint64(each) for each in (10, 32, 52, 55))
LOW32, ALL = np.uint64(0xFFFFFFFF), np.uint64(0xFFFFFFFFFFFFFFFF)
LARGEST_EXACT, HIDDEN = np.uint64(1 << 53), np.uint64(1 << 52)
NINETEEN = 19
"""Digits of which every number is below 2^64."""


def _powers_of_five() -> Bits:
    """The 128 highest bits of 5^q in two words, truncated; of q < 0 those of the reciprocal, rounded up."""
    found = []
    for q in range(LOWEST, HIGHEST + 1):
        power = 5 ** abs(q)
        size = power.bit_length()
        if q >= 0:
            value = power << (128 - size) if size <= 128 else power >> (size - 128)
        else:
            value = (1 << (size + 127 if q >= EXACT_RECIPROCAL else 2 * size + 128)) // power + 1
            value >>= value.bit_length() - 128
        found.append((value >> 64, value & 0xFFFFFFFFFFFFFFFF))
    return np.array(found, dtype=np.uint64)


FIVES = _powers_of_five()
TENS = np.array([float(10**k) for k in range(EXACT + 1)])


@inline_kernel
def _high(a: np.uint64, b: np.uint64) -> np.uint64:
    """Higher 64 bits of a product."""
    a0, a1, b0, b1 = a & LOW32, a >> U32, b & LOW32, b >> U32
    low = a0 * b0
    one = a1 * b0 + (low >> U32)
    two = a0 * b1 + (one & LOW32)
    return a1 * b1 + (one >> U32) + (two >> U32)


@inline_kernel
def _bits_of(w: np.uint64, q: int, fives: Bits) -> np.uint64:
    """The float64 nearest to ``w 10^q``, w > 0, as bits; 0: not decided here."""
    none = np.uint64(0)
    if q < LOWEST or q > HIGHEST:
        return none
    shift = 0
    while w >> U63 == none:
        w = w << U1
        shift += 1
    high, low = _high(w, fives[q - LOWEST, 0]), w * fives[q - LOWEST, 0]
    if high & (ALL >> U55) == ALL >> U55:
        more = _high(w, fives[q - LOWEST, 1])
        low = low + more
        if more > low:
            high = high + U1
    if low == ALL and (q < -27 or q > 55):
        return none
    upper = high >> U63
    back = upper + U9
    mantissa = high >> back
    exponent = ((217706 * q) >> 16) + 63 + np.int64(upper) - shift + 1023
    if exponent <= 0 or exponent >= 2046:
        return none
    if low <= U1 and q >= -4 and q <= 23 and mantissa & np.uint64(3) == U1 and mantissa << back == high:
        mantissa = mantissa & ~U1  # halfway: to even
    mantissa = (mantissa + (mantissa & U1)) >> U1
    if mantissa >= LARGEST_EXACT:
        mantissa = HIDDEN
        exponent += 1
    return (mantissa & ~HIDDEN) | (np.uint64(exponent) << U52)


@kernel
def parse_rows(
    raw: NDArray[np.uint8], begin: int, end: int, rows: int, columns: int, places: NDArray[np.int64], out: FloatArray, bits: Bits,
    first: int, fives: Bits, tens: FloatArray, counts: NDArray[np.int64],
) -> None:  # fmt: skip
    """Parse whole lines of ``columns`` numbers between blanks, until a line that is not so.

    Parameters
    ----------
    raw : ndarray of uint8
        Text; lines end with a line feed.
    begin, end : int
        Bytes of it to look at.
    rows : int
        Lines at most.
    columns : int
    places : ndarray of int, shape (columns,)
        Row of ``out`` for each column; -1: it is checked and dropped.
    out, bits : ndarray, shape (p, n), of float64 and the same memory as uint64
    first : int
        Column of ``out`` for the first line.
    fives, tens : ndarray
        `FIVES` and `TENS`.
    counts : ndarray of int, shape (3,)
        Result: lines parsed; the byte after them; 1 if the next line is whole and not of such numbers, else 0.
    """
    at = begin
    done = 0
    zero = np.uint64(0)
    while done < rows:
        start = at
        column = 0
        regular = True
        while regular:
            while at < end and (raw[at] == 32 or raw[at] == 9):
                at += 1
            if at >= end or raw[at] == 10:
                break
            if column == columns:
                regular = False
                break
            negative = raw[at] == 45
            if negative or raw[at] == 43:
                at += 1
            w = zero
            begun = at
            while at < end and raw[at] >= 48 and raw[at] <= 57:
                w = w * U10 + np.uint64(raw[at] - 48)
                at += 1
            digits = at - begun
            q = 0
            if at < end and raw[at] == 46:
                at += 1
                point = at
                while at < end and raw[at] >= 48 and raw[at] <= 57:
                    w = w * U10 + np.uint64(raw[at] - 48)
                    at += 1
                q = point - at
                digits -= q
            some = digits > 0
            if digits > NINETEEN:  # zeros that lead are none
                while begun < at and (raw[begun] == 48 or raw[begun] == 46):
                    digits -= raw[begun] == 48
                    begun += 1
            if at < end and some and (raw[at] == 101 or raw[at] == 69):
                at += 1
                below = at < end and raw[at] == 45
                if at < end and (below or raw[at] == 43):
                    at += 1
                some = False
                exponent = 0
                while at < end and raw[at] >= 48 and raw[at] <= 57:
                    some = True
                    if exponent < 10000:
                        exponent = 10 * exponent + int(raw[at] - 48)
                    at += 1
                q += -exponent if below else exponent
            if at >= end:
                break
            if not some or digits > NINETEEN or (raw[at] != 32 and raw[at] != 10 and raw[at] != 9):
                regular = False
                break
            place = places[column]
            column += 1
            if w == zero:
                value = 0.0
            elif w <= LARGEST_EXACT and q >= -EXACT and q <= EXACT:
                value = np.float64(w) / tens[-q] if q < 0 else np.float64(w) * tens[q]
            else:
                found = _bits_of(w, q, fives)
                if found == zero:
                    regular = False
                    break
                if place >= 0:
                    bits[place, first + done] = found | (np.uint64(negative) << U63)
                continue
            if place >= 0:
                out[place, first + done] = -value if negative else value
        if at >= end or not regular or column != columns:
            whole = False
            while at < end and not whole:
                whole = raw[at] == 10
                at += 1
            counts[0], counts[1], counts[2] = done, start, whole
            return
        at += 1
        done += 1
    counts[0], counts[1], counts[2] = done, at, 0
