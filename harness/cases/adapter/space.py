"""Probes of what is asked in space: spheres on an oblique floor, Hertz-Mindlin, unloading, twisting, pull-off."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import Rolling, SphereLaw, Surface, Unloading
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.boxes import rotation_matrix
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import FloatArray, SphereSetup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.adapter.probes import (
    FIRST_ORDER,
    FLOOR,
    KN,
    STEPS,
    THROWN_MU,
    THROWN_SPEED,
    WHY,
    ClosedForm,
    G,
    M,
    Probe,
    R,
    contact_error,
    has_springs,
    resting_overlap,
    round_off,
    thrown_loss,
)

UP = np.array([2.0, -1.0, 2.0]) / 3.0
"""Normal of the floor: no two components of one size and sign, so that axes that are exchanged or turned show."""

ALONG = np.array([1.0, 2.0, 0.0]) / math.sqrt(5.0)
"""A direction in the floor."""

E_STAR, G_STAR = 1e7, 4e6
"""Moduli of the contacts [Pa]."""

SURFACE = 5.0
"""Surface energy [J/m^2] whose pull-off is some ten times the weight."""


def law(info: EngineInfo, **changes: Any) -> SphereLaw:
    """Linear contact of a probe in the engine's own kind of contact."""
    rigid = {} if has_springs(info) else {"regularised": True, "restitution": 0.0}
    own = next((arm for arm, held_by in LEVER_ARMS.items() if held_by in info.capabilities), "radius")
    values: dict[str, Any] = {"kn": KN, "ks": KN, "lever_arm": own, **rigid, **changes}
    return SphereLaw(**values)


def hertz(**changes: Any) -> SphereLaw:
    """Hertz-Mindlin contact of a probe."""
    values: dict[str, Any] = {"e_star": E_STAR, **changes}
    return SphereLaw(**values)


def on_floor(contact: SphereLaw, overlap: float, *, gravity: float = G, **sphere: Any) -> SphereScene:
    """One sphere above an oblique floor through the origin; ``sphere`` goes to `Spheres`."""
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=_three(UP), law=contact)
    spheres = Spheres(**{"x": [(R - overlap) * UP], "radius": R, "mass": M, **sphere})
    return SphereScene(spheres=spheres, sphere_sphere=contact, walls=(floor,), gravity=_three(-gravity * UP))


def _three(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


def resting_sphere(info: EngineInfo, **sampling: int) -> Probe:
    """A sphere at rest on an oblique floor, and one that flies beside it, turning; ``sampling`` goes to `Numerics`."""
    overlap = resting_overlap(info)
    v, omega, begin = np.array([0.3, -0.2, 1.5]), np.array([1.0, 2.0, -3.0]), 5.0 * ALONG + 3.0 * UP
    contact, both = law(info), np.stack([(R - overlap) * UP, begin])
    scene = on_floor(contact, overlap, x=both, v=[np.zeros(3), v], omega=[np.zeros(3), omega])
    numerics = Numerics(dt=0.002, n_steps=20).replace(**sampling)
    allowed, weight, gravity = contact_error(info), M * G, -G * UP

    def closed_forms(history: History) -> list[ClosedForm]:
        t = (numerics.sampled_steps() * numerics.dt)[:, None]
        lag = 0.5 * G * float(t[-1, 0]) * numerics.dt * (1.0 + 1e-6) + round_off(info)
        free = "round-off: nothing but gravity acts"
        axes = "give vectors with the axes of the scene; spins [rad/s] about its axes, and their integrals"
        still = "equilibrium: round-off and the solver's tolerance"
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[:, 1], expected=v + gravity * t, bound=10 * round_off(info), why=free,
                       mend="apply SphereScene.gravity to all three components"),
            ClosedForm(quantity="x", unit="m", value=history.x[:, 1], expected=begin + v * t + 0.5 * gravity * t**2, bound=lag,
                       why="g t dt/2: half a step's lag of first-order schemes", mend=axes),
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[:, 1], expected=np.tile(omega, (len(t), 1)),
                       bound=10 * round_off(info), why=free, mend=axes, observed=False),
            ClosedForm(quantity="angle", unit="rad", value=history.angle[:, 1], expected=omega * t, bound=10 * round_off(info), why=free,
                       mend=axes, observed=False),
            ClosedForm(quantity="fn", unit="N", value=history.fn[-1, 0], expected=weight, bound=allowed * weight, why=still,
                       mend="the spring of a sphere on a plane is that of its law; compression is positive"),
            ClosedForm(quantity="force on the floor", unit="N", value=history.wall_force[-1, 0], expected=-weight * UP,
                       bound=allowed * weight, why=still, mend="wall_force is the force of the spheres ON the wall", observed=False),
        ]  # fmt: skip

    return probe_of_spheres("spheres", scene, numerics, closed_forms)


