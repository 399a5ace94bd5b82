"""Pairs of bounding spheres, against all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core import InvalidSceneError
from ninedisk.core.shapes import near_pairs, search


def all_pairs(x: np.ndarray, radius: np.ndarray, margin: float) -> np.ndarray:
    """Every pair, by the square of its distance as the search computes it."""
    i, j = np.triu_indices(len(x), 1)
    w = x[j] - x[i]
    far = radius[i] + radius[j] + margin
    near = (far >= 0.0) & (w[:, 0] * w[:, 0] + w[:, 1] * w[:, 1] + w[:, 2] * w[:, 2] <= far * far)
    return np.column_stack([i, j])[near]


SCENES = (
    "equal",
    "two sizes",
    "many sizes",
    "powers of two",
    "one large",
    "column",
    "far away",
    "one far away",
    "points",
    "same place",
)


def scene(name: str, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Centres and radii."""
    x = rng.uniform(0.0, count ** (1 / 3), size=(count, 3))
    radius = np.full(count, 0.5)
    if name == "two sizes":
        radius = rng.choice([0.05, 1.0], count)
    elif name == "many sizes":
        radius = 10.0 ** rng.uniform(-4.0, 0.0, count)
    elif name == "powers of two":
        radius = 2.0 ** rng.integers(-6, 1, count)
    elif name == "one large":
        radius[count // 2] = 1e3
    elif name == "column":
        x = np.column_stack([np.zeros(count), np.zeros(count), np.arange(count)])
    elif name == "far away":
        x = x + 1e6
    elif name == "one far away":
        x[0] = 1e12
    elif name == "points":
        radius = np.zeros(count)
    elif name == "same place":
        x[: count // 4] = x[0]
    return x, radius


@pytest.mark.parametrize("margin", [0.0, 0.1, 2.0, -0.2])
@pytest.mark.parametrize("name", SCENES)
def test_near_pairs_are_those_of_all_pairs(name: str, margin: float) -> None:
    rng = np.random.default_rng(len(name))
    for count in (0, 1, 2, 30, 400):
        x, radius = scene(name, count, rng) if count > 1 else (np.zeros((count, 3)), np.ones(count))
        for size in (1.0, 2.0**-10, 2.0**10):  # powers of two: no pair depends on rounding
            found = near_pairs(size * x, size * radius, size * margin)
            assert np.array_equal(found, all_pairs(size * x, size * radius, size * margin))
            assert found.dtype == np.int64


def test_touching_rows_of_cells_are_found() -> None:
    """A cubic grid of spheres that touch: three neighbours per sphere within it, whatever cells the rounding of centres gives."""
    side = 12
    for spacing in (1.0, 0.1, 1 / 3):
        grid = spacing * np.stack(np.meshgrid(*[np.arange(side)] * 3), axis=-1).reshape(-1, 3)
        found = near_pairs(grid, np.full(len(grid), 0.5 * spacing), 1e-9 * spacing)
        assert len(found) == 3 * side**2 * (side - 1)


def test_pairs_do_not_depend_on_the_order_of_bodies() -> None:
    rng = np.random.default_rng(7)
    x, radius = scene("many sizes", 300, rng)
    order = rng.permutation(300)
    found = near_pairs(x[order], radius[order], 0.1)
    assert np.array_equal(np.unique(np.sort(order[found], axis=1), axis=0), near_pairs(x, radius, 0.1))


@pytest.mark.parametrize("name", ["equal", "many sizes", "one large", "column"])
def test_work_grows_as_bodies_and_pairs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies in the 27 cells that are looked at: counted with a margin that lists every one of them."""
    rng = np.random.default_rng(9)
    tried = []
    for count in (1000, 4000):
        x, radius = scene(name, count, rng)
        seen = 0

        def counting(*args: object) -> int:
            nonlocal seen
            _, _, _, level, cell, keys, _, here, span, _, total = args
            lower = cell[level <= here]  # type: ignore[index]
            for dx in (-1, 0, 1):
                for dy in (-1, 0, 1):
                    low = (lower[:, 0] + dx) * span[1] + (lower[:, 1] + dy) * span[0] + lower[:, 2] - 1  # type: ignore[index]
                    seen += int(np.sum(np.searchsorted(keys, low + 3) - np.searchsorted(keys, low)))  # type: ignore[arg-type]
            return int(total)  # type: ignore[call-overload]

        with monkeypatch.context() as patch:
            patch.setattr(search, "pairs_of_level", counting)
            near_pairs(x, radius, 0.0)
        tried.append(seen / count)
    # The same per body, but for the bodies at the surface of the pile: 27 cells of up to 8 bodies of each of 14 levels.
    assert tried[1] <= 1.5 * tried[0]
    assert tried[1] <= 27 * 8


@pytest.mark.parametrize(
    ("x", "radius", "margin", "message"),
    [
        ([[0.0, 0.0]], [1.0], 0.0, "x has shape (1, 2)"),
        ([[0.0, 0.0, np.inf]], [1.0], 0.0, "x must be finite"),
        ([[0.0, 0.0, 0.0]], [-1.0], 0.0, "radius = -1 is not allowed"),
        ([[0.0, 0.0, 0.0]], [1.0, 2.0], 0.0, "radius has shape (2,)"),
        ([[0.0, 0.0, 0.0]], [1.0], np.nan, "margin = nan is not allowed"),
    ],
)
def test_what_is_not_allowed_is_refused_by_name(x: object, radius: object, margin: float, message: str) -> None:
    with pytest.raises(InvalidSceneError) as refused:
        near_pairs(x, radius, margin)  # type: ignore[arg-type]
    assert message in str(refused.value)
