"""Contact laws by files: paths of two spheres to follow, and what came back held against closed forms.

The forces expected are those of `ninedisk.references.analytic.contact.two_sphere_motions`. Where codes differ by convention, each is tried.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.archive import make_folder
from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.audit.geometry import norm
from ninedisk.harness.audit.readers.columns import numbers_of
from ninedisk.harness.results.whole_file import write_whole
from ninedisk.references.analytic.contact.two_sphere_motions import END, MOTIONS, PairForces, pair_forces, pair_path

STEPS = 3200
"""Rows of a path; a code that advances with them errs by one step's slip at most, below half of what the arms differ by."""
LEAST_ROWS = 200
DRAWN = 300
"""Instants of a motion that a record keeps for its figure."""
DIGITS = 1e-5
"""Allowance for printed digits, over the largest force: six digits and their sums."""
HOLDS, VIOLATED, UNDECIDED = "holds", "violated", "not decidable"

LAW = {"radius": 1.0, "overlap": 0.05, "kn": 1e7, "ks": 5e6, "mu": 0.5, "dashpot": 2e6}
CONVENTIONS: dict[str, tuple[Any, ...]] = {
    "torque_arm": ("overlap", "radius"),
    "slip_arm": ("overlap", "radius"),
    "spring_turned": (True, False),
    "spring_twisted": (True, False),
    "spring_cut": (True, False),
    "tension": (False, True),
}
"""Conventions and their values; see `pair_forces`. ``torque_arm`` is the arm of the torque."""
EITHER = ("torque_arm", "slip_arm", "spring_twisted")
"""Conventions of which a law that declares none may have either; of the others the first is expected."""
_TURNS: tuple[dict[str, Any], ...] = (
    {"spring_turned": True, "slip_arm": "overlap"}, {"spring_turned": False, "slip_arm": "overlap"},
    {"spring_turned": True, "slip_arm": "radius"},
)  # fmt: skip
TRIED: dict[str, tuple[dict[str, Any], ...]] = {
    "shear-elastic": ({},),
    "shear-plastic": ({"spring_cut": True}, {"spring_cut": False}),
    "rotation-in-plane": _TURNS,
    "rotation-out-of-plane": _TURNS,
    "twist": ({"spring_twisted": True}, {"spring_twisted": False}),
    "spin": ({"slip_arm": "overlap"}, {"slip_arm": "radius"}),
    "viscous": ({"tension": False}, {"tension": True}),
    "unloading": ({"spring_cut": True}, {"spring_cut": False}),
}
"""Conventions that each motion shows. With the arm R a pair that turns as one body slips."""
WORDS = {
    ("torque_arm", "overlap"): "torques have the arm R less half the overlap",
    ("torque_arm", "radius"): "torques have the arm R, which does not conserve angular momentum",
    ("slip_arm", "overlap"): "spins slip at the arm R less half the overlap",
    ("slip_arm", "radius"): "spins slip at the arm R",
    ("spring_turned", True): "the shear spring turns with the normal",
    ("spring_turned", False): "the shear spring does not turn with the normal",
    ("spring_twisted", True): "the shear spring turns about the normal with the mean spin",
    ("spring_twisted", False): "the shear spring does not turn about the normal",
    ("spring_cut", True): "the shear spring is cut where friction limits the force",
    ("spring_cut", False): "the shear spring goes on while friction limits the force",
    ("tension", False): "the dashpot does not pull",
    ("tension", True): "the dashpot pulls",
}
NEEDED = ("t", "fx", "fy", "fz")
TORQUES = tuple(f"tq{k}{axis}" for k in (1, 2) for axis in "xyz")

