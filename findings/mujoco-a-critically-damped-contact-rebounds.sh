#!/usr/bin/env bash
# What: In MuJoCo a ball that hits a plane in the default contact, damping ratio 1, rebounds with 13.5 % of its speed, e^-2, whatever the
#   step and the time constant. A damping ratio of 5 leaves 1 %.
# Versions: mujoco 4.0.0
# Why a good guess misses: a critically damped spring does not swing back. The contact cannot pull, and lets go where spring and damper
#   cancel: at twice its time constant, when the ball is on its way out.
# Documentation: MuJoCo, chapter "Modeling", solver parameters: solref is (timeconst, dampratio), a damping ratio of 1 is critical damping.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet mujoco==4.0.0
cat > "$folder/run.py" <<'PY'
import math
import sys

import mujoco


def rebound(step, time, ratio):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{step}" gravity="0 0 0"/>
      <worldbody><geom type="plane" size="9 9 1" solref="{time} {ratio}"/>
      <body pos="0 0 0.5"><freejoint/><geom type="sphere" size="0.5" mass="3" solref="{time} {ratio}"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[2] = -1.0
    for _ in range(round(20 * time * ratio / step)):
        mujoco.mj_step(model, data)
    return data.qvel[2]


print("mujoco", mujoco.__version__)
found = {}
for step, time, ratio in ((2e-3, 0.02, 1), (1e-4, 0.02, 1), (1e-5, 0.02, 1), (1e-5, 0.002, 1), (1e-5, 0.02, 5)):
    found[step, time, ratio] = rebound(step, time, ratio)
    print(f"step {step:g} s, time constant {time:g} s, damping ratio {ratio}: rebounds at {found[step, time, ratio]:.4f} of its speed")
print(f"e^-2 is {math.exp(-2):.4f}")
critical = [each for (step, _, ratio), each in found.items() if ratio == 1 and step < 1e-3]
described = all(abs(each - math.exp(-2)) < 3e-3 for each in critical) and found[2e-3, 0.02, 1] > 0.12 and 0.0 < found[1e-5, 0.02, 5] < 0.02
print("as described" if described else "changed")
sys.exit(0 if described else 1)
PY
"$folder/venv/bin/python" "$folder/run.py"
