"""Rigid spheres by sequential impulses as an engine of ninedisk: `python3 rigid_spheres.py describe` or `run`. Needs numpy.

A contact is a pair that touches at the start of a step. Its impulse keeps the pair from approaching, or throws it back by its restitution;
friction is Coulomb's. All contacts are swept until no impulse changes. Overlaps, of up to the path of a step, are not pushed out.
"""

import json
import sys
import time

import numpy as np

ABOUT = {
    "wire_version": 1,
    "id": "rigid-spheres",
    "version": "1.0",
    "contact": "impulse",
    "scheme": "semi-implicit-euler",
    "capabilities": [
        "spheres",
        "friction",
        "restitution",
        "gravity",
        "moving-walls",
        "blocked-rotation",
        "fixed-disks",
    ],
    "options": {
        "sweeps": {
            "default": 10000,
            "low": 1,
            "whole": True,
            "why": "enough for rows of ten: a sweep ends when all is solved",
        }
    },
    "sweeps": "sweeps",
    "plane": False,
}
TOUCH = 1e-9  # gap over radius below which bodies touch: rounding of positions
DONE = 1e-13  # change of impulses over the largest at which the sweeps end


def place(wall, t, t_half):
    """Point of a wall at t, its velocity at t_half; it moves along straight lines."""
    point, velocity, begin = np.array(wall["point"], dtype=float), np.zeros(3), 0.0
    for segment in wall["motion"]:
        end, own = begin + float(segment["duration"]), np.array(segment["velocity"])
        point = point + own * max(0.0, min(t, end) - begin)
        velocity = own if begin <= t_half < end else velocity
        begin = end
    return point, velocity


def geometry(scene, x, walls):
    """Of all pairs (i, j), j a sphere or, from n on, a wall: gap, unit normal from i to j, law."""
    n, radius, found = len(x), scene["spheres"]["radius"], {}
    for i in range(n):
        for j in range(i + 1, n + len(walls)):
            if j < n:
                away = x[j] - x[i]
                far = float(np.linalg.norm(away))
                found[i, j] = far - radius[i] - radius[j], away / far, scene["sphere_sphere"]
            else:
                normal = -np.array(scene["walls"][j - n]["normal"])
                found[i, j] = float((walls[j - n][0] - x[i]) @ normal) - radius[i], normal, scene["walls"][j - n]["law"]
    return found