TOML = """\
# Parameters of the law that your code is to have, and what it declares. Read by: ninedisk law-test judge DIR
[law]
radius = 1.0      # [m] of both spheres
overlap = 0.05    # [m] at the start
kn = 1e7          # [N/m] normal stiffness, linear
ks = 5e6          # [N/m] shear stiffness, linear, no dashpot
mu = 0.5          # Coulomb friction
dashpot = 2e6     # [N s/m] normal dashpot of the motion "viscous" alone; 0 in the others

[conventions]     # uncomment what your code documents: it is then held to it
# torque_arm = "overlap"     # arm R less half the overlap, or "radius"
# slip_arm = "overlap"       # the same of the slip by spins
# spring_turned = true       # the shear spring turns with the normal
# spring_twisted = true      # the shear spring turns about the normal with the mean spin
# spring_cut = true          # the shear spring is cut where friction limits the force
# tension = false            # the dashpot may pull
"""
README = """\
# A contact-law test

Each `NAME.csv` prescribes the motion of two spheres: `t` [s], positions `x1 y1 z1 x2 y2 z2` [m], velocities `vx1 .. vz2` [m/s], spins
`wx1 .. wz2` [rad/s], orientations `q1w .. q2z` (unit quaternions, from the body's frame to space). Nothing else acts. `law.toml` has the
parameters of the contact.

Move the spheres along each path, with its rows as steps or finer ones. Write `NAME.forces.csv` beside it, with a line of names and these
columns, in at least 200 rows up to the end:

| column | meaning |
|---|---|
| `t` | time of the row [s], that of the positions which make the force |
| `fx, fy, fz` | contact force on the first sphere [N] |
| `tq1x, tq1y, tq1z` | torque of the contact on the first sphere [N m]; optional |
| `tq2x, tq2y, tq2z` | the same on the second; optional |

Then run `ninedisk law-test judge DIR`. `--only MOTION` leaves out motions without forces, `--out PAGE` writes a page.

| motion | what it shows |
|---|---|
| shear-elastic, shear-plastic | stiffness, limit of friction, unloading |
| rotation-in-plane, rotation-out-of-plane | the pair turns as one body after a shear: the spring turns with the normal |
| twist | both spheres turn about the normal after a shear |
| spin | equal spins: arm of the slip |
| viscous | dashpot, and whether it pulls |
| unloading | a shear below friction, then less overlap and back |
"""


@dataclass(frozen=True)
class _Law:
    values: dict[str, float]
    declared: dict[str, Any]


def write_law_test(folder: Path) -> list[Path]:
    """Write the paths, ``README.md`` and, unless there is one, ``law.toml``; the files written.

    A ``law.toml`` that is there stays as it is. The paths follow its radius and overlap.

    Raises
    ------
    UsageError
        If the ``law.toml`` that is there is wrong, or a foreign ``README.md`` is there.
    UnwritableFileError, StoreError
        If the folder cannot be made or a file cannot be written.
    """
    readme = folder / "README.md"
    if readme.is_file() and not readme.read_bytes().startswith(README.partition("\n")[0].encode()):
        raise UsageError(f"DIR: {str(readme)!r} exists, and is not replaced: give another folder")
    make_folder(folder)
    given = folder / "law.toml"
    law = _read_law(given) if given.exists() else _Law(LAW, {})
    files = {"README.md": README} | ({} if given.exists() else {"law.toml": TOML})
    files |= {f"{motion}.csv": _path_text(motion, law) for motion in MOTIONS}
    for name, text in files.items():
        write_whole("DIR", folder / name, text)
    return [folder / name for name in files]


def _path_text(motion: str, law: _Law) -> str:
    """The table of a path."""
    t = np.linspace(0.0, END, STEPS + 1)
    still = np.zeros((len(t), 3))
    bodies = [f"{name}{axis}{k}" if name else f"{axis}{k}" for name in ("", "v", "w") for k in (1, 2) for axis in "xyz"]
    names = ["t", *bodies, *(f"q{k}{part}" for k in (1, 2) for part in "wxyz")]
    path = pair_path(motion=motion, radius=law.values["radius"], overlap=law.values["overlap"], t=t)
    half = 0.5 * norm(path.angle)
    turn = np.column_stack([np.cos(half), 0.5 * np.sinc(half / np.pi)[:, None] * path.angle])
    rows = np.column_stack([t, still, path.x, still, path.v, path.spin, path.spin, turn, turn])
    lines = [",".join(f"{value:.16g}" for value in row) for row in rows.tolist()]
    return "\n".join([",".join(names), *lines]) + "\n"


