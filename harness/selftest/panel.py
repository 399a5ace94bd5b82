"""The variants that wrong engines run: few and short, yet with every kind of check that the whole matrix has.

Springs are softer and settling times and runs shorter than in the matrix, which changes the number of steps and no tolerance's reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ninedisk.harness.run.plan import Cell, plan_case
from ninedisk.harness.selftest.declared import DECLARED, RUNS, Declared

PRESS, SHEAR = "nine-disk/compression", "nine-disk/distortion"
HIT, INCLINE, ROLL = "binary-collision", "incline-block", "slip-to-roll"
STATIC, THROW = "sliding/quasistatic", "sliding/dynamic"
LENSES, OVALS, GRAINS, REST = "nurbs/overlap", "nurbs/collision", "nurbs/rolling", "nurbs/settle"
GAS, REOPEN, WALL, STACK = "gas/elastic", "contact/reopening", "contact/moving-wall", "static/stack"
RETRACE, HOLD, COOL, RESIST, COHESION = (
    "contact/retraced-loop",
    "friction/hold",
    "gas/cooling",
    "rolling/resistance",
    "impact/cohesion",
)
DRIVEN = "contact/driven-wall"
MATERIALS, FORCES = "contact/materials", "motion/forces"
LATTICE, SHEAR_CELL = "cell/lattice", "cell/shear"
BUDGET = "energy/budget"
TWO, CLUSTER, ORBIT, BELT = "impact/two-disks", "contact/cluster", "contact/orbit", "contact/belt"
HOLDING = "contact/holding"

ENGINES = ("dem", "spheres", "cd", *DECLARED)
"""`spheres` is the DEM on scenes in space: its own panel, whose defects are not run on the plane's."""


@dataclass(frozen=True)
class Probe:
    """A variant of a case: the parameters that differ from its defaults.

    ``long``: it takes minutes with interpreted kernels, longer than to compile those of a defect.
    """

    case: str
    params: Mapping[str, Any] = field(default_factory=dict)
    long: bool = False


_BOTH = {
    "press": Probe(PRESS, {"settle_cycles": 400}),
    "press-undamped": Probe(PRESS, {"load_case": "b2", "xi": 0.0}),
    "press-rough": Probe(PRESS, {"xi": 0.0, "wall_mu": "mu"}),
    "press-settle": Probe(PRESS, {"wall_mu": "mu", "load_case": "a2"}),
    "shear-caps": Probe(
        SHEAR,
        {"phi_deg": 15.0, "ks_over_kn": 2.0 / 3.0, "walls": "mid-pivot-caps-translate", "lever_arm": "overlap"},
    ),
}

