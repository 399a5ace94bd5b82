"""Kernels of the minimum-degree ordering: the graph of what is left is kept as a quotient graph.

Bodies that are yet to be eliminated are variables. An eliminated one becomes an element: the clique of the variables that it
touched. A variable's list holds its elements first, then the variables it still touches directly. Variables with the same
neighbours are joined to one; the degrees are upper bounds that are cheap to keep [Amestoy, Davis, Duff 1996, An approximate minimum
degree ordering algorithm, SIAM J. Matrix Anal. Appl. 17].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

Longs = NDArray[np.int64]

START, LENGTH, ELEMENTS, WEIGHT, DEGREE, FLAG, NEXT, BEFORE, HEAD, MEMBER, LAST, BUCKET, CHAIN, HASH = range(14)
"""Rows of the table of bodies: start, length and elements of the list, members of the variable (0: none, it has been joined or
eliminated), degree, work, degree lists (neighbours and heads), members (next and last), hash buckets, next in a bucket, hash."""
LINES = 14


@inline_kernel
def _insert(t: Longs, i: int, degree: int) -> None:
    """Put a variable at the head of a list of its degree."""
    first = t[HEAD, degree]
    t[NEXT, i], t[BEFORE, i], t[HEAD, degree] = first, -1, i
    if first >= 0:
        t[BEFORE, first] = i


@inline_kernel
def _remove(t: Longs, i: int) -> None:
    """Take a variable out of its list of degrees."""
    before, after = t[BEFORE, i], t[NEXT, i]
    if before >= 0:
        t[NEXT, before] = after
    else:
        t[HEAD, t[DEGREE, i]] = after
    if after >= 0:
        t[BEFORE, after] = before


@inline_kernel
def _join(t: Longs, i: int, k: int) -> None:
    """Append the members of k to those of i."""
    t[MEMBER, t[LAST, i]] = k
    t[LAST, i] = t[LAST, k]


@inline_kernel
def _clique(t: Longs, lists: Longs, me: int, free: int) -> int:
    """Write the variables that ``me`` touches to ``lists[free:]``, their weights negative from now on; returns the end.

    The elements that ``me`` belonged to are part of the new one and vanish (`FLAG` 0).
    """
    t[WEIGHT, me] = -t[WEIGHT, me]
    end, start = free, t[START, me]
    elements = t[ELEMENTS, me]
    for q in range(elements + 1):
        if q < elements:
            e = lists[start + q]
            low, high = t[START, e], t[START, e] + t[LENGTH, e]
            t[FLAG, e] = 0
        else:
            low, high = start + elements, start + t[LENGTH, me]
        for p in range(low, high):
            i = lists[p]
            if t[WEIGHT, i] > 0:
                t[WEIGHT, i] = -t[WEIGHT, i]
                lists[end] = i
                end += 1
                _remove(t, i)
    return end


@inline_kernel
def _outside(t: Longs, lists: Longs, free: int, end: int, flag: int) -> None:
    """For each element of the clique's variables: ``FLAG - flag`` becomes the weight of what lies outside of the clique."""
    for p in range(free, end):
        i = lists[p]
        for q in range(t[START, i], t[START, i] + t[ELEMENTS, i]):
            e = lists[q]
            if t[FLAG, e] >= flag:
                t[FLAG, e] += t[WEIGHT, i]
            elif t[FLAG, e] > 0:
                t[FLAG, e] = t[DEGREE, e] + flag + t[WEIGHT, i]


@inline_kernel
def _prune(t: Longs, lists: Longs, me: int, free: int, end: int, flag: int) -> int:
    """New lists and degrees of the clique's variables; returns the weight of those that touch nothing else and go with ``me``."""
    n = t.shape[1]
    gone = 0
    for p in range(free, end):
        i = lists[p]
        start = t[START, i]
        at, degree, code = start, 0, 0
        for q in range(start, start + t[ELEMENTS, i]):
            e = lists[q]
            if t[FLAG, e] > flag:
                degree += t[FLAG, e] - flag
                lists[at] = e
                at += 1
                code += e
            else:
                t[FLAG, e] = 0
        elements = at - start + 1
        stop = start + t[LENGTH, i]
        # The new element takes the first place: a variable or an element has just left the list, so that there is room.
        first_variable = at
        for q in range(start + t[ELEMENTS, i], stop):
            k = lists[q]
            if t[WEIGHT, k] > 0:
                degree += t[WEIGHT, k]
                lists[at] = k
                at += 1
                code += k
        if degree == 0:
            gone -= t[WEIGHT, i]
            t[WEIGHT, i] = 0
            _join(t, me, i)
            continue
        if first_variable < at:
            lists[at] = lists[first_variable]
        lists[first_variable] = lists[start]
        lists[start] = me
        t[ELEMENTS, i], t[LENGTH, i] = elements, at + 1 - start
        t[DEGREE, i] = min(t[DEGREE, i], degree)
        code = (code + me) % n
        t[HASH, i] = code
        t[CHAIN, i], t[BUCKET, code] = t[BUCKET, code], i
    return gone