def _check_path(path: Path, law: _Law) -> None:
    """Refuse a path that is not the one of ``law.toml``: its forces would be judged by another motion."""
    if not path.exists():
        return
    table = _read_table(path, ("t", "x2", "y2", "z2"))
    radius, overlap = law.values["radius"], law.values["overlap"]
    expected = pair_path(motion=path.stem, radius=radius, overlap=overlap, t=table["t"]).x
    off = norm(np.column_stack([table[name] for name in ("x2", "y2", "z2")]) - expected)
    if len(wrong := np.flatnonzero(~(off <= DIGITS * overlap))):
        raise UsageError(
            f"{path}, line {wrong[0] + 2}: this is not the path for radius = {radius:g} and overlap = {overlap:g} of law.toml: run "
            f"`ninedisk law-test write {path.parent}`, and your code along the new paths"
        )


def _read_law(path: Path) -> _Law:
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(
            f"{str(path)!r} cannot be read ({getattr(error, 'strerror', None) or 'it is no UTF-8 text'}): `ninedisk law-test write DIR` "
            "writes one"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} is no TOML: {error}") from error
    tables = {"law": tuple(LAW), "conventions": tuple(CONVENTIONS)}
    for where, keys in {"": tuple(tables), **tables}.items():
        found = data if not where else data.get(where, {})
        if not isinstance(found, dict):
            raise UsageError(f"{path}: {where} must be a table, [{where}]")
        for key in found:
            if key not in keys:
                raise UsageError(
                    f"{path}: {where + '.' if where else ''}{key} is unknown: allowed are {', '.join(keys)}.{close_matches(key, keys)}"
                )
    values = {**LAW, **data.get("law", {})}
    declared = dict(data.get("conventions", {}))
    for key, value in declared.items():
        if not any(value is each or (isinstance(value, str) and value == each) for each in CONVENTIONS[key]):
            allowed = " or ".join(repr(each).lower().replace("'", '"') for each in CONVENTIONS[key])
            raise UsageError(f"{path}: conventions.{key} = {value!r} is not allowed: write {allowed}")
    try:
        for motion in MOTIONS:
            pair_forces(motion=motion, t=[0.0], **values)
    except ValueError as error:
        raise UsageError(f"{path}: law: {error}") from error
    return _Law({key: float(value) for key, value in values.items()}, declared)


