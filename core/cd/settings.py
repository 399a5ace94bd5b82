"""What a run of contact dynamics is told: solver, tolerances, rigid or elastic contacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

from ninedisk.core._crew import check_threads
from ninedisk.core.cd.result import SolverOptions
from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics

Stiffness = Literal["auto", "rigid", "elastic"]
STIFFNESS: tuple[Stiffness, ...] = ("auto", "rigid", "elastic")

TOLERANCE = 1e-12
"""Of natural map and duality gap in each step: round-off of a few hundred steps stays below 1e-10 of the largest force."""

OPTIONS: Mapping[str, Any] = {
    "cd.tolerance": TOLERANCE,
    "cd.max_iterations": None,
    "cd.time_limit": 600.0,
    "cd.relaxation": 1.0,
    "cd.threads": 1,
    "cd.factoriser": "auto",
    "cd.contacts": "auto",
    "cd.save_failed": "",
}
"""Options of `Numerics.options` with their defaults. ``cd.threads``: threads of Gauss-Seidel, 1..64; no result depends on them.
``cd.contacts``: rigid, elastic (1/kn, 1/ks), or auto: elastic unless the law's springs only regularise a rigid contact.
``cd.save_failed``: file that receives the problem of a step that fails."""


@dataclass(frozen=True)
class CdSettings:
    """Checked settings of a run.

    Attributes
    ----------
    solver_options : SolverOptions
    contacts : {"auto", "rigid", "elastic"}
    save_failed : str
        File for the problem of a failing step; empty: none.
    """

    solver_options: SolverOptions
    contacts: Stiffness
    save_failed: str


def read_settings(numerics: Numerics) -> CdSettings:
    """Settings of ``numerics``; options of other engines are left alone.

    Raises
    ------
    InvalidNumericsError
        Naming the unknown option or the value that is not allowed.
    """
    given = {key: value for key, value in numerics.options.items() if key.startswith("cd.")}
    unknown = sorted(set(given) - set(OPTIONS))
    if unknown:
        raise InvalidNumericsError(f"unknown option {unknown[0]!r}: contact dynamics knows {', '.join(OPTIONS)}")
    told = {**OPTIONS, **given}
    if told["cd.contacts"] not in STIFFNESS:
        raise InvalidNumericsError(
            f"cd.contacts = {told['cd.contacts']!r} is unknown: use one of {', '.join(STIFFNESS)}"
        )
    iterations = told["cd.max_iterations"]
    options = SolverOptions(
        tolerance=_number("cd.tolerance", told["cd.tolerance"]),
        max_iterations=None if iterations is None else int(_number("cd.max_iterations", iterations)),
        time_limit=_number("cd.time_limit", told["cd.time_limit"]),
        relaxation=_number("cd.relaxation", told["cd.relaxation"]),
        threads=check_threads(told["cd.threads"], "cd.threads"),
        factoriser=str(told["cd.factoriser"]),
    )
    return CdSettings(options, cast(Stiffness, told["cd.contacts"]), str(told["cd.save_failed"]))


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidNumericsError(f"{name} = {value!r} is not allowed: it must be a number")
    return float(value)
