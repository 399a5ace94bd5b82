"""Stored configurations of a case, and the file that holds a case's numbers.

Configurations (frames) become moving scenes for the page's player and pictures with every engine's outlines overlaid; force chains show
the normal force at every contact. The numbers go into one script file: every stored sample exactly, each array once, compressed.
"""

from __future__ import annotations

import base64
import json
import math
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.results.figures import Figure
from ninedisk.harness.results.schema import Row
from ninedisk.reports.drawing.charts import Look
from ninedisk.reports.drawing.draw import Configuration, SpaceView, WallView, read_scene, read_space
from ninedisk.reports.drawing.figures import Looks, tolerances, varying
from ninedisk.reports.panel.load import Curve
from ninedisk.reports.panel.model import CaseData, Panel
from ninedisk.reports.panel.text import decoded, parameters

FloatArray = NDArray[np.float64]

STILL = 1e-3
"""Motion below this share of a disk's radius is not seen, so it is not played."""


@dataclass(frozen=True)
class Frames:
    """Stored configurations of one cell: f frames, n disks, m walls."""

    step: FloatArray
    t: FloatArray
    x: FloatArray
    angle: FloatArray
    wall_point: FloatArray
    wall_angle: FloatArray


def read_frames(cell: Row) -> Frames | None:
    """Frames of a cell of disks; None where it has none, or they are damaged, or those of spheres (`spaces`)."""
    held = decoded(cell["frames"], dict)
    try:
        step = np.array(held["step"], dtype=np.float64)
        f = len(step)
        x = np.array(held["x"], dtype=np.float64).reshape(f, -1, 2)
        angle = np.array(held["angle"], dtype=np.float64).reshape(f, x.shape[1])
        points = np.array(held.get("wall_point") or np.empty((f, 0, 2)), dtype=np.float64).reshape(f, -1, 2)
        turned = np.array(held.get("wall_angle") or np.empty((f, 0)), dtype=np.float64).reshape(f, points.shape[1])
        t = np.array(held.get("t") or step, dtype=np.float64).reshape(f)
    except (KeyError, TypeError, ValueError):
        return None
    return Frames(step, t, x, angle, points, turned) if f and x.shape[1] and np.isfinite(x).all() else None


def moving_scenes(case: CaseData, arrays: Arrays) -> dict[str, Any]:
    """By variant: radii, and for each engine the numbers of its arrays and its contacts; only what visibly moves."""
    scenes: dict[str, Any] = {}
    for cell in case.cells:
        frames = read_frames(cell)
        setup = decoded(cell["setup"], dict)
        if frames is None or len(frames.step) < 2:
            continue
        try:
            n = frames.x.shape[1]
            radius = np.array(np.broadcast_to(np.asarray(setup["scene"]["disks"]["radius"], dtype=np.float64), (n,)))
        except (KeyError, TypeError, ValueError):
            continue
        turn = np.nan_to_num(frames.angle - frames.angle[0])
        moved = max(float(np.abs(frames.x - frames.x[0]).max() / radius.max()), float(np.abs(turn).max()))
        if moved < STILL:
            continue
        held = springs(setup)
        pairs: list[tuple[int, int]] = []
        forces = np.empty((len(frames.step), 0))
        if held is not None and len(held.walls) == frames.wall_point.shape[1] and len(held.radius) == n:
            pairs, forces = contact_forces(held, frames.x, frames.wall_point, frames.wall_angle)
        view = read_scene(setup)
        edges = [None if edge is None else arrays(edge) for edge in (view.edges if view else (None,) * n)]
        shown: dict[str, Any] = {"radius": arrays(radius), "edges": edges, "engines": {}}
        periodic = view.cell if view else None
        if periodic is not None:
            shown["cell"] = {"size": periodic.size.tolist(), "motion": periodic.motion.tolist()}
        scene = scenes.setdefault(cell["variant"], shown)
        scene["engines"][cell["engine"]] = {
            "step": arrays(frames.step), "t": arrays(frames.t), "x": arrays(frames.x), "angle": arrays(frames.angle),
            "wall_point": arrays(frames.wall_point), "wall_angle": arrays(frames.wall_angle),
            "pairs": pairs, "forces": arrays(forces),
        }  # fmt: skip
    return scenes


