"""A DEM with contact springs as an engine of ninedisk: `python3 spring_dem.py describe` or `run`. No dependencies."""

import json
import math
import sys
import time

CAPABILITIES = """linear-contact shear-spring friction contact-damping global-damping-central global-damping-lagged
    moving-walls gravity blocked-rotation preload disk-inertia lever-arm-radius lever-arm-overlap slip-end"""
HISTORY = "step t x v angle omega gap fn fs wall_point wall_angle wall_force"
ABOUT = {"wire_version": 1, "id": "spring-dem", "version": "1.0", "contact": "spring", "scheme": "central-difference"}


def place(wall, t, t_half):
    """Point of a wall at t, its normal, its velocity at t_half; it moves along straight lines."""
    (x, y), velocity, begin = wall["point"], (0.0, 0.0), 0.0
    for segment in wall["motion"]:
        (vx, vy), end = segment["velocity"], begin + float(segment["duration"])
        passed = max(0.0, min(t, end) - begin)
        x, y, velocity = x + vx * passed, y + vy * passed, (vx, vy) if begin <= t_half < end else velocity
        begin = end
    return (x, y), wall["normal"], velocity


def contact(law, normal, gap, arms, speeds, inverse_mass, shear, dt):
    """Forces (fn, fs) of a contact: spring, dashpot without tension, incremental shear spring, Coulomb's cap."""
    (nx, ny), ((vx, vy, wi), (ux, uy, wj)) = normal, speeds
    closing = (vx - ux) * nx + (vy - uy) * ny
    fn = max(0.0, 2.0 * law["beta"] * math.sqrt(law["kn"] / inverse_mass) * closing - law["kn"] * gap)
    slip = ((vy - uy) * nx - (vx - ux) * ny + arms[0] * wi + arms[1] * wj) * dt
    return fn, max(-law["mu"] * fn, min(law["mu"] * fn, shear - law["ks"] * slip))


def run(scene, numerics, watch, sampled_steps, **_):
    """The history: in each step forces at the positions of t_n, then velocities of t_(n + 1/2), then positions."""
    disks, walls, xi, n = scene["disks"], scene["walls"], scene["xi"], len(scene["disks"]["mass"])
    x, R, m, rotating = disks["x"], disks["radius"], disks["mass"], disks["rotating"]
    dt, lagged = numerics["contact_dt"], numerics["damping_form"] == "lagged"
    substeps, a, angle = round(numerics["dt"] / dt), 0.5 * xi * dt, [0.0] * n
    # Velocities and spins, of t_(n - 1/2) where forces are computed: dashpots and slips see these.
    v = [[*velocity, spin] for velocity, spin in zip(disks["v"], disks["omega"], strict=True)]
    shear, wanted = {(i, j): force for i, j, force in scene["initial_shear"]}, set(sampled_steps)
    history = {key: [] for key in HISTORY.split()}
    for step in range(numerics["n_steps"] * substeps + 1):
        placed = [place(wall, step * dt, max(0.0, (step - 0.5) * dt)) for wall in walls]
        load, found = [[mass * g for g in (*scene["gravity"], 0.0)] for mass in m] + [[0.0] * 3 for _ in walls], {}
        for i in range(n):
            for j in range(i + 1, n + len(walls)):
                if j < n:
                    law, u, Rj, inverse = scene["disk_disk"], v[j], R[j], 1.0 / m[i] + 1.0 / m[j]
                    nx, ny = x[j][0] - x[i][0], x[j][1] - x[i][1]
                    distance = math.hypot(nx, ny)
                    nx, ny, gap = nx / distance, ny / distance, distance - R[i] - Rj
                else:
                    (px, py), (nx, ny), u = placed[j - n]
                    law, u, Rj, inverse = walls[j - n]["law"], (*u, 0.0), 0.0, 1.0 / m[i]
                    nx, ny, gap = -nx, -ny, (x[i][0] - px) * nx + (x[i][1] - py) * ny - R[i]
                fn = fs = 0.0
                if gap < 0.0:
                    less = -0.5 * gap if law["lever_arm"] == "overlap" else 0.0
                    arms, before = (R[i] - less, Rj - less), shear.get((i, j), 0.0)
                    fn, fs = contact(law, (nx, ny), gap, arms, (v[i], u), inverse, before, dt if step else 0.0)
                    for body, sign, arm in ((i, 1.0, arms[0]), (j, -1.0, arms[1])):
                        load[body][0] += sign * (-fn * nx - fs * ny)
                        load[body][1] += sign * (-fn * ny + fs * nx)
                        load[body][2] += arm * fs
                found[i, j], shear[i, j] = (gap, fn, fs), fs
        kept, gain = (1.0 - xi * dt, dt) if lagged else ((1.0 - a) / (1.0 + a), dt / (1.0 + a))
        if step == 0:
            kept, gain = 1.0 - a, 0.5 * dt  # the start is synchronised: half a step from t_0
        after = [[kept * v[i][k] + gain * load[i][k] / m[i] for k in (0, 1)] for i in range(n)]
        spins = [kept * v[i][2] + gain * load[i][2] / disks["inertia"][i] if rotating[i] else v[i][2] for i in range(n)]
        after = [[*velocity, spin] for velocity, spin in zip(after, spins, strict=True)]
        if step % substeps == 0 and step // substeps in wanted:
            at_t = v if step == 0 else [[0.5 * (v[i][k] + after[i][k]) for k in range(3)] for i in range(n)]
            for key, value in {
                "step": step // substeps, "t": step * dt, "x": [list(place) for place in x],
                "v": [u[:2] for u in at_t], "angle": list(angle), "omega": [u[2] for u in at_t],
                "gap": [found[i, j][0] for i, j in watch], "fn": [found[i, j][1] for i, j in watch],
                "fs": [found[i, j][2] for i, j in watch], "wall_point": [point for point, _, _ in placed],
                "wall_angle": [math.atan2(ny, nx) for _, (nx, ny), _ in placed], "wall_force": [f[:2] for f in load[n:]],
            }.items():  # fmt: skip
                history[key].append(value)
        v = after
        x = [[x[i][0] + dt * v[i][0], x[i][1] + dt * v[i][1]] for i in range(n)]
        angle = [angle[i] + dt * v[i][2] for i in range(n)]
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
