"""What every run must satisfy, whatever the scene: each check takes a world and the engine that runs it.

Tolerances: a run of some dozen steps carries the round-off of its coordinates, 1e-15 of their size; an unlucky contact
(grazing, or steep against the distance flown) magnifies it by some 100, and the few that follow each other multiply. The
contact solver adds its own residual, 1e-12.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from random_worlds import KN, Run, World, in_units, moved, renumbered, rotation

from ninedisk.core.dem.session import DemSession
from ninedisk.core.history import History
from ninedisk.core.scene import Disks, Scene

SAME_MOTION = 1e-8
"""Of the size of positions and velocities: round-off after up to three magnifying contacts in a row."""


def scales(scene: Scene, history: History) -> tuple[float, float]:
    """Sizes of positions [m] and velocities [m/s] of a run."""
    return float(np.abs(history.x).max()) + float(scene.disks.radius.max()), float(np.abs(history.v).max()) + 1e-30


def frames(scene: Scene, pairs: list[tuple[int, int]], x: np.ndarray) -> np.ndarray:
    """Unit normals of pairs, from i to j, walls at rest, shape (s, c, 2)."""
    n = len(scene.disks)
    found = np.empty((len(x), len(pairs), 2))
    for k, (i, j) in enumerate(pairs):
        if j < n:
            d = x[:, j] - x[:, i]
            found[:, k] = d / np.hypot(d[:, 0], d[:, 1])[:, None]
        else:
            found[:, k] = -np.array(scene.walls[j - n].normal)
    return found


def on_disks(world: World, history: History, rows: slice, at: slice) -> tuple[np.ndarray, np.ndarray]:
    """Forces and torques on the disks that the reported contact forces make, shapes (s, n, 2) and (s, n).

    ``-fn n + fs t`` acts on i, its opposite on j; both receive the torque ``a fs``. Forces of samples ``rows``, normals of
    the configurations ``at``.
    """
    scene, n = world.scene, len(world.scene.disks)
    normal = frames(scene, world.pairs, history.x[at])
    tangent = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    contact = -history.fn[rows, :, None] * normal + history.fs[rows, :, None] * tangent
    force, torque = np.zeros((len(contact), n, 2)), np.zeros((len(contact), n))
    for k, (i, j) in enumerate(world.pairs):
        law = scene.law((i, j))
        shorter = 0.0 if world.rigid or law.lever_arm == "radius" else np.maximum(-history.gap[rows, k], 0.0) / 2.0
        force[:, i] += contact[:, k]
        torque[:, i] += (scene.disks.radius[i] - shorter) * history.fs[rows, k]
        if j < n:
            force[:, j] -= contact[:, k]
            torque[:, j] += (scene.disks.radius[j] - shorter) * history.fs[rows, k]
    return force + scene.disks.mass[:, None] * np.array(scene.gravity), torque


def action_equals_reaction(world: World, run: Run) -> None:
    """Every disk moves as the forces of its contacts report, each of which acts on two bodies, and spins as their torques say.

    DEM: second differences of the positions, which magnify round-off by m/dt^2. Contact dynamics: differences of the
    velocities; normals are those of the step's begin.
    """
    history, disks, dt = world.watched(run), world.scene.disks, world.numerics.dt
    length, speed = scales(world.scene, history)
    if world.rigid:
        force, torque = on_disks(world, history, slice(1, None), slice(None, -1))
        gained, turned = np.diff(history.v, axis=0) / dt, np.diff(history.omega, axis=0) / dt
        # Residual of the solver relative to its largest force, and the round-off of velocities over a step.
        allowed = 1e-9 * float(np.abs(history.fn[1:]).max(initial=0.0)) + 1e-12 * float(disks.mass.max()) * speed / dt
    else:
        force, torque = on_disks(world, history, slice(1, -1), slice(1, -1))
        gained = np.diff(np.diff(history.x, axis=0), axis=0) / dt**2
        turned = np.diff(np.diff(history.angle, axis=0), axis=0) / dt**2
        rounding = 8.0 * float(np.spacing(max(length, float(np.abs(history.angle).max()))))
        allowed = rounding * float(disks.mass.max()) / dt**2 + 1e-12 * KN * length
    np.testing.assert_allclose(disks.mass[:, None] * gained, force, rtol=0.0, atol=allowed)
    np.testing.assert_allclose(disks.inertia * turned, torque, rtol=0.0, atol=allowed * float(disks.radius.max()))


def momentum_is_conserved(world: World, run: Run) -> None:
    """Without walls and gravity; some hundred sums of terms of the total's size."""
    scene = world.scene.replace(walls=(), gravity=(0.0, 0.0))
    history = run(scene, world.numerics, [])
    momentum = np.einsum("i,tid->td", scene.disks.mass, history.v)
    size = float(np.abs(scene.disks.mass[:, None] * history.v).sum(axis=1).max())
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), rtol=0.0, atol=2e-12 * size)


def frame_does_not_matter(world: World, run: Run, *, angle: float, shift: tuple[float, float], mirror: bool) -> None:
    """Turned, shifted, mirrored: the same motion."""
    one = world.watched(run)
    two = run(moved(world.scene, angle=angle, shift=shift, mirror=mirror), world.numerics, world.pairs)
    turn, sign = rotation(angle, mirror), -1.0 if mirror else 1.0
    length, speed = scales(world.scene, one)
    size = (length + max(map(abs, shift))) / length  # larger coordinates carry more round-off
    np.testing.assert_allclose(two.x, one.x @ turn.T + shift, rtol=0.0, atol=SAME_MOTION * size * length)
    np.testing.assert_allclose(two.v, one.v @ turn.T, rtol=0.0, atol=SAME_MOTION * size * speed)
    spin = float(np.abs(one.omega).max()) + speed / float(world.scene.disks.radius.min())
    np.testing.assert_allclose(two.omega, sign * one.omega, rtol=0.0, atol=SAME_MOTION * size * spin)


