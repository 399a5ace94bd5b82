"""Reproduce faults that were found from outside, one after the other: what is found now beside what is right.

    python tools/reproduce_faults.py            all of them, some minutes
    python tools/reproduce_faults.py D1 R1      these alone
    python tools/reproduce_faults.py --list     their names

Exits with 1 if any answer is wrong. Each fault also has its own test; this script shows all of them at a glance.
"""

from __future__ import annotations

import json
import math
import os
import stat
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core import (
    Cell,
    ContactLaw,
    CoreError,
    Disks,
    History,
    Numerics,
    Rolling,
    Scene,
    SphereLaw,
    Spheres,
    SphereScene,
    Wall,
    simulate,
)

Answer = tuple[bool, str]
"""Whether the answer is right, and what was found."""

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "docs" / "examples"
FAULTS: dict[str, tuple[str, Callable[[], Answer]]] = {}
FLOOR_LAW = ContactLaw(kn=1e6, ks=8e5, mu=0.3, beta=0.2)


def fault(name: str, right: str) -> Callable[[Callable[[], Answer]], Callable[[], Answer]]:
    """Register a reproduction with its right answer in words."""

    def register(function: Callable[[], Answer]) -> Callable[[], Answer]:
        FAULTS[name] = right, function
        return function

    return register