def sliding_sphere(info: EngineInfo) -> Probe:
    """A sphere thrown along the floor in a direction that is no axis: it slows by mu g, and spins up by 5/2 mu g/R across."""
    mu, speed = 0.1, 1.0
    numerics = Numerics(dt=0.002, n_steps=50, sliding="coulomb")
    scene = on_floor(law(info, mu=mu), resting_overlap(info), v=[speed * ALONG])
    end = numerics.dt * numerics.n_steps
    slow = mu * G * numerics.dt + contact_error(info) * mu * G * end

    def closed_forms(history: History) -> list[ClosedForm]:
        spin = 2.5 * mu * G * end / R * np.cross(UP, ALONG)
        why = "friction may act one step less, in the first"
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1, 0], expected=(speed - mu * G * end) * ALONG, bound=slow, why=why,
                       mend="friction on a sliding sphere is mu fn against its slip, along no axis"),
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[-1, 0], expected=spin, bound=2.5 * slow / R, why=why,
                       mend="the torque is the arm from the centre to the contact times the force; a sphere has (2/5) m R^2"),
            ClosedForm(quantity="mean fs", unit="N", value=history.fs[1:, 0].mean(axis=0), expected=-mu * M * G * ALONG,
                       bound=slow / end * M, why=why, observed=False, mend="fs is the shear force on the first body, a vector"),
        ]  # fmt: skip

    return probe_of_spheres("sliding in space", scene, numerics, closed_forms)


def reported_losses(info: EngineInfo) -> Probe:
    """The same: friction takes mu m g times the slip, which shrinks by 7/2 mu g t."""
    scene = on_floor(law(info, mu=THROWN_MU), resting_overlap(info), v=[THROWN_SPEED * ALONG])
    return thrown_loss("energy budget in space", lambda numerics: _setup(scene, numerics), 3.5, info)


def elastic_impact() -> Probe:
    """Half a Hertz impact of a sphere on the floor: at its middle the overlap is the deepest and the sphere at rest."""
    speed = 0.1
    deepest = (15.0 * M * speed**2 / (16.0 * E_STAR * math.sqrt(R))) ** 0.4
    half = math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9) * deepest / speed
    scene = on_floor(hertz(), 0.0, gravity=0.0, v=[-speed * UP])
    numerics = Numerics(dt=half / STEPS, contact_dt=half / STEPS, n_steps=STEPS, sample_from=STEPS)

    def closed_forms(history: History) -> list[ClosedForm]:
        mend = (
            "Hertz: fn = (4/3) E* sqrt(R) overlap^(3/2), E* and R those of the contact (at a plane R is the sphere's)"
        )
        why = WHY.replace("omega t omega dt", "that of a linear spring of this duration")
        most = 4.0 / 3.0 * E_STAR * math.sqrt(R) * deepest**1.5
        return [
            ClosedForm(quantity="overlap", unit="m", value=R - history.x[-1, 0] @ UP, expected=deepest, bound=FIRST_ORDER * deepest,
                       why=why, mend=mend),
            ClosedForm(quantity="fn", unit="N", value=history.fn[-1, 0], expected=most, bound=1.5 * FIRST_ORDER * most, why=why,
                       mend=mend),
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1, 0], expected=np.zeros(3), bound=2.0 * FIRST_ORDER * speed, why=why,
                       mend=mend),
        ]  # fmt: skip

    return probe_of_spheres("Hertz impact", scene, numerics, closed_forms)


