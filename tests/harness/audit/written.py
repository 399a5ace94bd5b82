"""Trajectories as each format's own library, or its program, writes them; for tests of readers and of damaged files."""

from __future__ import annotations

import base64
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core import ContactLaw, Numerics, PlaneWall, Spheres, SphereScene, simulate
from ninedisk.core.array_types import FloatArray

G = 9.81
RADIUS = np.array([0.1, 0.08, 0.09, 0.12])
MASS = 2000.0 * 4.0 / 3.0 * np.pi * RADIUS**3
DT = 2e-5
EVERY = 50
NAMES = ("x", "y", "z", "vx", "vy", "vz", "omegax", "omegay", "omegaz")
TOML = f"""gravity = [0.0, 0.0, -9.81]
time = {{dt = {DT}, interval = {DT * EVERY}}}
contact = {{mu = 0.3, kn = 1e5, ks = 8e4, lever_arm = "overlap"}}
walls = [{{name = "floor", point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, 1.0]}}]
"""
WITH_BODIES = f'spheres = {{inertia = "sphere", radius = {RADIUS.tolist()}, mass = {MASS.tolist()}}}\n'
PLAIN = 'spheres = {inertia = "sphere"}\n'
DENSE = 'spheres = {inertia = "sphere", density = 2000.0}\n'
"""For formats without masses."""


@dataclass(frozen=True)
class Run:
    """Steps, times and, by frame and body, the numbers in the order of `NAMES`."""

    step: list[int]
    t: list[float]
    rows: FloatArray

    @property
    def x(self) -> FloatArray:
        return self.rows[:, :, :3]

    @property
    def v(self) -> FloatArray:
        return self.rows[:, :, 3:6]

    @property
    def omega(self) -> FloatArray:
        return self.rows[:, :, 6:]


def make_run(g: float = G, frames: int = 120) -> Run:
    """Four spheres, spinning, two of which meet in the air, fall on a floor: our own DEM."""
    law = ContactLaw(kn=1e5, ks=8e4, mu=0.3, lever_arm="overlap")
    scene = SphereScene(
        spheres=Spheres(
            x=[(0.0, 0.0, 0.5), (0.3, 0.02, 0.52), (1.0, 0.5, 0.12), (2.0, 0.1, 0.9)], radius=RADIUS, mass=MASS,
            v=[(1.0, 0.0, 0.5), (-1.0, 0.0, 0.5), (0.5, 0.2, -1.0), (0.0, 0.1, 0.0)],
            omega=[(3.0, -5.0, 7.0), (1.0, 2.0, -3.0), (0.0, 4.0, 1.0), (2.0, 0.0, 0.0)],
        ),
        walls=(PlaneWall(name="floor", point=(0, 0, 0), normal=(0, 0, 1), law=law),),
        sphere_sphere=law,
        gravity=(0.0, 0.0, -g),
    )  # fmt: skip
    history = simulate(scene, Numerics(dt=DT * EVERY, n_steps=frames - 1, contact_dt=DT))
    rows = np.concatenate([history.x, history.v, history.omega], axis=2)
    return Run([EVERY * k for k in range(len(history.t))], [float(t) for t in history.t], rows)


def dump(path: Path, run: Run, _: str = "f8") -> None:
    made = []
    for k, step in enumerate(run.step):
        made += ["ITEM: TIMESTEP", str(step), "ITEM: NUMBER OF ATOMS", str(len(RADIUS)), "ITEM: BOX BOUNDS ff ff ff"]
        made += ["-9 9"] * 3 + [f"ITEM: ATOMS id radius mass {' '.join(NAMES)}"]
        made += [" ".join(map(_printed, (i + 1, RADIUS[i], MASS[i], *run.rows[k, i]))) for i in range(len(RADIUS))]
    path.write_text("\n".join(made) + "\n")


def _printed(value: float) -> str:
    return f"{value:.15g}"


