"""What all adapters of engines with contact springs owe a scene: the same motion as its exact steps and as the in-house DEM's.

Runs of the real engines are held against exact time-discrete solutions, closed forms and the in-house DEM, which shares no code
with them; they are skipped only where an engine is absent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ninedisk_tests_comparison import ROUND_OFF, assert_same, variant, worst

from ninedisk.core.errors import UnstableTimeStepError
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.engine import EngineError, EngineTimeoutError
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.cases.nine_disk.scene import LOAD_CASES, MASS
from ninedisk.references.exact_steps.compression import smooth_row


@dataclass(frozen=True, kw_only=True)
class Expected:
    """What one engine is expected to give.

    Attributes
    ----------
    licence : str
    settings : mapping
        What must be on record of a run of the nine disks beside the version and the contact step.
    long : int
        Steps that no engine does in the time limit.
    block : float or None
        Relative error of a preloaded block's forces; None: it has no preload.
    collision : float
        Error of positions and velocities of a collision.
    behind : str
        Words where a disk is driven through a wall; "" where that is no error of the engine's.
    rough, needs_a_disk : bool
        Whether it has friction; whether a scene without disks is refused.
    """

    licence: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    long: int = 10_000_000
    block: float | None = None
    collision: float = 1e-12
    behind: str = ""
    rough: bool = True
    needs_a_disk: bool = True


EXPECTED = {
    "yade": Expected(
        licence="GPL-2.0-or-later",
        settings={"contact_law": "Law2_ScGeom_FrictPhys_CundallStrack"},
        block=1e-9,  # the round-off of the position: ulp(0.5 m) kn = 1e-9 N of 74 N
        needs_a_disk=False,
    ),
    "lammps": Expected(
        licence="GPL-2.0-only",
        settings={"pair_style": "granular"},
        block=1e-9,
        behind="disk \\d is .* m behind wall '\\w+', where LAMMPS no longer pushes it back",
    ),
    "liggghts": Expected(
        licence="GPL-2.0-or-later",
        settings={"contact model": "model hooke/stiffness tangential history"},
        long=20_000_000,
        # The plane's triangle has corners 33 m away (ulp 7.1e-15 m): four such units times kn are 4e-9 of fn.
        block=4e-9,
        behind=r"disk \d is .* m behind wall '\w+'|ended",
    ),
    "kratos": Expected(
        licence="BSD-4-Clause",
        settings={"contact law": "DEM_D_Linear_Custom_Constants"},
        long=200_000,
        # Positions of 3 m are kept as displacements: some thousand steps, each rounded by 4e-16 m, times omega/dt.
        collision=1e-11,
    ),
    "esys-particle": Expected(licence="Apache-2.0", settings={"grid spacing [m]": 125.0}, long=200_000, rough=False),
}

YADES = {"lever_arm": "overlap", "wall_velocity_at": "mid-overlap", "slip_at": "end"}
"""YADE's conventions of a contact."""


@pytest.fixture
def engine(request: pytest.FixtureRequest) -> Any:
    """The engine of the parametrisation, where it is installed; each test has its own, whose attributes it may set."""
    found = type(get_engine(request.param))()
    if not found.info().installed:
        pytest.skip(f"{found.info().name}: {found.info().not_installed_because}")
    return found


def engines(wanted: Callable[[Expected], Any] = lambda _: True) -> Any:
    return pytest.mark.parametrize("engine", [name for name, each in EXPECTED.items() if wanted(each)], indirect=True)


@engines()
@pytest.mark.parametrize(
    ("load_case", "xi", "form"), [("a1", 3.0, "central"), ("a2", 3.0, "lagged"), ("b1", 0.0, "central")]
)  # fmt: skip
def test_smooth_compression_is_the_exact_recurrence(engine: Any, load_case: str, xi: float, form: str) -> None:
    setup = variant("nine-disk/compression", load_case=load_case, xi=xi, damping_form=form, settle_cycles=0)
    history: History = engine.run(setup.scene, setup.numerics, setup.watch).history
    load = LOAD_CASES[load_case]
    middle, wall = smooth_row(
        kn=load.kn,
        mass=MASS,
        xi=xi,
        dt=load.dt,
        n_load=load.load_cycles,
        v_wall=load.v_wall,
        n_steps=200,
        form=form,  # type: ignore[arg-type]
    )
    for column, expected in enumerate((middle, middle, wall, wall)):
        assert worst(history.fn[:, column], expected) <= ROUND_OFF
    assert history.fn[1, 2] == pytest.approx(load.kn * load.v_wall * load.dt, rel=1e-9)  # walls have moved in step 1
    core = simulate(setup.scene, setup.numerics, setup.watch)
    for name in ("x", "v", "gap", "wall_force", "wall_point", "wall_angle"):
        assert worst(getattr(history, name), getattr(core, name)) <= ROUND_OFF, name
    for name in ("kinetic", "elastic"):
        assert worst(history.energy[name], core.energy[name]) <= 4.0 * ROUND_OFF, name


