"""What a run of contact dynamics is told: solver, tolerances, rigid or elastic contacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from ninedisk.core.cd.options import OPTIONS, Stiffness
from ninedisk.core.cd.result import SolverOptions
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options


@dataclass(frozen=True)
class CdSettings:
    """Checked settings of a run.

    Attributes
    ----------
    solver_options : SolverOptions
    contacts : {"auto", "rigid", "elastic"}
    save_failed : str
        File for the problem of a failing step; empty: none.
    told : mapping from str to value
        All options by their full names.
    """

    solver_options: SolverOptions
    contacts: Stiffness
    save_failed: str
    told: Mapping[str, Any]


def read_settings(numerics: Numerics) -> CdSettings:
    """Settings of ``numerics``; options of other engines are left alone.

    Raises
    ------
    InvalidNumericsError
        Naming the unknown option or the value that is not allowed.
    """
    told = read_options("cd", OPTIONS, numerics)
    options = SolverOptions(
        **{
            name: told[f"cd.{name}"]
            for name in ("tolerance", "max_iterations", "time_limit", "relaxation", "threads", "factoriser")
        }
    )
    return CdSettings(options, cast(Stiffness, told["cd.contacts"]), told["cd.save_failed"], told)
