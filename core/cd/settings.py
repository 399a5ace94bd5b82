"""Settings of a run of contact dynamics and of a contact solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, cast

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option, read_options
from ninedisk.core.threads import MOST_THREADS

ContactKind = Literal["auto", "rigid", "elastic"]
CONTACT_KINDS: tuple[ContactKind, ...] = ("auto", "rigid", "elastic")

OPTIONS: Mapping[str, Option] = {
    "tolerance": Option(
        default=1e-12,
        high=1.0,
        low_open=True,
        high_open=True,
        why="natural map and duality gap of a step: round-off of a few hundred steps stays below 1e-10 of the largest force",
    ),
    "max_iterations": Option(
        default=None,
        low=1,
        high=1e15,
        whole=True,
        none="each solver's own",
        why="beyond its own limit a solver comes hardly nearer",
    ),
    "time_limit": Option(
        default=600.0, low_open=True, why="wall-clock seconds of one step's problem: ten minutes, for the largest ones"
    ),
    "accept": Option(
        default=None,
        high=1.0,
        low_open=True,
        high_open=True,
        none="no forces that miss the tolerance",
        why="a run stops at a step that misses its tolerance; with a looser bound here the best forces found are taken, and told",
    ),
    "relaxation": Option(
        default=1.0,
        high=2.0,
        low_open=True,
        high_open=True,
        why="Gauss-Seidel as it is; from 1.8 on Coulomb's law does not converge",
    ),
    "threads": Option(
        default=1, low=1, high=MOST_THREADS, whole=True, why="threads of Gauss-Seidel; no result depends on them"
    ),
    "contacts": Option(
        default="auto",
        choices=CONTACT_KINDS,
        why="elastic (1/kn, 1/ks) unless the law's springs only regularise a rigid contact",
    ),
    "save_failed": Option(
        default="", text=True, why="file that receives the problem of a step that fails; empty: none"
    ),
}
"""Options of `Numerics.options`, there named ``cd.tolerance`` and so on; their ranges are those of `SolverOptions`, too."""


@dataclass(frozen=True, kw_only=True)
class SolverOptions:
    """When a solver stops; ranges are those of `OPTIONS`.

    Parameters
    ----------
    tolerance : float
        Bound on natural-map residual and relative duality gap (`ninedisk.core.cd.problem.Residuals`).
    max_iterations : int or None
        Iteration limit; None: the solver's own default.
    time_limit : float
        Seconds of wall-clock time.
    accept : float or None
        Looser bound up to which Gauss-Seidel, where it gives up, hands over the best forces found in place of an error. The residuals of a
        result show which it is.
    relaxation : float
        Over-relaxation of Gauss-Seidel.
    threads : int
        Threads of Gauss-Seidel; the result does not depend on them.

    Raises
    ------
    InvalidNumericsError
        If a value is out of range.
    """

    tolerance: float = 1e-10
    max_iterations: int | None = None
    time_limit: float = 600.0
    accept: float | None = None
    relaxation: float = 1.0
    threads: int = 1

    def __post_init__(self) -> None:
        for field in fields(self):
            value = OPTIONS[field.name].checked(field.name, getattr(self, field.name))
            object.__setattr__(self, field.name, value)


@dataclass(frozen=True)
class CdSettings:
    """Checked settings of a run.

    Attributes
    ----------
    solver_options : SolverOptions
    contacts : {"auto", "rigid", "elastic"}
    save_failed : str
        File for the problem of a failing step; empty: none.
    options : mapping from str to value
        All options by their full names.
    """

    solver_options: SolverOptions
    contacts: ContactKind
    save_failed: str
    options: Mapping[str, Any]


def read_settings(numerics: Numerics) -> CdSettings:
    """Settings of ``numerics``; options of other engines are left alone.

    Raises
    ------
    InvalidNumericsError
        Naming the unknown option or the value that is not allowed.
    """
    given = read_options("cd", OPTIONS, numerics)
    options = SolverOptions(**{field.name: given[f"cd.{field.name}"] for field in fields(SolverOptions)})
    return CdSettings(options, cast(ContactKind, given["cd.contacts"]), given["cd.save_failed"], given)
