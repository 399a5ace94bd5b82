"""Random contact problems of every kind that a solver has to stand, feasible by construction.

Each builder makes a problem in which one motion is known to satisfy all contacts: standing still where no gap is negative,
or the motion that `driven` starts from. Lengths are radii, stiffness and mass are of order one unless a builder says
otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ninedisk.core.cd.problem import ContactProblem

FloatArray = NDArray[np.float64]
Rng = np.random.Generator

COUNT = 200
SMALLEST, LARGEST = 2, 2000
"""Contacts of the smallest and the largest of the `COUNT` problems."""
GOLDEN = 0.6180339887498949
FLOOR, LEFT, RIGHT, ROOF = (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, -1.0)


@dataclass
class Packing:
    """Disks and contacts before friction, compliance and load are chosen; arrays as in `ContactProblem`."""

    x: FloatArray
    radius: FloatArray
    bodies: NDArray[np.int64]
    normal: FloatArray
    gap: FloatArray

    @property
    def mass(self) -> FloatArray:
        """Masses of disks of unit density, shape (b, 3)."""
        m = np.pi * self.radius**2
        return np.column_stack([m, m, 0.5 * m * self.radius**2])

    @property
    def arms(self) -> FloatArray:
        """Arms of the friction forces, shape (c, 4)."""
        radius = np.append(self.radius, 0.0)
        arms = np.zeros((len(self.bodies), 4))
        arms[:, 2:] = radius[self.bodies]
        return arms

    def keep(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Packing:
        """The same disks with some of the contacts, in this order."""
        return replace(self, bodies=self.bodies[chosen], normal=self.normal[chosen], gap=self.gap[chosen])


def pack(x: FloatArray, radius: FloatArray, reach: float, walls: tuple[tuple[float, float], ...] = ()) -> Packing:
    """Contacts of all pairs closer than ``reach``; walls touch the outermost disks of their side, overlaps count as closed."""
    pairs = cKDTree(x).query_pairs(2.0 * float(radius.max()) + reach, output_type="ndarray").reshape(-1, 2)
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    d = x[pairs[:, 1]] - x[pairs[:, 0]]
    length = np.hypot(d[:, 0], d[:, 1])
    gap = length - radius[pairs].sum(axis=1)
    bodies, normals, gaps = [pairs], [d / length[:, None]], [gap]
    for wall in walls:
        height = x @ np.array(wall) - radius
        disks = np.arange(len(x))
        bodies.append(np.column_stack([disks, np.full(len(x), -1)]))
        normals.append(np.tile(-np.array(wall), (len(x), 1)))
        gaps.append(height - height.min())
    packing = Packing(x, radius, np.concatenate(bodies), np.concatenate(normals), np.concatenate(gaps))
    packing = packing.keep(packing.gap < reach)
    return replace(packing, gap=np.where(packing.gap < 1e-9, 0.0, packing.gap))


def lattice(columns: int, rows: int, *, hexagonal: bool = False) -> FloatArray:
    """Centres of disks of radius 1/2 that touch, shape (columns rows, 2)."""
    i, j = (index.ravel().astype(float) for index in np.meshgrid(np.arange(columns), np.arange(rows)))
    return np.column_stack([i + 0.5 * (j % 2), j * np.sqrt(0.75)]) if hexagonal else np.column_stack([i, j])


def tile(rng: Rng, contacts: int, walls: tuple[tuple[float, float], ...] = (), *, hexagonal: bool = False) -> Packing:
    """A lattice with every contact closed, 2 or 3 contacts per disk: more forces than equations of balance."""
    disks = contacts / (3.0 if hexagonal else 2.0) + 2.0
    columns = max(1, round(float(np.sqrt(disks * rng.uniform(0.4, 2.5)))))
    x = lattice(columns, int(np.ceil(disks / columns)), hexagonal=hexagonal)
    return pack(x, np.full(len(x), 0.5), 0.01, walls)


def jumble(rng: Rng, contacts: int, spread: float = 1.5) -> Packing:
    """Disks of radii 0.4 to 0.4 ``spread`` on a jittered lattice over a floor; half of the contacts are open."""
    side = int(np.ceil(np.sqrt(contacts / 2.0 + 1.0)))
    x = lattice(side, side) + rng.uniform(-0.1, 0.1, (side * side, 2))
    packing = pack(x, 0.4 * rng.uniform(1.0, spread, side * side), 0.25, (FLOOR,))
    return replace(packing, gap=np.where(rng.random(len(packing.gap)) < 0.5, np.maximum(packing.gap, 0.0), 0.0))


@dataclass
class Choice:
    """What a builder chooses: the packing, and whatever differs from the usual draw of `problem`."""

    packing: Packing
    mass: FloatArray | None = None
    force: FloatArray | None = None
    mu: FloatArray | None = None
    compliance: FloatArray | None = None
    offset: FloatArray | None = None


def loose(rng: Rng, contacts: int) -> Choice:
    """Random packing, half of it open."""
    return Choice(jumble(rng, contacts))


def hyperstatic(rng: Rng, contacts: int) -> Choice:
    """Square or hexagonal lattice on a floor, all contacts closed."""
    return Choice(tile(rng, contacts, (FLOOR,), hexagonal=bool(rng.random() < 0.5)))


def wedged(rng: Rng, contacts: int) -> Choice:
    """Lattice of disks that exactly fills the room between walls: no motion opens all contacts, forces are unbounded."""
    walls = (LEFT, RIGHT) if rng.random() < 0.5 else (LEFT, RIGHT, FLOOR, ROOF)
    return Choice(tile(rng, contacts, walls))


def redundant(rng: Rng, contacts: int) -> Choice:
    """Each contact up to five times, identical but for its friction."""
    packing = jumble(rng, max(1, contacts // 3))
    return Choice(packing.keep(np.sort(rng.integers(0, len(packing.bodies), contacts))))


def idle(rng: Rng, contacts: int) -> Choice:
    """Closed contacts, of which all carry nothing but those near the one disk that is loaded."""
    packing = tile(rng, contacts, (FLOOR,), hexagonal=True)
    force = np.zeros_like(packing.mass)
    force[rng.integers(len(force)), :2] = rng.normal(0.0, 1.0, 2)
    return Choice(packing, force=force)


def mixed(rng: Rng, contacts: int) -> Choice:
    """Smooth and rough, rigid and elastic contacts side by side; friction up to 2."""
    packing = tile(rng, contacts, (FLOOR, LEFT), hexagonal=True)
    c = len(packing.bodies)
    mu = np.where(rng.random(c) < 0.5, 0.0, rng.uniform(0.0, 2.0, c))
    return Choice(packing, mu=mu, compliance=rng.uniform(0.0, 0.3, (c, 2)) * (rng.random((c, 2)) < 0.5))


def blocked(rng: Rng, contacts: int) -> Choice:
    """Some spins, some directions and some whole disks are held."""
    packing = tile(rng, contacts, (FLOOR,), hexagonal=bool(rng.random() < 0.5))
    mass = np.where(rng.random(packing.mass.shape) < [0.05, 0.05, 0.3], np.inf, packing.mass)
    mass[rng.random(len(mass)) < 0.05] = np.inf
    inverse = np.append(1.0 / mass[:, :2], np.zeros((1, 2)), axis=0)
    yields = (packing.normal[:, None, :] ** 2 * inverse[packing.bodies]).sum(axis=(1, 2))
    return Choice(packing.keep(yields > 1e-3), mass=mass)


def column(rng: Rng, contacts: int) -> Choice:
    """A column one or two disks wide on a floor: what happens at the top has far to travel."""
    wide = int(rng.integers(1, 3))
    x = lattice(wide, contacts // (2 * wide - 1) + 2)
    x[:, 0] += rng.uniform(-0.05, 0.05, len(x))
    packing = pack(x, np.full(len(x), 0.5), 0.2, (FLOOR,))
    return Choice(replace(packing, gap=np.zeros(len(packing.gap))))


def ratios(rng: Rng, contacts: int) -> Choice:
    """Masses over four decades."""
    packing = jumble(rng, contacts)
    factor = 10.0 ** rng.uniform(-2.0, 2.0, len(packing.x))
    return Choice(packing, mass=packing.mass * factor[:, None])


def static(rng: Rng, contacts: int) -> Choice:
    """Elastic contacts and next to no mass, as in the static limit: the load rests on compliance alone."""
    packing = tile(rng, contacts, (FLOOR, LEFT, RIGHT), hexagonal=bool(rng.random() < 0.5))
    compliance = rng.uniform(0.05, 0.3, (len(packing.bodies), 2))
    force = np.column_stack([np.zeros(len(packing.x)), -packing.mass[:, 0], np.zeros(len(packing.x))])
    return Choice(packing, mass=1e-8 * packing.mass, force=force, compliance=compliance)


def driven(rng: Rng, contacts: int) -> Choice:
    """Obstacles move, gaps are negative: a random motion satisfies all contacts, half of them without room."""
    packing = jumble(rng, contacts)
    c = len(packing.bodies)
    mu = draw_friction(rng, c)
    stuck = ContactProblem(
        mass=packing.mass,
        force=np.zeros_like(packing.mass),
        bodies=packing.bodies,
        normal=packing.normal,
        arms=packing.arms,
        offset=np.zeros((c, 2)),
        mu=mu,
    )
    slip = rng.normal(0.0, 1.0, c) * (rng.random(c) < 0.5)
    opening = mu * np.abs(slip) + rng.exponential(0.5, c) * (rng.random(c) < 0.5)
    motion = rng.normal(0.0, 1.0, packing.mass.shape)
    offset = np.column_stack([opening, slip]) - stuck.contact_velocity(motion, np.zeros((c, 2)))
    return Choice(packing, mu=mu, offset=offset)


BUILDERS: tuple[Callable[[Rng, int], Choice], ...] = (
    loose,
    hyperstatic,
    wedged,
    redundant,
    idle,
    mixed,
    blocked,
    column,
    ratios,
    static,
    driven,
)


def draw_friction(rng: Rng, c: int) -> FloatArray:
    """Friction coefficients from 0 to 2: none, the same everywhere, spread out, or here and there; shape (c,)."""
    kind = rng.integers(5)
    if kind < 3:
        return np.full(c, (0.0, 0.3, 2.0)[kind])
    return rng.uniform(0.0, 2.0, c) * (1.0 if kind == 3 else rng.random(c) < 0.6)


def size_of(index: int) -> int:
    """Contacts aimed at by problem ``index``: spread evenly on a logarithmic scale, whatever the builder."""
    return round(SMALLEST * (LARGEST / SMALLEST) ** ((index + 1) * GOLDEN % 1.0))


def of_kind(builder: Callable[[Rng, int], Choice], at_least: int) -> ContactProblem:
    """The smallest of the problems of a kind that has this many contacts."""
    kind = BUILDERS.index(builder)
    every = [problem(i) for i in range(kind, COUNT, len(BUILDERS))]
    return min((p for p in every if p.n_contacts >= at_least), key=lambda p: p.n_contacts)


def builder_of(index: int) -> str:
    """Name of the builder of problem ``index``."""
    return BUILDERS[index % len(BUILDERS)].__name__


@cache
def problem(index: int) -> ContactProblem:
    """Problem ``index`` of the `COUNT`, always the same."""
    rng = np.random.default_rng([20260, index])
    size = size_of(index)
    made = BUILDERS[index % len(BUILDERS)](rng, size)
    packing = made.packing
    c, b = len(packing.bodies), len(packing.x)
    soft = rng.random() < 0.5
    elastic = rng.uniform(0.01, 0.3, (c, 2)) if soft else np.zeros((c, 2))
    weight = np.column_stack([np.zeros(b), -3.0 * packing.mass[:, 0], np.zeros(b)])
    fields = {
        "normal": packing.normal,
        "bodies": packing.bodies,
        "arms": packing.arms,
        "offset": np.column_stack([packing.gap, np.zeros(c)]) if made.offset is None else made.offset,
        "mu": draw_friction(rng, c) if made.mu is None else made.mu,
        "compliance": elastic if made.compliance is None else made.compliance,
        "shear_0": rng.normal(0.0, 0.2, c) if soft else np.zeros(c),
    }
    # A builder makes whole lattices; what exceeds the size aimed at is left out.
    kept = np.sort(rng.permutation(c)[:size])
    return ContactProblem(
        mass=packing.mass if made.mass is None else made.mass,
        force=rng.normal(0.0, 1.0, (b, 3)) * [1.0, 1.0, 0.2] + weight if made.force is None else made.force,
        **{name: value[kept] for name, value in fields.items()},
    )


def law_broken(problem: ContactProblem, r: FloatArray) -> float:
    """Largest violation of Coulomb's law, contact by contact, written out: relative to the largest velocity and force without contacts."""
    u = problem.contact_velocity(problem.body_velocity(r), r)
    speed, force = float(np.abs(problem.b).max()), float(np.abs(r).max()) or 1.0
    p, q, un, ut = r[:, 0] / force, r[:, 1] / force, u[:, 0] / speed, u[:, 1] / speed
    mu = problem.mu
    room = mu * p - np.abs(q)
    wrong = [-p, -un, p * un, -room, np.where(mu > 0.0, room * np.abs(ut), np.abs(q)), q * ut]
    return float(max(each.max() for each in wrong))
