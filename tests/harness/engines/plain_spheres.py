"""A plain numpy DEM of spheres with engines' own conventions, and a box of spheres that touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.spheres.law import SphereLaw, damping_ratio
from ninedisk.core.spheres.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.harness.engines.spring import plane_path

FLOOR = PlaneSegment(velocity=(0.02, 0.0, 0.0), angular_velocity=(0.0, 0.0, 0.5), pivot=(0.0, 0.01, 0.0))
"""The floor slides and turns about its normal."""


def pile(law: SphereLaw, *, moving: bool = True, edge: int = 2, layers: int = 2, **bodies: object) -> SphereScene:
    """Spheres of three sizes on a disturbed grid, thrown together between a moving floor and two walls, one of them oblique."""
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(*[np.arange(edge)] * 2, np.arange(layers), indexing="ij"), axis=-1).reshape(-1, 3)
    radius = np.resize([0.01, 0.011, 0.0095], len(grid))
    x = (grid + 0.5) * 0.02 + rng.uniform(-2e-4, 2e-4, grid.shape)
    spheres = Spheres(
        x=x,
        radius=radius,
        mass=2500.0 * 4.0 / 3.0 * np.pi * radius**3,
        v=rng.uniform(-0.2, 0.2, grid.shape),
        omega=rng.uniform(-20.0, 20.0, grid.shape),
        **bodies,  # type: ignore[arg-type]
    )
    floor = replace(law, mu=0.2)
    walls = (
        PlaneWall(name="floor", point=(0, 0, 0), normal=(0, 0, 1), law=floor, motion=(FLOOR,) if moving else ()),
        PlaneWall(name="left", point=(0, 0, 0), normal=(1, 0, 0), law=law),
        PlaneWall(name="oblique", point=(0.0, 0.0, 0.0), normal=(0.1, 1.0, 0.2), law=law),
    )
    return SphereScene(spheres=spheres, sphere_sphere=law, walls=walls, gravity=(-1.0, -2.0, -9.0))


LINEAR = SphereLaw(kn=2e4, ks=1.5e4, mu=0.4, beta=damping_ratio(0.8))
HERTZ = SphereLaw(e_star=2e7, g_star=4.2e6, mu=0.4, beta=damping_ratio(0.8))
RUN = Numerics(dt=2e-5, n_steps=300, contact_dt=1e-5, sample_every=100, damping_form="lagged")


def plain_dem(
    scene: SphereScene,
    numerics: Numerics,
    *,
    arms: dict[str, str],
    turn: str,
    pulls: bool = True,
    keeps: bool = False,
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(x, v, omega) at the sampled steps; velocities of half steps, slip at the step's end, dashpots of v_{n-1/2}.

    ``arms`` are those of "torque", "slip" between spheres and of "wall", each "radius", "overlap" (R - overlap/2) or "whole" (R -
    overlap). ``turn`` is "project": a shear is projected on the new tangent plane with its size kept; "shrink": without that;
    "rotate": it is turned with the normal, and about it by the mean spin, to first order; "keep": it keeps its direction in space.
    ``keeps``: two spheres that part keep their shear for the next time they touch.
    """
    spheres, n, dt = scene.spheres, len(scene.spheres), numerics.contact_dt
    x, v, w = np.array(spheres.x), np.array(spheres.v), np.array(spheres.omega)
    substeps = numerics.substeps(dt)
    path = plane_path(scene, dt, substeps * numerics.n_steps)
    near = spheres.radius.max()  # further than any sphere moves in these runs
    pairs = [
        (i, j)
        for i in range(n)
        for j in range(i + 1, n + len(scene.walls))
        if j >= n or np.linalg.norm(x[i] - x[j]) < spheres.radius[i] + spheres.radius[j] + near
    ]
    memory: dict[tuple[int, int], tuple[np.ndarray, float, np.ndarray]] = {}
    inflow, rows = np.tile(scene.gravity, (n, 1)), []
    share = {"radius": 0.0, "overlap": 0.5, "whole": 1.0}
    for step in range(substeps * numerics.n_steps + 1):
        h = dt if step else 0.0
        force, torque = inflow * spheres.mass[:, None], np.zeros((n, 3))
        planes = path[min(step, len(path) - 1)]
        for i, j in pairs:
            law, wall = scene.law((i, j)), j >= n
            if wall:
                point, facing, speed, spin = planes[j - n].reshape(4, 3)
                normal, gap = -facing, float((x[i] - point) @ facing - spheres.radius[i])
                mass, radius = spheres.mass[i], spheres.radius[i]
            else:
                d = x[j] - x[i]
                distance = float(np.linalg.norm(d))
                normal, gap = d / distance, distance - spheres.radius[i] - spheres.radius[j]
                mass, radius = (1.0 / (1.0 / a[i] + 1.0 / a[j]) for a in (spheres.mass, spheres.radius))
            if gap >= 0.0:
                if wall or not keeps:
                    memory.pop((i, j), None)
                continue
            overlap = -gap
            torque_arm, slip_arm = (share[arms["wall" if wall else name]] * overlap for name in ("torque", "slip"))
            arm = (spheres.radius[i] - slip_arm) * normal
            at_i = v[i] + np.cross(w[i], arm)
            if wall:
                other = speed + np.cross(spin, x[i] + arm - point)
                mean = 0.5 * (w[i] + spin)
            else:
                other = v[j] - np.cross(w[j], (spheres.radius[j] - slip_arm) * normal)
                mean = 0.5 * (w[i] + w[j])
            relative = at_i - other
            approach = float((v[i] - (other if wall else v[j])) @ normal)
            slip = relative - (relative @ normal) * normal
            a = np.sqrt(radius * overlap)
            if law.hertz:
                elastic, c = 4.0 / 3.0 * law.e_star * a * overlap, np.sqrt(5.0 / 6.0 * mass * 2.0 * law.e_star * a)
                stiffness = 8.0 * law.g_star * a
            else:
                elastic, c, stiffness = law.kn * overlap, np.sqrt(mass * law.kn), law.ks
            fn = elastic + 2.0 * law.beta * c * approach
            fn = fn if pulls else max(fn, 0.0)
            shear, before, old = memory.get((i, j), (np.zeros(3), a, normal))  # the force, whatever the law keeps
            if turn == "shrink":
                shear = shear - (shear @ normal) * normal
            elif turn == "project":
                along = shear - (shear @ normal) * normal
                size = float(np.linalg.norm(along))
                shear = along * (np.linalg.norm(shear) / size) if size else shear
            elif turn == "rotate":
                shear = shear + np.cross(np.cross(old, normal), shear)
                shear = shear + np.cross(h * (mean @ old) * old, shear)
            if law.hertz and law.unloading == "none":
                shear = shear * (a / before)
            elif law.hertz and law.unloading == "rescale":
                shear = shear * (a / before) * min(1.0, a / before)
            shear = shear - stiffness * h * slip
            size, most = float(np.linalg.norm(shear)), law.mu * abs(fn)
            shear = shear * (most / size) if size > most else shear
            memory[i, j] = shear, a, normal
            force[i] += shear - fn * normal
            torque[i] += np.cross((spheres.radius[i] - torque_arm) * normal, shear)
            if not wall:
                force[j] -= shear - fn * normal
                torque[j] += np.cross((spheres.radius[j] - torque_arm) * normal, shear)
        ahead = 0.5 * dt * force / spheres.mass[:, None], 0.5 * dt * torque / spheres.inertia[:, None]
        ahead = np.where(spheres.held, 0.0, ahead[0]), np.where(spheres.rotating[:, None], ahead[1], 0.0)
        if step == 0:
            v, w = v - ahead[0], w - ahead[1]
        if step % (substeps * numerics.sample_every) == 0:
            rows.append((x, v + ahead[0], w + ahead[1]))
        v, w = v + 2.0 * ahead[0], w + 2.0 * ahead[1]
        x = x + dt * v
    return rows