def yaml(path: Path, run: Run, _: str = "f8") -> None:
    made = []
    for k, step in enumerate(run.step):
        made += [
            "---",
            "creator: LAMMPS",
            f"timestep: {step}",
            "units: si",
            f"time: {run.t[k]:.15g}",
            f"natoms: {len(RADIUS)}",
        ]
        made += [
            "boundary: [ f, f, f, f, f, f, ]",
            "thermo:",
            "  - keywords: [ Step, Temp, ]",
            f"  - data: [ {step}, 0, ]",
        ]
        made += ["box:", *["  - [ -9, 9 ]"] * 3, f"keywords: [ id, radius, mass, {', '.join(NAMES)},  ]", "data:"]
        for i in range(len(RADIUS)):
            numbers = " , ".join(map(_printed, (i + 1, RADIUS[i], MASS[i], *run.rows[k, i])))
            made.append(f"  - [ {numbers}, ]")
        made.append("...")
    path.write_text("\n".join(made) + "\n")


def table(path: Path, run: Run, _: str = "f8") -> None:
    made = ["t,id,radius,mass," + ",".join(NAMES)]
    for k, t in enumerate(run.t):
        made += [",".join(map(_printed, (t, i + 1, RADIUS[i], MASS[i], *run.rows[k, i]))) for i in range(len(RADIUS))]
    path.write_text("\n".join(made) + "\n")


def extxyz(path: Path, run: Run, _: str = "f8") -> None:
    made = []
    for k, t in enumerate(run.t):
        made += [str(len(RADIUS)), f'Time={t:.15g} pbc="F F F" Lattice="9 0 0 0 9 0 0 0 9" Properties=species:S:1:id:I:1:pos:R:3:vel:R:3:'
                 "omega:R:3:radius:R:1:mass:R:1"]  # fmt: skip
        made += [
            f"C {i + 1} " + " ".join(map(_printed, (*run.rows[k, i], RADIUS[i], MASS[i]))) for i in range(len(RADIUS))
        ]
    path.write_text("\n".join(made) + "\n")


def yade(path: Path, run: Run, _: str = "f8") -> None:
    path.mkdir()
    for k, step in enumerate(run.step):
        made = ["#format x_y_z_r_attrs", "# x y z r vx vy vz omegax omegay omegaz mass"]
        for i in range(len(RADIUS)):
            made.append("\t".join(f"{each:g}" for each in (*run.x[k, i], RADIUS[i], *run.rows[k, i, 3:], MASS[i])))
        (path / f"{step}.txt").write_text("\n".join(made) + "\n")


def netcdf(path: Path, run: Run, kind: str = "f8", form: str = "NETCDF3_64BIT_DATA") -> None:
    import netCDF4

    with netCDF4.Dataset(path, "w", format=form) as data:
        for name, size in (("frame", None), ("atom", len(RADIUS)), ("spatial", 3)):
            data.createDimension(name, size)
        data.program, data.Conventions = "LAMMPS", "AMBER"
        time = data.createVariable("time", kind, ("frame",))
        time.scale_factor = np.float32(DT)
        time.set_auto_scale(False)
        made = {name: data.createVariable(name, kind, ("frame", "spatial")) for name in ("cell_lengths", "cell_angles")}
        vectors = {
            name: data.createVariable(name, kind, ("frame", "atom", "spatial"))
            for name in ("coordinates", "velocities")
        }
        scalars = {name: data.createVariable(name, kind, ("frame", "atom")) for name in (*NAMES[6:], "radius", "mass")}
        number = data.createVariable("id", "i4", ("frame", "atom"))
        for k, step in enumerate(run.step):
            time[k], number[k], made["cell_lengths"][k], made["cell_angles"][k] = (
                step,
                np.arange(1, len(RADIUS) + 1),
                0.0,
                90.0,
            )
            vectors["coordinates"][k], vectors["velocities"][k] = run.x[k], run.v[k]
            for c, name in enumerate(NAMES[6:]):
                scalars[name][k] = run.omega[k, :, c]
            scalars["radius"][k], scalars["mass"][k] = RADIUS, MASS


def netcdf_in_hdf5(path: Path, run: Run, kind: str = "f8") -> None:
    netcdf(path, run, kind, "NETCDF4")