@inline_kernel
def _same(t: Longs, lists: Longs, k: int, mark: int) -> bool:
    """Whether all of k's list is marked."""
    q, end = t[START, k], t[START, k] + t[LENGTH, k]
    while q < end and t[FLAG, lists[q]] == mark:
        q += 1
    return bool(q == end)


@inline_kernel
def _join_equals(t: Longs, lists: Longs, free: int, end: int, flag: int) -> int:
    """Join the clique's variables with equal lists; returns the next free flag."""
    for p in range(free, end):
        i = lists[p]
        if t[WEIGHT, i] == 0:
            continue
        code = t[HASH, i]
        i = t[BUCKET, code]
        t[BUCKET, code] = -1
        while i >= 0 and t[CHAIN, i] >= 0:
            for q in range(t[START, i], t[START, i] + t[LENGTH, i]):
                t[FLAG, lists[q]] = flag
            last, k = i, t[CHAIN, i]
            while k >= 0:
                after = t[CHAIN, k]
                alike = t[LENGTH, k] == t[LENGTH, i] and t[ELEMENTS, k] == t[ELEMENTS, i] and _same(t, lists, k, flag)
                if alike:
                    t[WEIGHT, i] += t[WEIGHT, k]
                    t[WEIGHT, k] = 0
                    _join(t, i, k)
                    t[CHAIN, last] = after
                else:
                    last = k
                k = after
            flag += 1
            i = t[CHAIN, i]
    return flag


@kernel
def minimum_degree(ptr: Longs, neighbour: Longs, dense: int, t: Longs, lists: Longs, order: Longs) -> bool:
    """Order in which bodies are eliminated; False if ``lists`` is too short.

    Parameters
    ----------
    ptr, neighbour : ndarray of int64
        Neighbours of each body, without itself.
    dense : int
        Bodies with more neighbours than this are eliminated last.
    t : ndarray of int64, shape (LINES, b)
        Work.
    lists : ndarray of int64
        Work: as long as the graph's lists and the cliques of all eliminations.
    order : ndarray of int64, shape (b,)
        Out.
    """
    n = ptr.shape[0] - 1
    for i in range(n):
        t[HEAD, i] = t[BUCKET, i] = t[MEMBER, i] = -1
    free = ptr[n]
    for p in range(free):
        lists[p] = neighbour[p]
    done = 0
    for i in range(n):
        t[START, i], t[LENGTH, i], t[ELEMENTS, i] = ptr[i], ptr[i + 1] - ptr[i], 0
        t[LAST, i], t[WEIGHT, i], t[FLAG, i] = i, 1, 1
        if t[LENGTH, i] > dense:
            t[WEIGHT, i] = 0
            done += 1
            order[n - done] = i
        else:
            t[DEGREE, i] = t[LENGTH, i]
            _insert(t, i, t[DEGREE, i])
    at = least = 0
    flag, largest = 2, 0
    while done < n:
        while t[HEAD, least] < 0:
            least += 1
        me = t[HEAD, least]
        _remove(t, me)
        if free + n - done > lists.shape[0]:
            return False
        weight = t[WEIGHT, me]
        end = _clique(t, lists, me, free)
        degree = 0
        for p in range(free, end):
            degree -= t[WEIGHT, lists[p]]
        _outside(t, lists, free, end, flag)
        gone = _prune(t, lists, me, free, end, flag)
        degree -= gone
        done += weight + gone
        largest = max(largest, degree)
        flag = _join_equals(t, lists, free, end, flag + largest + 1)
        t[WEIGHT, me], t[START, me], t[DEGREE, me] = 0, free, degree
        for p in range(free, end):
            i = lists[p]
            if t[WEIGHT, i] == 0:
                continue
            t[WEIGHT, i] = -t[WEIGHT, i]
            bound = min(t[DEGREE, i] + degree - t[WEIGHT, i], n - done - t[WEIGHT, i])
            t[DEGREE, i] = bound
            _insert(t, i, bound)
            least = min(least, bound)
            lists[free] = i
            free += 1
        t[LENGTH, me] = free - t[START, me]
        t[FLAG, me] = 1 if t[LENGTH, me] > 0 else 0
        i = me
        while i >= 0:
            order[at] = i
            at += 1
            i = t[MEMBER, i]
    return True
