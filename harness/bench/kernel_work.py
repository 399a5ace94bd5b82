"""Arithmetic and memory traffic of the DEM's step, counted from its kernels, for the pairs and contacts of a run.

Counted is one contact step of disks with one thread: forces (`disk_disk_forces`, `disk_wall_forces`), kick and drift
(`kick_and_drift`). Not counted are rebuilds of the lists, sums of a few numbers a step (walls, energies), and work on whole numbers:
indices, comparisons, signs.

Operations on floats: a sum, difference, product, quotient or root is one, as written in the source (a product and a sum that the
processor fuses are two). What `disk_disk_forces` does

- for each listed pair: dx, dy; reach; d2 (2 products, 1 sum); reach squared: 2 + 1 + 3 + 1 = 7,
- for each contact besides: root, overlap, 1/d, nx, ny, kn overlap: 6; gx, gy: 2; sums of both forces: 4; together 12,
- with dashpots: rate of the overlap 5, damping times it, the sum: 7,
- with friction: arms 4; slip rate 5 + 8; times dt; mu fn; fs 2; its parts of the force 4; of both torques 4: 29,
- for each disk: sums of force and torque: 3.

`disk_wall_forces` does

- for each listed pair: height 5, overlap: 6,
- for each contact besides: foot 4, point of the wall's velocity 8, that velocity 4, rate 9, kn overlap, gx, gy: 2, sums of the disk's
  force 2 and of the wall's load 2 + 4: 36,
- with dashpots: coefficient 3 (2 beta is a constant of the wall), product and sum: 5,
- with friction: arm 2, slip rate 5 + 4, times dt, mu fn, fs 2, its part of the force 4, of the torque 2: 21.

`kick_and_drift` does for each disk: velocities 10, way 2, positions 2, spin 4, angle 2, displacement since the rebuild 2, its square 3:
25; where dashpots see extrapolated velocities 6 more.

Bytes are those that have to come from and go to the level of memory that holds all arrays, if the caches never load any of them twice in a
step: disks lie in the order of the cells and are kicked while they are still in the fast caches. Each disk: position 16, velocity 16,
force 16, spin, angle, torque, radius, 1/m, 1/I and displacement 8 each, row of the list 4, together 108 to be read; of these position,
velocity, force, spin, angle, torque and displacement, 80, are written. Each listed pair: number of the other disk 4, shear force 8,
which is written in any case, and the dashpot's coefficient 8 (neighbours in the list share cache lines, so that it is loaded for pairs
that do not touch, too).
"""

from __future__ import annotations

from dataclasses import dataclass

from ninedisk.core.dem.counts import Counts
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene

PAIR, CONTACT, DASHPOT, FRICTION = 7, 12, 7, 29
WALL_PAIR, WALL_CONTACT, WALL_DASHPOT, WALL_FRICTION = 6, 36, 5, 21
DISK, EXTRAPOLATION = 3 + 25, 6
"""Operations on floats, see above."""

DISK_READ, DISK_WRITTEN, EXTRAPOLATED = 108, 80, 16
PAIR_READ, PAIR_WRITTEN, COEFFICIENT = 4 + 8, 8, 8
"""Bytes, see above."""


@dataclass(frozen=True)
class Work:
    """What a step does and moves, per disk.

    Attributes
    ----------
    flops : float
        Operations on floats.
    traffic : float
        Bytes read and written.
    held : float
        Bytes of the arrays that every step goes through.
    """

    flops: float
    traffic: float
    held: float


def work_of(scene: Scene, numerics: Numerics, counts: Counts) -> Work:
    """Work of one step of the disks of ``scene``, which all have the scene's laws, with these pairs and contacts."""
    n = len(scene.disks)
    laws = [scene.disk_disk, *(wall.law for wall in scene.walls)]
    damped = scene.disk_disk.beta > 0.0
    ahead = numerics.damping_form == "central" and any(law.beta > 0.0 for law in laws)
    contact = CONTACT + DASHPOT * damped + FRICTION * _rough(scene.disk_disk)
    # Walls of one scene may differ; a contact with a wall is given their mean.
    walls = [WALL_CONTACT + WALL_DASHPOT * (law.beta > 0.0) + WALL_FRICTION * _rough(law) for law in laws[1:]]
    at_wall = sum(walls) / max(1, len(walls))
    flops: float = n * (DISK + EXTRAPOLATION * ahead) + PAIR * counts.pairs + contact * counts.contacts
    flops += WALL_PAIR * counts.wall_pairs + at_wall * counts.wall_contacts
    extra = EXTRAPOLATED * ahead
    listed = counts.pairs + counts.wall_pairs
    held = n * (DISK_READ + extra) + PAIR_READ * listed + COEFFICIENT * damped * counts.pairs
    written = n * (DISK_WRITTEN + extra) + PAIR_WRITTEN * listed
    return Work(flops / n, (held + written) / n, held / n)


def _rough(law: ContactLaw) -> bool:
    return law.mu > 0.0 and law.ks > 0.0