def _read_table(path: Path, needed: tuple[str, ...], more: tuple[str, ...] = ()) -> dict[str, FloatArray]:
    """Columns over the whole motion; those in ``more`` may lack."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(
            f"{str(path)!r} cannot be read ({getattr(error, 'strerror', None) or 'it is no UTF-8 text'}): write a table with commas"
        ) from error
    names = [name.strip() for name in lines[0].split(",")] if lines else []
    torques = f", and for torques {', '.join(more)}" if more else ""
    if lacking := [name for name in needed if name not in names]:
        raise UsageError(
            f"{path}, line 1: there is no column {lacking[0]}: needed are {', '.join(needed)}{torques}, with commas between them"
        )
    if doubled := [name for name in names if names.count(name) > 1]:
        raise UsageError(f"{path}, line 1: the column {doubled[0]} appears twice: write it once")
    rows = [line + "\n" for line in lines[1:]]
    while rows and not rows[-1].strip():
        rows.pop()
    if len(rows) < LEAST_ROWS:
        raise UsageError(
            f"{path}: {len(rows)} rows of numbers; at least {LEAST_ROWS} are needed, over the whole motion"
        )
    table = numbers_of(rows, names, ",", path, 2)
    for name in (*needed, *(each for each in more if each in table)):
        if len(bad := np.flatnonzero(~(np.abs(table[name]) < 1e75))):
            raise UsageError(
                f"{path}, line {bad[0] + 2}: {name} = {table[name][bad[0]]:g}: it must be a finite number below 1e75"
            )
    t = table["t"]
    if len(back := np.flatnonzero(np.diff(t) <= 0.0)):
        raise UsageError(f"{path}, line {back[0] + 3}: t = {t[back[0] + 1]:g} after {t[back[0]]:g}: times must grow")
    wrong = np.flatnonzero((t < 0.0) | (t > END * (1.0 + 1e-6)))
    if len(wrong):
        raise UsageError(
            f"{path}, line {wrong[0] + 2}: t = {t[wrong[0]]:g} is not allowed: times of the path are 0 to {END:.6g} s"
        )
    if t[-1] < 0.98 * END or t[0] > 0.02 * END or np.diff(t).max() > 0.02 * END:
        raise UsageError(
            f"{path}: times from {t[0]:g} to {t[-1]:g} s, at most {np.diff(t).max():g} apart, leave out more than 2 % of the motion, which "
            f"takes {END:.6g} s"
        )
    table["t"] = np.minimum(t, END)
    return table


def judge_law_test(folder: Path, only: Sequence[str] = ()) -> dict[str, Any]:
    """Judge all forces in a folder.

    Parameters
    ----------
    folder : Path
    only : sequence of str
        Motions to judge; of all if empty.

    Returns
    -------
    dict
        ``checks``, each with id, verdict, said, value and allowance (the worst, in N or N m) and its t; ``conventions`` with what was
        declared, expected and found; ``law``; ``motions``, worst first, each with its ratio of error to allowance and its ``curves``: t,
        and by component what was returned and the closed form that fits best [N]; ``missing``, motions without forces.

    Raises
    ------
    UsageError
        Naming file, line, value, what is allowed.
    """
    if not folder.is_dir():
        raise UsageError(f"there is no folder {str(folder)!r}: `ninedisk law-test write DIR` writes one")
    if (unknown := next((motion for motion in only if motion not in MOTIONS), None)) is not None:
        raise UsageError(
            f"there is no motion {unknown!r}: motions are {', '.join(MOTIONS)}.{close_matches(unknown, MOTIONS)}"
        )
    law = _read_law(folder / "law.toml")
    wanted = [motion for motion in MOTIONS if not only or motion in only]
    present = [motion for motion in wanted if (folder / f"{motion}.forces.csv").exists()]
    if not present:
        raise UsageError(
            f"{str(folder)!r} has no forces: write {wanted[0]}.forces.csv and so on, with the columns of its README.md"
        )
    checks: list[dict[str, Any]] = []
    found: dict[str, list[Any]] = {key: [] for key in CONVENTIONS}
    for motion in present:
        _check_path(folder / f"{motion}.csv", law)
    tables = {motion: _read_table(folder / f"{motion}.forces.csv", NEEDED, TORQUES) for motion in present}
    motions: list[dict[str, Any]] = []
    for motion in wanted:
        if motion in tables:
            made, curves = _judge_motion(motion, tables[motion], law, found)
            checks += made
            ratio = max(check["value"] / check["allowance"] for check in made)
            motions.append({"id": motion, "ratio": ratio, "curves": curves})
        else:
            checks.append(_check(motion, UNDECIDED, f"there is no {motion}.forces.csv"))
    motions.sort(key=lambda motion: -float(motion["ratio"]))
    checks.append(_judge_torques(tables, law, found))
    shown = {}
    for key in CONVENTIONS:
        values = list(dict.fromkeys(found[key]))
        shown[key] = {
            "declared": law.declared.get(key),
            "accepted": list(_accepted(key, law)),
            "found": values[0] if len(values) == 1 and values[0] is not None else None,
            "said": "not shown"
            if not values
            else WORDS[key, values[0]]
            if len(values) == 1 and values[0] is not None
            else "no convention fits"
            if values == [None]
            else "motions differ",
        }
    return {
        "folder": str(folder), "law": law.values, "checks": checks, "conventions": shown, "motions": motions,
        "missing": [motion for motion in wanted if motion not in tables],
    }  # fmt: skip


def _accepted(key: str, law: _Law) -> tuple[Any, ...]:
    if key in law.declared:
        return (law.declared[key],)
    return CONVENTIONS[key] if key in EITHER else CONVENTIONS[key][:1]


def _check(
    name: str, verdict: str, said: str, value: float = 0.0, allowance: float = 0.0, t: float = 0.0
) -> dict[str, Any]:
    return {"id": name, "verdict": verdict, "said": said, "value": value, "allowance": allowance, "t": t}


def _worst(t: FloatArray, error: FloatArray, allowed: FloatArray) -> tuple[float, float, float]:
    """Largest error over its allowance: the error, the allowance and the time."""
    k = int(np.argmax(error / allowed))
    return float(error[k]), float(np.broadcast_to(allowed, error.shape)[k]), float(t[k])


def _expected(motion: str, law: _Law, t: FloatArray, conventions: Mapping[str, Any]) -> PairForces:
    return pair_forces(motion=motion, t=t, **{**law.values, **conventions})


def _judge_motion(
    motion: str, table: Mapping[str, FloatArray], law: _Law, found: dict[str, list[Any]]
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Normal force, shear force and the convention of one motion, and its curves."""
    t = table["t"]
    force = np.column_stack([table[f"f{axis}"] for axis in "xyz"])
    path = pair_path(motion=motion, radius=law.values["radius"], overlap=law.values["overlap"], t=t)
    n = path.x / norm(path.x)[:, None]
    fn = -(force * n).sum(axis=1)
    shear = force + fn[:, None] * n
    chosen = TRIED[motion]
    tried: list[dict[str, tuple[float, float, float]]] = []
    for conventions in chosen:
        expected = _expected(motion, law, t, conventions)
        digits = DIGITS * max(float(np.abs(expected.fn).max()), float(norm(expected.shear).max()))
        lag = _lag(motion, law, t, conventions)
        tried.append({
            "normal": _worst(t, np.abs(fn - expected.fn), lag.fn + digits),
            "shear": _worst(t, norm(shear - expected.shear), lag.shear + digits),
        })  # fmt: skip
    ratios = [max(error / allowed for error, allowed, _ in each.values()) for each in tried]
    best = int(np.argmin(ratios))
    fits = ratios[best] <= 1.0
    for key in {key for each in chosen for key in each}:
        found[key].append(chosen[best][key] if fits else None)
    wanted = [
        k for k, each in enumerate(chosen) if all(value in _accepted(key, law) for key, value in each.items())
    ] or list(range(len(chosen)))
    shown_as = min(wanted, key=lambda k: ratios[k])
    hint = ""
    if not fits:
        nearest = _expected(motion, law, t, chosen[best])
        scale = 0.02 * (float(norm(nearest.shear).max()) + float(np.abs(nearest.fn).max()))
        if float(norm(force + nearest.shear - nearest.fn[:, None] * n).max()) < scale:
            hint = "; all forces are reversed: give those on the first sphere"
        elif float(norm(shear + nearest.shear).max()) < scale < 50.0 * float(norm(nearest.shear).max()):
            hint = "; the shear force is reversed"
    elif best not in wanted:
        odd = [WORDS[key, value] for key, value in chosen[best].items() if value not in _accepted(key, law)]
        hint = f"; what fits is: {' and '.join(odd)}"
    checks = []
    for name, (value, allowed, at) in tried[shown_as].items():
        verdict = HOLDS if value <= allowed else VIOLATED
        said = f"{name} force off by at most {value:.3g} N at t = {at:.4g} s, allowed {allowed:.3g} N"
        checks.append(
            _check(f"{motion}/{name}", verdict, said + (hint if verdict == VIOLATED else ""), value, allowed, at)
        )
    size, limit = norm(shear), law.values["mu"] * np.maximum(fn, 0.0)
    value, allowed, at = _worst(
        t, np.maximum(size - limit, 0.0), np.full(len(t), DIGITS * law.values["kn"] * law.values["overlap"])
    )
    said = f"shear force beyond mu fn by at most {value:.3g} N at t = {at:.4g} s, allowed {allowed:.3g} N"
    checks.append(_check(f"{motion}/cone", HOLDS if value <= allowed else VIOLATED, said, value, allowed, at))
    expected = _expected(motion, law, t, chosen[shown_as])
    return checks, _curves(t, force, expected.shear - expected.fn[:, None] * n)


