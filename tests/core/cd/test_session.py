"""Contact dynamics over scenes: which contacts are found, moving walls, energies, errors, replay."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.session import CdSession
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError, NonFiniteStateError, SolverNotConvergedError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate

RIGID = ContactLaw(kn=1e8, ks=1e8, mu=0.3, restitution=0.0, regularised=True)
SOFT = ContactLaw(kn=1e6, ks=1e6, mu=0.3)


def box_walls(size: float, law: ContactLaw) -> tuple[Wall, ...]:
    return (
        Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(size, 0.0), normal=(-1.0, 0.0), law=law),
        Wall(name="bottom", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),
        Wall(name="top", point=(0.0, size), normal=(0.0, -1.0), law=law),
    )


def gas(side: int, speed: float, law: ContactLaw, seed: int = 3) -> Scene:
    rng = np.random.default_rng(seed)
    x = np.array([(1.3 * i + 1.0, 1.3 * j + 1.0) for i in range(side) for j in range(side)])
    disks = Disks(
        x=x + rng.uniform(-0.1, 0.1, x.shape),
        v=rng.normal(0.0, speed, x.shape),
        radius=rng.uniform(0.35, 0.5, len(x)),
        mass=rng.uniform(1.0, 5.0, len(x)),
    )
    return Scene(disks=disks, disk_disk=law, walls=box_walls(1.3 * side + 1.0, law))


def deepest(scene: Scene, x: np.ndarray) -> float:
    """Largest overlap [m], by brute force over all pairs and walls."""
    radius = scene.disks.radius
    apart = np.hypot(*(x[:, None, :] - x[None, :, :]).transpose(2, 0, 1)) - radius[:, None] - radius[None, :]
    np.fill_diagonal(apart, np.inf)
    gaps = [float(apart.min())]
    gaps += [float(((x - np.array(wall.point)) @ np.array(wall.normal) - radius).min()) for wall in scene.walls]
    return -min(gaps)


@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize("speed", [1.0, 100.0])
def test_no_contact_is_missed(speed: float, sliding: Any) -> None:
    """A gas whose disks fly up to many diameters a step never overlaps: every pair that can close takes part.

    The solver's tolerance, 1e-12 of the largest velocity, leaves as much of the displacement in a step, from several contacts at once.
    """
    scene = gas(6, speed, RIGID)
    history = simulate(scene, Numerics(dt=0.05, n_steps=20, sliding=sliding), method="cd")
    assert max(deepest(scene, x) for x in history.x) <= 1e-12 * (1.0 + 3.0 * speed * 0.05)


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_momentum_of_a_free_cluster(theta: float) -> None:
    """Without walls the momentum stays, to round-off of a sum of 36 terms, and energy never grows."""
    scene = gas(6, 1.0, RIGID.__class__(kn=1e8, ks=1e8, mu=0.5, regularised=True))
    scene = Scene(disks=scene.disks, disk_disk=scene.disk_disk)
    history = simulate(scene, Numerics(dt=0.02, n_steps=50, theta=theta, sliding="coulomb"), method="cd")
    momentum = (scene.disks.mass[:, None] * history.v).sum(axis=1)
    assert np.abs(momentum - momentum[0]).max() <= 1e-13 * np.abs(scene.disks.mass[:, None] * history.v[0]).sum()
    assert (np.diff(history.energy["kinetic"]) <= 1e-12 * history.energy["kinetic"][0]).all()


@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
def test_global_damping_alone(theta: float) -> None:
    """M v1 = M v0 - dt xi M (theta v1 + (1 - theta) v0), spins included."""
    disks = Disks(x=[[0.0, 0.0]], v=[[1.0, -2.0]], omega=[3.0], radius=1.0, mass=2.0)
    scene = Scene(disks=disks, disk_disk=SOFT, xi=0.7)
    history = simulate(scene, Numerics(dt=0.1, n_steps=10, theta=theta), method="cd")
    factor = ((1.0 - (1.0 - theta) * 0.07) / (1.0 + theta * 0.07)) ** np.arange(11)
    assert np.abs(history.v[:, 0, 0] - factor).max() <= 1e-15 * 10
    assert np.abs(history.omega[:, 0] - 3.0 * factor).max() <= 1e-15 * 30


def test_moving_wall_hits_and_carries() -> None:
    """Plastic: after the wall has caught it, a disk moves with the wall; harmonic motion, exact at every step."""
    motion = WallSegment(amplitude=(0.0, 0.4), frequency=1.3)
    wall = Wall(name="piston", point=(0.0, 0.0), normal=(0.0, 1.0), law=RIGID, motion=(motion,))
    disks = Disks(x=[[0.0, 1.02]], radius=1.0, mass=2.0)
    scene = Scene(disks=disks, disk_disk=RIGID, walls=(wall,), gravity=(0.0, -10.0))
    history = simulate(scene, Numerics(dt=0.01, n_steps=200), [(0, 1)], method="cd")
    expected = 1.0 + 0.4 * np.sin(1.3 * history.t)
    touching = history.t > 0.1
    assert np.abs(history.x[touching, 0, 1] - expected[touching]).max() <= 1e-13
    assert np.abs(history.gap[touching, 0]).max() <= 1e-13
    assert history.wall_force[-1, 0, 1] == pytest.approx(-history.fn[-1, 0], rel=1e-12)


def test_conveyor_drags_and_rotating_wall_pushes() -> None:
    """A wall that slides along itself drives a disk by friction; one that turns lifts it along its own surface."""
    belt = Wall(name="belt", point=(0.0, 0.0), normal=(0.0, 1.0), law=RIGID, motion=(WallSegment(velocity=(0.5, 0.0)),))
    disks = Disks(x=[[0.0, 1.0]], radius=1.0, mass=2.0, rotating=False)
    scene = Scene(disks=disks, disk_disk=RIGID, walls=(belt,), gravity=(0.0, -10.0))
    history = simulate(scene, Numerics(dt=0.01, n_steps=60, sliding="coulomb"), method="cd")
    # mu g = 3 m/s^2 until the belt's speed is reached at 1/6 s.
    assert history.v[10, 0, 0] == pytest.approx(0.3, rel=1e-12)
    assert history.v[-1, 0, 0] == pytest.approx(0.5, rel=1e-12)
    work = history.energy["wall_work"][-1]
    assert work == pytest.approx(0.5 * (3.0 * 2.0) * (1.0 / 6.0), rel=0.07)
    turning = Wall(
        name="flap", point=(0.0, 0.0), normal=(0.0, 1.0), law=RIGID, motion=(WallSegment(angular_velocity=0.2),)
    )
    scene = Scene(
        disks=Disks(x=[[3.0, 1.0]], radius=1.0, mass=2.0), disk_disk=RIGID, walls=(turning,), gravity=(0.0, -10.0)
    )
    history = simulate(scene, Numerics(dt=0.01, n_steps=50, sliding="coulomb"), [(0, 1)], method="cd")
    assert np.abs(history.gap[1:, 0]).max() <= 1e-13
    normal = np.column_stack([np.cos(history.wall_angle[:, 0]), np.sin(history.wall_angle[:, 0])])
    assert normal[-1] == pytest.approx([-math.sin(0.1), math.cos(0.1)], abs=1e-14)


def test_initial_shear_and_overlap_of_elastic_contacts() -> None:
    """An oscillator on its shear spring: the preload is there at time 0 and drives the disk."""
    wall = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=SOFT)
    disks = Disks(x=[[0.0, 0.999]], radius=1.0, mass=100.0, rotating=False)
    scene = Scene(disks=disks, disk_disk=SOFT, walls=(wall,), gravity=(0.0, -10.0), initial_shear={(0, 1): 200.0})
    history = simulate(scene, Numerics(dt=1e-5, n_steps=4000), [(0, 1)], method="cd")
    assert history.fn[0, 0] == pytest.approx(1000.0, rel=1e-12)
    assert history.fs[0, 0] == 200.0
    expected = 200.0 * np.cos(math.sqrt(1e6 / 100.0) * history.t)
    assert np.abs(history.fs[:, 0] - expected).max() <= 200.0 * 0.5 * 100.0**2 * 1e-5 * history.t[-1] * 1.1


@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize("preload", [-2000.0, 400.0])
def test_a_preload_that_friction_cannot_hold_is_cut_off_as_in_the_dem(preload: float, sliding: Any) -> None:
    wall = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=SOFT)
    disks = Disks(x=[[0.0, 0.999]], radius=1.0, mass=100.0)
    scene = Scene(disks=disks, disk_disk=SOFT, walls=(wall,), gravity=(0.0, -10.0), initial_shear={(0, 1): preload})
    numerics = Numerics(dt=1e-4, n_steps=200, sliding=sliding)
    dem, cd = (simulate(scene, numerics, [(0, 1)], method=method) for method in ("dem", "cd"))
    held = math.copysign(300.0, preload)
    for history in (dem, cd):
        assert history.fn[0, 0] == pytest.approx(1000.0, rel=1e-12)
        assert history.fs[0, 0] == pytest.approx(held, rel=1e-12)
    # A spring that is cut off to its limit turns back at once: the disk never slides, and by neither rule it is lifted.
    assert np.abs(cd.x[:, 0, 1] - 0.999).max() < 1e-12
    # First order at theta = 1: in 20 ms the amplitude falls by omega^2 dt t/2 = 3 %, omega^2 = 3 ks/m, and the phase follows.
    assert np.abs(cd.x[:, 0, 0] - dem.x[:, 0, 0]).max() < 0.1 * np.abs(dem.x[:, 0, 0]).max()


@pytest.mark.parametrize("method", ["dem", "cd"])
def test_coincident_centres_are_named_where_they_happen(method: Any) -> None:
    three = Disks(x=[[1.0, 2.0], [1.0, 2.0], [9.0, 9.0]], radius=1.0, mass=1.0)
    with pytest.raises(
        InvalidSceneError, match=r"disks 0 and 1 coincide at \(1, 2\): their contact has no normal; move one"
    ):
        simulate(Scene(disks=three, disk_disk=ContactLaw(kn=1e5)), Numerics(dt=1e-3, n_steps=2), method=method)
    # Springs that are next to none let the disks pass through each other; after four steps the centres are one.
    meet = Disks(x=[[-1.0, 0.0], [1.0, 0.0], [9.0, 9.0]], v=[[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]], radius=0.5, mass=1.0)
    scene = Scene(disks=meet, disk_disk=ContactLaw(kn=1e-150))
    for options in ({}, {"solver": "interior-point"}) if method == "cd" else ({},):
        numerics = Numerics(dt=0.25, n_steps=8, contact_dt=0.25, **options)  # type: ignore[arg-type]
        with pytest.raises(NonFiniteStateError, match=r"disks 0 and 1 .*no normal") as caught:
            simulate(scene, numerics, method=method)
        assert "step 5 (t = 1.25 s)" in str(caught.value)
        history = simulate(scene, numerics.replace(n_steps=4), [(0, 1)], method=method)
        assert history.gap[-1, 0] == -1.0
        assert np.isfinite(history.fn[1:]).all()


def test_what_is_refused() -> None:
    overlap = Scene(
        disks=Disks(x=[[0.0, 0.99]], radius=1.0, mass=1.0), disk_disk=RIGID, walls=box_walls(10.0, RIGID)[2:3]
    )
    with pytest.raises(InvalidSceneError, match=r"disk 0 and wall 'bottom' overlap by 0.01 m"):
        CdSession(overlap, Numerics(dt=0.1, n_steps=1))
    two = Disks(x=[[0.0, 0.0], [3.0, 0.0]], radius=1.0, mass=1.0)
    no_e = ContactLaw(kn=1e6, regularised=True)
    with pytest.raises(InvalidSceneError, match="needs a restitution"):
        CdSession(Scene(disks=two, disk_disk=no_e), Numerics(dt=0.1, n_steps=1, impact="newton"))
    with pytest.raises(InvalidSceneError, match="initial shear"):
        CdSession(Scene(disks=two, disk_disk=SOFT, initial_shear={(0, 1): 5.0}), Numerics(dt=0.1, n_steps=1))
    scene = Scene(disks=two, disk_disk=SOFT)
    for numerics, word in (
        ({"solver": "newton"}, "solver = 'newton' is unknown"),
        (
            {"options": {"cd.tolerence": 1.0}},
            r"'cd.tolerence' is unknown: use one of cd\.tolerance, cd\.max_iterations",
        ),
        ({"options": {"cd.tolerance": 0.0}}, r"cd\.tolerance = 0\.0 .* a number in \(0, 1\)"),
        ({"options": {"cd.tolerance": "tight"}}, "must be a number"),
        ({"options": {"cd.tolerance": np.nan}}, r"cd\.tolerance = nan .* a number in \(0, 1\)"),
        (
            {"options": {"cd.max_iterations": np.nan}},
            r"cd\.max_iterations = nan .* a whole number in \[1, 1e\+15\], or none",
        ),
        (
            {"options": {"cd.max_iterations": 1.5}},
            r"cd\.max_iterations = 1\.5 .* a whole number in \[1, 1e\+15\], or none",
        ),
        (
            {"options": {"cd.max_iterations": True}},
            r"cd\.max_iterations = True .* a whole number in \[1, 1e\+15\], or none",
        ),
        ({"options": {"cd.time_limit": 0}}, r"cd\.time_limit = 0 .* a number > 0"),
        ({"options": {"cd.time_limit": np.inf}}, r"cd\.time_limit = inf .* a number > 0"),
        ({"options": {"cd.relaxation": 2.0}}, r"cd\.relaxation = 2\.0 .* a number in \(0, 2\)"),
        ({"options": {"cd.save_failed": 7}}, r"cd\.save_failed = 7 .* a text"),
        ({"options": {"cd.contacts": "soft"}}, "cd.contacts = 'soft'"),
        ({"options": {"cd.threads": 0}}, r"cd\.threads = 0 .* whole number in \[1, 64\]"),
    ):
        with pytest.raises(InvalidNumericsError, match=word):
            CdSession(scene, Numerics(dt=0.1, n_steps=1, **numerics))
    with pytest.raises(InvalidNumericsError, match=r"theta = 0.4"):
        Numerics(dt=0.1, n_steps=1, theta=0.4)


TAKEN: dict[str, tuple[object, ...]] = {
    "tolerance": (0.5,),
    "max_iterations": (1, 2, 65, None),
    "time_limit": (0.5, 1, 1.5, 2, 65, 1e308),
    "accept": (0.5, None),
    "relaxation": (0.5, 1, 1.5),
    "threads": (1, 2),
}


@pytest.mark.parametrize("name", [field.name for field in fields(SolverOptions)])
def test_solver_options_have_the_ranges_of_a_run_s_options_and_their_words(name: str) -> None:
    scene = gas(2, 3.0, RIGID)
    for value in (np.nan, np.inf, -1.0, 0, 0.5, 1, 1.5, 2, 65, 1e308, "many", "qdldl", None):
        numerics = Numerics(dt=0.1, n_steps=1, options={f"cd.{name}": value})
        if value in TAKEN[name]:
            assert getattr(SolverOptions(**{name: value}), name) == value  # type: ignore[arg-type]
            assert getattr(CdSession(scene, numerics).settings.solver_options, name) == value
            continue
        with pytest.raises(InvalidNumericsError, match=f"^{name} = .*(must be|use one of)") as alone:
            SolverOptions(**{name: value})  # type: ignore[arg-type]
        with pytest.raises(InvalidNumericsError) as in_a_run:
            CdSession(scene, numerics)
        assert str(in_a_run.value) == f"cd.{alone.value}"


def test_options_act_as_numbers_of_any_kind() -> None:
    options = {"cd.max_iterations": 1e3, "cd.threads": np.int64(2), "cd.tolerance": np.float32(0.5)}
    reported = CdSession(gas(2, 3.0, RIGID), Numerics(dt=0.1, n_steps=1, options=options)).settings
    assert (
        reported.solver_options.max_iterations,
        reported.solver_options.threads,
        reported.solver_options.tolerance,
    ) == (
        1000,
        2,
        0.5,
    )
    assert reported.options["cd.contacts"] == "auto"


def test_a_file_that_cannot_be_written_does_not_hide_the_failure(tmp_path: Path) -> None:
    scene = gas(5, 3.0, RIGID).replace(gravity=(0.0, -10.0))
    options = {"cd.max_iterations": 1, "cd.save_failed": str(tmp_path / "no" / "failed.npz")}
    numerics = Numerics(dt=0.2, n_steps=20, solver="gauss-seidel", options=options)
    with pytest.raises(SolverNotConvergedError, match=r"could not be kept: .*failed\.npz.*No such file"):
        simulate(scene, numerics, method="cd")


def test_a_failing_step_can_be_replayed(tmp_path: Path) -> None:
    scene = gas(5, 3.0, RIGID).replace(gravity=(0.0, -10.0))
    file = tmp_path / "failed.npz"
    options = {"cd.max_iterations": 1, "cd.save_failed": str(file)}
    numerics = Numerics(dt=0.2, n_steps=20, solver="gauss-seidel", options=options)
    with pytest.raises(SolverNotConvergedError, match=r"step \d+ .*gauss-seidel stopped .*failed\.npz"):
        simulate(scene, numerics, method="cd")
    problem = ContactProblem.load(file)
    assert problem.n_contacts > 0
    assert problem.notes["step"].isdigit()
    assert '"disks"' in problem.notes["scene"]


def test_same_input_same_bits() -> None:
    scene = gas(5, 3.0, RIGID).replace(gravity=(0.0, -10.0))
    runs = [simulate(scene, Numerics(dt=0.05, n_steps=20), method="cd") for _ in range(2)]
    assert np.array_equal(runs[0].x, runs[1].x)
    assert np.array_equal(runs[0].v, runs[1].v)
