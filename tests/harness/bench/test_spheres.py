"""The suite ``spheres`` on sixty of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core.packings.spheres import settled_spheres
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.bench import dem, spheres
from ninedisk.harness.bench.spheres import LAMMPS, PEERS, SphereProblem, problem_makers
from ninedisk.harness.results.schema import Row


@pytest.fixture(scope="module")
def problems() -> dict[str, SphereProblem]:
    """Sixty spheres without a word about any cache, few steps, by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spheres, "packing", lambda n, notify: settled_spheres(n, progress=notify))
        (make,) = problem_makers([60], lambda _: True).values()
        return {each.name: replace(each, steps=200) for each in make()}


def run(problem: SphereProblem, engine: str) -> Row:
    info = get_engine(engine).info()
    if not info.installed:
        pytest.skip(f"{info.name}: {info.not_installed_because}")
    rows = dem.run_problem(problem, {engine: get_engine(engine)}, repeats=1, time_limit=60.0, notify=lambda _: None)
    return {row["engine"]: row for row in rows}[engine]


@pytest.mark.parametrize("peer", PEERS, ids=[peer.id for peer in PEERS])
@pytest.mark.parametrize("kind", ["-short", "-undamped"])
def test_a_peer_with_the_same_physics_is_timed(peer: dem.Peer, kind: str, problems: dict[str, SphereProblem]) -> None:
    row = run(problems[f"settled-60{kind}"], peer.id)
    assert row["status"] == "pass", row["reason"]
    assert row["suite"] == "spheres"
    assert row["ratio"] > 0.0
    if peer.id == "lammps" and kind == "-undamped":
        assert row["check_value"] < 1e-9


@pytest.mark.parametrize(
    ("kind", "defect", "factor"), [("-undamped", "young", 1.001), ("-undamped", "mu", 0.9), ("-short", "beta", 0.5)]
)
def test_other_parameters_are_seen(
    kind: str, defect: str, factor: float, problems: dict[str, SphereProblem], monkeypatch: pytest.MonkeyPatch
) -> None:
    right = SphereProblem.law

    def wrong(self: SphereProblem, law: Any) -> dict[str, float]:
        told = right(self, law)
        return told | {defect: factor * told[defect]}

    monkeypatch.setattr(SphereProblem, "law", wrong)
    row = run(problems[f"settled-60{kind}"], "lammps")
    assert row["status"] == "fail"
    assert row["check_value"] > row["check_bound"]


def test_other_conventions_are_seen(problems: dict[str, SphereProblem], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spheres, "PEERS", (replace(LAMMPS, slip_at="middle"),))
    assert run(problems["settled-60-undamped"], "lammps")["status"] == "fail"


def test_problems_of_a_size_and_their_packing(packing_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert list(problem_makers([1000, 100_000], lambda name: not name.endswith("-short"))) == [
        "settled-1000",
        "settled-100000",
    ]
    first = spheres.packing(20)
    assert len(list(packing_folder.iterdir())) == 1
    with monkeypatch.context() as patch:
        patch.setattr(spheres, "settled_spheres", lambda *_, **__: pytest.fail("settled again"))
        assert spheres.packing(20) == first


def test_memory_and_counts_are_reported(problems: dict[str, SphereProblem]) -> None:
    (row,) = dem.run_problem(problems["settled-60"], {}, repeats=1, time_limit=60.0, notify=lambda _: None)
    assert row["status"] == "pass"
    assert 500.0 < row["bytes_per_disk"] < 5_000.0
    assert row["listed_pairs"] >= row["contacts"] > 100


def test_large_spheres_lie_on_the_small_ones(problems: dict[str, SphereProblem]) -> None:
    """Each touches one and overlaps none; LAMMPS, with a grid for each class of sizes, then takes the same steps."""
    plain = problems["settled-60-undamped"]
    small = plain.scene.spheres
    scene = spheres.with_large_ones(plain.scene, 1.6)
    bodies, n = scene.spheres, len(plain.scene.spheres)
    assert len(bodies) == n + 4
    assert bodies.mass[n] / bodies.radius[n] ** 3 == pytest.approx(small.mass[0] / small.radius[0] ** 3)
    gaps = np.linalg.norm(bodies.x[n:, None] - small.x, axis=2) - bodies.radius[n] - small.radius
    np.testing.assert_allclose(gaps.min(axis=1), 0.0, atol=1e-15)
    row = run(replace(plain, scene=scene, classes=(float(small.radius.max()),)), "lammps")
    assert (row["status"], row["disks"]) == ("pass", n + 4), row["reason"]
    assert row["check_value"] < 1e-9
    with pytest.raises(ValueError, match="ratio = 10 is not allowed"):
        spheres.with_large_ones(plain.scene, 10)


def test_which_sizes_have_mixed_problems() -> None:
    """Where a large sphere goes into the box."""
    names = [list(problem_makers([n], lambda name: name.startswith("mixed"))) for n in (100, 1000, 10_000)]
    assert names == [[], ["mixed-5-1000"], ["mixed-5-10000"]]
