"""Shear forces that contacts carry from the start, brought into LAMMPS' own contact histories."""

import numpy as np
from lammps_contacts import rough

TOLERANCE = 1e-9
"""Of the largest preload: round-off of the velocities that stretch the springs."""


def load_shear(run):
    """One step in which nothing moves but slip accumulates, from velocities that stretch every shear spring as asked.

    Every touching contact gets an equation for its slip, and one with a dashpot another for a normal velocity of zero. What no
    velocities can do, and what the friction limit cuts off, is refused.
    """
    wanted = {(i, j): force for i, j, force in run.preload}
    touching = dict(_touching(run))
    for (i, j), force in wanted.items():
        if (i, j) not in touching:
            raise RuntimeError(
                f"initial_shear of pair ({i}, {j}) is {force:g} N, but the two bodies do not overlap at time 0: a contact "
                f"that carries shear needs an initial overlap"
            )
    rows, values = [], []
    for (i, j), (law, normal) in touching.items():
        slip, approach = np.zeros((2, run.n, 3))
        for body, sign in ((i, 1.0), (j, -1.0)):
            if body < run.n:
                slip[body] = (-sign * normal[1], sign * normal[0], run.radius[body])
                approach[body, :2] = sign * normal[0], sign * normal[1]
        shear = wanted.get((i, j), 0.0)
        if rough(law):
            rows.append(slip.ravel())
            values.append(-shear / (law["ks"] * run.dt))
        elif shear:
            raise RuntimeError(f"initial_shear of pair ({i}, {j}) is {shear:g} N, but this contact has no shear spring")
        if law["beta"] > 0.0:  # else the friction limit does not depend on velocities
            rows.append(approach.ravel())
            values.append(0.0)
    state = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0].reshape(run.n, 3)
    run.set("v", state[:, :2])
    run.set("omega", state[:, 2])
    run.do("run 1 post no")
    largest = max(map(abs, wanted.values()))
    for pair, (_, fs) in run.forces(touching)[0].items():
        asked = wanted.get(pair, 0.0)
        if not abs(fs - asked) <= TOLERANCE * largest:
            raise RuntimeError(
                f"initial_shear of pair {pair} should be {asked:g} N, but LAMMPS holds {fs:g} N: it exceeds the friction "
                f"limit, or contacts that form a loop cannot be stretched independently"
            )


def _touching(run):
    """Pairs that overlap at time 0: ``(i, j)``, law and normal from the first body to the second."""
    for i in range(run.n):
        for j in range(i + 1, run.n):
            d = run.x0[j] - run.x0[i]
            distance = float(np.hypot(*d))
            if distance < run.radius[i] + run.radius[j]:
                yield (i, j), (run.law, d / distance)
        for w, wall in enumerate(run.walls):
            normal = np.array(wall["normal"])
            if (run.x0[i] - np.array(wall["point"])) @ normal < run.radius[i]:
                yield (i, run.n + w), (wall["law"], -normal)
