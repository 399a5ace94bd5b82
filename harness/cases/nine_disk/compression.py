"""Nine disks between four walls that move in (appendix A.1.1)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import WallSegment
from ninedisk.harness.api.case import Check, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.nine_disk._compression_checks import HISTORIES, compression_checks, peaks, row_sums
from ninedisk.harness.cases.nine_disk.scene import (
    CENTRE,
    DAMPING_FORM,
    LEFT,
    LEVER_ARM,
    LOAD_CASES,
    NINE_DISK_CD,
    SLIP_AT,
    cd_settings,
    contact_laws,
    nine_disks,
)
from ninedisk.harness.cases.nurbs.grains import SHAPE, as_outlines, overlap_error

WATCH = ((3, CENTRE), (0, 1), (3, LEFT), (0, LEFT))
"""Contacts of `HISTORIES`, in order: centre row, edge row, wall/middle disk, wall/corner disk, all along x."""


class Compression:
    """All four walls move in, then rest; the contact forces oscillate and settle.

    Without wall friction each row is one damped oscillator with an exact solution in discrete time. With it the side disks
    rub on the moving walls and the rows share the load unequally. By symmetry no disk turns, so the lever arm of the shear
    torque has no effect; the default is the one that every engine has.
    """

    id = "nine-disk/compression"
    version = 1
    title = "Nine disks, uniform compression"
    source = "appendix A.1.1, Table A.1, Figures A.2 and A.3"
    requirement = "Contact forces of the explicit scheme follow the exact recurrence and settle at kn v T/2."
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="load_case", default="a1", choices=tuple(LOAD_CASES), in_id=True, help="row of Table A.1: kn, dt, v, T"
        ),
        Parameter(name="xi", default=3.0, low=0.0, unit="1/s", in_id=True, help="global damping"),
        Parameter(
            name="wall_mu",
            default=0.0,
            words=("mu",),
            low=0.0,
            in_id=True,
            help="friction of the walls; the word mu stands for the disks' own tan(phi)",
        ),
        Parameter(name="phi_deg", default=15.0, low=0.0, high=89.0, unit="deg", help="angle of friction between disks"),
        Parameter(name="ks_over_kn", default=1.0, low=0.0, help="shear over normal contact stiffness"),
        Parameter(name="cycles", default=200, low=1, whole=True, help="cycles of the recorded history"),
        Parameter(
            name="settle_cycles",
            default=4000,
            low=0,
            whole=True,
            help="cycle at which the settled forces are read (damped runs only); 0: at the end of the history",
        ),
        Parameter(name="substeps", default=1, low=1, whole=True, help="contact steps in one cycle"),
        replace(LEVER_ARM, default="overlap"),
        DAMPING_FORM,
        SLIP_AT,
        SHAPE,
        *NINE_DISK_CD,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Four load cases, damped and not, smooth and rough walls; theta = 1 and the static limit of contact dynamics; outlines."""
        rows: list[Mapping[str, Value]] = [
            {"load_case": load_case, "xi": xi, "wall_mu": wall_mu}
            for wall_mu in (0.0, "mu")
            for xi in (3.0, 0.0)
            for load_case in LOAD_CASES
        ]
        rows += [{"load_case": "a1", "theta": 1.0}]
        rows += [{"load_case": "a1", "wall_mu": wall_mu, "regime": "quasi-static"} for wall_mu in (0.0, "mu")]
        return [*rows, *({"load_case": "a1", "wall_mu": wall_mu, "shape": "nurbs"} for wall_mu in (0.0, "mu"))]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Scene of Figure A.1 with the walls' motion of Table A.1."""
        load = LOAD_CASES[params["load_case"]]
        duration, v = load.load_cycles * load.dt, load.v_wall
        motions = {
            name: (WallSegment(duration=duration, velocity=(v * nx, v * ny)),)
            for name, nx, ny in (("left", 1, 0), ("right", -1, 0), ("bottom", 0, 1), ("top", 0, -1))
        }
        disk_law, wall_law = contact_laws(params, load.kn)
        scene = nine_disks(disk_law, wall_law, motions, params["xi"])
        if params["shape"] == "nurbs":
            scene = as_outlines(scene)
        cycles = params["cycles"]
        last = max(cycles, params["settle_cycles"]) if params["xi"] > 0.0 else cycles
        numerics = Numerics(
            dt=load.dt,
            n_steps=last,
            contact_dt=load.dt / params["substeps"],
            sample_until=cycles,
            damping_form=params["damping_form"],
            **cd_settings(params),
        )
        return Setup(scene=scene, numerics=numerics, watch=WATCH, labels=dict(zip(HISTORIES, WATCH, strict=True)))

    def slips(self, params: Mapping[str, Any]) -> bool:
        """Smooth walls leave every contact without slip: by symmetry each row moves along itself."""
        return bool(params["wall_mu"] != 0.0)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Force histories over cycles 0..cycles; settled values and their sums by row, peaks, amplitudes, symmetry."""
        load = LOAD_CASES[params["load_case"]]
        shown = history.step <= params["cycles"]
        step, t = history.step[shown], history.t[shown]
        series, scalars = {}, {}
        for name, pair in setup.labels.items():
            force = history.fn[:, history.contact(pair)]
            series[name] = ("N", force[shown])
            scalars[f"{name}_settled"] = ("N", float(force[-1]) if params["xi"] > 0.0 else math.nan)
            scalars |= peaks(name, step, force[shown], load.load_cycles)
        scalars |= row_sums(scalars)
        middle = 0.5 * (history.x + history.x[:, ::-1, :]) - history.x[:, CENTRE : CENTRE + 1, :]
        scalars["symmetry_error"] = ("m", float(np.abs(middle).max()))
        scalars["overlap_error"] = ("m", overlap_error(setup, history))
        return Observed(step=step, t=t, series=series, scalars=scalars)

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact recurrence and analytic forces for smooth walls, converged histories for rough ones."""
        return compression_checks(params, setup, observed, engine)


CASE = Compression()
