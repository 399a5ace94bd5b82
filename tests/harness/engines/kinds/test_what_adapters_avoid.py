"""What engines do that their adapters avoid or refuse, seen without them: why these are as they are.

A row that fails shows that the engine has changed, and that its adapter may become simpler.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.harness.engines.lammps.adapter import ENGINE as LAMMPS

SPIN, STEP = 1.0, 2e-3
"""Of a turntable [rad/s]; time step [s]."""


def carried_by_mujoco(table: str) -> float:
    """Speed [m/s] across its radius of a sphere 1 m from the axis of a table that has turned under it for half a second."""
    mujoco: Any = pytest.importorskip("mujoco")
    box = '<geom type="box" size="5 5 .1" pos="0 0 -.1" mass="1e8" friction=".5 0 0"/>'
    body = {
        "mocap": f'<body mocap="true">{box}</body>',
        "joint": f'<body><joint type="hinge" axis="0 0 1"/>{box}</body>',
    }
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{STEP}" cone="elliptic"/><worldbody>{body[table]}<body name="ball" pos="1 0 .1"><freejoint/>'
        '<geom type="sphere" size=".1" mass="1" friction=".5 0 0"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    for _ in range(250):
        if table == "mocap":
            half = 0.5 * SPIN * data.time
            data.mocap_quat[0] = (np.cos(half), 0.0, 0.0, np.sin(half))
        else:
            data.qvel[0] = SPIN
        mujoco.mj_step(model, data)
    assert data.ncon == 1
    return float(data.qvel[model.body("ball").dofadr[0] + 1])


def test_a_mocap_body_of_mujoco_drags_nothing() -> None:
    """Its pose changes and its velocity is 0 in every contact; a heavy body on a joint drags the sphere to 2/7 of its own speed."""
    assert abs(carried_by_mujoco("mocap")) < 1e-9
    assert carried_by_mujoco("joint") == pytest.approx(2.0 / 7.0 * SPIN, rel=0.02)


@pytest.mark.parametrize("mass", [0.0, 1e6])
def test_a_massless_body_of_bullet_that_turns_meets_contacts_with_another_velocity(mass: float) -> None:
    """With ``v + dt omega x v``: a sphere over its centre is dragged aside by the angle of one step's rotation."""
    pybullet: Any = pytest.importorskip("pybullet")
    client, dt, spin, speed = pybullet.connect(pybullet.DIRECT), 1.0 / 240.0, 10.0, 0.5
    try:
        pybullet.setTimeStep(dt, physicsClientId=client)
        pybullet.setGravity(0.0, 0.0, -10.0, physicsClientId=client)
        box = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[5.0, 5.0, 0.1], physicsClientId=client)
        ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1, physicsClientId=client)
        table = pybullet.createMultiBody(mass, box, basePosition=[0.0, 0.0, -0.1], physicsClientId=client)
        sphere = pybullet.createMultiBody(1.0, ball, basePosition=[0.0, 0.0, 0.1], physicsClientId=client)
        for body in (table, sphere):
            pybullet.changeDynamics(
                body, -1, lateralFriction=0.7, linearDamping=0.0, angularDamping=0.0, physicsClientId=client
            )
        for _ in range(60):
            x, y, _ = pybullet.getBasePositionAndOrientation(sphere, physicsClientId=client)[0]
            pybullet.resetBasePositionAndOrientation(table, [x, y, -0.1], [0.0, 0.0, 0.0, 1.0], physicsClientId=client)
            pybullet.resetBaseVelocity(table, [speed, 0.0, 0.0], [0.0, 0.0, spin], physicsClientId=client)
            pybullet.stepSimulation(physicsClientId=client)
        along, aside, _ = pybullet.getBaseVelocity(sphere, physicsClientId=client)[0]
    finally:
        pybullet.disconnect(client)
    assert along == pytest.approx(2.0 / 7.0 * speed, rel=0.01)
    assert aside / along == pytest.approx(0.0 if mass else dt * spin, abs=1e-3 * dt * spin)