@engines(lambda each: each.rough)
@pytest.mark.parametrize(("load_case", "form"), [("a1", "central"), ("b2", "lagged")])
def test_rough_compression_is_the_in_house_dem(engine: Any, load_case: str, form: str) -> None:
    """Corner disks rub on two walls at once: their shear forces are distinguished."""
    setup = variant("nine-disk/compression", load_case=load_case, wall_mu="mu", damping_form=form, settle_cycles=0)
    history = engine.run(setup.scene, setup.numerics, setup.watch).history
    core = simulate(setup.scene, setup.numerics, setup.watch)
    assert_same(history, core, ROUND_OFF, without=("angle", "omega"))
    assert np.abs(core.fs).max() > 1e6  # the walls do rub
    # Forces of 1e7 N are rounded by 1e-9 N; times R/I and 200 steps of 0.015 s that turns a disk of 1e10 kg m^2 by 1e-15.
    assert np.abs(history.omega).max() <= 1e-12


@engines(lambda each: each.block)
@pytest.mark.parametrize(("mu", "tilted"), [(0.36, True), (0.4, False)])
def test_preloaded_block_is_the_closed_form(engine: Any, mu: float, tilted: bool) -> None:
    mass, g, angle, kn = 7.854, 10.0, np.radians(20.0), 1e7
    down, up = np.array([np.cos(angle), -np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    gravity = (0.0, -g)
    if not tilted:
        gravity = (g * np.sin(angle), -g * np.cos(angle))
        down, up = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    weight, pull = mass * g * np.cos(angle), mass * g * np.sin(angle)
    held = min(mu * weight, pull)
    plane = Wall(name="plane", point=(0, 0), normal=tuple(up), law=ContactLaw(kn=kn, ks=kn, mu=mu))
    disks = Disks(x=[up * (0.5 - weight / kn)], radius=0.5, mass=mass, rotating=False)  # type: ignore[arg-type]
    shear = {(0, 1): -held}
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=kn), walls=(plane,), gravity=gravity, initial_shear=shear)
    history = engine.run(scene, Numerics(dt=0.01, n_steps=100), [(0, 1)]).history
    slope, rtol = (pull - held) / mass, EXPECTED[engine.id].block
    # Friction of the forces' error in 30 000 steps of 3e-5 s, at random, changes the velocity of 8 kg by 1e-10 m/s.
    assert np.abs(history.x[:, 0] @ down - 0.5 * slope * history.t**2).max() <= 1e-10
    assert np.abs(history.v[:, 0] @ down - slope * history.t).max() <= 1e-10
    assert worst(history.fn[:, 0], np.full(101, weight)) <= rtol
    assert worst(history.fs[:, 0], np.full(101, -held)) <= rtol
    assert np.abs(history.angle).max() == 0.0


@engines()
def test_collision_is_the_in_house_dem(engine: Any) -> None:
    """Dashpots, where it has them, see v_{n-1/2} everywhere: the lagged form is theirs."""
    setup = variant("binary-collision", restitution=0.5 if EXPECTED[engine.id].rough else 1.0)
    numerics = setup.numerics.replace(damping_form="lagged", sample_from=0)
    history = engine.run(setup.scene, numerics, setup.watch).history
    core = simulate(setup.scene, numerics, setup.watch)
    for name in ("x", "v"):
        assert np.abs(getattr(history, name) - getattr(core, name)).max() <= EXPECTED[engine.id].collision, name


@pytest.mark.parametrize(("engine", "conventions"), [("lammps", {}), ("yade", YADES)], indirect=["engine"])
def test_slip_to_roll_with_spin_beyond_a_turn(engine: Any, conventions: Any) -> None:
    law = ContactLaw(kn=1e6, ks=1e6, mu=0.3, **conventions)
    plane = Wall(name="plane", point=(0, 0), normal=(0, 1), law=law)
    disks = Disks(x=[(0.0, 1.0 - 1e-5)], radius=1.0, mass=1.0, v=[(60.0, 0.0)], omega=-90.0)  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=replace(law, mu=0.0), walls=(plane,), gravity=(0.0, -10.0))
    numerics = Numerics(dt=0.01, n_steps=500, sample_every=15)
    history, core = engine.run(scene, numerics, [(0, 1)]).history, simulate(scene, numerics, [(0, 1)])
    assert history.step.tolist() == [*range(0, 500, 15), 500]
    assert abs(core.angle[-1, 0]) > 20 * np.pi
    assert_same(history, core, 1e-8)  # forces carry the round-off of a position that has gone 300 m