def lifted_sphere(unloading: Unloading) -> Probe:
    """A sphere so heavy that no contact moves it glides and rises from an overlap to a quarter of it: its shear spring shrinks.

    With s the way and a the contact radius, which halves: "none" gives 8 G* a s, "force" the integral of 8 G* a ds, "rescale" 8 G* a
    times a spring that obeys d(s/a) = ds/a. Of 8 G* a_0 s these are 1/2, 7/9 and 1/3.
    """
    sunk, path, end = 0.01 * R, 1e-4, 0.01
    heavy = 1e12
    share = {"none": 1.0 / 2.0, "force": 7.0 / 9.0, "rescale": 1.0 / 3.0}[unloading]
    velocity = (path * ALONG + 0.75 * sunk * UP) / end
    contact = hertz(g_star=G_STAR, mu=1.0, unloading=unloading)
    scene = on_floor(contact, sunk, gravity=0.0, mass=heavy, v=[velocity])
    numerics = Numerics(dt=end / STEPS, contact_dt=end / STEPS, n_steps=STEPS, sample_from=STEPS)
    force = share * 8.0 * G_STAR * math.sqrt(R * sunk) * path

    def closed_forms(history: History) -> list[ClosedForm]:
        return [
            ClosedForm(quantity="fs", unit="N", value=history.fs[-1, 0], expected=-force * ALONG, bound=2.0 / STEPS * force,
                       why="two of the steps: where in a step the contact radius is taken, and whether the first has a slip",
                       mend=f"unloading = {unloading!r} says what the shear spring does while the contact radius falls (SphereLaw)"),
        ]  # fmt: skip

    return probe_of_spheres(f"unloading {unloading}", scene, numerics, closed_forms)


def twisting_sphere(info: EngineInfo, *, spring: bool) -> Probe:
    """A sphere that spins on the floor about its normal: it slows by 5/2 mu g/R, or swings on a spring for a quarter period."""
    end, omega, mu = 0.1, 1.0, 0.02
    inertia = 0.4 * M * R**2
    rate = 0.5 * math.pi / end
    model = "elastic-plastic" if spring else "constant"
    resistance = Rolling(model=model, mu=10.0 if spring else mu, kr=inertia * rate**2 if spring else 0.0)  # type: ignore[arg-type]
    scene = on_floor(law(info, twisting=resistance), resting_overlap(info), omega=[omega * UP])
    numerics = Numerics(dt=end / STEPS, n_steps=STEPS, sample_from=STEPS)
    slowing = 2.5 * mu * G / R
    spin = 0.0 if spring else omega - slowing * end
    turn = omega / rate if spring else omega * end - 0.5 * slowing * end**2
    bound = 2.0 * (omega * rate if spring else slowing) * numerics.dt + contact_error(info) * omega

    def closed_forms(history: History) -> list[ClosedForm]:
        why = "two steps without the torque"
        mend = "twisting resists the relative spin about the normal by up to mu R fn (see ContactLaw.twisting); it is no rolling"
        return [
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[-1, 0], expected=spin * UP, bound=bound, why=why, mend=mend),
            ClosedForm(quantity="angle", unit="rad", value=history.angle[-1, 0], expected=turn * UP, bound=bound * end, why=why,
                       mend=mend, observed=False),
        ]  # fmt: skip

    return probe_of_spheres(f"twisting resistance {model}", scene, numerics, closed_forms)


def sticky_sphere(info: EngineInfo, surface: Surface) -> Probe:
    """A sphere at rest on a floor that pulls it: its overlap carries the weight and the pull.

    DMT: (4/3) E* a^3/R = m g + 4 pi g R, overlap a^2/R. JKR: (4/3) E* a^3/R - 4 sqrt(pi g E* a^3) = m g, quadratic in a^(3/2), overlap
    a^2/R - 2 sqrt(pi g a/E*).
    """
    weight = M * G
    if surface == "dmt":
        a = (0.75 * R * (weight + 4.0 * math.pi * SURFACE * R) / E_STAR) ** (1.0 / 3.0)
        overlap = a**2 / R
    else:
        p, q = 4.0 * E_STAR / (3.0 * R), 4.0 * math.sqrt(math.pi * SURFACE * E_STAR)
        a = ((q + math.sqrt(q**2 + 4.0 * p * weight)) / (2.0 * p)) ** (2.0 / 3.0)
        overlap = a**2 / R - 2.0 * math.sqrt(math.pi * SURFACE * a / E_STAR)
    scene = on_floor(hertz(surface_energy=SURFACE, surface=surface), overlap)
    numerics = Numerics(dt=0.0005, n_steps=20, sample_from=20)

    def closed_forms(history: History) -> list[ClosedForm]:
        why, bound = (
            "equilibrium: round-off, and an equation in the contact radius solved to its tolerance",
            max(1e-6, round_off(info)),
        )
        mend = f"surface = {surface!r}, surface_energy that of one face: the pull-off is {'4' if surface == 'dmt' else '3'} pi g R"
        return [
            ClosedForm(quantity="fn", unit="N", value=history.fn[-1, 0], expected=weight, bound=bound * weight, why=why, mend=mend),
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1, 0], expected=np.zeros(3), bound=bound * G * 0.01, why=why, mend=mend),
        ]  # fmt: skip

    return probe_of_spheres(f"surface {surface}", scene, numerics, closed_forms)