def _curves(t: FloatArray, force: FloatArray, expected: FloatArray) -> dict[str, Any]:
    """Forces returned and expected, by component, at so many instants as a figure needs."""
    kept = np.unique(np.linspace(0, len(t) - 1, DRAWN).round().astype(int))
    pairs = {f"f{axis}": [force[kept, k].tolist(), expected[kept, k].tolist()] for k, axis in enumerate("xyz")}
    return {"t": t[kept].tolist(), **pairs}


def _lag(motion: str, law: _Law, t: FloatArray, conventions: Mapping[str, Any]) -> PairForces:
    """What one step of the path changes the forces by; of springs, which sum slips of ends or middles of steps, the most is added."""
    step = END / STEPS
    before, now, after = (
        _expected(motion, law, np.clip(t + shift, 0.0, END), conventions) for shift in (-step, 0.0, step)
    )
    fn = np.maximum(np.abs(after.fn - now.fn), np.abs(before.fn - now.fn))
    shear = np.maximum(norm(after.shear - now.shear), norm(before.shear - now.shear))
    return PairForces(fn, np.asarray(shear + shear.max()))


def _judge_torques(
    tables: Mapping[str, Mapping[str, FloatArray]], law: _Law, found: dict[str, list[Any]]
) -> dict[str, Any]:
    """Torques against arms times the returned forces themselves, whatever these are."""
    radius = law.values["radius"]
    errors: dict[str, list[tuple[float, float, float, str]]] = {arm: [] for arm in CONVENTIONS["torque_arm"]}
    fitted = {1: [0.0, 0.0], 2: [0.0, 0.0]}
    for motion, table in tables.items():
        t = table["t"]
        force = np.column_stack([table[f"f{axis}"] for axis in "xyz"])
        if motion == "viscous":
            continue
        path = pair_path(motion=motion, radius=radius, overlap=law.values["overlap"], t=t)
        distance = norm(path.x)
        unit = np.cross(path.x / distance[:, None], force)
        for k in (1, 2):
            names = [f"tq{k}{axis}" for axis in "xyz"]
            if any(name not in table for name in names):
                continue
            torque = np.column_stack([table[name] for name in names])
            fitted[k][0] += float((torque * unit).sum())
            fitted[k][1] += float((unit * unit).sum())
            lag = 0.5 * END / STEPS * norm(path.v) * norm(unit)
            allowed = lag + DIGITS * radius * max(float(norm(force).max()), 1e-300)
            for arm in errors:
                length = 0.5 * distance if arm == "overlap" else np.full(len(t), radius)
                errors[arm].append(
                    (*_worst(t, norm(torque - length[:, None] * unit), allowed), f"{motion}, sphere {k}")
                )
    if not errors["radius"]:
        return _check("torque", UNDECIDED, f"there are no torques: columns {', '.join(TORQUES)}")
    worst = {arm: max(each, key=lambda one: one[0] / one[1]) for arm, each in errors.items()}
    best = min(worst, key=lambda arm: worst[arm][0] / worst[arm][1])
    fits = worst[best][0] <= worst[best][1]
    found["torque_arm"].append(best if fits else None)
    accepted = _accepted("torque_arm", law)
    value, allowed, at, where = worst[min(accepted, key=lambda arm: worst[arm][0] / worst[arm][1])]
    said = f"torque off by at most {value:.3g} N m ({where}, t = {at:.4g} s), allowed {allowed:.3g} N m"
    arms = [f"{above / below:.4g} m of sphere {k}" for k, (above, below) in fitted.items() if below > 0.0]
    if value > allowed:
        half = radius - 0.5 * law.values["overlap"]
        said += (
            f"; the arm that fits best is {' and '.join(arms)}; R is {radius:g} m, R less half the overlap {half:g} m"
        )
    return _check("torque", HOLDS if value <= allowed else VIOLATED, said, value, allowed, at)