DEM_PANEL: dict[str, Probe] = {
    **_BOTH,
    "shear": Probe(SHEAR, {}),
    "hit": Probe(HIT, {"kn": 1e4}),
    "hit-near": Probe(HIT, {"kn": 1e4, "gap": 0.45}),
    "hit-damped": Probe(HIT, {"kn": 1e4, "restitution": 0.5}),
    "hit-plastic": Probe(HIT, {"kn": 1e4, "kind": "plastic"}),
    "slide": Probe(INCLINE, {"mu": 0.36, "kn": 1e6}),
    "stick": Probe(INCLINE, {"mu": 0.4, "kn": 1e6}),
    "land": Probe(INCLINE, {"mu": 0.4, "preload": False, "kn": 1e6}),
    "throw": Probe(THROW, {"dt": 0.01, "g0": 0.001}),
    "throw-touching": Probe(THROW, {"dt": 0.01, "g0": 0.0}),
    "roll": Probe(ROLL, {"kn": 1e6}),
    "stop": Probe(ROLL, {"kn": 1e6, "rotating": False}),
    "reopen-disks": Probe(REOPEN, {}),
    "reopen-far": Probe(REOPEN, {"speed": 20.0}),
    "reopen-wall": Probe(REOPEN, {"pair": "wall", "arm": "overlap"}),
    "push-wall": Probe(WALL, {}),
    "shake": Probe(WALL, {"motion": "shake"}),
    "retrace": Probe(RETRACE, {}),
    "retrace-wall": Probe(RETRACE, {"kind": "wall"}),
    "resist-constant": Probe(RESIST, {"kn": 1e5}),
    "resist-viscous": Probe(RESIST, {"model": "viscous", "kn": 1e5}),
    "resist-spring": Probe(RESIST, {"model": "elastic-plastic", "kn": 1e5}),
    "resist-pair": Probe(RESIST, {"model": "viscous", "plane": "pair", "kn": 1e5}),
    "hold-spring": Probe(RESIST, {"model": "elastic-plastic", "plane": "hold", "beta": 0.3, "kn": 1e5}),
    "cohesive": Probe(COHESION, {}),
    "cohesive-damped": Probe(COHESION, {"beta": 0.2}),
    "materials": Probe(MATERIALS, {"kn": 1e6}),
    "forces": Probe(FORCES, {}),
    "hold": Probe(HOLD, {"kn": 1e4, "duration": 0.2}),
    "stack": Probe(STACK, {"start": "equilibrium", "n": 12, "duration": 0.02}),
    "cell-press": Probe(LATTICE, {"mode": "compression"}),
    "cell-shear": Probe(LATTICE, {"mode": "shear"}),
    "cell-smooth": Probe(SHEAR_CELL, {"mu": 0.0}),
    "cell-seen": Probe(LATTICE, {"mode": "shear", "frame": 3.0}),
    "cell-flow": Probe(SHEAR_CELL, {"kind": "flow", "rows": 8}, long=True),
    "budget": Probe(BUDGET, {"duration": 0.2}),
    "unequal": Probe(TWO, {"across": -1.2, "restitution": 0.5, "kn": 1e7}),
    "held": Probe("impact/held-disk", {"partner": "held"}),
    "six": Probe(CLUSTER, {"arrangement": "six"}),
    "nine": Probe(CLUSTER, {"arrangement": "many"}),
    "box": Probe(CLUSTER, {"arrangement": "box", "blocked": True}),
    "orbit": Probe(ORBIT, {"steps": 200}),
    "belt-stops": Probe(BELT, {"kn": 1e6}),
    "press-outlines": Probe(PRESS, {"shape": "nurbs", "cycles": 10, "settle_cycles": 5, "wall_mu": "mu"}),
    "lenses": Probe(LENSES, {"shape": "ellipse", "pairs": 3}),
    "ovals": Probe(OVALS, {"kn": 100.0, "phase": 0.3, "mu": 0.5}),
    "ovals-area": Probe(OVALS, {"contact": "area", "kn": 100.0, "phase": 0.12}),
    "stand": Probe(GRAINS, {"kn": 1e5, "steepness": 0.6, "duration": 0.1}),
    "oval-rolls": Probe(GRAINS, {"grain": "ellipse", "kn": 1e4, "duration": 0.2}),
}