def spaces(case: CaseData, arrays: Arrays) -> dict[str, Any]:
    """By variant in space: axis that stands upright, gravity, radii, boxes if there are any, and for each engine the numbers of its arrays.

    Set-ups that no engine ran have one configuration, the set-up's.
    """
    found: dict[str, Any] = {}
    for cell in case.cells:
        view = read_space(decoded(cell["setup"], dict))
        if view is None:
            continue
        given = {"up": view.up, "gravity": view.gravity.tolist(), "radius": arrays(view.radius), "engines": {}}
        if view.half.any():  # rows of a turn are the directions of the edges
            given |= {"half": arrays(view.half), "turn": arrays(view.turn.transpose(0, 2, 1))}
        scene = found.setdefault(cell["variant"], given)
        scene["setup"] = _configurations(arrays, {"t": [0.0], "x": [view.x], "angle": [0.0 * view.x]}, view)
        held = decoded(cell["frames"], dict)
        try:
            f = len(held["t"])
            shapes = {"t": (f,), "x": (f, *view.x.shape), "angle": (f, *view.x.shape)}
            shapes |= {name: (f, len(view.walls), 3) for name in ("wall_point", "wall_angle")}
            frames = {name: np.array(held[name], dtype=np.float64).reshape(shape) for name, shape in shapes.items()}
        except (KeyError, TypeError, ValueError):
            continue
        if f and np.isfinite(frames["x"]).all():
            scene["engines"][cell["engine"]] = _configurations(arrays, frames, view)
    return found


def _configurations(arrays: Arrays, frames: Mapping[str, Any], view: SpaceView) -> dict[str, int]:
    count = len(frames["t"])
    still = {"wall_point": [wall.point for wall in view.walls], "wall_angle": [wall.normal for wall in view.walls]}
    walls = {}
    for name, given in still.items():
        start = np.tile(np.array(given, dtype=np.float64).reshape(1, -1, 3), (count, 1, 1))
        reported = np.asarray(frames.get(name, start), dtype=np.float64)
        walls[name] = np.where(np.isfinite(reported), reported, start)
    return {
        **{name: arrays(np.nan_to_num(np.asarray(frames[name], dtype=np.float64))) for name in ("t", "x", "angle")},
        **{name: arrays(value) for name, value in walls.items()},
    }


