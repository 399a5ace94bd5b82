#!/usr/bin/env bash
# What: Box2D 3 cuts the spin of every body to pi/4 a step: at 60 steps a second to 47.12 rad/s, whatever the number of substeps.
# Versions: pyb2d3 0.11.1 (PyPI), bindings of Box2D 3
# Why a good guess misses: substeps (4 by default) divide the step in which bodies move, so a limit of 4 times as much is expected. A
#   free body without damping slows at once, and angular momentum is lost without contact.
# Documentation: Box2D 3, reference of b2BodyDef: a flag lets a body bypass "rotational speed limits", whose size is not given there;
#   pyb2d3's BodyDef has no such attribute.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet --disable-pip-version-check install pyb2d3==0.11.1 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
cat > "$folder/run.py" <<'PY'
import math
import sys

import pyb2d3 as b2


def kept(spin, steps_a_second, substeps):
    """Spin of a free disk after one second."""
    world = b2.World(gravity=(0, 0))
    body = world.create_dynamic_body(position=(0, 0), angular_velocity=spin)
    body.create_shape(b2.shape_def(density=1), b2.circle(center=(0, 0), radius=0.5))
    for _ in range(steps_a_second):
        world.step(1 / steps_a_second, substeps)
    return body.angular_velocity


print("pyb2d3 0.11.1: spin of a free disk after 1 s")
as_described = True
for steps_a_second, substeps in ((60, 1), (60, 4), (60, 16), (240, 4)):
    limit = math.pi / 4 * steps_a_second
    for spin in (0.9 * limit, 1.1 * limit, 4 * limit):
        found = kept(spin, steps_a_second, substeps)
        print(f"  {steps_a_second} steps a second of {substeps} substeps: {spin:.2f} -> {found:.2f} rad/s")
        as_described &= abs(found / min(spin, limit) - 1) < 1e-4
print("as described: pi/4 a step" if as_described else "changed")
sys.exit(0 if as_described else 1)
PY
"$folder/venv/bin/python" "$folder/run.py"