def spinning_box(info: EngineInfo) -> Probe:
    """A smooth box that stands on the oblique floor with a face and spins about the floor's normal: it keeps its spin and its place."""
    half, spin, weight = np.array([0.5, 0.3, 0.4]), 3.0, M * G
    # The shortest rotation that takes z to the floor's normal; the box then turns about that axis of its frame.
    first = np.array([1.0 + UP[2], -UP[1], UP[0], 0.0]) / math.sqrt(2.0 + 2.0 * UP[2])
    scene = on_floor(
        law(info), 0.0, x=[half[2] * UP], radius=None, half_sizes=[half], quaternion=[first], omega=[spin * UP]
    )
    numerics = Numerics(dt=0.002, n_steps=20)
    end = numerics.dt * numerics.n_steps
    turn = spin * end
    allowed = contact_error(info)

    def closed_forms(history: History) -> list[ClosedForm]:
        along = np.full(3, np.nan) if history.quaternion is None else rotation_matrix(history.quaternion[-1, 0])[:, 0]
        start = rotation_matrix(first)
        moment = np.full(3, np.nan) if history.moment is None else history.moment[-1, 0]
        still = "equilibrium: round-off and the solver's tolerance"
        mend = "a box touches a plane with the corners of a face; its centre is half an edge above"
        return [
            ClosedForm(quantity="fn", unit="N", value=history.fn[-1, 0], expected=weight, bound=allowed * weight, why=still, mend=mend),
            ClosedForm(quantity="gap", unit="m", value=history.gap[-1, 0], expected=0.0, bound=1e-3 * R,
                       why="a soft contact sinks by less", mend="the gap of a box is the smallest distance of its corners from the plane"),
            ClosedForm(quantity="x", unit="m", value=history.x[-1, 0], expected=half[2] * UP, bound=1e-3 * R,
                       why="a soft contact sinks by less", mend=mend),
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[-1, 0], expected=spin * UP, bound=max(allowed, 1e-9) * spin,
                       why="nothing acts about the normal", mend="spins of boxes have the axes of the scene"),
            ClosedForm(quantity="first axis of the box", unit="1", value=along,
                       expected=math.cos(turn) * start[:, 0] + math.sin(turn) * start[:, 1],
                       bound=turn * (spin * numerics.dt) ** 2 + allowed * turn,
                       why="a step's rotation is exact to the third order of its angle",
                       mend="quaternions (w, x, y, z) take the frames of the bodies to the scene's"),
            ClosedForm(quantity="moment", unit="N m", value=moment, expected=np.zeros(3), bound=(max(allowed, 1e-9) + 1e-3) * weight * R,
                       why="forces at four corners that balance; a soft contact shares them by overlaps", observed=False,
                       mend="moment is the torque of the contact forces on the first body about its centre"),
        ]  # fmt: skip

    return probe_of_spheres("boxes", scene, numerics, closed_forms)


def alone(info: EngineInfo, **sphere: Any) -> SphereScene:
    """One sphere at the origin, without gravity; ``sphere`` goes to `Spheres`."""
    spheres = Spheres(**{"x": [[0.0, 0.0, 0.0]], "radius": R, "mass": M, **sphere})
    return SphereScene(spheres=spheres, sphere_sphere=law(info))


def probe_of_spheres(title: str, scene: SphereScene, numerics: Numerics, closed_forms: Any) -> Probe:
    """A probe that watches the first sphere at the first wall, where there is one."""
    return Probe(title=title, setup=_setup(scene, numerics), closed_forms=closed_forms)


def _setup(scene: SphereScene, numerics: Numerics) -> SphereSetup:
    watch = ((FLOOR[0], len(scene.spheres)),) if scene.walls else ()
    return SphereSetup(scene=scene, numerics=numerics, watch=watch)