CD_PANEL: dict[str, Probe] = {
    **_BOTH,
    "press-theta": Probe(PRESS, {"settle_cycles": 400, "theta": 1.0}),
    "press-static": Probe(PRESS, {"regime": "quasi-static", "settle_cycles": 200}),
    "press-outlines": Probe(PRESS, {"shape": "nurbs", "settle_cycles": 5, "wall_mu": "mu"}),
    "rough-outlines": Probe(PRESS, {"shape": "nurbs", "xi": 0.0, "wall_mu": "mu"}),
    "rest": Probe(REST, {}),
    "ovals": Probe(OVALS, {"kn": 100.0, "phase": 0.3, "mu": 0.5}),
    "stand": Probe(GRAINS, {"kn": 1e5, "steepness": 0.6, "duration": 0.1}),
    "oval-rolls": Probe(GRAINS, {"grain": "ellipse", "kn": 1e4, "duration": 0.2}),
    "push-wall": Probe(WALL, {}),
    "shake": Probe(DRIVEN, {"motion": "shake"}),
    "turn": Probe(DRIVEN, {"motion": "turn"}),
    "budget": Probe(BUDGET, {"duration": 0.2}),
    "budget-rigid": Probe(BUDGET, {"duration": 0.1, "contacts": "rigid"}),
    "materials": Probe(MATERIALS, {}),
    "forces": Probe(FORCES, {}),
    "unequal": Probe(TWO, {"across": -1.2, "restitution": 0.5}),
    "six": Probe(CLUSTER, {"arrangement": "six", "steps": 200}),
    "box": Probe(CLUSTER, {"arrangement": "box", "blocked": True, "steps": 200}),
    "orbit": Probe(ORBIT, {"steps": 100, "turns": 2}),
    "belt-stops": Probe(BELT, {}),
    "hit": Probe(HIT, {}),
    "hit-damped": Probe(HIT, {"restitution": 0.5}),
    "hit-plastic": Probe(HIT, {"kind": "plastic"}),
    "hit-between": Probe(HIT, {"gap": 0.5025}),
    "hit-newton": Probe(HIT, {"restitution": 0.5, "impact": "newton"}),
    "gas-newton": Probe(GAS, {"impact": "newton", "rows": 4, "spacing": 2.3, "duration": 0.5}),
    "cool": Probe(COOL, {"rows": 5, "duration": 2.0}),
    "hold": Probe(HOLD, {}),
    "slide": Probe(INCLINE, {"mu": 0.36}),
    "slide-coulomb": Probe(INCLINE, {"mu": 0.36, "sliding": "coulomb"}),
    "stick": Probe(INCLINE, {"mu": 0.4}),
    "stick-coulomb": Probe(INCLINE, {"mu": 0.4, "sliding": "coulomb"}),
    "hang": Probe(HOLDING, {"kind": "adhesion"}),
    "cohesive-slide": Probe(HOLDING, {}),
    "pyramid": Probe(HOLDING, {"kind": "pyramid"}),
    "pushed-row": Probe(HOLDING, {"kind": "row"}),
    "push": Probe(STATIC, {}),
    "push-gap": Probe(STATIC, {"gap_0": 0.0005}),
    "push-coulomb": Probe(STATIC, {"sliding": "coulomb"}),
    "throw-short": Probe(THROW, {"dt": 0.001, "g0": 0.001}),
    "throw": Probe(THROW, {"dt": 0.01, "g0": 0.001}),
    "throw-touching": Probe(THROW, {"dt": 0.01, "g0": 0.0}),
    "throw-coulomb": Probe(THROW, {"dt": 0.01, "g0": 0.001, "sliding": "coulomb"}),
    "roll": Probe(ROLL, {}),
    "roll-coulomb": Probe(ROLL, {"sliding": "coulomb"}),
    "stop": Probe(ROLL, {"rotating": False}),
    "stop-coulomb": Probe(ROLL, {"rotating": False, "sliding": "coulomb"}),
    "box-tips": Probe("box/incline", {"mu": 0.5, "slope_deg": 30.0, "aspect": 0.4}),
    "box-slides": Probe("box/incline", {"mu": 0.35}),
    "box-turns": Probe("box/free", {}),
    "ball-bounces": Probe("spheres/thornton", {"law": "linear", "incidence": 1.5}),
    "ball-rolls": Probe("spheres/rolling", {}),
    "ball-on-table": Probe("spheres/turntable", {"turn": 14.0}),
}

RIGID_PANEL: dict[str, Probe] = {
    "hit": Probe(HIT, {"restitution": 0.5}),
    "slide": Probe(INCLINE, {"mu": 0.36}),
    "stick": Probe(INCLINE, {"mu": 0.4}),
    "roll": Probe(ROLL, {}),
    "stop": Probe(ROLL, {"rotating": False}),
    "spin": Probe("spinning-disk", {}),
    "bounce": Probe("impact/bouncing-disk", {}),
    "graze": Probe("impact/oblique", {"restitution": 0.5, "spin": 2.0}),
    "stack": Probe(STACK, {}),
    "against": Probe("invariance/galilei", {"scene": "slide", "frame_vx": -3.0}),
    "belt": Probe("invariance/galilei", {"scene": "belt", "frame_vx": -1.0}),
    "shake": Probe(DRIVEN, {"motion": "shake"}),
    "turn": Probe(DRIVEN, {"motion": "turn"}),
    "fixed": Probe("impact/held-disk", {"partner": "fixed"}),
    "held": Probe("impact/held-disk", {"partner": "held"}),
    "unequal": Probe(TWO, {"across": -1.2, "restitution": 0.5}),
    "belt-stops": Probe(BELT, {}),
    "materials": Probe(MATERIALS, {}),
    "forces": Probe(FORCES, {}),
}
"""Of an engine with rigid contacts, whatever it declares them as."""

