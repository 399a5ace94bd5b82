"""Outlines that several tests use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.mass import centred
from ninedisk.core.nurbs.shapes import fitted


def periodic(points: NDArray[np.float64], degree: int, weights: NDArray[np.float64] | None = None) -> NurbsCurve:
    """Smooth closed curve with uniform knots and these different control points."""
    n = len(points)
    own = np.ones(n) if weights is None else weights
    return NurbsCurve(
        degree=degree,
        knots=np.arange(-degree, n + degree + 1),
        points=np.concatenate([points, points[:degree]]),
        weights=np.concatenate([own, own[:degree]]),
    )


def ring(n: int, seed: int, spread: float = 0.15) -> NDArray[np.float64]:
    """``n`` points around the origin at distances near 1, counter-clockwise."""
    rng = np.random.default_rng(seed)
    angle = 2.0 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    radius = 1.0 + rng.uniform(-spread, spread, n)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def placed(curve: NurbsCurve, at: NDArray[np.float64], x: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Points of a curve that is turned by ``angle`` [rad] and shifted to ``x`` [m]."""
    c, s = np.cos(angle), np.sin(angle)
    turned: NDArray[np.float64] = curve.evaluate(at) @ np.array([[c, s], [-s, c]]) + x
    return turned


def outline(radius_of: object, k: int = 400) -> NDArray[np.float64]:
    """Points of the outline r(angle)."""
    angle = 2.0 * np.pi * np.arange(k) / k
    radius = radius_of(angle)  # type: ignore[operator]
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def peanut() -> NurbsCurve:
    """Non-convex grain of 20 control points, waisted at x = 0, symmetric about both axes, 1.3 long and 0.7 high in half."""
    fit = fitted(outline(lambda a: 1.0 + 0.3 * np.cos(2.0 * a)), 20)
    return centred(fit.curve)