def gsd(
    path: Path,
    run: Run,
    _: str = "f4",
    leave_out: tuple[str, ...] = (),
    once: tuple[str, ...] = (),
    change: Callable[[Any, int], None] | None = None,
) -> None:
    """``leave_out``: chunks that no frame stores; ``once``: that the first alone stores; ``change`` is called with each frame."""
    import gsd.hoomd

    inertia = 0.4 * MASS * RADIUS**2
    rng = np.random.default_rng(3)
    turned = rng.normal(size=(len(RADIUS), 4))
    q = turned / np.sqrt((turned**2).sum(axis=1))[:, None]
    with gsd.hoomd.open(path, "w") as file:
        for k, step in enumerate(run.step):
            frame = gsd.hoomd.Frame()
            frame.configuration.step = step
            spin = run.omega[k] * inertia[:, None]
            # L in space is q S q*, and HOOMD keeps 2 q S = 2 L q.
            w, v = q[:, 0], q[:, 1:]
            momentum = 2.0 * np.column_stack([-(spin * v).sum(axis=1), w[:, None] * spin + np.cross(spin, v)])
            chunks: dict[str, Any] = {
                "position": run.x[k], "velocity": run.v[k], "mass": MASS, "diameter": 2.0 * RADIUS, "orientation": q,
                "moment_inertia": np.column_stack([inertia] * 3), "angmom": momentum, "typeid": [0] * len(RADIUS),
            }  # fmt: skip
            frame.particles.N, frame.particles.types = len(RADIUS), ["grain"]
            for name, values in chunks.items():
                if name not in leave_out and (k == 0 or name not in once):
                    setattr(frame.particles, name, values)
            if change is not None:
                change(frame, k)
            file.append(frame)


def h5md(path: Path, run: Run, kind: str = "f8", change: Callable[[Any], None] | None = None) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file.create_group("h5md").attrs["version"] = (1, 1)
        group = file.create_group("particles/all")
        box = group.create_group("box")
        box.attrs["dimension"], box.attrs["boundary"] = 3, [b"none"] * 3
        for name, values in (("position", run.x), ("velocity", run.v), ("angular_velocity", run.omega)):
            element = group.create_group(name)
            element["value"], element["step"], element["time"] = values.astype(kind), run.step, run.t
        group["mass"], group["radius"], group["id"] = MASS, RADIUS, np.arange(1, len(RADIUS) + 1)
        if change is not None:
            change(group)


def vtk_raw(path: Path, run: Run, kind: str = "f8", order: str = "<", *, appended: bool = True) -> None:
    """A folder of .vtp, arrays raw behind the XML or in base 64 within it."""
    path.mkdir()
    named = {"Points": run.x, "velocity": run.v, "omega": run.omega}
    fixed = {"radius": RADIUS, "mass": MASS, "id": np.arange(1.0, len(RADIUS) + 1.0)}
    word = {"f8": "Float64", "f4": "Float32"}[kind]
    for k, step in enumerate(run.step):
        head, body = "", b""
        for name, values in {**{name: each[k] for name, each in named.items()}, **fixed}.items():
            raw = np.ascontiguousarray(values, dtype=order + kind).tobytes()
            packed = struct.pack(order + "I", len(raw)) + raw
            parts = 3 if values.ndim == 2 else 1
            place = f'format="appended" offset="{len(body)}"/>' if appended else (
                'format="binary">' + base64.b64encode(packed).decode() + "</DataArray>"
            )  # fmt: skip
            array = f'<DataArray type="{word}" Name="{name}" NumberOfComponents="{parts}" {place}'
            head += f"<Points>{array}</Points><PointData>" if name == "Points" else array
            body += packed
        text = f'<VTKFile type="PolyData" byte_order="{"LittleEndian" if order == "<" else "BigEndian"}" header_type="UInt32">'
        text += f'<PolyData><Piece NumberOfPoints="{len(RADIUS)}">{head}</PointData></Piece></PolyData>'
        tail = b'<AppendedData encoding="raw">_' + body + b"</AppendedData></VTKFile>" if appended else b"</VTKFile>"
        (path / f"frame-{step:06d}.vtp").write_bytes(text.encode() + tail)


