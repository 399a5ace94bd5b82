"""Probes of contact springs, of the walls that move them, and of the static limit."""

from __future__ import annotations

import math

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import LeverArm, SlipAt
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene, Wall, WallSegment
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.check_engine.claims import Claim, Probe, contact_error, round_off
from ninedisk.harness.check_engine.scenes import FLOOR, KN, G, M, R, has_springs, law, on_floor, some_disks
from ninedisk.references.analytic.spring_dashpot import contact_duration, contact_history

STEPS = 100
"""Steps in the quarter period, or half contact, that a probe follows."""

OMEGA = math.sqrt(KN / M)
"""Angular frequency of a disk on its contact spring [rad/s]."""

FIRST_ORDER = 0.5 * math.pi * (0.5 * math.pi / STEPS)
"""omega t times omega dt at the end of a quarter period: the relative error that a first-order scheme may have made."""

WHY = "first order in the step: omega t omega dt"


def impact(beta: float = 0.0) -> Probe:
    """A disk touches a floor at 0.1 m/s and is followed until half of the contact's duration."""
    speed = 0.1
    half = 0.5 * contact_duration(kn=KN, m_eff=M, beta=beta)
    scene = on_floor(ContactLaw(kn=KN, beta=beta), gravity=(0.0, 0.0), v=[[0.0, -speed]])
    numerics = Numerics(dt=half / STEPS, n_steps=STEPS, sample_from=STEPS // 2)
    deepest = speed / OMEGA

    def claims(history: History) -> list[Claim]:
        times = numerics.sampled_steps() * numerics.dt
        overlap, rate, force = contact_history(times[1:], kn=KN, m_eff=M, beta=beta, speed=speed)
        late = FIRST_ORDER + 0.5 * math.pi / STEPS
        # The dashpot acts in full from the first moment on, and a scheme of half steps feels it half a step late.
        strongest = KN * deepest * (1.0 + 2.0 * beta)
        return [
            Claim(quantity="overlap", unit="m", value=R - history.x[1:, 0, 1], expected=overlap, bound=FIRST_ORDER * deepest, why=WHY,
                  mend="the normal force is kn overlap" + (" + c rate, c = 2 beta sqrt(m_eff kn)" if beta else "")),
            Claim(quantity="v", unit="m/s", value=history.v[1:, 0, 1], expected=-rate, bound=late * speed, why=WHY),
            Claim(quantity="fn", unit="N", value=history.fn[1:, 0], expected=force, bound=2.0 * late * strongest,
                  why=f"{WHY}, and the force of a step before or after",
                  mend="fn is a force in N at t, or the impulse of the step that ends at t divided by dt (force_meaning)"),
        ]  # fmt: skip

    name = "spring and dashpot" if beta else "spring"
    return Probe(name=name, setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), claims=claims)