def ninedisk(*arguments: str, limit: float = 600.0, folder: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command line in its own process."""
    return subprocess.run(
        [sys.executable, "-m", "ninedisk", *arguments],
        capture_output=True, text=True, errors="replace", timeout=limit, check=False, cwd=folder,
    )  # fmt: skip


def disks_of(**fields: Any) -> Disks:
    """Disks of plain lists."""
    return Disks(**fields)


def spheres_of(**fields: Any) -> Spheres:
    """Spheres of plain lists."""
    return Spheres(**fields)


def run_attempt(scene: Scene | SphereScene, numerics: Numerics, **options: Any) -> tuple[str, History | None]:
    """First line of the error with which a run is refused, and no history; or no text and the history."""
    try:
        return "", simulate(scene, numerics, **options)
    except CoreError as error:
        return str(error).splitlines()[0], None


def refused(scene: Scene | SphereScene, numerics: Numerics, **options: Any) -> str:
    """The first line of the error with which a run is refused; empty if it is not."""
    return run_attempt(scene, numerics, **options)[0]


def is_faulty(source: str, old: str, new: str, folder: str) -> str:
    """Command of an example engine with one planted fault."""
    text = (EXAMPLES / source).read_text(encoding="utf-8")
    assert text.count(old) >= 1, f"{source} has no {old!r}"
    file = Path(folder, source)
    file.write_text(text.replace(old, new), encoding="utf-8")
    return f"{sys.executable} {file}"


# The core


@fault("D1", "slow bodies meet: gap -6e-9 R, velocities exchanged (0 and 1), in the plane and in space")
def _slow_bodies() -> Answer:
    radius, dt, u = 0.5, 1e-4, 4.5e-10
    numerics = Numerics(dt=3.5e6 * dt, n_steps=20, contact_dt=dt)
    plane = disks_of(x=[(0, 0), (2.051 * radius, 0)], v=[(u / dt, 0), (0, 0)], radius=radius, mass=1.0)
    space = spheres_of(x=[(0, 0, 0), (2.051 * radius, 0, 0)], v=[(u / dt, 0, 0), (0, 0, 0)], radius=radius, mass=1.0)
    speeds = []
    for scene in (
        Scene(disks=plane, disk_disk=ContactLaw(kn=1e6)),
        SphereScene(spheres=space, sphere_sphere=SphereLaw(kn=1e6)),
    ):
        v = simulate(scene, numerics).v[-1, :, 0] * dt / u
        speeds += [float(each) for each in v]
    found = ", ".join(f"{speed:.4g}" for speed in speeds)
    return bool(np.allclose(speeds, [0.0, 1.0, 0.0, 1.0], atol=1e-3)), f"final velocities over the first: {found}"


@fault("D2", "a critical step that falls on the way is refused, where going on gains energy")
def _critical_step_during_run() -> Answer:
    # Disks that fall loosely into a box, where each has more contacts than at the start.
    k = np.arange(60)
    law = ContactLaw(kn=1e5, ks=5e4, mu=0.5, beta=0.1)
    scene = Scene(
        disks=disks_of(x=np.column_stack([2.02 * (k % 6) + 0.1 * np.cos(k * k), 1.2 + 2.2 * (k // 6)]), radius=1.0, mass=1.0),
        walls=(
            Wall(name="floor", point=(0, 0), normal=(0, 1), law=law),
            Wall(name="left", point=(-1.2, 0), normal=(1, 0), law=law),
            Wall(name="right", point=(11.5, 0), normal=(-1, 0), law=law),
        ),
        disk_disk=law, gravity=(0.0, -50.0),
    )  # fmt: skip
    from ninedisk.core.dem.session import DemSession

    step = 0.95 * DemSession(scene, Numerics(dt=1e-3, n_steps=1)).critical_dt
    numerics = Numerics(dt=step, contact_dt=step, n_steps=2000, sample_every=10)
    message = refused(scene, numerics)
    energy = simulate(scene, numerics.replace(allow_unstable=True)).energy
    total = energy["kinetic"] + energy["elastic"] + energy["gravity"]
    gain = float((np.maximum.accumulate(total[::-1])[::-1][1:] - total[:-1]).max())
    return bool(message), f"{message or 'runs'}; unlooked at, energy grows by up to {gain:.3g} of {total[0]:.3g} J"


@fault("D3", "the energy budget closes with every lever arm")
def _budget() -> Answer:
    worst = {}
    for arm in ("radius", "overlap", "torque-overlap"):
        residuals = []
        for dt in (2e-5, 1e-5):
            law = ContactLaw(kn=1e4, ks=8e3, mu=0.2, lever_arm=arm)
            disks = disks_of(
                x=[(0, 0), (0.98, 0.1)], v=[(1, 0), (-1, 0.5)], omega=[5.0, -3.0], radius=[0.5, 0.5], mass=[1.0, 2.0]
            )
            history = simulate(
                Scene(disks=disks, disk_disk=law),
                Numerics(dt=dt, n_steps=round(0.05 / dt), contact_dt=dt, energy_budget=True),
            )
            e = history.energy
            total = e["kinetic"] + e["elastic"] + sum(series for name, series in e.items() if name.endswith("_loss"))
            residuals.append(float(np.abs(total - total[0]).max() / e["kinetic"][0]))
        worst[arm] = residuals
    text = "; ".join(f"{arm} {one:.2g} -> {two:.2g} at half the step" for arm, (one, two) in worst.items())
    return all(two < 1e-4 and (two < 0.6 * one or two < 1e-12) for one, two in worst.values()), text


@fault("D4", "the default contact step of spheres holds rolling springs: no error, or one about what was given")
def _rolling_step() -> Answer:
    found = []
    for kr in (10.0, 1.0):
        law = SphereLaw(kn=2e4, ks=1e4, mu=0.5, rolling=Rolling(model="elastic-plastic", mu=0.1, kr=kr))
        spheres = spheres_of(x=[(0, 0, 0), (1.999e-3, 0, 0)], omega=[(0, 1, 0), (0, 0, 0)], radius=1e-3, mass=1e-5)
        scene = SphereScene(spheres=spheres, sphere_sphere=law)
        found.append(refused(scene, Numerics(dt=1e-6, n_steps=10)))
    return not any(found), "; ".join(text or "runs" for text in found)


@fault("D5", "equal centres of spheres: an error of the core that names both")
def _equal_centres() -> Answer:
    spheres = spheres_of(x=[(0, 0, 0), (5, 0, 0), (0, 0, 0)], radius=1.0, mass=1.0)
    try:
        simulate(SphereScene(spheres=spheres, sphere_sphere=SphereLaw(kn=1e4)), Numerics(dt=1e-3, n_steps=2))
    except CoreError as error:
        return "0" in str(error) and "2" in str(error), str(error)
    except ValueError as error:
        return False, f"ValueError: {error}"
    return False, "no error"


@fault("D6", "the same collision at lengths of 1e-30, 1 and 1e30 m, or a refusal")
def _scales() -> Answer:
    found = []
    for scale in (2.0**-100, 2.0**-72, 1.0, 2.0**100):
        disks = disks_of(x=[(0, 0), (7.0 * scale, 0)], v=[(scale, 0), (0, 0)], radius=scale, mass=1.0)
        scene, numerics = Scene(disks=disks, disk_disk=ContactLaw(kn=1e4)), Numerics(dt=1e-2, n_steps=600)
        message, history = run_attempt(scene, numerics)
        found.append(message if history is None else f"{float(history.v[-1, 1, 0]) / scale:.6f}")
    return len(set(found) - {message for message in found if " " in message}) == 1, ", ".join(found)


@fault("D7", "two disks at rest on a floor at y = -1e6: 19.62 N at most a percent off, or a refusal")
def _far_away() -> Answer:
    found, right = [], True
    for sliding in ("associated", "coulomb"):
        law = ContactLaw(kn=1e9, mu=0.3, regularised=True)
        scene = Scene(
            disks=disks_of(x=[(0, -1e6 + 0.5), (0, -1e6 + 1.5)], radius=0.5, mass=1.0),
            walls=(Wall(name="floor", point=(0, -1e6), normal=(0, 1), law=law),), disk_disk=law, gravity=(0.0, -9.81),
        )  # fmt: skip
        message, history = run_attempt(
            scene, Numerics(dt=1e-6, n_steps=50, sliding=sliding), watch=[(0, 2)], method="cd"
        )
        force = math.nan if history is None else float(np.abs(history.fn[1:, 0] - 19.62).max())
        right &= bool(message) or force < 0.2
        found.append(message or f"off by at most {force:.3g} N")
    return right, "; ".join(found)


@fault("N1", "law.py says that the lever arm 'radius' does not keep angular momentum")
def _angular_momentum() -> Answer:
    text = (ContactLaw.__doc__ or "").split("lever_arm :")[1].split("wall_velocity_at :")[0]
    return "angular momentum" in text, "said" if "angular momentum" in text else "not said"


@fault("N2", "a packing whose upper half is 1e6 times heavier is solved, and its walls bear the weight")
def _heavy_on_light() -> Answer:
    law = ContactLaw(kn=1e8, ks=1e8, mu=0.4, restitution=0.0, regularised=True)
    x = [(0.5 + k, 0.5 + row) for row in range(8) for k in range(6)]
    mass = np.where(np.array(x)[:, 1] > 4.0, 1e6, 1.0)
    sides = (("floor", (0.0, 0.0), (0.0, 1.0)), ("left", (0.0, 0.0), (1.0, 0.0)), ("right", (6.0, 0.0), (-1.0, 0.0)))
    scene = Scene(
        disks=disks_of(x=x, radius=0.5, mass=mass),
        disk_disk=law,
        walls=tuple(Wall(name=name, point=point, normal=normal, law=law) for name, point, normal in sides),
        gravity=(0.0, -9.81),
    )
    numerics = Numerics(dt=1e-3, n_steps=3, sliding="coulomb")
    message, history = run_attempt(scene, numerics, method="cd")
    if history is None:
        return False, message
    share = abs(float(history.wall_force[-1, :, 1].sum())) / (9.81 * float(mass.sum()))
    return abs(share - 1.0) < 1e-8, f"walls bear {share:.9f} of the weight"


@fault("R2", "a disk that touches its own image: stress kn (2R - L)/Ly")
def _own_image() -> Answer:
    kn, edge, height = 1e5, 1.9, 5.0
    scene = Scene(
        disks=disks_of(x=[(0.3, 0.2)], radius=1.0, mass=1.0),
        disk_disk=ContactLaw(kn=kn),
        cell=Cell(size=(edge, height)),
    )
    message, history = run_attempt(scene, Numerics(dt=1e-5, n_steps=2))
    if history is None or (stress := history.stress) is None:
        return False, message or "no stress"
    found, right = float(stress[0, 0, 0, 0]), kn * (2.0 - edge) / height
    return abs(found - right) < 1e-9 * right, f"{found:.9g} N/m, right {right:.9g}"


@fault("R5", "a disk that moves by several radii in a step rebounds, passes nothing unseen, or is refused")
def _fast() -> Answer:
    found, right = [], True
    for speed in (1e3, 1e5):
        disks = disks_of(x=[(0, 0), (10.0, 0.0)], v=[(speed, 0), (0, 0)], radius=0.5, mass=1.0)
        message, history = run_attempt(Scene(disks=disks, disk_disk=ContactLaw(kn=1e4)), Numerics(dt=1e-3, n_steps=30))
        gain = 0.0 if history is None else float((history.v[-1] ** 2).sum() / speed**2 - 1.0)
        passed = history is not None and float(history.v[-1, 1, 0]) == 0.0
        right &= not passed and abs(gain) < 1e-3
        found.append(message or f"energy {gain:+.2%}, {'passed through' if passed else 'met'}")
    return right, "; ".join(found)


@fault("R6", "a polygon whose last point repeats the first: accepted, or an error that says so")
def _polygon() -> Answer:
    from ninedisk.core.nurbs.shapes import polygon

    try:
        polygon([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)])
    except CoreError as error:
        return "last" in str(error) and "first" in str(error), str(error)
    return True, "accepted"


@fault("R10", "friction without ks, and a restitution that the theta scheme does not have, are refused or used")
def _silent_laws() -> Answer:
    disks = disks_of(x=[(0, 0), (1.9, 0)], v=[(1, 1), (0, 0)], radius=1.0, mass=1.0)
    smooth = refused(Scene(disks=disks, disk_disk=ContactLaw(kn=1e4, mu=0.5)), Numerics(dt=1e-3, n_steps=5))
    apart = disks_of(x=[(0, 0), (2.1, 0)], v=[(1, 0), (0, 0)], radius=1.0, mass=1.0)
    scene = Scene(disks=apart, disk_disk=ContactLaw(kn=1e6, restitution=0.8, regularised=True))
    plastic, history = run_attempt(scene, Numerics(dt=0.01, n_steps=40), method="cd")
    if history is not None:
        e = float(history.v[-1, 1, 0] - history.v[-1, 0, 0])
        plastic = f"e = {e:.3g}" if abs(e - 0.8) < 0.01 else ""
    return bool(
        smooth and plastic
    ), f"mu without ks: {smooth or 'silent'}; restitution: {plastic or 'silently plastic'}"


@fault("D8", "docs/explanation/convergence.md: the sphere leaves at 67.8 degrees (closed form)")
def _departure() -> Answer:
    text = (ROOT / "docs" / "explanation" / "convergence.md").read_text(encoding="utf-8")
    return "120 degrees" not in text and "67.8" in text, "67.8 named" if "67.8" in text else "not named"


# Judging


@fault("J1", "a reversed friction torque is not green in the steps of the action")
def _false_green() -> Answer:
    with tempfile.TemporaryDirectory() as folder:
        command = is_faulty("spring_dem.py", "load[body][2] += arm * fs", "load[body][2] -= arm * fs", folder)
        checked = ninedisk("check-engine", "--engine-cmd", command)
        ran = ninedisk(
            "run",
            "slip-to-roll",
            "rolling/incline-disk",
            "--engine-cmd",
            command,
            "--store",
            str(Path(folder, "store")),
        )
        none = ninedisk("run", "slip-to-roll", "--engine", "esys-particle", "--store", str(Path(folder, "other")))
    codes = checked.returncode, ran.returncode, none.returncode
    return all(codes), "check-engine ends with {}, run with {}, run of an engine that is not installed with {}".format(
        *codes
    )


@fault("C1", "every disk with the mass of disk 0, or its inertia, or its weight: caught by run")
def _equal_masses() -> Answer:
    plants = {
        "mass": [("/ m[i] for k in (0, 1)", "/ m[0] for k in (0, 1)")],
        "inertia": [('disks["inertia"][i]', 'disks["inertia"][0]')],
        "weight": [("for mass in m]", "for mass in [m[0]] * n]")],
        "effective mass": [("1.0 / m[i] + 1.0 / m[j]", "4.0 / (m[i] + m[j])")],
    }
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name, ((old, new),) in plants.items():
            command = is_faulty("spring_dem.py", old, new, folder)
            globs = ("binary-collision", "impact/*", "static/*", "chain/*", "rolling/*", "gas/*")
            ran = ninedisk(
                "run",
                *globs,
                "--engine-cmd",
                command,
                "--allow-unsupported",
                "--store",
                str(Path(folder, name)),
                "-j",
                "2",
            )
            found.append((name, ran.returncode))
    return all(code == 1 for _, code in found), ", ".join(f"{name}: exit {code}" for name, code in found)


# Output and robustness


@fault("R1", "--json into a FIFO writes into it; a link stays a link")
def _not_regular() -> Answer:
    with tempfile.TemporaryDirectory() as folder:
        pipe, target, link, got = Path(folder, "pipe"), Path(folder, "target"), Path(folder, "link"), []
        os.mkfifo(pipe)
        target.write_text("[]", encoding="utf-8")
        link.symlink_to(target)
        reader = threading.Thread(target=lambda: got.append(pipe.read_text(encoding="utf-8")), daemon=True)
        reader.start()
        run = (
            "run",
            "binary-collision",
            "--engine",
            "dem",
            "--set",
            "kind=elastic",
            "--store",
            str(Path(folder, "store")),
        )
        ninedisk(*run, "--json", str(pipe))
        reader.join(5.0)
        ninedisk(*run, "--json", str(link))
        fifo = stat.S_ISFIFO(pipe.stat().st_mode) and bool(got) and bool(json.loads(got[0]))
        kept = link.is_symlink() and bool(json.loads(target.read_text(encoding="utf-8")))
    return (
        fifo and kept,
        f"FIFO {'written into' if fifo else 'replaced or empty'}, link {'kept' if kept else 'replaced'}",
    )


@fault("R8", "a closed pipe changes no exit code, three times out of three")
def _closed_pipe() -> Answer:
    codes = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(3):
            command = f"{sys.executable} -m ninedisk run binary-collision --engine dem --store {folder}/{k}"
            shell = f"set -o pipefail; {command} | head -1 >{os.devnull}; echo ${{PIPESTATUS[0]}}"
            codes.append(
                subprocess.run(["bash", "-c", shell], capture_output=True, text=True, check=False).stdout.strip()
            )
    return set(codes) == {"0"}, f"exit codes {', '.join(codes)}"


@fault("O1", "run prints value and expected of a check that fails")
def _value_and_expected() -> Answer:
    with tempfile.TemporaryDirectory() as folder:
        command = is_faulty("spring_dem.py", "load[body][2] += arm * fs", "load[body][2] -= arm * fs", folder)
        text = ninedisk(
            "run", "slip-to-roll", "--engine-cmd", command, "--store", folder + "/s", "--allow-unsupported"
        ).stdout
    head = next((line for line in text.splitlines() if "quantity" in line), "")
    return "expected" in head and ("value" in head or "found" in head), head.strip() or "no table"


@fault("O3", "findings lists what is known without a stored run")
def _findings() -> Answer:
    with tempfile.TemporaryDirectory() as folder:
        run = ninedisk("findings", folder=folder)
    return run.returncode == 0 and len(
        run.stdout.splitlines()
    ) > 10, f"exit {run.returncode}, {len(run.stdout.splitlines())} lines"


def main(arguments: list[str]) -> int:
    """Run the named faults, all without names."""
    if "--list" in arguments:
        for name, (right, _) in FAULTS.items():
            print(f"{name:4} {right}")
        return 0
    unknown = [name for name in arguments if name not in FAULTS]
    if unknown:
        print(f"no fault is named {unknown[0]!r}; known: {', '.join(FAULTS)}", file=sys.stderr)
        return 2
    wrong = []
    for name in arguments or FAULTS:
        right, function = FAULTS[name]
        begin = time.perf_counter()
        try:
            ok, found = function()
        except Exception as error:  # a reproduction that ends in an error is a wrong answer, not the end of the others
            ok, found = False, f"{type(error).__name__}: {error}"
        wrong += [] if ok else [name]
        print(f"{'right' if ok else 'WRONG'} {name:4} wanted: {right}", flush=True)
        print(f"           found:  {found} ({time.perf_counter() - begin:.0f} s)", flush=True)
    print(f"{len(arguments or FAULTS) - len(wrong)} right, {len(wrong)} wrong{': ' if wrong else ''}{', '.join(wrong)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
