"""Verdicts on the source's claims: each rule on results that confirm, contradict, and cannot decide."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.harness.api.case import Observed, Setup
from ninedisk.harness.api.claims import UndecidedError, claims_of
from ninedisk.harness.api.registry import BUILTIN_CASES, get_case
from ninedisk.harness.cases.nine_disk.figures import CONTACTS
from ninedisk.harness.results.claims import judge_claims
from ninedisk.harness.results.schema import CELL_COLUMNS, CLAIM_COLUMNS, MEASUREMENT_COLUMNS
from ninedisk.harness.results.tables import CaseResult, complete

G = 10.0
CLAIMS = {claim.id: claim for case_id in BUILTIN_CASES for claim in claims_of(get_case(case_id))}


def cell(
    params: Mapping[str, Any],
    series: Mapping[str, Any] | None = None,
    scalars: Mapping[str, float] | None = None,
    rows: tuple[Mapping[str, Any], ...] = (),
    **fields: Any,
) -> CaseResult:
    curves = {name: ("", np.asarray(values, dtype=float)) for name, values in (series or {}).items()}
    count = max((len(values) for _, values in curves.values()), default=1)
    steps = np.arange(count)
    head = {
        "case": "x",
        "variant": str(dict(params)),
        "engine": "dem",
        "status": "pass",
        "params": json.dumps(dict(params)),
    }
    scene = Scene(disks=Disks(x=[[0, 0]], radius=0.5, mass=7.854), disk_disk=ContactLaw(kn=1.0), gravity=(0.0, -G))
    return CaseResult(
        cell=complete({**head, **fields}, CELL_COLUMNS),
        rows=[complete({"variant": head["variant"], **row}, MEASUREMENT_COLUMNS) for row in rows],
        setup=Setup(scene=scene, numerics=Numerics(dt=1.0, n_steps=count), watch=()),
        observed=Observed(
            step=steps, t=steps * 1.0, series=curves, scalars={k: ("", v) for k, v in (scalars or {}).items()}
        ),
    )


def forces(settled: float, amplitude: float = 0.0) -> dict[str, Any]:
    return dict.fromkeys(CONTACTS, settled + amplitude * np.sin(np.arange(200.0)))


def settled(values: tuple[float, ...], xi: float = 3.0) -> list[CaseResult]:
    names = ("a1", "a2", "b1", "b2")
    return [cell({"load_case": n, "xi": xi}, forces(f)) for n, f in zip(names, values, strict=False)]


def damped(with_damping: float) -> list[CaseResult]:
    return [cell({"xi": 3.0}, forces(1.0, with_damping)), cell({"xi": 0.0}, forces(1.0, 0.5))]


def distorted(by_friction: float, by_stiffness: float) -> list[CaseResult]:
    converged = {"quantity": "fs_up", "truth": "converged", "uncertainty": 0.01, "scale": 1.0}
    return [
        cell(
            {"phi_deg": phi, "ks_over_kn": ratio},
            {"fs_up": np.linspace(0.0, 1.0, 9) * (1.0 + by_friction * (phi == 30.0) + by_stiffness * (ratio == 1.0))},
            rows=(converged,),
        )
        for phi in (15.0, 30.0)
        for ratio in (2 / 3, 1.0)
    ]


def collided(kind: str, status: str) -> list[CaseResult]:
    row = {
        "quantity": "vx_1_final",
        "truth": "published",
        "status": status,
        "value": 0.4,
        "expected": 0.5,
        "abs_error": 0.1,
    }
    return [cell({"kind": kind}, rows=(row, {**row, "quantity": "other", "status": "fail"}))]


def increments(gap: list[float]) -> list[CaseResult]:
    return [cell({"mu": 0.5, "increment": 0.1}, {"gap": gap})]


def rises(above: float, below: float, **extra: float) -> list[CaseResult]:
    params = {"mu": 0.5, "speed": 1.0, "g0": 1e-3, **extra}
    return [cell({**params, "dt": dt}, scalars={"du_y_1": rise}) for dt, rise in ((0.01, above), (0.001, below))]


def thrown(free: list[float], blocked: list[float]) -> list[CaseResult]:
    return [cell({"rotating": True}, {"gap": free}), cell({"rotating": False}, {"gap": blocked})]


def slid(power: float, share: float = 0.005, sign: float = 1.0) -> list[CaseResult]:
    ramp = np.linspace(0.0, 1.0, 11)
    return [
        cell({"mu": 0.36, "dt": dt}, {"gap": sign * share * (dt / 0.01) ** power * ramp, "x": ramp})
        for dt in (0.01, 0.005, 0.0025)
    ]


def pressed(force: float) -> list[CaseResult]:
    return [cell({"mu": 0.36, "angle_deg": 20.0}, {"fn": np.full(11, force)})]


def stuck(status: str, mu: float = 0.4) -> list[CaseResult]:
    return [cell({"mu": mu}, rows=({"quantity": "creep_rate", "status": status, "abs_error": 0.0, "value": 0.0},))]


MG = 7.854 * G
COS = math.cos(math.radians(20.0))
LIFT = (0.005 - 1e-3) / 1.25


@pytest.mark.parametrize(
    ("claim", "cells", "verdict"),
    [
        ("same-settled-force", settled((4.9, 4.9, 5.0, 5.1)), True),
        ("same-settled-force", settled((4.9, 4.9, 5.0, 5.3)), False),
        ("same-settled-force", settled((4.9, 4.9, 5.0)), None),
        ("same-settled-force", settled((4.9, 4.9, 5.0, 5.1), xi=0.0), None),
        ("damping-reduces-oscillation", damped(0.1), True),
        ("damping-reduces-oscillation", damped(0.6), False),
        ("damping-reduces-oscillation", damped(0.1)[:1], None),
        ("nurbs-overlap", [cell({"shape": "disk"}, {"gap_error": [1e-14, 1e-15]})], True),
        ("nurbs-overlap", [cell({"shape": "disk"}, {"gap_error": [1e-14, 1e-11]})], False),
        ("nurbs-overlap", [cell({"shape": "ellipse"}, {"gap_error": [1e-14, 1e-15]})], None),
        ("friction-and-stiffness-ratio-shape-distortion", distorted(0.5, 0.1), True),
        ("friction-and-stiffness-ratio-shape-distortion", distorted(0.5, 0.005), False),
        ("friction-and-stiffness-ratio-shape-distortion", distorted(-0.5, 0.1), False),
        ("friction-and-stiffness-ratio-shape-distortion", distorted(0.5, 0.1)[:2], None),
        ("elastic-collision-conserves", collided("elastic", "pass"), True),
        ("elastic-collision-conserves", collided("elastic", "fail"), False),
        ("elastic-collision-conserves", collided("elastic", "known-gap"), None),
        ("elastic-collision-conserves", collided("plastic", "pass"), None),
        ("plastic-collision-conserves-momentum-only", collided("plastic", "gap-closed"), True),
        ("plastic-collision-conserves-momentum-only", collided("plastic", "fail"), False),
        ("quasistatic-dilates-once", increments([0.0, 0.05, 0.05, 0.05]), True),
        ("quasistatic-dilates-once", increments([0.0, 0.05, 0.05, 0.0501]), False),
        ("quasistatic-dilates-once", increments([0.0, 0.0, 0.0]), False),
        ("critical-time-step", rises(LIFT, 0.0), True),
        ("critical-time-step", rises(LIFT, 1e-6), False),
        ("critical-time-step", rises(1.01 * LIFT, 0.0), False),
        ("critical-time-step", rises(LIFT, 0.0)[:1], None),
        ("rotations-limit-dilation", thrown([0.0, 0.1, 0.0], [0.0, 0.1, 0.1]), True),
        ("rotations-limit-dilation", thrown([0.0, 0.2, 0.0], [0.0, 0.1, 0.1]), False),
        ("rotations-limit-dilation", thrown([0.0, 0.1, 0.05], [0.0, 0.1, 0.1]), False),
        ("rotations-limit-dilation", thrown([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]), None),
        ("dilation-small-and-shrinks-with-dt", slid(1.0), True),
        ("dilation-small-and-shrinks-with-dt", slid(0.5), False),
        ("dilation-small-and-shrinks-with-dt", slid(1.0, share=0.02), False),
        ("dilation-small-and-shrinks-with-dt", slid(1.0, sign=-1.0), None),
        ("dilation-small-and-shrinks-with-dt", slid(1.0)[:1], None),
        ("contact-forces-match-mg", pressed(MG), True),
        ("contact-forces-match-mg", pressed(MG * COS), False),
        ("contact-forces-match-mg", pressed(MG * 0.97), None),
        ("block-stays", stuck("pass"), True),
        ("block-stays", stuck("fail"), False),
        ("block-stays", stuck("pass", mu=0.36), None),
    ],
)
def test_rules(claim: str, cells: list[CaseResult], verdict: bool | None) -> None:
    if verdict is None:
        with pytest.raises(UndecidedError):
            CLAIMS[claim].rule(cells)
    else:
        found, evidence = CLAIMS[claim].rule(cells)
        assert found is verdict, evidence
        assert evidence


@pytest.mark.parametrize("claim", CLAIMS)
def test_an_engine_that_cannot_see_decides_nothing(claim: str) -> None:
    """NaN in every series never confirms and never contradicts."""
    blind = {
        "nurbs-overlap": [cell({"shape": "disk"}, {"gap_error": [math.nan] * 3})],
        "same-settled-force": settled((math.nan,) * 4),
        "damping-reduces-oscillation": damped(math.nan),
        "friction-and-stiffness-ratio-shape-distortion": distorted(math.nan, math.nan),
        "quasistatic-dilates-once": increments([math.nan] * 4),
        "critical-time-step": rises(math.nan, math.nan),
        "rotations-limit-dilation": thrown([math.nan] * 3, [math.nan] * 3),
        "dilation-small-and-shrinks-with-dt": slid(math.nan),
        "contact-forces-match-mg": pressed(math.nan),
    }
    with pytest.raises(UndecidedError):
        CLAIMS[claim].rule(blind.get(claim, [cell({"mu": 0.4, "kind": "elastic"})]))


def test_the_source_s_claims_are_all_there() -> None:
    """Twelve of the source, and three of others; each with its own words and how it is decided; no id is used twice."""
    found = [claim for case_id in BUILTIN_CASES for claim in claims_of(get_case(case_id))]
    assert len(found) == len(CLAIMS)
    assert [claim.id for claim in found if not claim.place.startswith("A.")] == [
        "haffs-law",
        "nesterenkos-speed",
        "haffs-law-of-spheres",
    ]
    assert len(found) == 15
    for claim in found:
        assert claim.text
        assert claim.decided_by.endswith("."), claim.id
        assert all(line.endswith(".") for line in claim.derivation), claim.id


def test_rows() -> None:
    params = {"mu": 0.36, "angle_deg": 20.0, "dt": 0.01}
    curves = {"fn": [MG * COS] * 5, "gap": [0.0] * 5, "x": [0.0] * 5}
    slides = [cell(params, curves, case="incline-block", engine=engine) for engine in ("dem", "pymunk")]
    absent = cell({"mu": 0.36}, case="incline-block", engine="yade", status="not-installed", reason="no yade")
    rows = judge_claims([*slides, absent])
    assert all(list(row) == list(CLAIM_COLUMNS) for row in rows)
    found = {(row["claim"], row["engine"]): (row["verdict"], row["evidence"]) for row in rows}
    assert found["contact-forces-match-mg", "dem"][0] == "contradicted"
    assert found["contact-forces-match-mg", "pymunk"][0] == "contradicted"
    assert found["contact-forces-match-mg", "yade"] == ("undecided", "not-installed: no yade")
    assert {row["claim"] for row in rows} == {claim.id for claim in get_case("incline-block").claims}
    assert any("m g cos" in line for row in rows for line in json.loads(row["derivation"]))


def test_a_case_that_cannot_be_loaded_has_no_claims() -> None:
    assert judge_claims([cell({}, case="no/such")]) == []