@pytest.mark.parametrize("limit", [None, 1e30])
def test_a_massless_body_of_bullet_drags_at_a_hundred_units_at_most(limit: float | None) -> None:
    """Its velocity beyond maxJointVelocity, 100 by default, does not act in contacts, though the body reports it back."""
    pybullet: Any = pytest.importorskip("pybullet")
    client, speed = pybullet.connect(pybullet.DIRECT), 140.0
    try:
        pybullet.setTimeStep(1e-3, physicsClientId=client)
        pybullet.setGravity(0.0, 0.0, -10.0, physicsClientId=client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=[0.0, 0.0, 1.0], physicsClientId=client)
        ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=1.0, physicsClientId=client)
        belt = pybullet.createMultiBody(0.0, plane, physicsClientId=client)
        sphere = pybullet.createMultiBody(1.0, ball, basePosition=[0.0, 0.0, 1.0], physicsClientId=client)
        given = {} if limit is None else {"maxJointVelocity": limit}
        pybullet.changeDynamics(belt, -1, lateralFriction=1.0, physicsClientId=client, **given)
        pybullet.changeDynamics(
            sphere,
            -1,
            lateralFriction=1.0,
            linearDamping=0.0,
            angularDamping=0.0,
            maxJointVelocity=1e30,
            physicsClientId=client,
        )
        pybullet.resetBaseVelocity(sphere, [speed, 0.0, 0.0], [0.0, 0.0, 0.0], physicsClientId=client)
        for _ in range(100):
            pybullet.resetBaseVelocity(belt, [speed, 0.0, 0.0], [0.0, 0.0, 0.0], physicsClientId=client)
            pybullet.stepSimulation(physicsClientId=client)
        (along, _, _), _ = pybullet.getBaseVelocity(sphere, physicsClientId=client)
    finally:
        pybullet.disconnect(client)
    # A sphere that goes with its plane meets no friction; 40 m/s slower, a plane brakes it by mu g.
    assert speed - along == pytest.approx(0.0 if limit else 10.0 * 0.1, abs=0.05)


ADHESIVE = """
import json, lammps
run = lammps.lammps(cmdargs=["-screen", "none", "-log", "none"])
run.commands_string('''newton off
units si
atom_style sphere
boundary f f f
comm_modify vel yes
region box block -1 1 -1 1 -1 1
create_box 1 box
create_atoms 1 single 0 0 0.009998
set type 1 diameter 0.02 density 2500
pair_style granular
pair_coeff * * jkr 1e7 0.0 0.3 0.05 tangential linear_nohistory 0.0 0.0 damping velocity
timestep 1e-6
neighbor 0.002 bin
fix away all move linear 0 0 0.04
region floor plane 0 0 0 0 0 1
fix floor all wall/gran/region granular jkr 1e7 0.0 0.3 0.05 tangential linear_nohistory 0.0 0.0 damping velocity region floor''')
seen = []
for _ in range(200):
    run.command("run 1 post no")
    seen.append((run.numpy.extract_atom("x")[0, 2] - 0.01, run.numpy.extract_atom("f")[0, 2]))
print(json.dumps(seen))
"""
"""A sphere is drawn slowly off a plane; E [Pa], restitution's damping, Poisson's ratio, surface energy of a face [J/m^2]."""


def test_a_region_of_lammps_releases_jkr_without_a_neck() -> None:
    """At gap 0, where 8/9 of the pull-off ``3 pi g R`` act; that is reached on the neck beyond, which pairs of spheres have."""
    if not LAMMPS.info().installed:
        pytest.skip("there is no LAMMPS")
    from ninedisk.harness.engines.lammps.adapter import _mpi_library

    environment = {**os.environ, "LD_LIBRARY_PATH": str(Path(_mpi_library()[0]).parent)}
    done = subprocess.run(
        [sys.executable, "-c", ADHESIVE], env=environment, capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 0, done.stderr
    gap, force = np.array(json.loads(done.stdout.splitlines()[-1])).T
    assert not force[gap > 0.0].any()
    assert gap[force != 0.0].max() > -5e-8  # of the last step before
    assert force.min() / (-3.0 * np.pi * 0.05 * 0.01) == pytest.approx(8.0 / 9.0, rel=0.01)