def vtk_inline(path: Path, run: Run, kind: str = "f8", order: str = "<") -> None:
    vtk_raw(path, run, kind, order, appended=False)


def vtk_text(path: Path, run: Run, _: str = "f8") -> None:
    """A folder of legacy .vtk in text."""
    path.mkdir()
    n = len(RADIUS)
    for k, step in enumerate(run.step):
        made = ["# vtk DataFile Version 3.0", f"step {step}", "ASCII", "DATASET POLYDATA", f"POINTS {n} double"]
        made += [" ".join(map(_printed, row)) for row in run.x[k]]
        made += [f"VERTICES {n} {2 * n}", *[f"1 {i}" for i in range(n)], f"POINT_DATA {n}"]
        for name, values in (("velocity", run.v[k]), ("omega", run.omega[k])):
            made += [f"VECTORS {name} double", *[" ".join(map(_printed, row)) for row in values]]
        for name, values in (("radius", RADIUS), ("mass", MASS), ("id", np.arange(1.0, n + 1.0))):
            made += [f"SCALARS {name} double 1", "LOOKUP_TABLE default", *map(_printed, values)]
        (path / f"frame-{step:06d}.vtk").write_text("\n".join(made) + "\n")


def npz(path: Path, run: Run, kind: str = "f8") -> None:
    arrays = {"x": run.x, "v": run.v, "omega": run.omega}
    np.savez(path, t=run.t, radius=RADIUS, mass=MASS, **{name: each.astype(kind) for name, each in arrays.items()})


def parquet(path: Path, run: Run, kind: str = "f8") -> None:
    import pandas as pd

    n, frames = len(RADIUS), len(run.t)
    columns = {name: run.rows[:, :, c].ravel().astype(kind) for c, name in enumerate(NAMES)}
    fixed = {
        "t": np.repeat(run.t, n),
        "id": np.tile(np.arange(1, n + 1), frames),
        "radius": np.tile(RADIUS, frames),
        "mass": np.tile(MASS, frames),
    }
    pd.DataFrame({**fixed, **columns}).to_parquet(path)


SPLIT = (slice(0, 1), slice(1, 4))
"""Bodies of two processes, which swap places from frame to frame."""


def vtk_pieces(path: Path, run: Run, _: str = "f8", ghosts: bool = False, ids: bool = True) -> None:
    """A folder of .pvtp, each with two pieces; ``ghosts``: the second one repeats a body of the first one, marked and misplaced."""
    path.mkdir()
    for k, step in enumerate(run.step):
        names = []
        for p, part in enumerate(SPLIT if k % 2 else SPLIT[::-1]):
            rows = np.arange(len(RADIUS))[part]
            marks = np.zeros(len(rows), dtype=int)
            if ghosts and p == 1:
                rows, marks = (
                    np.append(rows, np.arange(len(RADIUS))[(SPLIT[::-1] if k % 2 else SPLIT)[1]][0]),
                    np.append(marks, 1),
                )
            arrays: dict[str, Any] = {
                "Points": run.x[k],
                "velocity": run.v[k],
                "omega": run.omega[k],
                "radius": RADIUS,
                "mass": MASS,
            }
            if ids:
                arrays["id"] = np.arange(1, len(RADIUS) + 1)
            body = ""
            for name, values in arrays.items():
                chosen = values[rows] + (7.0 * marks[:, None] if name == "Points" else 0)
                numbers, width = " ".join(map(_printed, chosen.ravel())), 3 if chosen.ndim == 2 else 1
                array = f'<DataArray type="Float64" Name="{name}" NumberOfComponents="{width}" format="ascii">{numbers}</DataArray>\n'
                body += f"<Points>{array}</Points><PointData>" if name == "Points" else array
            if ghosts:
                body += f'<DataArray type="UInt8" Name="vtkGhostType" format="ascii">{" ".join(map(str, marks))}</DataArray>'
            names.append(f"frame-{step:06d}_{p}.vtp")
            text = (
                f'<VTKFile type="PolyData"><PolyData>\n<Piece NumberOfPoints="{len(rows)}">{body}</PointData></Piece>\n'
            )
            (path / names[-1]).write_text(text + "</PolyData></VTKFile>\n")
        pieces = "".join(f'<Piece Source="{name}"/>\n' for name in names)
        (path / f"frame-{step:06d}.pvtp").write_text(
            f'<VTKFile type="PPolyData"><PPolyData>\n{pieces}</PPolyData></VTKFile>\n'
        )


