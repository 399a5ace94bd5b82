"""Compiled loops of audits: decimals are rounded as `float` rounds them, pairs are those of all distances, blocks end anywhere."""

from __future__ import annotations

import random
import re
import struct
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit import geometry
from ninedisk.harness.audit.kernels import pair_groups
from ninedisk.harness.audit.read import read_trajectory
from ninedisk.harness.audit.readers import lines
from ninedisk.harness.audit.readers.decimals import FIVES, TENS, parse_rows
from ninedisk.harness.audit.readers.rounding import Rounding
from ninedisk.harness.audit.tally import _worst


def parsed(tokens: list[str]) -> tuple[FloatArray, int]:
    """Numbers by the compiled loop, one a line, and how many it left to `float` (NaN here)."""
    raw = np.frombuffer("".join(f"{token}\n" for token in tokens).encode(), dtype=np.uint8).copy()
    out, counts = np.full((1, len(tokens)), np.nan), np.zeros(3, dtype=np.int64)
    at = done = left = 0
    places = np.zeros(1, dtype=np.int64)
    while done < len(tokens):
        parse_rows(
            raw, at, len(raw), len(tokens) - done, 1, places, out, out.view(np.uint64), done, FIVES, TENS, counts
        )
        done, at = done + int(counts[0]), int(counts[1])
        if counts[2]:
            at += len(tokens[done]) + 1
            left, done = left + 1, done + 1
    return out[0], left


def wrong(tokens: list[str]) -> list[str]:
    values, _ = parsed(tokens)
    right = np.array([float(token) for token in tokens])
    off = ~np.isnan(values) & (values.view(np.uint64) != right.view(np.uint64))
    return [tokens[k] for k in np.flatnonzero(off)]


def doubles(count: int) -> list[float]:
    rng = random.Random(1)
    found = [struct.unpack("d", struct.pack("Q", rng.getrandbits(64)))[0] for _ in range(count)]
    return [each for each in found if np.isfinite(each)]


@pytest.mark.parametrize("form", ["%.17g", "%.16g", "%.12g", "%g", "%.18e", "%+.3f"])
def test_decimals_are_rounded_as_float_rounds_them(form: str) -> None:
    tokens = [form % each for each in doubles(20_000)]
    assert wrong(tokens) == []
    if form in ("%.17g", "%.12g", "%g"):
        assert parsed(tokens)[1] < 0.002 * len(tokens), "subnormal numbers alone are left to float"


def test_numbers_halfway_between_two_are_rounded_to_even() -> None:
    rng = random.Random(2)
    tokens = []
    for _ in range(30_000):
        odd, e = 2 * (rng.getrandbits(52) | 1 << 52) + 1, rng.randrange(-8, 12)
        tokens.append(str(odd << e) if e >= 0 else f"{odd * 5**-e}e{e}")
        tokens.append(f"{Decimal(odd) * Decimal(2) ** rng.randrange(-70, 70):.18e}")
    assert wrong(tokens) == []
    assert parsed(tokens)[1] < 0.5 * len(tokens)


def test_every_form_of_a_number_is_read_or_left() -> None:
    tokens = [
        "0", "-0", "-0.0", "+1", ".5", "5.", "1e5", "1E-05", "00012", "1e22", "1e23", "8.5e22", "9007199254740993", "4.9e-324", "1e400",
        "0e9999", "1e-9999",
    ]  # fmt: skip
    tokens += ["0." + "0" * 30 + "1", "9" * 19, "18446744073709551615", "18446744073709551616", "1" * 40]
    assert wrong(tokens) == []
    for token in ("1_0", "nan", "inf", "1e", "e5", ".", "-", "+-1", "1.2.3", "0x10", "1-2", "1e5.0", "\u0661", "1,5"):
        values, left = parsed([token])
        assert np.isnan(values[0]), token
        assert left == 1, token


ROWS = [[k + 1, 0.1 * k, 1.0 / (k + 3), -2.5e-7 * k, float(k)] for k in range(40)]
HEAD = "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n40\nITEM: BOX BOUNDS ff ff ff\n-9 9\n-9 9\n-9 9\nITEM: ATOMS id x y z vx\n"


def dump(folder: Path, row: str = "%d %.17g %.17g %.17g %.17g\n", end: str = "\n") -> Path:
    text = "".join(HEAD.format(step) + "".join(row % tuple(each) for each in ROWS) for step in (0, 1))
    (folder / "a.dump").write_bytes(text.replace("\n", end).encode())
    return folder / "a.dump"


@pytest.mark.parametrize("block", [7, 64, 1000, 1 << 22])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", " \n"])
def test_blocks_end_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int, end: str) -> None:
    monkeypatch.setattr(lines, "BLOCK", block)
    monkeypatch.setattr(lines, "ROWS", 3)
    frames = list(read_trajectory(dump(tmp_path, end=end), {}).frames(lambda *_: None))
    assert [frame.place for frame in frames] == ["frame 1, line 10", "frame 2, line 59"]
    for frame in frames:
        for k, name in enumerate(("id", "x", "y", "z", "vx")):
            assert frame.columns[name].tolist() == [row[k] for row in ROWS]


