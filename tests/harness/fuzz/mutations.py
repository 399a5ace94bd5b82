"""Damage to data: to structures (JSON, tables), to texts and to bytes. Everything follows from the given generator."""

from __future__ import annotations

import copy
from random import Random
from typing import Any

ODD_NUMBERS = (
    0, -0.0, 1, -1, 2, 1e-300, 5e-324, 1e300, 1.7976931348623157e308, -1e300, 1e-12, 10**30, 2**31, 2**63, -(2**63) - 1, 0.1,
    float("nan"), float("inf"), float("-inf"),
)  # fmt: skip
ODD_TEXTS = (
    "", " ", "0", "-1", "nan", "inf", "1e999", "1/0", "0/0", "1/3", "10 ms", "10 apples", "5 kg", "true", "none", "None", "null",
    "mu", "auto", "=", "==", "a=b", "\u00b5", "\u2212 1", "１２", "\x00", "\x1b[2J", "\n", "\u202e", "../../etc", "%s%n", "{}",
    "[1,2]", "[bold]x[/bold]", "x" * 5000, "\U0001f600", "1_000", "0x10", "1e5", "+3", "--help", "-", "*", "?", "[", "dt", "\ud800",
)  # fmt: skip
ODD_VALUES: tuple[Any, ...] = (
    *ODD_NUMBERS,
    *ODD_TEXTS,
    None,
    True,
    False,
    [],
    {},
    [[]],
    [None],
    {"": 1},
    [1, 2, 3],
    [[0.0, 0.0]],
)


def damaged(rng: Random, data: Any, hits: int = 1) -> Any:
    """A copy of nested dicts and lists in which some places were replaced, removed, doubled or exchanged."""
    root = [copy.deepcopy(data)]
    for _ in range(hits):
        holder, key = _place(rng, root)
        how = rng.randrange(6)
        if how == 0 and holder is not root:
            del holder[key]
        elif how == 1 and isinstance(holder, list) and holder is not root:
            holder.insert(key, copy.deepcopy(holder[key]))
        elif how == 2 and isinstance(holder, dict):
            holder[rng.choice(ODD_TEXTS)] = rng.choice(ODD_VALUES)
        elif how == 3:
            other, place = _place(rng, root)
            holder[key] = copy.deepcopy(other[place])
        elif how == 4 and isinstance(holder[key], int | float) and not isinstance(holder[key], bool):
            holder[key] = holder[key] * rng.choice((-1, 0, 1e-9, 1e9, 1e200, 0.5, 3))
        else:
            holder[key] = copy.deepcopy(rng.choice(ODD_VALUES))
    return root[0]


def _place(rng: Random, root: list[Any]) -> tuple[Any, Any]:
    holder: Any = root
    key: Any = 0
    while isinstance(holder[key], dict | list) and holder[key] and rng.random() < 0.85:
        holder = holder[key]
        key = rng.choice(list(holder)) if isinstance(holder, dict) else rng.randrange(len(holder))
    return holder, key


def damaged_bytes(rng: Random, data: bytes) -> bytes:
    """Bytes cut short, flipped, overwritten, doubled or emptied."""
    how = rng.randrange(6)
    at = rng.randrange(len(data) + 1)
    if how == 0:
        return data[:at]
    if how == 1:
        return data[:at] + data[at + rng.randrange(1, 40) :]
    if how == 2:
        return data[:at] + rng.randbytes(rng.randrange(1, 40)) + data[at + rng.randrange(0, 40) :]
    if how == 3:
        return data[:at] + data[max(0, at - 30) :]
    if how == 4:
        return rng.choice((b"", b"\x00", b"{}", b"[]", b"null", b"PAR1", b"\xff\xfe", b"PK\x03\x04"))
    changed = bytearray(data)
    for _ in range(rng.randrange(1, 6)):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def damaged_text(rng: Random, text: str) -> str:
    """Text in which words were replaced, lines dropped or bytes damaged."""
    if rng.random() < 0.4:
        return damaged_bytes(rng, text.encode()).decode("utf-8", "replace")
    lines = text.splitlines()
    k = rng.randrange(len(lines))
    how = rng.randrange(3)
    if how == 0:
        del lines[k]
    elif how == 1:
        lines.insert(k, lines[rng.randrange(len(lines))])
    else:
        words = lines[k].split(" ")
        words[rng.randrange(len(words))] = str(rng.choice(ODD_VALUES))
        lines[k] = " ".join(words)
    return "\n".join(lines)