def run(scene, numerics, watch, sampled_steps, **_):
    """The history: in each step gravity, then impulses of the contacts, then positions with the new velocities."""
    spheres, dt, n = scene["spheres"], numerics["dt"], len(scene["spheres"]["mass"])
    sweeps = numerics["options"].get("rigid-spheres.sweeps", ABOUT["options"]["sweeps"]["default"])
    x, v, omega = (np.array(spheres[name], dtype=float) for name in ("x", "v", "omega"))
    fixed, radius, angle = np.all(spheres["held"], axis=1), np.array([*spheres["radius"], 0.0]), np.zeros_like(x)
    # Inverse masses and inertias; a wall is one more body, whose are 0.
    light = np.array([*np.where(fixed, 0.0, 1.0 / np.array(spheres["mass"])), 0.0])
    turns = np.array([*np.where(spheres["rotating"], 1.0 / np.array(spheres["inertia"]), 0.0), 0.0])
    history = {
        name: []
        for name in (
            "step",
            "t",
            "x",
            "v",
            "angle",
            "omega",
            "gap",
            "fn",
            "fs",
            "wall_point",
            "wall_angle",
            "wall_force",
        )
    }
    impulses, on_walls, wanted = None, None, set(sampled_steps)

    for step in range(numerics["n_steps"] + 1):
        walls = [place(wall, step * dt, (step + 0.5) * dt) for wall in scene["walls"]]
        now = geometry(scene, x, walls)
        if step in wanted:
            seen = None if impulses is None else [impulses.get(tuple(pair), np.zeros(3)) / dt for pair in watch]
            row = {
                "step": step, "t": step * dt, "x": x.tolist(), "v": v.tolist(), "angle": angle.tolist(), "omega": omega.tolist(),
                "gap": [now[tuple(pair)][0] for pair in watch],
                # On the first body: against the normal, and along the surface. Before the first step there are none.
                "fn": [-float(p @ now[tuple(k)][1]) for p, k in zip(seen, watch, strict=True)] if seen else [None] * len(watch),
                "fs": [(p - (p @ now[tuple(k)][1]) * now[tuple(k)][1]).tolist() for p, k in zip(seen, watch, strict=True)]
                if seen else [[None] * 3 for _ in watch],
                "wall_point": [point.tolist() for point, _ in walls],
                "wall_angle": [wall["normal"] for wall in scene["walls"]],
                "wall_force": [[None] * 3 for _ in walls] if on_walls is None else (on_walls / dt).tolist(),
            }  # fmt: skip
            for name, value in row.items():
                history[name].append(value)
        v[~fixed] += dt * np.array(scene["gravity"])
        touching = [(i, j, *found[1:]) for (i, j), found in now.items() if found[0] <= TOUCH * radius[i]]
        bodies = [min(j, n) for _, j, _, _ in touching]
        impulse, target = np.zeros((len(touching), 3)), []
        spin, gained = np.vstack([omega, np.zeros(3)]), 2.0 * dt * np.array(scene["gravity"])
        for i, j, normal, law in touching:  # what gravity alone brings in a step or two is rest, and not thrown back
            closing = float((v[i] - (v[j] if j < n else walls[j - n][1])) @ normal)
            target.append(-law.get("restitution", 0.0) * closing if closing > abs(gained @ normal) else 0.0)
        for _ in range(sweeps):
            before = impulse.copy()
            for k, ((i, j, normal, law), body) in enumerate(zip(touching, bodies, strict=True)):
                mass, own = light[i] + light[body], impulse[k]
                if mass == 0.0:
                    continue
                # Velocity of i's surface at the contact less that of j's.
                passing = v[i] - (v[j] if j < n else walls[j - n][1])
                passing = passing + np.cross(radius[i] * spin[i] + radius[body] * spin[body], normal)
                pushed = max(0.0, -float(own @ normal) + (float(passing @ normal) - target[k]) / mass)
                along = passing - (passing @ normal) * normal
                ease = mass + radius[i] ** 2 * turns[i] + radius[body] ** 2 * turns[body]
                rubbed = own - (own @ normal) * normal - along / ease
                size, most = float(np.linalg.norm(rubbed)), law.get("mu", 0.0) * pushed
                rubbed *= min(1.0, most / size) if size > 0.0 else 0.0
                change, impulse[k] = -pushed * normal + rubbed - own, -pushed * normal + rubbed
                v[i] += light[i] * change
                spin[i] += turns[i] * radius[i] * np.cross(normal, change)
                if body < n:
                    v[body] -= light[body] * change
                    spin[body] += turns[body] * radius[body] * np.cross(normal, change)
            if np.abs(impulse - before).max(initial=0.0) <= DONE * np.abs(impulse).max(initial=1e-300):
                break
        omega = spin[:n]
        impulses = {(i, j): p for (i, j, _, _), p in zip(touching, impulse, strict=True)}
        on_walls = np.array(
            [sum((-p for (_, j), p in impulses.items() if j == n + w), np.zeros(3)) for w in range(len(walls))]
        )
        x, angle = x + dt * v, angle + dt * omega
    return {**history, "force_meaning": "step-mean", "energy": {}}, {
        "rigid-spheres.sweeps": sweeps,
        "touching below, over radius": TOUCH,
    }


if sys.argv[1:] == ["describe"]:
    print(json.dumps(ABOUT))
else:
    request, begin = json.load(sys.stdin), time.perf_counter()
    history, settings = run(**request)
    timings = {"setup": 0.0, "warm_up": 0.0, "advance": time.perf_counter() - begin}
    answer = {"wire_version": 1, "engine_version": ABOUT["version"], "timings": timings, "settings": settings}
    print(json.dumps({**answer, "history": history}))
