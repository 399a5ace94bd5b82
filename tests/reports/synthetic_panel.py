"""Rows of a whole synthetic panel: plausible histories, and every status that a cell can have."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from ninedisk.harness.api.case import figures_of
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.results.figures import figures_to_text
from ninedisk.harness.results.schema import TABLES

Row = dict[str, Any]
ENGINES = {  # id: name, version, support, relative error of its histories
    "dem": ("ninedisk DEM", "0.1.0", "exact", 2e-15),
    "yade": ("YADE", "2024.02", "equivalent", 3e-7),
    "pymunk": ("pymunk", "7.0", "approximate", 4e-3),
    "box2d": ("Box2D", "3.1", "approximate", 2e-2),
    "lammps": ("LAMMPS", "2024-08", "equivalent", 5e-9),
    "chrono": ("Chrono", "", "no", math.nan),
}


def compression(params: Row, t: np.ndarray) -> dict[str, np.ndarray]:
    """Damped oscillator driven by a ramp, near enough to the row of disks."""
    loaded = np.minimum(t, 0.61 if params["load_case"] in ("a1", "b1") else 1.83) / 0.61
    ring = np.exp(-0.5 * params["xi"] * t) * np.sin(18.5412 * t)
    curve = 4.941e7 * loaded / loaded.max() + 5e6 * ring
    names = ("fn_disk_disk_centre", "fn_disk_disk_edge", "fn_wall_mid", "fn_wall_corner")
    return {name: curve * (1.0 + (0.05 * k if params["wall_mu"] else 0.0)) for k, name in enumerate(names)}


def cases(
    scenes: ModuleType,
) -> list[tuple[str, str, list[Row], Callable[[Row, np.ndarray], dict[str, np.ndarray]], Row, np.ndarray, str]]:
    """Id, title, params of the variants, truth of the histories, set-up, times, unit."""
    cycles, second = np.arange(201) * 0.01525, np.arange(101) * 0.01

    def distortion(p: Row, t: np.ndarray) -> dict[str, np.ndarray]:
        mu = math.tan(math.radians(p["phi_deg"]))
        fn = 4.6e9 * (1.0 + 0.1 * np.sin(t / 3.0))
        fs = np.minimum(mu * fn, 8e8 * p["ks_over_kn"] * t)
        return {"fn_up": fn, "fs_up": fs, "fn_right": 1.02 * fn, "fs_right": -fs}

    def collision(p: Row, t: np.ndarray) -> dict[str, np.ndarray]:
        after, e = t > 0.5, 1.0 if p["kind"] == "elastic" else 0.0
        one, two = np.where(after, (1 - e) / 2, 1.0), np.where(after, (1 + e) / 2, 0.0)
        zero, m = np.zeros_like(t), math.pi
        return {
            "energy": m * (one**2 + two**2) / 2,
            "momentum_x": m * (one + two),
            "vx_1": one,
            "vx_2": two,
            "vy_1": zero,
            "vy_2": zero,
        }

    def incline(p: Row, t: np.ndarray) -> dict[str, np.ndarray]:
        a = 0.037308 if p["mu"] < 0.364 else 0.0
        fn = np.full_like(t, 73.803)
        return {"x": a * t**2 / 2, "vx": a * t, "gap": p["mu"] * p["dt"] * a * t, "fs": -p["mu"] * fn, "fn": fn}

    def rolling(p: Row, t: np.ndarray) -> dict[str, np.ndarray]:
        v = np.maximum(2 / 3, 1 - 3 * p["mu"] * t)
        return {"x": np.cumsum(v) * 0.01, "vx": v, "spin": -(1 - v) * 4}

    def sliding(p: Row, t: np.ndarray) -> dict[str, np.ndarray]:
        return {"gap": np.full_like(t, p["mu"] * 0.01), "x": 0.01 * np.arange(len(t))}

    grid = [
        {"load_case": c, "xi": xi, "wall_mu": mu}
        for mu in (0.0, "mu")
        for xi in (3.0, 0.0)
        for c in ("a1", "a2", "b1", "b2")
    ]
    walls = ("mid-pivot", "corner-pivot-caps-translate")
    shear = [
        {"walls": w, "wall_mu": "mu", "phi_deg": phi, "ks_over_kn": k}
        for w in walls
        for phi in (15.0, 30.0)
        for k in (1.0, 2 / 3)
    ]
    tilted = scenes.small_setup(1, gravity=(3.42, -9.397), wall=True)
    return [
        (
            "nine-disk/compression",
            "Nine disks, uniform compression",
            grid,
            lambda p, t: compression({**p, "wall_mu": p["wall_mu"] == "mu"}, t),
            scenes.box_setup(),
            cycles,
            "N",
        ),
        (
            "nine-disk/distortion",
            "Nine disks, distortion",
            shear,
            distortion,
            scenes.box_setup(),
            np.arange(501) * 0.01525,
            "N",
        ),
        (
            "binary-collision",
            "Collision of two disks",
            [{"kind": "elastic"}, {"kind": "plastic"}],
            collision,
            scenes.small_setup(2),
            second,
            "m/s",
        ),
        (
            "incline-block",
            "Block on an incline",
            [{"mu": mu, "dt": dt} for mu in (0.36, 0.4) for dt in (0.01, 0.005, 0.0025)],
            incline,
            tilted,
            second,
            "m",
        ),
        (
            "slip-to-roll",
            "From sliding to rolling",
            [{"mu": 0.3}],
            rolling,
            scenes.small_setup(1, wall=True),
            second,
            "m/s",
        ),
        (
            "sliding/quasistatic",
            "Quasi-static sliding",
            [{"mu": 0.5}],
            sliding,
            scenes.small_setup(1, wall=True),
            np.arange(11.0),
            "m",
        ),
    ]


def panel_tables(scenes: ModuleType) -> dict[str, list[Row]]:
    """A whole panel: histories with each engine's own error, checks, references, claims, and every kind of failure."""
    random = np.random.default_rng(9)
    tables: dict[str, list[Row]] = {name: [] for name in TABLES}
    for case, title, variants, truth, setup, t, unit in cases(scenes):
        for params in variants:
            variant = ",".join(f"{k}={v:.4g}" if isinstance(v, float) else f"{k}={v}" for k, v in params.items())
            curves = truth(params, t)
            for quantity, curve in curves.items():
                tables["references"] += [
                    {
                        "case": case,
                        "variant": variant,
                        "label": "analytic: closed form",
                        "truth": "analytic",
                        "source": "closed form",
                        "quantity": quantity,
                        "unit": unit,
                        "step": k,
                        "t": t[k],
                        "value": curve[k],
                        "uncertainty": 0.0,
                    }
                    for k in range(len(t))
                ]
            for number, (engine, (name, version, support, size)) in enumerate(ENGINES.items()):
                common = {
                    "case": case,
                    "case_version": 1,
                    "variant": variant,
                    "params": json.dumps(params),
                    "engine": engine,
                    "engine_version": version,
                    "support": support,
                }
                status, reason = "pass", ""
                if not version:
                    status, reason = "not-installed", f"{name} is not on this machine: apt install {engine}"
                elif engine == "pymunk" and case.startswith("nine-disk"):
                    status, reason = "unsupported", "lacks: linear normal contact of a given stiffness kn"
                elif engine == "box2d" and case == "slip-to-roll":
                    status, reason = "error", "exit code -11\n<b>Segmentation fault</b>"
                elif engine == "lammps" and case == "nine-disk/distortion" and params["phi_deg"] == 30.0:
                    status, reason = "timeout", "stopped after 60 s"
                ran = status == "pass"
                for quantity, curve in curves.items() if ran else ():
                    scale = float(np.abs(curve).max())
                    growth = 1.0 + 9.0 * np.arange(len(t)) / len(t)
                    value = curve + size * 0.1 * (scale or 1e-16) * growth * random.uniform(-1, 1, len(t))
                    error, limit = float(np.abs(value - curve).max()), (1e-12 if support == "exact" else 1e-6)
                    verdict = "pass" if error <= limit * scale + 1e-15 else "fail"
                    gap = engine == "box2d" and quantity == "fn"
                    tables["measurements"].append(
                        {
                            **common,
                            "quantity": quantity,
                            "unit": unit,
                            "norm": "max",
                            "truth": "analytic",
                            "source": "closed form",
                            "value": value[-1],
                            "expected": curve[-1],
                            "uncertainty": 0.0,
                            "abs_error": error,
                            "rel_error": error / scale if scale else math.nan,
                            "scale": scale,
                            "atol": 1e-15,
                            "rtol": limit,
                            "why": "round-off of 200 steps"
                            if support == "exact"
                            else "order of the scheme at this step",
                            "worst_step": 7,
                            "first_divergence_step": -1,
                            "status": "known-gap" if gap else verdict,
                            "reason": "the source says m g" if gap else "",
                        }
                    )
                    tables["series"] += [
                        {
                            "case": case,
                            "variant": variant,
                            "engine": engine,
                            "quantity": quantity,
                            "unit": unit,
                            "step": k,
                            "t": t[k],
                            "value": value[k],
                            "expected": curve[k],
                            "truth": "analytic",
                        }
                        for k in range(len(t))
                    ]
                    reported = quantity == next(iter(curves))
                    tables["headlines"] += [
                        {
                            **common,
                            "headline": f"{quantity} at its worst",
                            "use": "sliding",
                            "quantity": quantity,
                            "unit": unit,
                            "source": "closed form",
                            "value": curve[-1] + error,
                            "expected": curve[-1],
                            "scale": scale or 1.0,
                            "scale_is": "largest value",
                            "rel_error": error / (scale or 1.0),
                        }
                    ] * reported
                    status = "fail" if verdict == "fail" and not gap else status
                if not ran:
                    tables["measurements"].append({**common, "status": status, "reason": reason})
                tables["cells"].append(
                    {
                        **common,
                        "case_title": title,
                        "case_source": "Appendix A",
                        "case_requirement": "Forces follow the truth.",
                        "case_figures": figures_to_text(figures_of(get_case(case))),
                        "engine_name": name,
                        "engine_licence": "BSD-3-Clause",
                        "engine_runs": "in this process",
                        "missing": json.dumps(
                            ["linear normal contact of a given stiffness kn"] if status == "unsupported" else []
                        ),
                        "notes": json.dumps(["restitution stands for the spring"] if support == "approximate" else []),
                        "asked": json.dumps(["gravity", "Coulomb friction"]),
                        "capabilities": json.dumps(["Coulomb friction", "gravity", "disks that stay where they are"]),
                        "penetration": size if ran else math.nan,
                        "settings": json.dumps({"iterations": 10, "damping": {"form": "central"}}),
                        "status": status,
                        "reason": reason,
                        "setup_s": 0.01 if ran else math.nan,
                        "warm_up_s": 0.5 if ran else math.nan,
                        "advance_s": 0.002 if ran else math.nan,
                        "n_steps": len(t) - 1,
                        "n_disks": len(setup["scene"]["disks"]["x"]),
                        "setup": json.dumps(setup),
                        "frames": json.dumps(scenes.box_frames(number))
                        if ran and case == "nine-disk/distortion"
                        else "",
                    }
                )
    for engine in ("dem", "yade"):
        for k, verdict in enumerate(("confirmed", "contradicted", "undecided")):
            tables["claims"].append(
                {
                    "claim": f"claim-{k}",
                    "place": "A.3.4",
                    "text": "The contact forces match m g and mu m g.",
                    "case": "incline-block",
                    "engine": engine,
                    "verdict": verdict,
                    "evidence": "fn = 73.80 N against 78.54 N",
                }
            )
    return tables