class Arrays:
    """Float arrays by number; equal ones (times, truths that several engines share) are held once."""

    def __init__(self) -> None:
        self._number: dict[bytes, int] = {}

    def __call__(self, values: Any) -> int:
        """Number of the array that holds ``values``, flattened."""
        raw = np.asarray(values, dtype="<f8").tobytes()
        return self._number.setdefault(raw, len(self._number))

    @property
    def lengths(self) -> list[int]:
        """Numbers of values, in the order of `planes`."""
        return [len(raw) // 8 for raw in self._number]

    def planes(self) -> bytes:
        """All arrays, each with its first bytes together, then its second bytes and so on.

        Neighbouring samples share their leading bytes, so that this order compresses by a third better.
        """
        return b"".join(np.frombuffer(raw, np.uint8).reshape(-1, 8).T.tobytes() for raw in self._number)


def pack_case(panel: Panel, case: CaseData, looks: Looks, arrays: Arrays, more: dict[str, Any]) -> str:
    """Text of a case's data file.

    Parameters
    ----------
    panel, case
        What is packed.
    looks : Looks
        Looks of its engines and references.
    arrays : Arrays
        May hold arrays already; the curves' are added.
    more : dict
        Plain data that the page's scripts find in the head: moving scenes, folded tables.

    Returns
    -------
    str
        A call of ``ninedisk.load`` with the base64 text of zlib of: length of the head (uint32), head (JSON), arrays.
    """
    engines, variants, labels = list(looks.engines), list(case.variants), list(looks.references)
    limits = tolerances(case)

    def places(curve: Curve) -> list[int]:
        return [arrays(curve.step), arrays(curve.t), arrays(curve.value)]

    curves, references = [], []
    for (name, variant, engine, quantity), curve in panel.stored.series.items():
        if name == case.id and variant in case.variants and engine in looks.engines:
            limit = limits.get((variant, engine, quantity, curve.truth), math.nan)
            place = [variants.index(variant), engines.index(engine), quantity]
            known = limit if math.isfinite(limit) else None
            curves.append([*place, *places(curve), arrays(curve.expected), curve.truth, known])
    for (name, variant, quantity), found in panel.stored.references.items():
        if name == case.id and variant in case.variants:
            references += [[variants.index(variant), quantity, labels.index(c.label), *places(c)] for c in found]
    head = {
        "engines": [{"id": engine, **_plain(look)} for engine, look in looks.engines.items()],
        "labels": [_plain(looks.references[label]) for label in labels],
        "variants": variants,
        "curves": curves,
        "references": references,
        **more,
        "lengths": arrays.lengths,
    }
    text = json.dumps(head, allow_nan=False, separators=(",", ":")).encode()
    raw = zlib.compress(struct.pack("<I", len(text)) + text + arrays.planes(), 9)
    return f'ninedisk.load("{base64.b64encode(raw).decode()}");\n'


def unpack(text: str) -> tuple[dict[str, Any], list[NDArray[np.float64]]]:
    """Head and arrays of a data file: the inverse of `pack_case`, for checks."""
    raw = zlib.decompress(base64.b64decode(text[text.index('"') + 1 : text.rindex('"')]))
    (size,) = struct.unpack_from("<I", raw)
    head = json.loads(raw[4 : 4 + size])
    at, arrays = 4 + size, []
    for n in head["lengths"]:
        planes = np.frombuffer(raw, np.uint8, 8 * n, at).reshape(8, n)
        arrays.append(np.ascontiguousarray(planes.T).view("<f8").ravel())
        at += 8 * n
    return head, arrays


def _plain(look: Look) -> dict[str, Any]:
    return {
        "name": look.label, "colour": look.colour, "dash": list(look.dash), "width": look.width, "shape": look.shape,
        "phase": look.phase,
    }  # fmt: skip


MOST_GROUPS = 8
"""Variants whose configurations are drawn on one page."""

UNPLANNED = Figure(
    title="Configurations",
    kind="configuration",
    shows="Disks and walls at the stored steps; each spoke turns with its disk.",
    allows="Whether the engines move the bodies alike.",
)


def case_configurations(case: CaseData, looks: dict[str, Look]) -> tuple[Figure, list[tuple[str, list[Configuration]]]]:
    """Plan of the configuration figure and, for each variant that has frames, heading and one picture a stored step."""
    plan = next((p for p in case.figures if p.kind == "configuration"), UNPLANNED)
    cells = [cell for cell in case.cells if decoded(cell["frames"], dict).get("x")]
    chosen = [cell for cell in cells if plan.matches(case.variants[cell["variant"]])] or cells
    most = 1 if plan is UNPLANNED else MOST_GROUPS
    variants = list(dict.fromkeys(cell["variant"] for cell in chosen))[:most]
    names = varying(case.variants[variant] for variant in variants)
    groups = []
    for variant in variants:
        pictures = _pictures([cell for cell in chosen if cell["variant"] == variant], looks, plan.last)
        if pictures:
            groups.append((parameters(case.variants[variant], names), pictures))
    return plan, groups


def _pictures(cells: list[dict[str, Any]], looks: dict[str, Look], last: int | None) -> list[Configuration]:
    """The last stored step and the one that begins the last ``last`` steps, with every engine that has them.

    The force chains are those of the first engine whose contacts are plain springs.
    """
    scene = next((view for cell in cells if (view := read_scene(decoded(cell["setup"], dict)))), None)
    times: dict[int, float] = {}
    if scene is None:
        return []
    bodies: dict[int, list[Any]] = {}
    chains: dict[int, tuple[str, tuple[tuple[Any, float], ...]]] = {}
    for cell in cells:
        frames = read_frames(cell)
        if frames is None or frames.x.shape[1] != len(scene.radius):
            continue
        look, held = looks[cell["engine"]], springs(decoded(cell["setup"], dict))
        for k, step in enumerate(frames.step.astype(int).tolist()):
            walls = _walls(frames.wall_point[k], frames.wall_angle[k])
            bodies.setdefault(step, []).append((look, frames.x[k], frames.angle[k], walls))
            times.setdefault(step, float(frames.t[k]))
        if held is not None and not chains and len(held.walls) == frames.wall_point.shape[1]:
            pairs, forces = contact_forces(held, frames.x, frames.wall_point, frames.wall_angle)
            for k, step in enumerate(frames.step.astype(int).tolist()):
                place = frames.x[k], frames.wall_point[k], frames.wall_angle[k]
                links = tuple((ends(pair, *place), float(f)) for pair, f in zip(pairs, forces[k], strict=True))
                chains[step] = (look.label, links)
    if not bodies:
        return []
    final = max(bodies)
    begin = min(bodies, key=lambda step: (abs(step - (final - last if last else 0)), step))
    return [
        Configuration(
            f"cycle {step}",
            scene.radius,
            tuple(bodies[step]),
            *chains.get(step, ("", ())),
            scene.edges,
            None if scene.cell is None else (scene.cell, times[step]),
        )
        for step in sorted({begin, final})
    ]


def _walls(points: Any, angles: Any) -> tuple[WallView, ...]:
    return tuple(
        WallView("", point, np.array([np.cos(angle), np.sin(angle)]))
        for point, angle in zip(points, angles, strict=True)
        if np.isfinite(point).all() and np.isfinite(angle)
    )


@dataclass(frozen=True)
class Springs:
    """Linear contacts of a scene: ``kn`` between disks and of each wall [N/m], radii [m]."""

    radius: FloatArray
    disk_disk: float
    walls: FloatArray


def springs(setup: Mapping[str, Any]) -> Springs | None:
    """Springs of a stored scene; None where the distance of disks alone does not give the force.

    That is so with dashpots, a restitution, no stiffness, other outlines than disks, the law of the common area, and a periodic cell.
    """
    try:
        scene = setup["scene"]
        laws = [scene["disk_disk"], *(wall["law"] for wall in scene["walls"])]
        if any(law.get("beta") or law.get("restitution") is not None or not law["kn"] for law in laws):
            return None
        n = len(scene["disks"]["x"])
        if scene.get("cell"):
            return None
        if max(scene["disks"].get("outline", (-1,)), default=-1) >= 0 or any(
            law.get("contact") == "area" for law in laws
        ):
            return None
        radius = np.array(np.broadcast_to(np.asarray(scene["disks"]["radius"], dtype=np.float64), (n,)))
        kn = np.array([law["kn"] for law in laws], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        return None
    return Springs(radius, float(kn[0]), kn[1:])


def contact_forces(
    held: Springs, x: FloatArray, wall_point: FloatArray, wall_angle: FloatArray
) -> tuple[list[tuple[int, int]], FloatArray]:
    """Contacts and their normal forces ``kn overlap`` over several configurations.

    Parameters
    ----------
    held : Springs
        Of n disks and m walls.
    x : ndarray, shape (f, n, 2)
        Centres [m].
    wall_point, wall_angle : ndarray, shapes (f, m, 2) and (f, m)
        A point of each wall [m] and the direction of its normal [rad].

    Returns
    -------
    pairs : list of (int, int)
        Contacts that bear a force in some configuration; walls are numbered after the disks.
    forces : ndarray, shape (f, len(pairs))
        Normal forces [N].
    """
    n, radius = len(held.radius), held.radius
    i, j = np.triu_indices(n, 1)
    overlap = radius[i] + radius[j] - np.linalg.norm(x[:, j] - x[:, i], axis=2)
    normal = np.stack([np.cos(wall_angle), np.sin(wall_angle)], axis=2)
    depth = radius - np.einsum("fnmk,fmk->fnm", x[:, :, None] - wall_point[:, None], normal).transpose(0, 2, 1)
    forces = np.concatenate([held.disk_disk * overlap, (held.walls[:, None] * depth).reshape(len(x), -1)], axis=1).clip(
        min=0.0
    )
    pairs = [*zip(i.tolist(), j.tolist(), strict=True), *((k, n + w) for w in range(len(held.walls)) for k in range(n))]
    # An overlap at the level of round-off of the coordinates is a disk that just touches.
    touching = 1e-12 * held.disk_disk * float(radius.max(initial=0.0))
    used = np.flatnonzero((np.nan_to_num(forces) > touching).any(axis=0))
    return [pairs[k] for k in used], forces[:, used]


def ends(pair: tuple[int, int], x: FloatArray, wall_point: FloatArray, wall_angle: FloatArray) -> FloatArray:
    """Ends of a chain's link in one configuration, shape (2, 2): both centres, or a centre and its foot on the wall."""
    one, two = pair
    if two < len(x):
        return np.array([x[one], x[two]])
    wall = two - len(x)
    normal = np.array([np.cos(wall_angle[wall]), np.sin(wall_angle[wall])])
    return np.array([x[one], x[one] - ((x[one] - wall_point[wall]) @ normal) * normal])
