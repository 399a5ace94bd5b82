"""A trajectory that passes, with the TOML and the contact forces beside it: a run of our own DEM, to start from and to spoil."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ninedisk.core import ContactLaw, Disks, Numerics, Scene, Wall, simulate
from ninedisk.core.archive import make_folder
from ninedisk.harness.results.whole_file import check_same_text, write_whole

TOML = """\
# What the trajectory does not say. Run:  ninedisk audit trajectory.csv
# In space every vector has three numbers, and [disks] may be called [spheres].
gravity = [0.0, -9.81]             # [m/s^2]
# dimension = 2                    # or 3; the vectors say it as well
# damping = 0.0                    # global damping [1/s]: m a + damping m v = F
# reverse = "back.csv"             # a run from the end with all velocities reversed
# open = true                      # disks may come and leave
# partial = true                   # the file has a part of the disks
# single = true                    # the engine computes in single precision, whatever the file shows
# periodic = ["x"]                 # axes along which a domain repeats of which the file does not say so: MercuryDPM's

[time]
dt = 1e-5                          # the engine's own step [s]; t = step x dt where the file has steps only
# interval = 1e-3                  # time between two files of a series without times

[disks]                            # one number, a list (ids in order), or by type {1 = 0.1, 2 = 0.2}
radius = [0.1, 0.1, 0.15, 0.12]    # [m]; a column radius of the file does as well
density = 1000.0                   # [kg/m^2], in space [kg/m^3]; or mass = ... [kg]
inertia = "disk"                   # or "sphere", also of spheres in a plane, or I/(m R^2)
# fixed = [7, 8]                   # ids of disks that do not move freely

# [data]                           # radii and masses out of a data file of LAMMPS
# file = "run.data"
# style = "hybrid sphere bond"     # where the file says hybrid alone

[contact]                          # what is not given is not judged
mu = 0.3
kn = 1e6                           # [N/m], linear; or rigid = true, with slop = ... [m] if the engine allows one
ks = 8e5                           # [N/m]
restitution = 0.7                  # 1 with mu = 0: energy is kept as well
# cohesive = true                  # contacts pull
# pull = false                     # no dashpot pulls at the end of a contact
# rolling = true                   # contacts resist rolling
# lever_arm = "overlap"            # arms of shear forces: R less half the overlap, or "radius"; omitted: either

[[walls]]                          # half-planes (walls = "unknown": nobody knows): a point, the normal into the free side
name = "floor"
point = [0.0, 0.0]
normal = [0.0, 1.0]
# mu = 0.5                         # its own mu, kn, ks
# motion = [{ velocity = [0.1, 0.0], duration = 2.0 }]
#          # segments: duration, velocity, angular_velocity, pivot, amplitude, frequency, phase

# [columns]                        # names of the file's columns, where they are other ones
# x = "pos_x"

[contacts]                         # forces: columns t or step, i, j, fn, fs; j = -1 is the first wall, -2 the second
file = "contacts.csv"
"""


def example_scene() -> tuple[Scene, Numerics]:
    """Four disks: two meet in the air, spinning, one bounces and slides on a floor, one falls on it later."""
    law = ContactLaw(kn=1e6, ks=8e5, mu=0.3, restitution=0.7, beta=0.1128, lever_arm="overlap")
    radius = np.array([0.1, 0.1, 0.15, 0.12])
    scene = Scene(
        disks=Disks(
            x=np.array([(0.0, 1.0), (0.6, 1.03), (1.5, 0.2), (2.6, 0.4)]),
            v=np.array([(2.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (-0.5, 0.0)]),
            omega=np.array([3.0, -5.0, 0.0, 2.0]),
            radius=radius,
            mass=1000.0 * np.pi * radius**2,
        ),
        walls=(Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
        disk_disk=law,
        gravity=(0.0, -9.81),
    )
    return scene, Numerics(dt=1e-3, n_steps=400, contact_dt=1e-5)


def write_example(folder: Path) -> list[Path]:
    """Write ``trajectory.csv``, ``trajectory.toml`` and ``contacts.csv``; the files.

    Raises
    ------
    UsageError
        If another file has one of the names.
    UnwritableFileError, StoreError
        If the folder cannot be made or a file cannot be written.
    """
    scene, numerics = example_scene()
    n = len(scene.disks)
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n + 1)]
    history = simulate(scene, numerics, watch=pairs)
    rows = ["t,id,x,y,vx,vy,angle,omega"]
    forces = ["t,i,j,fn,fs"]
    for k, t in enumerate(history.t):
        for i in range(n):
            given = (*history.x[k, i], *history.v[k, i], history.angle[k, i], history.omega[k, i])
            rows.append(f"{t:.6g},{i}," + ",".join(f"{value:.9g}" for value in given))
        for column, (i, j) in enumerate(pairs):
            if history.fn[k, column] > 0.0:
                other = j if j < n else n - 1 - j
                forces.append(f"{t:.6g},{i},{other},{history.fn[k, column]:.9g},{history.fs[k, column]:.9g}")
    make_folder(folder)
    files = {"trajectory.csv": "\n".join(rows), "trajectory.toml": TOML.rstrip("\n"), "contacts.csv": "\n".join(forces)}
    for name, text in files.items():
        check_same_text("--example", folder / name, text + "\n")
    for name, text in files.items():
        write_whole("--example", folder / name, text + "\n")
    return [folder / name for name in files]