SPHERE_PANEL: dict[str, Probe] = {
    "hit": Probe("spheres/chung-ooi/1", {}),
    "hit-plane": Probe("spheres/chung-ooi/2", {}),
    "rebound": Probe("spheres/chung-ooi/3", {}),
    "oblique": Probe("spheres/chung-ooi/4", {"angle": 3.0}),
    "oblique-damped": Probe("spheres/chung-ooi/6", {"spin": 7.0}),
    "rescale": Probe("spheres/chung-ooi/4", {"angle": 3.0, "unloading": "rescale"}),
    "keeps": Probe("spheres/chung-ooi/4", {"angle": 3.0, "unloading": "none"}),
    "spins": Probe("spheres/chung-ooi/7", {"partner": "same"}),
    "comes-to-roll": Probe("spheres/rolling", {}),
    "all-ways": Probe("spheres/isotropy", {"speed": 0.05}),
    "turntable": Probe("spheres/turntable", {"turn": 40.0}),
    "large": Probe("spheres/chung-ooi/8", {}),
    "turns-with-plane": Probe("spheres/turned", {"kind": "plane"}),
    "turns-about-normal": Probe("spheres/turned", {"kind": "spun"}),
    "slides": Probe("spheres/thornton", {"incidence": 9.0}),
    "sticks": Probe("spheres/thornton", {"incidence": 1.5}),
    "chain": Probe("spheres/hertz-chain", {}),
    "top-thrown": Probe("spheres/top", {"kind": "thrown"}),
    "twist": Probe("spheres/top", {"kind": "constant"}),
    "twist-spring": Probe("spheres/top", {"kind": "elastic-plastic"}),
    "resists": Probe("spheres/rolling-resistance", {"plane": "incline"}),
    "resists-both": Probe("spheres/rolling-resistance", {"model": "elastic-plastic", "plane": "twisting"}),
    "heap": Probe("spheres/stack", {}),
    "heap-falls": Probe("spheres/stack", {"share": 0.8}),
    "cools": Probe("spheres/cooling", {"duration": 1.0}),
    "neck": Probe("spheres/jkr", {}),
    "necks": Probe("spheres/jkr", {"speed": 0.9}),
    "shares": Probe("spheres/budget", {"duration": 0.05}),
    "units": Probe("spheres/invariance/units", {"scene": "heap", "units": "km-Mg-min"}),
    "turned": Probe("spheres/invariance/rotation", {"scene": "table", "angle_deg": 77.0}),
    "moves": Probe("spheres/invariance/galilei", {"scene": "throw", "frame_vx": 3.0, "frame_vy": -2.0}),
    "off-ball": Probe("spheres/off-ball", {}),
    "saddle": Probe("spheres/saddle", {"ratio": 5.0}),
    "unequal": Probe("spheres/unequal", {}),
    "unequal-slide": Probe("spheres/unequal", {"law": "linear"}),
    "flies": Probe("spheres/unequal", {"kind": "flight"}),
    "belt": Probe("spheres/unequal", {"kind": "belt"}),
    "held": Probe("spheres/unequal", {"kind": "held"}),
    "crowd": Probe("spheres/unequal", {"kind": "crowd"}),
    "resisted-pair": Probe("spheres/unequal", {"kind": "resisted"}),
    "mirrored": Probe("spheres/invariance/mirror", {"scene": "table", "mirror": True}),
}

PANELS: dict[str, dict[str, Probe]] = {
    "dem": DEM_PANEL,
    "spheres": SPHERE_PANEL,
    "cd": CD_PANEL,
    **dict.fromkeys(DECLARED, RIGID_PANEL),
}


def panel_cells(engine: str, names: Sequence[str] = ()) -> list[Cell]:
    """Cells of an engine's panel, or of the named probes of it."""
    panel = PANELS[engine]
    stands_for = Declared(engine) if engine in DECLARED else RUNS.get(engine, engine)
    return [plan_case(panel[name].case, stands_for, panel[name].params) for name in names or panel]