def rolling(arm: LeverArm, *, sunk: float = 0.2, speed: float = 0.5, force: float = 0.0) -> Probe:
    """A disk that sticks to a floor by its shear spring, thrown or with a preload ``force``, for a quarter period.

    With the arms a of the torque and b of the slip, the slip s = x + b angle obeys s'' = -(ks/m)(1 + m a b/I) s. ``sunk`` is
    the static overlap over the radius: 0.2 sets the arms R and R - overlap/2 a tenth apart.
    """
    overlap = sunk * R
    kn = M * G / overlap
    ks = kn
    short = R - 0.5 * overlap
    torque_arm = R if arm == "radius" else short
    slip_arm = short if arm == "overlap" else R
    inertia = 0.5 * M * R**2
    omega = math.sqrt(ks / M * (1.0 + M * torque_arm * slip_arm / inertia))
    contact = ContactLaw(kn=kn, ks=ks, mu=100.0, lever_arm=arm)
    scene = on_floor(contact, overlap=overlap, v=[[speed, 0.0]])
    scene = scene.replace(initial_shear={FLOOR: force} if force else {})
    numerics = Numerics(dt=0.5 * math.pi / omega / STEPS, n_steps=STEPS, sample_from=STEPS, theta=0.5)
    pull = ks * speed / omega  # of the slip at the end
    apart = 0.01 * R

    def claims(history: History) -> list[Claim]:
        x, v = float(history.x[-1, 0, 0]), float(history.v[-1, 0, 0])
        angle, spin, fs = float(history.angle[-1, 0]), float(history.omega[-1, 0]), float(history.fs[-1, 0])
        impulse = pull / omega if speed else -force / omega
        torque_seen = inertia * spin / (M * (v - speed)) if v != speed else math.nan
        slip_seen = (-fs / ks - x) / angle if angle else math.nan
        found = [
            Claim(quantity="v", unit="m/s", value=v, expected=speed - impulse / M, bound=2.0 * FIRST_ORDER * abs(impulse) / M, why=WHY,
                  mend="the shear force grows by ks times the slip of each step; Scene.initial_shear is where it begins"),
            Claim(quantity="arm of the torque, I omega / m (v - v0)", unit="m", value=torque_seen,
                  expected=torque_arm, bound=apart, why="a tenth of what the lever arms differ by",
                  mend="the shear torque's arm is that of ContactLaw.lever_arm; declare only the ones that the engine has"),
        ]  # fmt: skip
        if speed:
            found += [
                Claim(quantity="fs", unit="N", value=fs, expected=-pull, bound=2.0 * FIRST_ORDER * pull, why=WHY),
                Claim(quantity="arm of the slip, (-fs/ks - x)/angle", unit="m", value=slip_seen, expected=slip_arm,
                      bound=apart, why="a tenth of what the lever arms differ by",
                      mend="the slip by rotation uses the arm of ContactLaw.lever_arm"),
            ]  # fmt: skip
        return found

    name = f"preload, arm {arm}" if force else f"rolling, arm {arm}"
    return Probe(name=name, setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), claims=claims)


def passing(info: EngineInfo, slip_at: SlipAt) -> Probe:
    """A disk flies past another one, deep in its contact, whose forces are too weak to turn it aside.

    It passes the other's centre at the distance h with the speed v: the slip is the integral of ``v h/r`` over the time, and the
    rectangle rule of the steps' ends adds ``dt/2`` times what its integrand grows by.
    """
    speed, height, way, count = 1.0, 0.5 * R, 1.5 * R, 50
    dt = way / speed / count
    # In the time T of the way a contact moves disks by some kn overlap T^2/m: round-off of the way.
    kn = 1e-12 * M * (speed / way) ** 2
    # Slips of up to 0.9 R on overlaps of 0.4 R and more do not reach the cone.
    contact = ContactLaw(kn=kn, ks=kn, mu=10.0, slip_at=slip_at)
    turning = Capability.BLOCKED_ROTATION not in info.capabilities
    scene = Scene(
        disks=some_disks(x=[[0.0, 0.0], [-way, height]], v=[[0.0, 0.0], [speed, 0.0]], rotating=[turning, turning]),
        disk_disk=contact,
    )
    numerics = Numerics(dt=dt, n_steps=count, contact_dt=dt, sample_from=count)
    grown = speed * (1.0 - height / math.hypot(way, height))
    slip = height * math.asinh(way / height) + (0.5 * dt * grown if slip_at == "end" else 0.0)

    def claims(history: History) -> list[Claim]:
        return [
            Claim(quantity="slip, -fs/ks", unit="m", value=-history.fs[-1, 0] / kn, expected=slip,
                  bound=0.125 * dt * grown, why="a quarter of what the two places in the step differ by",
                  mend="the slip of the half step's velocities is measured with the normal of ContactLaw.slip_at"),
        ]  # fmt: skip

    return Probe(
        name=f"passing, slip at the {slip_at}",
        setup=Setup(scene=scene, numerics=numerics, watch=((0, 1),)),
        claims=claims,
    )


