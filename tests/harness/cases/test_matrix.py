"""The first variant of each case on the engines of this process passes; which checks there are depends on no value, and each can fail.

All variants of all cases on all engines: `tests/verification`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from ninedisk.harness.api.case import Case
from ninedisk.harness.api.engine import Engine
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK

ALL = (PYMUNK, DEM, CD)
ENGINES: Mapping[str, tuple[Engine, ...]] = {
    "binary-collision": (PYMUNK, DEM),
    "impact/bouncing-disk": ALL,
    "impact/oblique": ALL,
    "incline-block": (PYMUNK, DEM),
    "chain/newton-cradle": ALL,
    "row/pushed": (CD, DEM),
    "slip-to-roll": (PYMUNK, DEM),
    "spinning-disk": ALL,
    "rolling/incline-disk": ALL,
    "static/stack": ALL,
    "strength/hexagonal": ALL,
    "contact/moving-wall": (CD, DEM),
    "contact/driven-wall": ALL,
    "impact/held-disk": ALL,
    "impact/two-disks": ALL,
    "contact/belt": ALL,
    "contact/cluster": (DEM,),
    "contact/orbit": (DEM,),
    "friction/hold": ALL,
    "energy/budget": (CD, DEM),
    "cell/lattice": (DEM,),
    "cell/shear": (DEM,),
    "cell/own-image": (DEM,),
    "rolling/resistance": (DEM,),
    "impact/cohesion": (CD, DEM),
    "contact/holding": (CD, DEM),
    "contact/materials": ALL,
    "motion/forces": ALL,
    **{f"spheres/chung-ooi/{k}": (DEM,) for k in range(1, 9)},
    "spheres/thornton": (DEM,),
    "spheres/hertz-chain": (DEM,),
    **{
        f"spheres/{name}": (DEM,)
        for name in ("rolling", "incline", "isotropy", "turntable", "turned", "top", "rolling-resistance", "stack")
    },
    **{f"spheres/invariance/{name}": (DEM,) for name in ("units", "rotation", "galilei", "mirror")},
    "spheres/cooling": (DEM,),
    "spheres/budget": (DEM,),
    "spheres/jkr": (DEM,),
    "rolling/off-disk": ALL,
    "spheres/off-ball": (DEM,),
    "spheres/saddle": (DEM,),
    "spheres/unequal": (DEM,),
    **{f"nurbs/{name}": (DEM,) for name in ("overlap", "collision", "settle", "rolling")},
    **{
        f"box/{name}": (CD,)
        for name in ("incline", "stop", "free", "corner-drop", "rocking", "carries-balls", "stack", "domino", "spin")
    },
}
LEAST = {
    "row/pushed": 7,
    "contact/moving-wall": 7,
    "contact/driven-wall": 7,
    "impact/held-disk": 9,
    "impact/two-disks": 14,
    "contact/belt": 8,
    "contact/cluster": 26,
    "contact/orbit": 6,
    "friction/hold": 8,
    "energy/budget": 4,
    "cell/lattice": 8,
    "cell/own-image": 6,
    "rolling/resistance": 8,
    "contact/materials": 21,
    "motion/forces": 14,
    "spheres/chung-ooi/1": 9,
    "spheres/chung-ooi/2": 7,
    "spheres/thornton": 4,
    "spheres/hertz-chain": 7,
    **{f"spheres/{name}": 3 for name in ("rolling", "incline", "turned")},
    **{f"spheres/{name}": 5 for name in ("top", "rolling-resistance", "cooling")},
    **{f"spheres/invariance/{name}": 3 for name in ("rotation", "galilei", "mirror")},
    "spheres/isotropy": 51,
    "spheres/budget": 3,
    "spheres/jkr": 2,
    "spheres/turntable": 21,
    "spheres/saddle": 4,
    "rolling/off-disk": 3,
    "spheres/off-ball": 3,
    "spheres/unequal": 12,
    "spheres/stack": 2,
    "spheres/invariance/units": 7,
    "nurbs/overlap": 5,
    "nurbs/collision": 2,
    "nurbs/settle": 2,
}
"""Checks that bind every engine on a variant, where more than one must."""

OTHERS: tuple[tuple[str, Engine, Mapping[str, Any]], ...] = (
    ("gas/elastic", PYMUNK, {}),
    ("gas/elastic", DEM, {}),
    ("gas/elastic", DEM, {"phase": 0.05}),
    ("gas/elastic", CD, {"duration": 1.0}),
    *(("gas/cooling", engine, {"rows": 5}) for engine in ALL),
    ("slip-to-roll", PYMUNK, {"start": "dilated"}),
    *((f"spheres/{name}", CD, {}) for name in ("rolling", "incline", "isotropy")),
    ("spheres/turntable", CD, {"turn": 2.0}),
    ("spheres/thornton", CD, {"law": "linear", "incidence": 2.5}),
    *(("row/pushed", CD, {"xi": xi, "g": g}) for xi, g in ((0.0, 0.0), (300.0, 10.0))),
)
"""Variants that are in no matrix, or too long in theirs."""


def runs(case_id: str, engine: Engine, params: Mapping[str, Any]) -> bool:
    """Whether the engine can run the variant, and is no other engine than the variant is for."""
    if case_id == "row/pushed":
        return engine is CD or not set(params) & {"theta", "regime"}
    if case_id == "impact/held-disk":
        return engine in (CD, DEM) or params["partner"] == "fixed"
    if case_id == "strength/hexagonal":
        return engine is CD or params["sliding"] == "associated"
    return engine is not PYMUNK or params.get("start") != "equilibrium"  # pymunk has no springs to start with overlaps


def cells() -> Iterator[Any]:
    """A case, an engine, and variants of which the first is run."""
    for name, engines in ENGINES.items():
        case = get_case(name)
        for engine in engines:
            variants = [params for params in case.matrix() if runs(name, engine, params)]
            yield pytest.param(case, engine, variants, id=f"{name}-{engine.id}")
    for name, engine, params in OTHERS:
        case = get_case(name)
        yield pytest.param(case, engine, [params], id=f"{name}-{engine.id}-{resolve(case, params).id}")


@pytest.mark.parametrize(("case", "engine", "variants"), list(cells()))
def test_the_first_variant_passes_and_every_check_of_all_can_fail(
    run_cell: Any, judge_history: Any, case: Case, engine: Engine, variants: list[Mapping[str, Any]]
) -> None:
    cell = run_cell(case, engine, variants[0])
    assert cell.failures == []
    for params in variants:
        blank = judge_history(case, engine.info(), params, None)
        assert len(blank.failures) == len(blank.checks) >= LEAST.get(case.id, 1), params
        if params is variants[0]:
            names = [[(c.quantity, c.norm, c.truth) for c in each.checks] for each in (blank, cell)]
            assert names[0] == names[1]
