"""What a run of contact dynamics can be told by options: names, ranges, defaults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from ninedisk.core._crew import MOST_THREADS
from ninedisk.core.options import Option

FACTORISERS = ("auto", "supernodal", "qdldl")
"""Sparse factorisations of the interior-point method: "auto" is the supernodal one, qdldl checks it."""

Stiffness = Literal["auto", "rigid", "elastic"]
STIFFNESS: tuple[Stiffness, ...] = ("auto", "rigid", "elastic")

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
        whole=True,
        none="each solver's own",
        why="beyond its own limit a solver comes hardly nearer",
    ),
    "time_limit": Option(
        default=600.0, low_open=True, why="wall-clock seconds of one step's problem: ten minutes, for the largest ones"
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
    "factoriser": Option(default="auto", choices=FACTORISERS, why="the supernodal one; qdldl checks it"),
    "contacts": Option(
        default="auto",
        choices=STIFFNESS,
        why="elastic (1/kn, 1/ks) unless the law's springs only regularise a rigid contact",
    ),
    "save_failed": Option(
        default="", text=True, why="file that receives the problem of a step that fails; empty: none"
    ),
}
"""Options of `Numerics.options`, there named ``cd.tolerance`` and so on."""