@engines()
def test_central_damping_starts_from_the_velocity_of_time_0(engine: Any) -> None:
    """A disk in free flight, far from small xi dt: any other start shows in the first step."""
    # LIGGGHTS' drag leaves spins alone, ESyS-Particle has none.
    names = ("x", "v") if engine.id in {"liggghts", "esys-particle"} else ("x", "v", "angle", "omega")
    spin = 3.0 if "omega" in names else 0.0
    disks = Disks(x=[(0.0, 0.0)], radius=1.0, mass=2.0, v=[(3.0, -1.0)], omega=spin)  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1.0), gravity=(0.5, -9.0), xi=5.0)
    numerics = Numerics(dt=0.05, n_steps=40, contact_dt=0.05)
    history, core = engine.run(scene, numerics, []).history, simulate(scene, numerics, [])
    for name in names:
        assert worst(getattr(history, name), getattr(core, name)) <= 1e-14, name


@engines()
def test_two_runs_at_once_do_not_disturb_each_other(
    engine: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = variant("nine-disk/compression", settle_cycles=0)
    engine.extra(setup.scene, setup.numerics, tmp_path)  # the core's kernels find their cache in the true home
    (tmp_path / "wall_path.npy").unlink(missing_ok=True)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    with ThreadPoolExecutor(2) as pool:
        one, two = pool.map(lambda _: engine.run(setup.scene, setup.numerics, setup.watch).history, range(2))
    np.testing.assert_array_equal(one.fn, two.fn)
    assert one.fn.max() > 0.0
    assert list(tmp_path.iterdir()) == []  # neither a temporary file nor a home


@engines()
def test_run_stopped_halfway_is_a_timeout(engine: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    engine.time_limit, steps = 1.5, EXPECTED[engine.id].long
    setup = variant("nine-disk/compression")
    # No path of the walls to prepare: the time goes into the engine.
    with pytest.raises(EngineTimeoutError, match=r"was stopped at its time limit of 1.5 s"):
        engine.run(setup.scene.replace(walls=(), xi=0.0), setup.numerics.replace(n_steps=steps, sample_every=steps), [])
    assert list(tmp_path.iterdir()) == []


@engines()
def test_step_beyond_the_critical_one_is_the_users_mistake(engine: Any) -> None:
    scene = variant("nine-disk/compression").scene
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        engine.run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@engines(lambda each: each.rough)
def test_state_that_explodes_is_an_error(engine: Any) -> None:
    """Positions overflow; the adapter must not hand that on."""
    scene = variant("nine-disk/compression").scene.replace(gravity=(1e304, 0.0), walls=())
    numerics = Numerics(dt=1.0, n_steps=2000, contact_dt=1.0, allow_unstable=True)
    with pytest.raises(EngineError, match=r"stopped being finite|gave up|ended|no finite length"):
        engine.run(scene, numerics, [])


@engines(lambda each: each.behind)
def test_disk_driven_through_a_wall_is_an_error(engine: Any) -> None:
    """These push back no disk whose centre has passed a wall, or push it on; the scene's wall does not."""
    scene = variant("nine-disk/compression").scene
    numerics = Numerics(dt=1.0, n_steps=2000, contact_dt=1.0, allow_unstable=True)
    with pytest.raises(EngineError, match=EXPECTED[engine.id].behind):
        engine.run(scene, numerics, [])


@engines(lambda each: each.needs_a_disk)
def test_scene_without_disks_is_an_error(engine: Any) -> None:
    scene = Scene(disks=Disks(x=np.empty((0, 2)), radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=1.0))  # type: ignore[arg-type]
    with pytest.raises(EngineError, match=f"there is no disk: {engine.info().name.removesuffix(' DEM')} needs"):
        engine.run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@engines()
@pytest.mark.usefixtures("cold_starts")
def test_info_and_settings_of_the_real_one(engine: Any) -> None:
    info = engine.info()
    assert info.licence == EXPECTED[engine.id].licence
    setup = variant("nine-disk/compression")
    settings = engine.run(setup.scene, Numerics(dt=0.01, n_steps=1), setup.watch).settings
    assert settings["engine_version"] == info.version
    assert EXPECTED[engine.id].settings.items() <= settings.items()
    assert settings["contact_dt"] * settings["contact_steps_per_dt"] == pytest.approx(0.01)
