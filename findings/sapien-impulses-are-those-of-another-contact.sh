#!/usr/bin/env bash
# What: With enhanced determinism PhysX's solver PGS reports the impulses of one contact as those of another: a ball in a groove presses on
#   each plane with the force of the other.
# Versions: sapien 3.0.3 (PyPI), PhysX 5.3.1
# Why a good guess misses: the motion is right, and so is the sum of the impulses; without the flag, or with TGS, each is right.
# Documentation: that of PhysX on the flag names a cost in speed and no effect on reports, as far as was found.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet --disable-pip-version-check install sapien==3.0.3 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
cat > "$folder/run.py" <<'PY'
import math
import sys

import numpy as np
import sapien
from sapien import physx

G, DT, SLOPES = 10.0, 0.005, (math.radians(30), -math.radians(50))
NORMALS = np.array([[-math.sin(slope), math.cos(slope)] for slope in SLOPES])


def forces(tgs, determinism):
    """Forces of a ball of weight 10 N on two smooth planes, in the eighth step."""
    physx.set_scene_config(gravity=[0, 0, -G], enable_tgs=tgs, enable_enhanced_determinism=determinism)
    system = physx.PhysxCpuSystem()
    system.timestep = DT
    scene = sapien.Scene([system])
    smooth, (x, z) = physx.PhysxMaterial(0.0, 0.0, 0.0), np.linalg.solve(NORMALS, [1, 1])
    bodies = [physx.PhysxRigidStaticComponent(), physx.PhysxRigidStaticComponent(), physx.PhysxRigidDynamicComponent()]
    shapes = [physx.PhysxCollisionShapePlane(smooth) for _ in SLOPES] + [physx.PhysxCollisionShapeSphere(1.0, smooth)]
    halves = [0.25 * math.pi + 0.5 * slope for slope in SLOPES]  # a plane faces its own x
    poses = [sapien.Pose([0, 0, 0], [math.cos(half), 0, -math.sin(half), 0]) for half in halves]
    for body, shape, pose in zip(bodies, shapes, [*poses, sapien.Pose([x, 0, z])]):
        body.attach(shape)
        entity = sapien.Entity()
        entity.add_component(body)
        entity.set_pose(pose)
        scene.add_entity(entity)
    bodies[2].mass, bodies[2].inertia = 1.0, np.full(3, 0.4)
    planes = [body.entity.per_scene_id for body in bodies[:2]]
    for _ in range(8):
        system.step()
    found = dict.fromkeys(planes, 0.0)
    for contact in system.get_contacts():
        (number,) = {body.entity.per_scene_id for body in contact.bodies} & set(planes)
        found[number] += sum(float(np.linalg.norm(point.impulse)) for point in contact.points) / DT
    return np.array(list(found.values()))


wanted = np.linalg.solve(NORMALS.T, [0, G])
print(f"sapien {sapien.__version__}: forces on planes inclined by 30 and 50 degrees; statics: {np.round(wanted, 3)} N")
found = {(tgs, determinism): forces(tgs, determinism) for tgs in (False, True) for determinism in (False, True)}
for (tgs, determinism), got in found.items():
    print(f"  {'TGS' if tgs else 'PGS'}, enhanced determinism {determinism}: {np.round(got, 3)} N")
right = all(np.allclose(got, wanted, atol=0.05) for key, got in found.items() if key != (False, True))
as_described = right and np.allclose(found[False, True], wanted[::-1], atol=0.05)
print("as described: each plane is reported the other's force" if as_described else "changed")
sys.exit(0 if as_described else 1)
PY
"$folder/venv/bin/python" -W ignore "$folder/run.py"