@pytest.mark.parametrize("block", [7, 1 << 22])
@pytest.mark.parametrize("rows", [1, 1000])
def test_rows_that_are_no_decimals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int, rows: int) -> None:
    monkeypatch.setattr(lines, "BLOCK", block)
    monkeypatch.setattr(lines, "ODD", rows)
    text = re.sub(r"\n8 \S+", "\n8 nan", re.sub(r"\n9 \S+", "\n9 -inf", dump(tmp_path).read_text()))
    (tmp_path / "a.dump").write_text(text)
    x = next(iter(read_trajectory(tmp_path / "a.dump", {}).frames(lambda *_: None))).columns["x"]
    assert np.flatnonzero(~np.isfinite(x)).tolist() == [7, 8]
    assert x[9:].tolist() == [row[1] for row in ROWS[9:]]
    (tmp_path / "a.dump").write_text(re.sub(r"\n5 \S+", "\n5 word", text))
    with pytest.raises(UsageError, match=r"line 14, column 2 \(x\): 'word' is no number"):
        list(read_trajectory(tmp_path / "a.dump", {}).frames(lambda *_: None))


def test_missing_rows_are_named_before_words(tmp_path: Path) -> None:
    text = dump(tmp_path).read_text().replace("\n5 0.4", "\n5 word", 1)
    at = text.index("\n30 ")
    (tmp_path / "a.dump").write_text(text[: at + 1] + text[text.index("ITEM", at) :])
    with pytest.raises(UsageError, match=r"line 39: frame 1 \(step 0\) ends after 29 of 40 lines"):
        list(read_trajectory(tmp_path / "a.dump", {}).frames(lambda *_: None))


def brute(x: FloatArray, reach: FloatArray) -> set[tuple[int, int]]:
    i, j = np.triu_indices(len(x), 1)
    near = np.sqrt(((x[i] - x[j]) ** 2).sum(axis=1)) <= reach[i] + reach[j]
    return set(zip(i[near].tolist(), j[near].tolist(), strict=True))


@pytest.mark.parametrize("seed", range(40))
def test_pairs_are_those_of_all_distances(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 150))
    x = rng.uniform(0.0, rng.choice([1.0, 3.0, 30.0, 1000.0]), (n, 2 + seed % 2))
    reach = rng.uniform(0.01, rng.choice([0.02, 0.3, 2.0]), n)
    if seed % 7 == 0:
        reach[0] = 50.0
    if seed % 11 == 0:
        x[1] = 1e9
    if seed % 5 == 0:
        x[:, 0] = 0.0
    pairs = geometry.close_pairs(x, reach)[0]
    assert len(set(map(tuple, pairs.tolist()))) == len(pairs)
    assert set(map(tuple, np.sort(pairs, axis=1).tolist())) == brute(x, reach)


def test_groups_are_those_of_a_graph() -> None:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rng = np.random.default_rng(4)
    for n in (1, 5, 200):
        pairs = rng.integers(0, n, (n // 2, 2))
        joined = rng.random(len(pairs)) < 0.7
        label = np.empty(n, dtype=np.int64)
        count = pair_groups(pairs, joined, label)
        inner = pairs[joined]
        graph = coo_array((np.ones(len(inner)), (inner[:, 0], inner[:, 1])), shape=(n, n))
        groups, expected = connected_components(graph, directed=False)
        assert count == groups
        assert label.tolist() == expected.tolist()


def test_the_largest_ratio_counts_what_is_not_finite() -> None:
    value, allowance = np.array([1.0, 3.0, -1.0, 2.0]), np.array([1.0, 2.0, 1.0, 1.0])
    assert _worst(value, allowance)[:3] == (3, 2, 2.0)
    assert _worst(np.array([1.0, np.inf]), np.ones(2))[:2] == (1, 1)
    assert _worst(np.array([0.0, 1.0]), np.zeros(2))[:3] == (1, 1, np.inf)


@pytest.mark.parametrize(
    "rule",
    [
        Rounding(significant=6),
        Rounding(significant=17),
        Rounding(decimals=4),
        Rounding(bits=24),
        Rounding(significant=3, factor=0.5, absolute=1e-9),
    ],
)
def test_errors_of_digits_are_the_same_in_one_pass(rule: Rounding) -> None:
    rng = np.random.default_rng(3)
    powers = np.array([float(f"1e{k}") for k in range(-30, 31)])
    values = np.concatenate([rng.normal(size=300), powers, -powers, 0.999999 * powers, [0.0, np.nan]])
    found, squares = np.empty((len(values), 3)), np.zeros(len(values))
    rule.place(values, 1, 0.0, found, squares)
    assert np.array_equal(found[:, 1], values, equal_nan=True)
    np.testing.assert_allclose(np.sqrt(squares), rule.error(np.nan_to_num(values)), rtol=1e-14)