def driven(info: EngineInfo, motion: str) -> Probe:
    """A disk that touches a floor which begins to move: uniformly, about a distant pivot, or from rest along a cosine.

    Springs carry it by ``u'' = omega^2 (floor - u)``; a rigid floor carries it along.
    """
    springs = has_springs(info)
    count = STEPS if springs else 20
    dt = 0.5 * math.pi / OMEGA / STEPS if springs else 1e-3
    end, speed, lever = count * dt, 0.2, 2.0
    frequency = 0.5 * OMEGA if springs else 1.0 / end
    amplitude = speed / frequency
    segment = {
        "moving": WallSegment(velocity=(0.0, speed)),
        "turning": WallSegment(angular_velocity=speed / lever, pivot=(0.0, 0.0)),
        "curved": WallSegment(amplitude=(0.0, amplitude), frequency=frequency, phase=-0.5 * math.pi),
    }[motion]
    at = lever if motion == "turning" else 0.0
    scene = on_floor(law(info, ks=0.0), gravity=(0.0, 0.0), motion=(segment,), x=at)
    numerics = Numerics(dt=dt, n_steps=count)
    eps = round_off(info)

    def claims(history: History) -> list[Claim]:
        t = numerics.sampled_steps() * dt
        floor = amplitude * (1.0 - np.cos(frequency * t)) if motion == "curved" else speed * t
        turned = speed / lever * t if motion == "turning" else 0.0 * t
        height = np.zeros_like(t) if motion == "turning" else floor
        if not springs:
            carried, bound = floor, speed * dt + contact_error(info) * speed * end
            why = "a step's way of the wall"
        elif motion == "curved":
            part = OMEGA**2 / (OMEGA**2 - frequency**2)
            carried = amplitude * (1.0 - np.cos(OMEGA * t) - part * (np.cos(frequency * t) - np.cos(OMEGA * t)))
            bound, why = FIRST_ORDER * speed / OMEGA, WHY
        else:
            carried = speed * t - speed / OMEGA * np.sin(OMEGA * t)
            bound, why = FIRST_ORDER * speed / OMEGA, WHY
        # A floor that turns by a small angle meets the disk this much nearer to the pivot, or higher.
        bound += speed * end * float(turned[-1])
        mend = "a wall pushes where it is at t_n, pose by WallSegment: move it every step"
        return [
            Claim(quantity="way of the disk", unit="m", value=history.x[:, 0, 1] - R, expected=carried, bound=bound, why=why, mend=mend),
            Claim(quantity="wall_point", unit="m", value=history.wall_point[:, 0], expected=np.column_stack([0.0 * t, height]),
                  bound=10 * eps, why="a prescribed motion", mend="wall_point is the wall's reference point, moved with it"),
            Claim(quantity="wall_angle", unit="rad", value=history.wall_angle[:, 0], expected=0.5 * math.pi + turned, bound=10 * eps,
                  why="a prescribed motion", mend="wall_angle is the direction of the wall's normal [rad]"),
        ]  # fmt: skip

    return Probe(name=f"{motion} wall", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), claims=claims)


def squeezed(info: EngineInfo) -> Probe:
    """The static limit: a disk between a floor and a lid that comes down takes half of the way at either contact."""
    contact = law(info, ks=0.0)
    way, count = 1e-3, 5
    lid = Wall(
        name="lid", point=(0.0, 2.0 * R), normal=(0.0, -1.0), law=contact, motion=(WallSegment(velocity=(0.0, -way)),)
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact)
    scene = Scene(disks=some_disks(x=[[0.0, R]]), disk_disk=contact, walls=(floor, lid))
    numerics = Numerics(dt=1.0, n_steps=count, regime="quasi-static")

    def claims(history: History) -> list[Claim]:
        down = 0.5 * way * numerics.sampled_steps()
        bound = contact_error(info)
        return [
            Claim(quantity="fn", unit="N", value=history.fn, expected=np.column_stack([KN * down, KN * down]),
                  bound=bound * KN * float(down[-1]), why="the solver's tolerance", mend="each step ends in equilibrium"),
            Claim(quantity="way of the disk", unit="m", value=R - history.x[:, 0, 1], expected=down, bound=bound * float(down[-1]),
                  why="the solver's tolerance"),
        ]  # fmt: skip

    return Probe(name="squeezed", setup=Setup(scene=scene, numerics=numerics, watch=((0, 1), (0, 2))), claims=claims)
