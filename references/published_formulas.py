"""Formulas that the source prints, as functions of a variant's parameters, exactly as printed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ninedisk.references.analytic.on_plane.sliding import critical_dt, normal_displacement_as_printed

SOURCE_GRAVITY = 10.0
"""Acceleration of gravity of A.3.4 [m/s^2], where the variant has no parameter ``g``."""

SOURCE_BLOCK_MASS = 7.854
"""Mass of the block of A.3.4 [kg], where the variant has no parameter ``mass``."""


def _gravity(params: Mapping[str, Any]) -> float:
    return float(params.get("g", SOURCE_GRAVITY))


def _weight(params: Mapping[str, Any]) -> float:
    return float(params.get("mass", SOURCE_BLOCK_MASS)) * _gravity(params)


def _slope_term(params: Mapping[str, Any]) -> float:
    """Bracket of (A.7), 0 where the source prints 0."""
    angle, mu = math.radians(params["angle_deg"]), params["mu"]
    return math.sin(angle) - mu * math.cos(angle) if mu < math.tan(angle) else 0.0


def _dynamic(params: Mapping[str, Any]) -> float:
    return normal_displacement_as_printed(mu=params["mu"], speed=params["speed"], dt=params["dt"], g0=params["g0"])


def _critical(params: Mapping[str, Any]) -> float:
    return critical_dt(mu=params["mu"], speed=params["speed"], g0=params["g0"])


FORMULAS: Mapping[str, Callable[[Mapping[str, Any]], float]] = {
    "A.3.1-dilation": lambda params: params["mu"] * abs(params["increment"]),
    "A.4": _dynamic,
    "A.5": _critical,
    "A.7-x": lambda params: 0.5 * _slope_term(params) * _gravity(params) * params["duration"] ** 2,
    "A.7-v": lambda params: _slope_term(params) * _gravity(params) * params["duration"],
    "mg": _weight,
    "mu-mg": lambda params: params["mu"] * _weight(params),
    "tan-angle": lambda params: math.tan(math.radians(params["angle_deg"])),
}
"""Value of a printed formula; raises KeyError for a parameter that it needs."""

CONDITIONS: Mapping[str, Callable[[Mapping[str, Any]], bool]] = {
    "dt > dt_cr": lambda params: params["dt"] > _critical(params),
    "dt <= dt_cr": lambda params: params["dt"] <= _critical(params),
    "mu > tan(angle)": lambda params: params["mu"] > math.tan(math.radians(params["angle_deg"])),
}
"""Ranges in which a published value is stated; raise KeyError for a parameter that they need."""
