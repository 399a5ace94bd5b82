"""A DEM of spheres as an engine of ninedisk: `python3 sphere_dem.py describe` or `run`. No dependencies."""

import json
import math
import sys
import time

CAPABILITIES = """spheres linear-contact hertz-mindlin unloading-none unloading-force unloading-rescale shear-spring friction
    contact-damping moving-walls gravity blocked-rotation held-motion fixed-disks lever-arm-radius slip-end"""
HISTORY = "step t x v angle omega gap fn fs wall_point wall_angle wall_force"
ABOUT = {"wire_version": 1, "id": "sphere-dem", "version": "1.0", "contact": "spring", "scheme": "central-difference",
         "plane": False, "shear_keeps_twist": True}  # fmt: skip


def dot(a, b):
    """Product of two vectors, a number."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def plus(a, b, factor=1.0):
    """The vector a + factor b."""
    return [p + factor * q for p, q in zip(a, b, strict=True)]


def cross(a, b):
    """Product of two vectors, a vector."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def place(wall, t, t_half):
    """Point of a wall at t, its velocity at t_half; it moves along straight lines."""
    point, velocity, begin = wall["point"], [0.0] * 3, 0.0
    for segment in wall["motion"]:
        end = begin + float(segment["duration"])
        point = plus(point, segment["velocity"], max(0.0, min(t, end) - begin))
        velocity = segment["velocity"] if begin <= t_half < end else velocity
        begin = end
    return point, velocity


def contact(law, normal, overlap, radius, mass, closing, slip, before):
    """Force fn and vector fs; linear, or Hertz-Mindlin. ``before`` is the shear force of the last step and its contact radius."""
    shear, a_before = before
    a = math.sqrt(radius * overlap)
    if law.get("e_star", 0.0) > 0.0:
        kn, kt = 2.0 * law["e_star"] * a, 8.0 * law.get("g_star", 0.0) * a
        elastic, damping = kn * overlap / 1.5, 2.0 * math.sqrt(5.0 / 6.0)
        falling = min(1.0, a / a_before)
        shear = [f * {"force": 1.0, "none": a / a_before, "rescale": a / a_before * falling}[law.get("unloading", "force")]
                 for f in shear]  # fmt: skip
    else:
        kn, kt = law["kn"], law.get("ks", 0.0)
        elastic, damping = kn * overlap, 2.0
    fn = elastic + damping * law.get("beta", 0.0) * math.sqrt(mass * kn) * closing
    # The shear force turns with the contact: its size stays, its direction is that across the new normal.
    size, across = math.sqrt(dot(shear, shear)), plus(shear, normal, -dot(shear, normal))
    left = math.sqrt(dot(across, across))
    fs = plus([f * size / left for f in across] if left else across, slip, -kt)
    size, most = math.sqrt(dot(fs, fs)), law.get("mu", 0.0) * max(fn, 0.0)
    return fn, [f * most / size for f in fs] if size > most else fs, a


