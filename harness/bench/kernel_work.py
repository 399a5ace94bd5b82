"""Arithmetic and memory traffic of the DEM's step, counted from its kernels, for the pairs and contacts of a run.

Counted is one contact step of disks with one thread: forces (`disk_disk_forces`, `disk_wall_forces`), kick and drift
(`kick_and_drift`). Not counted are rebuilds of the lists, sums of a few numbers a step (walls, energies), products of constants of a law
or a wall, and work on whole numbers: indices, bits, comparisons, signs, the choice of one of two numbers.

Operations on floats: a sum, difference, product, quotient or root is one, as written in the source (a product and a sum that the
processor fuses are two). `disk_disk_forces` does the same for every listed pair, whether it touches or not and whatever its law is: a
pair out of contact gets its zero after its forces have been found.

- `gather`: dx, dy, reach: 3; difference of the velocities 2; R_i omega_i + R_j omega_j 3, omega_i + omega_j: together 9,
- `gather_dashpots`, where dashpots see extrapolated velocities: 2,
- `pair_forces`: d 4, overlap, 1/d, nx, ny: 8; rate of the overlap 3; kn overlap, damping times rate, the sum: 3; difference of the
  positions half a step before 4, 1 over its length 5; slip rate by translation 4, by rotation, whose arms see the overlap of then,
  4 + 5; times dt; mu fn; fs 2; force 3 + 3; what the overlap takes from the torques 2: 48,
- `scatter`: sums of both forces 4; of both torques 3 + 3: 10.

`disk_wall_forces` does

- for each wall: velocity of the point of its surface by its spin 3 + 3: 6,
- for each listed pair: height 5, overlap: 6,
- for each contact besides: foot 4, point of the wall's velocity 8, rate with that velocity 9, kn overlap, gx, gy: 2, sums of the disk's
  force 2 and of the wall's load 2 + 4: 32,
- with dashpots: coefficient 3 (2 beta is a constant of the wall), product and sum: 5,
- with friction: arm 2, slip rate by translation 5, height where slip is measured 9, overlap there, what the wall's spin takes from the
  slip rate down there 3, slip rate by rotation 4, times dt, mu fn, fs 2, its part of the force 4, of the torque 2: 34.

`kick_and_drift` does for each disk: velocities 12 (gravity times 1, or 0 for a fixed disk, among them), way 2, positions 2, displacement
since the rebuild 2, spin 4, angle 2, square of the displacement 3: 27; where dashpots see extrapolated velocities 6 more.

Bytes are those that have to come from and go to the level of memory that holds all arrays, if the caches never load any of them twice in a
step: disks lie in the order of the cells and are kicked while they are still in the fast caches. Each disk: position 16, velocity 16,
force 16, spin, angle, torque, radius, 1/m, 1/I and displacement 8 each, together 104 to be read; of these position, velocity, force,
spin, angle, torque and displacement, 80, are written. Each listed pair: numbers of both disks 4 each, the dashpot's coefficient 8, which
is 0 without dashpots, and the shear force 8, which is written in any case; with a wall: number of the disk 4, shear force 8. Pointers into
the list are read once for a block of disks and not counted.

Nor is the scratch of `disk_disk_forces`: each chunk of pairs overwrites the same 9 kB, which need not leave the first cache, so that
they take nothing from the bandwidth that the bytes are held against. A pair writes 11 numbers there (7 differences and 4 results; 2 more
where dashpots see extrapolated velocities) and reads 14: the results, the differences of the velocities twice, once for the rate of the
overlap, and the sum of the radii twice, for the overlaps at both times.
"""

from __future__ import annotations

from dataclasses import dataclass

from ninedisk.core.dem.session import Counts
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene

PAIR, PAIR_EXTRAPOLATION = 9 + 48 + 10, 2
WALL, WALL_PAIR, WALL_CONTACT, WALL_DASHPOT, WALL_FRICTION = 6, 6, 32, 5, 34
DISK, EXTRAPOLATION = 27, 6
"""Operations on floats, see above."""

DISK_READ, DISK_WRITTEN, EXTRAPOLATED = 104, 80, 16
PAIR_READ, WALL_PAIR_READ, PAIR_WRITTEN = 4 + 4 + 8 + 8, 4 + 8, 8
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
    ahead = numerics.damping_form == "central" and any(law.beta > 0.0 for law in laws)
    # Walls of one scene may differ; a contact with a wall is given their mean.
    walls = [WALL_CONTACT + WALL_DASHPOT * (law.beta > 0.0) + WALL_FRICTION * _rough(law) for law in laws[1:]]
    at_wall = sum(walls) / max(1, len(walls))
    flops: float = n * (DISK + EXTRAPOLATION * ahead) + counts.pairs * (PAIR + PAIR_EXTRAPOLATION * ahead)
    flops += WALL * len(walls) + WALL_PAIR * counts.wall_pairs + at_wall * counts.wall_contacts
    extra = EXTRAPOLATED * ahead
    held = n * (DISK_READ + extra) + PAIR_READ * counts.pairs + WALL_PAIR_READ * counts.wall_pairs
    written = n * (DISK_WRITTEN + extra) + PAIR_WRITTEN * (counts.pairs + counts.wall_pairs)
    return Work(flops / n, (held + written) / n, held / n)


def _rough(law: ContactLaw) -> bool:
    return law.mu > 0.0 and law.ks > 0.0
