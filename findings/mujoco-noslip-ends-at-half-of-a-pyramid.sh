#!/usr/bin/env bash
# What: MuJoCo's NoSlip solver stops the creep of a box on a slope only up to half of the friction angle's tangent if the friction cone is
#   pyramidal, the default. Beyond tan = mu/2 it changes little or nothing, however many iterations it has. With the elliptic cone it
#   stops the creep nearly up to mu.
# Versions: mujoco 3.3.0 (PyPI)
# Why a good guess misses: both cones hold the box up to tan = mu, and the solver is described as one for all friction.
# Documentation: MuJoCo, page "XML Reference" (option, noslip_iterations): the pass is said to suppress slip; no limit of the slope.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet --disable-pip-version-check install mujoco==3.3.0 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
cat > "$folder/run.py" <<'PY'
import math
import sys

import mujoco

MU, G = 0.5, 9.81


def creep(cone, iterations, share):
    """Mean speed of a box from 1.5 s to 3 s on a slope of tangent ``share`` MU [m/s]."""
    angle = math.atan(share * MU)
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option gravity="{G * math.sin(angle)} 0 {-G * math.cos(angle)}" cone="{cone}" noslip_iterations="{iterations}"/>
          <worldbody>
            <geom type="plane" size="50 50 1" friction="{MU} 0 0"/>
            <body pos="0 0 0.05"><freejoint/><geom type="box" size=".1 .1 .05" friction="{MU} 0 0"/></body>
          </worldbody>
        </mujoco>""")
    data = mujoco.MjData(model)
    half = round(1.5 / model.opt.timestep)
    for step in range(2 * half):
        if step == half:
            begin = data.qpos[0]
        mujoco.mj_step(model, data)
    return (data.qpos[0] - begin) / 1.5


shares = (0.3, 0.45, 0.55, 0.7, 0.9)
print(f"mujoco {mujoco.__version__}: creep of a box on a slope of tangent s mu, s = {', '.join(map(str, shares))}")
found = {}
for cone in ("pyramidal", "elliptic"):
    for iterations in (0, 10, 100):
        found[cone, iterations] = speeds = [creep(cone, iterations, share) for share in shares]
        print(f"  {cone}, noslip_iterations {iterations}: {', '.join(f'{speed:.1e}' for speed in speeds)} m/s")
stopped = {key: [a < 0.01 * b for a, b in zip(speeds, found[key[0], 0])] for key, speeds in found.items() if key[1]}
as_described = all(
    held[0] and (not any(held[2:]) if cone == "pyramidal" else all(held)) for (cone, _), held in stopped.items()
)
print("as described: the pyramid holds up to mu/2" if as_described else "changed")
sys.exit(0 if as_described else 1)
PY
"$folder/venv/bin/python" "$folder/run.py"