def run(scene, numerics, watch, sampled_steps, **_):
    """The history: in each step forces at the positions of t_n, then velocities of t_(n + 1/2), then positions."""
    spheres, walls, n = scene["spheres"], scene["walls"], len(scene["spheres"]["mass"])
    x, R, m, inertia, held = (spheres[name] for name in ("x", "radius", "mass", "inertia", "held"))
    v, omega, angle = spheres["v"], spheres["omega"], [[0.0] * 3] * n
    dt, history, carried = numerics["contact_dt"], {key: [] for key in HISTORY.split()}, {}
    substeps, wanted = round(numerics["dt"] / dt), set(sampled_steps)
    for step in range(numerics["n_steps"] * substeps + 1):
        placed = [place(wall, step * dt, max(0.0, (step - 0.5) * dt)) for wall in walls]
        force, torque = [[mass * g for g in scene["gravity"]] for mass in m] + [[0.0] * 3] * len(walls), [[0.0] * 3] * n
        found, touching = {}, {}
        for i in range(n):
            for j in range(i + 1, n + len(walls)):
                if j < n:
                    law, away = scene["sphere_sphere"], plus(x[j], x[i], -1.0)
                    distance = math.sqrt(dot(away, away))
                    normal, gap = [d / distance for d in away], distance - R[i] - R[j]
                    radius, mass = R[i] * R[j] / (R[i] + R[j]), m[i] * m[j] / (m[i] + m[j])
                else:
                    law, normal = walls[j - n]["law"], [-d for d in walls[j - n]["normal"]]
                    gap, radius, mass = dot(plus(placed[j - n][0], x[i], -1.0), normal) - R[i], R[i], m[i]
                fn, fs = 0.0, [0.0] * 3
                if gap < 0.0:
                    other = v[j] if j < n else placed[j - n][1]
                    turning = (
                        plus([R[i] * w for w in omega[i]], omega[j], R[j]) if j < n else [R[i] * w for w in omega[i]]
                    )
                    speed = plus(plus(v[i], other, -1.0), cross(turning, normal))
                    closing = dot(speed, normal)
                    slip = [(u - closing * d) * (dt if step else 0.0) for u, d in zip(speed, normal, strict=True)]
                    before = carried.get((i, j), ([0.0] * 3, math.sqrt(radius * -gap)))
                    fn, fs, a = contact(law, normal, -gap, radius, mass, closing, slip, before)
                    touching[i, j] = fs, a
                    push = plus(fs, normal, -fn)
                    force[i], force[j] = plus(force[i], push), plus(force[j], push, -1.0)
                    turn = cross(normal, fs)
                    torque[i] = plus(torque[i], turn, R[i])
                    if j < n:
                        torque[j] = plus(torque[j], turn, R[j])
                found[i, j] = gap, fn, fs
        carried = touching
        gain = dt if step else 0.5 * dt  # the start is synchronised: half a step from t_0
        after = [
            [u if h else u + gain * f / m[i] for u, f, h in zip(v[i], force[i], held[i], strict=True)] for i in range(n)
        ]
        spins = [plus(omega[i], torque[i], gain / inertia[i]) if spheres["rotating"][i] else omega[i] for i in range(n)]
        if step % substeps == 0 and step // substeps in wanted:
            part = 0.5 if step else 0.0
            middle = [[plus([(1.0 - part) * u for u in old], new, part) for old, new in zip(*both, strict=True)]
                      for both in ((v, after), (omega, spins))]  # fmt: skip
            for key, value in {
                "step": step // substeps, "t": step * dt, "x": x, "v": middle[0], "angle": angle, "omega": middle[1],
                "gap": [found[i, j][0] for i, j in watch], "fn": [found[i, j][1] for i, j in watch],
                "fs": [found[i, j][2] for i, j in watch], "wall_point": [point for point, _ in placed],
                "wall_angle": [wall["normal"] for wall in walls], "wall_force": force[n:],
            }.items():  # fmt: skip
                history[key].append(value)
        v, omega = after, spins
        x = [plus(x[i], v[i], dt) for i in range(n)]
        angle = [plus(angle[i], omega[i], dt) for i in range(n)]
    return {**history, "force_meaning": "instantaneous", "energy": {}}


if sys.argv[1:] == ["describe"]:
    print(json.dumps({**ABOUT, "capabilities": CAPABILITIES.split()}))
else:
    request, begin = json.load(sys.stdin), time.perf_counter()
    history = run(**request)
    timings = {"setup": 0.0, "warm_up": 0.0, "advance": time.perf_counter() - begin}
    settings = {"contact_dt [s]": request["numerics"]["contact_dt"]}
    answer = {"wire_version": 1, "engine_version": ABOUT["version"], "timings": timings, "settings": settings}
    print(json.dumps({**answer, "history": history}))