def vtkhdf(path: Path, run: Run, kind: str = "f8", change: Callable[[Any], None] | None = None) -> None:
    """Two parts a step; masses and radii are stored once."""
    import h5py

    n, frames = len(RADIUS), len(run.t)
    orders = [np.concatenate([np.arange(n)[part] for part in (SPLIT if k % 2 else SPLIT[::-1])]) for k in range(frames)]
    with h5py.File(path, "w") as file:
        group = file.create_group("VTKHDF")
        group.attrs["Version"], group.attrs["Type"] = (2, 2), np.bytes_("PolyData")
        group["NumberOfPoints"] = np.concatenate([(1, 3) if k % 2 else (3, 1) for k in range(frames)])

        def flat(values: FloatArray) -> FloatArray:
            return np.concatenate([values[k, order] for k, order in enumerate(orders)]).astype(kind)

        group["Points"] = flat(run.x)
        data = group.create_group("PointData")
        data["velocity"], data["omega"] = flat(run.v), flat(run.omega)
        both = [np.concatenate([np.arange(n)[part] for part in parts]) for parts in (SPLIT[::-1], SPLIT)]
        for name, values in (("radius", RADIUS), ("mass", MASS), ("id", np.arange(1, n + 1))):
            data[name] = np.concatenate([values[order] for order in both])
        steps = group.create_group("Steps")
        steps.attrs["NSteps"] = frames
        steps["Values"], steps["PartOffsets"], steps["NumberOfParts"] = run.t, 2 * np.arange(frames), np.full(frames, 2)
        steps["PointOffsets"] = n * np.arange(frames)
        offsets = steps.create_group("PointDataOffsets")
        for name in ("radius", "mass", "id"):
            offsets[name] = n * (np.arange(frames) % 2)
        if change is not None:
            change(group)


def mercury(path: Path, run: Run, _: str = "f8") -> None:
    """As MercuryDPM's documentation has it: places with 15 digits, the rest with 10."""
    made = []
    for k, t in enumerate(run.t):
        made.append(f"{len(RADIUS)} {t:.10g} -9 -9 -9 9 9 9 ")
        for i in range(len(RADIUS)):
            rest = (*run.v[k, i], RADIUS[i], 0.1, -0.2, 0.3, *run.omega[k, i])
            made.append(" ".join([f"{each:.15g}" for each in run.x[k, i]] + [f"{each:.10g}" for each in rest] + ["0"]))
    path.write_text("\n".join(made) + "\n")


FORMATS: dict[str, tuple[str, Callable[..., None]]] = {
    "dump": ("run.dump", dump), "yaml": ("run.yaml", yaml), "csv": ("run.csv", table), "extxyz": ("run.extxyz", extxyz),
    "yade": ("frames", yade), "netcdf": ("run.nc", netcdf), "netcdf-hdf5": ("run.nc", netcdf_in_hdf5), "gsd": ("run.gsd", gsd),
    "h5md": ("run.h5", h5md), "vtk-raw": ("frames", vtk_raw), "vtk-inline": ("frames", vtk_inline), "vtk-text": ("frames", vtk_text),
    "vtk-pieces": ("frames", vtk_pieces), "vtkhdf": ("run.vtkhdf", vtkhdf), "mercury": ("run.data", mercury),
    "npz": ("run.npz", npz), "parquet": ("run.parquet", parquet),
}  # fmt: skip
"""Name -> file or folder, writer."""
