"""A plain numpy DEM of spheres with engines' own conventions, and a box of spheres that touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ninedisk.core.law import SphereLaw, damping_ratio
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
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
    spheres, n, m, dt = scene.spheres, len(scene.spheres), len(scene.walls), numerics.contact_dt
    x, v, w = np.array(spheres.x), np.array(spheres.v), np.array(spheres.omega)
    substeps = numerics.substeps(dt)
    path = plane_path(scene, dt, substeps * numerics.n_steps)
    path = path.reshape(len(path), m, 4, 3)
    # All pairs that may meet: no sphere moves further than the largest radius in these runs.
    i, j = np.triu_indices(n, 1)
    near = np.linalg.norm(x[i] - x[j], axis=1) < spheres.radius[i] + spheres.radius[j] + spheres.radius.max()
    i = np.concatenate([i[near], np.tile(np.arange(n), m)])
    j = np.concatenate([j[near], np.repeat(n + np.arange(m), n)])
    laws = [scene.law(pair) for pair in zip(i.tolist(), j.tolist(), strict=True)]
    kn, ks, e_star, g_star, mu, beta = (
        np.array([getattr(law, name) for law in laws]) for name in ("kn", "ks", "e_star", "g_star", "mu", "beta")
    )
    unloading = np.array([law.unloading if law.hertz else "" for law in laws])
    rule = [(np.flatnonzero(unloading == name), power) for name, power in (("none", 1), ("rescale", 2))]
    wall = j >= n
    share = {"radius": 0.0, "overlap": 0.5, "whole": 1.0}
    torque_share, slip_share = (
        np.where(wall, share[arms["wall"]], share[arms[name]])[:, None] for name in ("torque", "slip")
    )
    # A wall is a body that is infinitely large and heavy.
    radius, mass = (np.concatenate([of, np.full(m, np.inf)]) for of in (spheres.radius, spheres.mass))
    radius_j, reduced, small = radius[j][:, None], *(1.0 / (1.0 / of[i] + 1.0 / of[j]) for of in (mass, radius))
    radius_i = radius[i][:, None]
    # What contacts remember: shear is the force, whatever the law keeps; the normal and the contact's radius.
    shear, old, before = np.zeros((len(i), 3)), np.zeros((len(i), 3)), np.ones(len(i))
    new = np.ones(len(i), dtype=bool)
    rows = []
    for step in range(substeps * numerics.n_steps + 1):
        h = dt if step else 0.0
        point, facing, speed, spin = np.moveaxis(path[min(step, len(path) - 1)], 1, 0)
        at, moves, spins = np.concatenate([x, point]), np.concatenate([v, speed]), np.concatenate([w, spin])
        d = at[j] - at[i]
        d[wall] = -facing[j[wall] - n]
        distance = np.linalg.norm(d, axis=1)
        normal = d / distance[:, None]
        gap = distance - radius[i] - np.where(wall, 0.0, radius[j])
        gap[wall] = ((point[j[wall] - n] - x[i[wall]]) * normal[wall]).sum(axis=1) - radius[i[wall]]
        touch = gap < 0.0
        new |= ~touch if not keeps else ~touch & wall
        overlap = np.maximum(-gap, 0.0)
        arm = (radius_i - slip_share * overlap[:, None]) * normal
        arm_j = at[i] + arm - at[j]
        arm_j[~wall] = (slip_share * overlap[:, None] - radius_j)[~wall] * normal[~wall]
        other = moves[j] + np.cross(spins[j], arm_j)
        relative = moves[i] + np.cross(spins[i], arm) - other
        approach = ((moves[i] - np.where(wall[:, None], other, moves[j])) * normal).sum(axis=1)
        slip = relative - (relative * normal).sum(axis=1)[:, None] * normal
        a = np.sqrt(small * overlap)
        hertz = e_star > 0.0
        elastic = np.where(hertz, 4.0 / 3.0 * e_star * a, kn) * overlap
        c = np.sqrt(reduced * np.where(hertz, 5.0 / 3.0 * e_star * a, kn))
        fn = elastic + 2.0 * beta * c * approach
        fn = fn if pulls else np.maximum(fn, 0.0)
        shear[new], old[new], before[new] = 0.0, normal[new], a[new]
        kept = shear.copy()
        along = shear - (shear * normal).sum(axis=1)[:, None] * normal
        if turn == "shrink":
            shear = along
        elif turn == "project":
            size = np.linalg.norm(along, axis=1)
            longer = np.divide(np.linalg.norm(shear, axis=1), size, out=np.zeros(len(i)), where=size > 0.0)
            shear = np.where((size > 0.0)[:, None], along * longer[:, None], shear)
        elif turn == "rotate":
            mean = 0.5 * (spins[i] + spins[j])
            shear = shear + np.cross(np.cross(old, normal), shear)
            shear = shear + np.cross(h * (mean * old).sum(axis=1)[:, None] * old, shear)
        for which, power in rule:
            ratio = np.divide(a, before, out=np.ones(len(i)), where=before > 0.0)[which, None]
            shear[which] = shear[which] * (ratio if power == 1 else ratio * np.minimum(1.0, ratio))
        shear = shear - (np.where(hertz, 8.0 * g_star * a, ks) * h)[:, None] * slip
        size, most = np.linalg.norm(shear, axis=1), mu * np.abs(fn)
        shear = shear * np.divide(most, size, out=np.ones(len(i)), where=size > most)[:, None]
        shear, old = np.where(touch[:, None], shear, kept), np.where(touch[:, None], normal, old)
        before, new = np.where(touch, a, before), new & ~touch
        force, torque = spheres.mass[:, None] * scene.gravity, np.zeros((n, 3))
        pull, twist = shear - fn[:, None] * normal, np.cross(normal, shear)
        for body, sign, r in ((i, 1.0, radius_i), (j, -1.0, radius_j)):
            k = np.flatnonzero(touch & (body < n))
            np.add.at(force, body[k], sign * pull[k])
            np.add.at(torque, body[k], (r[k] - (torque_share * overlap[:, None])[k]) * twist[k])
        ahead = 0.5 * dt * force / spheres.mass[:, None], 0.5 * dt * torque / spheres.inertia[:, None]
        ahead = np.where(spheres.held, 0.0, ahead[0]), np.where(spheres.rotating[:, None], ahead[1], 0.0)
        if step == 0:
            v, w = v - ahead[0], w - ahead[1]
        if step % (substeps * numerics.sample_every) == 0:
            rows.append((x, v + ahead[0], w + ahead[1]))
        v, w = v + 2.0 * ahead[0], w + 2.0 * ahead[1]
        x = x + dt * v
    return rows