def steady_motion_does_not_matter(world: World, run: Run, *, boost: tuple[float, float]) -> None:
    """Galilei: everything flies along, walls included."""
    one = world.watched(run)
    speed_of_all = scales(world.scene, one)[1]
    fast = tuple(speed_of_all * each for each in boost)
    two = run(moved(world.scene, boost=fast), world.numerics, world.pairs)
    way = one.t[:, None, None] * np.array(fast)
    length, speed = scales(world.scene, two)
    np.testing.assert_allclose(two.x - way, one.x, rtol=0.0, atol=SAME_MOTION * length)
    np.testing.assert_allclose(two.v - np.array(fast), one.v, rtol=0.0, atol=SAME_MOTION * speed)


def numbers_do_not_matter(world: World, run: Run, *, seed: int) -> None:
    """Other numbers of the disks: sums in another order, the same motion."""
    order = np.random.default_rng(seed).permutation(len(world.scene.disks))
    one = run(world.scene, world.numerics, [])
    two = run(renumbered(world.scene, order), world.numerics, [])
    length, speed = scales(world.scene, one)
    np.testing.assert_allclose(two.x, one.x[:, order], rtol=0.0, atol=SAME_MOTION * length)
    np.testing.assert_allclose(two.v, one.v[:, order], rtol=0.0, atol=SAME_MOTION * speed)


def units_do_not_matter(world: World, run: Run, *, length: int, mass: int, time: int) -> None:
    """Units scaled by powers of two: the same bits of the DEM, since no operation rounds otherwise.

    The contact solver chooses its steps by comparisons with a residual; it may stop an iteration earlier or later.
    """
    factors = {"length": 2.0**length, "mass": 2.0**mass, "time": 2.0**time}
    other = in_units(world, **factors)
    one, two = world.watched(run), run(other.scene, other.numerics, other.pairs)
    speed = factors["length"] / factors["time"]
    force = factors["mass"] * speed / factors["time"]
    of_length, of_speed = scales(world.scene, one)
    if not world.rigid:
        np.testing.assert_array_equal(two.x, one.x * factors["length"])
        np.testing.assert_array_equal(two.v, one.v * speed)
        np.testing.assert_array_equal(two.fn, one.fn * force)
        np.testing.assert_array_equal(two.fs, one.fs * force)
        return
    np.testing.assert_allclose(two.x / factors["length"], one.x, rtol=0.0, atol=SAME_MOTION * of_length)
    np.testing.assert_allclose(two.v / speed, one.v, rtol=0.0, atol=SAME_MOTION * of_speed)


def forces_lie_in_the_cone(world: World, run: Run) -> None:
    """Contacts push and never pull, and shear by no more than mu times that.

    The DEM clips, to the last bit of its own fn; a sample finds the distance anew, without the fused products of the step: kn times
    some units in the last place of a distance, and of the dashpot's part of fn.
    """
    history = world.watched(run)
    mu = np.array([world.scene.law(pair).mu for pair in world.pairs])
    share = 1e-9 if world.rigid else 1e-14
    stiffest = max(world.scene.law(pair).kn for pair in world.pairs)
    reach = 2.0 * float(world.scene.disks.radius.max())
    rounding = 0.0 if world.rigid else 4.0 * float(np.finfo(np.float64).eps) * stiffest * reach
    first = 1 if world.rigid else 0  # impulses have a step that they belong to: none at time 0
    fn, fs = history.fn[first:], history.fs[first:]
    residual = share * float(fn.max(initial=0.0)) + rounding
    assert np.isfinite(fn).all()
    assert (fn >= -residual).all()
    assert (np.abs(fs) <= mu * fn + residual).all()


def bodies_do_not_pass_each_other(world: World, run: Run) -> None:
    """Rigid contacts end a step with a gap of zero or more; the linearised gap is never above the true one."""
    history = world.watched(run)
    assert history.gap.min(initial=0.0) >= -SAME_MOTION * scales(world.scene, history)[0]


def restart_changes_no_bit(world: World, *, at: int, file: Path, load: object = DemSession.load) -> None:
    """A DEM run that is saved, loaded and continued equals one that was never interrupted."""
    whole = DemSession(world.scene, world.numerics, world.pairs)
    expected = whole.run()
    first = DemSession(world.scene, world.numerics, world.pairs)
    first.advance(at)
    first.save(file)
    found = load(file).run()  # type: ignore[operator]
    for name in ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_force"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


def restart_of_contact_dynamics(world: World, run: Run, *, at: int) -> None:
    """The state of rigid contacts is positions and velocities alone: a new scene from them goes on along the same motion."""
    expected = world.watched(run)
    disks = world.scene.disks
    state = {"x": expected.x[at], "v": expected.v[at], "omega": expected.omega[at]}
    rest = world.scene.replace(disks=Disks(**{**vars(disks), **state}))
    found = run(rest, world.numerics.replace(n_steps=world.numerics.n_steps - at), world.pairs)
    length, speed = scales(world.scene, expected)
    np.testing.assert_allclose(found.x, expected.x[at:], rtol=0.0, atol=SAME_MOTION * length)
    np.testing.assert_allclose(found.v, expected.v[at:], rtol=0.0, atol=SAME_MOTION * speed)
