#!/usr/bin/env bash
# What: a box that slides on a floor leaves its straight line by a tenth of its path, and may turn: friction is not against the slip.
# Versions: pybullet 3.2.7 (PyPI), with its defaults
# Why a good guess misses: the solver's cone (enableConeFriction) is meant to be the same in all directions, and is so for spheres. It
#   seems to split the bound by the ratio of the two accumulated impulses, each divided by its own effective mass; at the corner of a box these
#   differ, so that the split is not that of the slip. More iterations change nothing.
# Documentation: the PyBullet Quickstart Guide calls enableConeFriction the implicit cone and its opposite a pyramid; it says nothing of
#   the shape of the body.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet --disable-pip-version-check install pybullet==3.2.7 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
cat > "$folder/run.py" <<'PY'
import math
import sys

import pybullet as p

MU, SPEED, G = 0.3, 1.5, 10.0
HALF = (0.5, 0.35, 0.2)


def stop(direction, yaw, iterations):
    """Distance along the initial velocity, to its left, and turn [degrees], of a box that slides until it stops."""
    client = p.connect(p.DIRECT)
    p.setTimeStep(0.005)
    p.setGravity(0, 0, -G)
    p.setPhysicsEngineParameter(numSolverIterations=iterations, enableConeFriction=1)
    half = 0.5 * math.radians(yaw)
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=HALF)
    box = p.createMultiBody(3, shape, basePosition=[0, 0, HALF[2]], baseOrientation=[0, 0, math.sin(half), math.cos(half)])
    wide = p.createCollisionShape(p.GEOM_BOX, halfExtents=[20, 20, 20])
    floor = p.createMultiBody(0, wide, basePosition=[0, 0, -20])
    p.changeDynamics(box, -1, lateralFriction=1, restitution=0, linearDamping=0, angularDamping=0)
    p.changeDynamics(floor, -1, lateralFriction=MU, restitution=0)
    c, s = math.cos(math.radians(direction)), math.sin(math.radians(direction))
    p.resetBaseVelocity(box, [SPEED * c, SPEED * s, 0], [0, 0, 0])
    for _ in range(140):
        p.stepSimulation()
    (x, y, _), turned = p.getBasePositionAndOrientation(box)
    p.disconnect(client)
    return x * c + y * s, y * c - x * s, math.degrees(2 * math.atan2(turned[2], turned[3])) - yaw


path = SPEED**2 / (2 * MU * G)
print(f"pybullet 3.2.7: a box slides to a stop; Coulomb's law: {path:.3f} m, 0 m aside, 0 degrees")
found = {}
for iterations in (50, 2000):
    for direction, yaw in ((0, 0), (30, 0), (45, 0), (45, 20), (45, 45)):
        along, aside, turn = found[iterations, direction, yaw] = stop(direction, yaw, iterations)
        print(f"  {iterations} iterations, direction {direction}, yaw {yaw}: {along:.3f} m, {aside:+.3f} m aside, {turn:+.2f} degrees")
straight = all(abs(found[n, 0, 0][1]) < 1e-6 for n in (50, 2000))
askew = all(0.035 < found[n, 45, 0][1] < 0.047 and found[n, 45, 45][0] > 0.40 for n in (50, 2000))
as_described = straight and askew
print("as described: along an axis straight, elsewhere up to a tenth aside" if as_described else "changed")
sys.exit(0 if as_described else 1)
PY
"$folder/venv/bin/python" "$folder/run.py"
