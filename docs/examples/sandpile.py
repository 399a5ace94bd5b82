"""A column of disks collapses on rough ground: what each model of rolling resistance makes of the heap.

Ai, Chen, Rotter & Ooi (Powder Technology 206 (2011) 269-282) let disks out of a hopper: a heap with the elastic-plastic model stands, one
with a constant torque creeps, and a viscous torque holds hardly more than none. Here are 138 disks, six seconds, no hopper, and three
heaps of each. A heap's height has no closed form, and whether one with a constant torque creeps depends on the heap: this is no case.

    python sandpile.py          (half a minute)
"""

import numpy as np

from ninedisk.core import ContactLaw, Disks, Numerics, Rolling, Scene, simulate

RADIUS, DENSITY, KN, MU, MU_R = 0.005, 1056.0, 1e6, 0.8, 0.3
WIDTH, HEIGHT, GROUND, SECONDS = 12, 12, 60, 6.0

REDUCED = 0.5 * RADIUS
MODELS = {
    "elastic-plastic": Rolling(model="elastic-plastic", mu=MU_R, kr=2.25 * KN * MU_R**2 * REDUCED**2, beta=0.3),
    "constant": Rolling(model="constant", mu=MU_R),
    "viscous": Rolling(model="viscous", mu=MU_R),
    "none": None,
}


def column(rolling: Rolling | None, seed: int) -> Scene:
    """A loose column above a row of fixed disks; radii within 15 % of the mean."""
    random = np.random.default_rng(seed)
    ground = [[2.0 * RADIUS * k, 0.0] for k in range(-GROUND, GROUND + 1)]
    loose = [
        [2.4 * RADIUS * (i - 0.5 * (WIDTH - 1 - j % 2)), RADIUS * (2.5 + 2.1 * j)]
        for j in range(HEIGHT)
        for i in range(WIDTH - j % 2)
    ]
    radius = np.array([RADIUS] * len(ground) + [RADIUS * random.uniform(0.85, 1.15) for _ in loose])
    fixed = np.arange(len(radius)) < len(ground)
    return Scene(
        disks=Disks(
            x=np.array(ground + loose),
            radius=radius,
            mass=DENSITY * np.pi * radius**2,
            held=np.column_stack([fixed, fixed]),
            rotating=~fixed,
        ),
        disk_disk=ContactLaw(kn=KN, ks=KN, mu=MU, beta=0.3, rolling=rolling),
        gravity=(0.0, -9.81),
    )


print(f"{'rolling resistance':20}{'seed':>5}{'height/R at 2 s':>17}{'at 6 s':>8}{'fastest disk at 6 s':>21}")
for name, rolling in MODELS.items():
    for seed in (3, 4, 5):
        scene = column(rolling, seed)
        history = simulate(scene, Numerics(dt=0.05, n_steps=round(SECONDS / 0.05), contact_dt=2.5e-5), [])
        free = ~scene.disks.fixed
        tops = np.sort(history.x[:, free, 1] + scene.disks.radius[free], axis=1)[:, -3:].mean(axis=1) / RADIUS
        fastest = np.abs(history.v[-1, free]).max()
        print(f"{name:20}{seed:5}{tops[40]:17.4f}{tops[-1]:8.4f}{1e3 * fastest:16.1e} mm/s", flush=True)
