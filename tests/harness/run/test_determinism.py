"""Determinism: planted defects are found by the repetition that is meant for them, and honest engines keep what they promise."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ninedisk.harness.api.errors import StoreError
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.cli.app import app
from ninedisk.harness.results.reader import read_determinism
from ninedisk.harness.results.schema import DETERMINISM_COLUMNS, DETERMINISM_KINDS, worse_than_promised
from ninedisk.harness.run.determinism import Edits, Trial, measure_kind

SPRING_DEM = Path(__file__).parents[3] / "docs" / "examples" / "spring_dem.py"

BEGIN, LOAD = "DemSession.__init__", "DemSession.load"
LAW = "self._law, self._laws, self._loads = np.array(law_row(scene.disk_disk)), law_arrays(scene), load_arrays(scene)"
KEEPS = [("dem.session", BEGIN, LAW, f"{LAW}\nDemSession._kept = self._law = getattr(DemSession, '_kept', self._law)")]
DISKS = "self._disks = disk_arrays(scene, self._step.lagged, numerics.energy_budget)"
FIRST = [("dem.session", BEGIN, DISKS, f"{DISKS}\nself._disks.v[0] *= 1.0 + 1e-9")]
SUMS = [("dem.session", BEGIN, "STRIPES if in_order else 1", "STRIPES // (8 * threads) if in_order else 1")]
OUTLINES = "session._outlines = restored(session._outlines, arrays)"
FORGETS = [("dem.session", LOAD, OUTLINES, f"{OUTLINES}\narrays['disks.omega'] = 0.0 * arrays['disks.omega']")]

ROW = 'self._row = restore(self.arrays(), arrays, int(arrays["row"][0]))'
STOPS = [("dem.space.session", "SphereSession.load", ROW, f"{ROW}\nsession._state.omega[:] = 0.0")]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("edits", "kind", "verdict"),
    [
        pytest.param(KEEPS, "scene", "different", id="the law of the run before"),
        pytest.param(FIRST, "bodies", "different", id="the disk told first is another"),
        pytest.param(SUMS, "threads", "round-off", id="sums in parts that depend on threads"),
        pytest.param(FORGETS, "restart", "different", id="a checkpoint without spins"),
        pytest.param(STOPS, "restart", "different", id="a checkpoint of spheres without spins"),
    ],
)
def test_a_planted_defect_is_found_by_its_repetition(edits: Edits, kind: str, verdict: str) -> None:
    scene = "spheres" if edits[0][0].startswith("dem.space.") else "pile"
    row = measure_kind(Trial(get_engine("dem"), scene, edits), kind)
    assert row["verdict"] == verdict, row
    assert worse_than_promised({"kind": kind, **row})
    assert (row["difference"] > row["allowance"]) == (verdict == "different")


@pytest.mark.slow
def test_our_engines_keep_their_promises() -> None:
    """Where the planted defects are found, and after a run that failed; bodies in another order stay far below the smallest of those."""
    dem, cd = (Trial(get_engine(name), "pile") for name in ("dem", "cd"))
    found = {kind: measure_kind(dem, kind) for kind in ("scene", "bodies", "threads", "restart")} | {
        "error": measure_kind(cd, "error")
    }
    assert {kind: row["verdict"] for kind, row in found.items()} == dict.fromkeys(found, "bitwise") | {
        "bodies": "round-off"
    }
    assert found["bodies"]["difference"] < 1e-12


def test_spheres_are_kept_beside_the_disks(tmp_path: Path) -> None:
    """The DEM goes on from a checkpoint of spheres; rows of both kinds of scene are in one store, and findings distinguish them."""
    trial = Trial(get_engine("dem"), "spheres")
    assert measure_kind(trial, "restart")["verdict"] == "bitwise"
    row = dict.fromkeys(DETERMINISM_COLUMNS) | {
        "engine": "dem",
        "engine_name": "DEM",
        "engine_version": "",
        "scene_why": "",
    }
    row |= {"kind": "twice", "verdict": "bitwise", "first_step": -1, "beyond_step": -1, "reason": ""}
    (tmp_path / "determinism").mkdir()
    for file, scene in (("dem.json", "pile"), ("dem.spheres.json", "spheres")):
        (tmp_path / "determinism" / file).write_text(json.dumps([row | {"scene": scene}]))
    assert [each["scene"] for each in read_determinism(tmp_path)] == ["pile", "spheres"]
    (tmp_path / "determinism" / "dem.spheres.json").write_text("[{}]")
    with pytest.raises(StoreError, match="--engine dem --spheres"):
        read_determinism(tmp_path)


def example(tmp_path: Path, edit: str) -> str:
    """Command of the example engine with a line added before it runs the scene."""
    text, begin = (
        SPRING_DEM.read_text(encoding="utf-8"),
        "    request, begin = json.load(sys.stdin), time.perf_counter()\n",
    )
    assert text.count(begin) == 1
    path = tmp_path / "engine.py"
    path.write_text(text.replace(begin, f"{begin}    {edit}\n"), encoding="utf-8")
    return f"{sys.executable} {path}"


def test_the_command_reports_names_and_stores_what_differs(tmp_path: Path) -> None:
    """An engine behind a command that starts at random, never twice alike; one run a process, no threads, no restart."""
    edit = "import random; request['scene']['disks']['v'][0][0] *= 1.0 + 1e-7 * random.SystemRandom().random()"
    command = example(tmp_path, edit)
    store, rows = tmp_path / "store", tmp_path / "rows.json"
    done = CliRunner().invoke(app, ["determinism", "--engine-cmd", command, "--store", str(store), "--json", str(rows)])
    assert done.exit_code == 1, done.output
    found = {row["kind"]: row for row in read_determinism(store)}
    assert list(found) == list(DETERMINISM_KINDS)
    assert all(list(row) == list(DETERMINISM_COLUMNS) for row in found.values())
    assert {row["kind"]: row["verdict"] for row in json.loads(rows.read_text())} == {
        kind: "not applicable" if kind in ("twice", "error", "scene", "threads", "restart") else "different"
        for kind in found
    }
    assert "✗ different" in done.output
    assert "in another process" in done.output
    (store / "determinism" / "spring-dem.json").write_text('[{"engine": "spring-dem"}]')
    with pytest.raises(StoreError, match="measure again"):
        read_determinism(store)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--engine", "demm"], "dem"),
        (["--engine", "pymunk", "--spheres"], "spheres"),
        (["--store", "/dev/null/x"], "cannot"),
        (["--json", "/no/such/folder/x"], "folder"),
    ],
)
def test_bad_input_is_named(tmp_path: Path, arguments: list[str], says: str) -> None:
    given = arguments if "--store" in arguments else [*arguments, "--store", str(tmp_path)]
    done = CliRunner().invoke(app, ["determinism", *given])
    assert done.exit_code == 2
    assert says in done.output
    assert "Traceback" not in done.output
