"""The probe of each capability: a case whose scene needs it, and little else, with its closed form.

Probes are in no list of cases and in no matrix: their truths hold an adapter to the meaning of a scene, not a method to its
accuracy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.history import History
from ninedisk.core.law import LeverArm, RollingModel, SlipAt
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, Cell, ContactLaw, Disks, Rolling, Scene, Wall, WallSegment
from ninedisk.harness.api.capabilities import LEVER_ARMS, Capability
from ninedisk.harness.api.case import Check, FloatArray, Norm, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import SOFTEST, EngineInfo
from ninedisk.harness.cases.nurbs.grains import grains
from ninedisk.harness.run.judge import blank_history
from ninedisk.references.analytic.impact.spring_dashpot import beta_of_restitution, contact_duration, contact_history

SHALLOW = 1e-4
"""Overlap over radius at which all lever arms are the same to that part."""

COARSE = 0.3
"""Part of a quantity's scale that a run which is graded approximate may be off: conventions stay below, a wrong unit, sign or
factor of two does not."""

R, M, KN, G = 0.5, 2.0, 1e6, 9.81
"""Radius [m], mass [kg], stiffness [N/m] and gravity [m/s^2]: no two alike, so that one in place of another shows."""

FLOOR = (0, 1)
"""The contact of a single disk with a single wall."""

STEPS = 100
"""Steps in the quarter period, or half contact, that a probe follows."""

OMEGA = math.sqrt(KN / M)
"""Angular frequency of a disk on its contact spring [rad/s]."""

FIRST_ORDER = 0.5 * math.pi * (0.5 * math.pi / STEPS)
"""omega t times omega dt at the end of a quarter period: the relative error that a first-order scheme may have made."""

WHY = "first order in the step: omega t omega dt"

FLAT = 0.6
"""Half-axis of the ellipse across the floor, over that along it."""

COARSE_GRADE = Parameter(
    name="coarse",
    default=False,
    choices=(False, True),
    help="whether the run is graded approximate: bounds of `COARSE`",
)


@dataclass(frozen=True, kw_only=True)
class ClosedForm:
    """A quantity of a run beside its closed form; ``bound`` is absolute, ``why`` says where it comes from.

    ``value`` and ``expected`` are a number, or arrays; an array with a row a sample is a series for each of its columns, any
    other a number for each of its entries. ``mend`` says what is wrong with an adapter that misses it; where not ``observed``,
    NaN is allowed.
    """

    quantity: str
    unit: str
    value: ArrayLike
    expected: ArrayLike
    bound: float
    why: str
    mend: str = ""
    observed: bool = True

    def parts(self, samples: int) -> list[tuple[str, Norm, FloatArray, FloatArray]]:
        """Name, norm, value and closed form of each series, shape (samples,), or number, shape ()."""
        value, expected = np.broadcast_arrays(np.asarray(self.value, dtype=np.float64), self.expected)
        norm: Norm = "max" if value.ndim and len(value) == samples else "scalar"
        shape = (samples, -1) if norm == "max" else (1, -1)
        columns = [
            (a, b) if norm == "max" else (a[0], b[0])
            for a, b in zip(value.reshape(shape).T, expected.reshape(shape).T, strict=True)
        ]
        names = [self.quantity] if len(columns) == 1 else [f"{self.quantity}[{k}]" for k in range(len(columns))]
        return [(name, norm, *column) for name, column in zip(names, columns, strict=True)]


@dataclass(kw_only=True)
class Probe:
    """A case of one scene; ``closed_forms`` takes a history and says what is known about it."""

    title: str
    setup: Setup
    closed_forms: Callable[[History], Sequence[ClosedForm]]
    id: str = field(init=False)
    version: int = 1
    source: str = "closed form"
    requirement: str = "what the capability means, in the units of the scene"
    parameters: tuple[Parameter, ...] = (COARSE_GRADE,)

    def __post_init__(self) -> None:
        self.id = "adapter/" + self.title.replace(",", "").replace(" ", "-")

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """The scene itself."""
        return ({},)

    def build(self, params: Mapping[str, Any]) -> Setup:  # noqa: ARG002
        """The scene."""
        return self.setup

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """What has a closed form."""
        series, scalars = {}, {}
        for form in self.closed_forms(history):
            for name, norm, value, _ in form.parts(len(history.step)):
                if norm == "max":
                    series[name] = (form.unit, value)
                else:
                    scalars[name] = (form.unit, float(value))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,
        engine: EngineInfo,  # noqa: ARG002
    ) -> Sequence[Check]:
        """The closed forms, which depend on no value of a history; coarsely where the run is graded approximate."""
        found = []
        for form in self.closed_forms(blank_history(setup)):
            scale = float(np.abs(np.asarray(form.expected, dtype=np.float64)).max(initial=0.0))
            for name, norm, _, expected in form.parts(len(observed.step)):
                value = (observed.series if norm == "max" else observed.scalars)[name][1]
                truth = expected if form.observed else np.where(np.isnan(value), np.nan, expected)
                found.append(
                    Check(
                        quantity=name,
                        norm=norm,
                        truth="analytic",
                        expected=truth,
                        source=self.source,
                        atol=max(form.bound, COARSE * scale) if params["coarse"] else form.bound,
                        why=form.why,
                    )
                )
        return found


def round_off(info: EngineInfo) -> float:
    """Relative bound of what every engine of this precision does to the last bits in some ten or hundred steps."""
    return 1e-4 if "32" in info.precision else 1e-10


def contact_error(info: EngineInfo) -> float:
    """Relative bound of a contact's force where nothing but the solver, or the engine's own softness, errs."""
    if info.contact == "soft":
        return max(SOFTEST if info.softness is None else info.softness, 1e-6)
    return max(1e-6, round_off(info))


def has_springs(info: EngineInfo) -> bool:
    """Whether contacts of the engine follow the scene's kn; else its contacts are rigid, and kn only regularises them."""
    return Capability.LINEAR_CONTACT in info.capabilities


def some_disks(**state: Any) -> Disks:
    """Disks of the probes' radius and mass, in a state; `Disks` takes lists as well as arrays."""
    return Disks(**{"radius": R, "mass": M, **state})


def law(info: EngineInfo, **changes: Any) -> ContactLaw:
    """The contact law of a probe in the engine's own kind of contact."""
    rigid = {} if has_springs(info) else {"regularised": True, "restitution": 0.0}
    values: dict[str, Any] = {"kn": KN, "ks": KN, **rigid, **changes}
    return ContactLaw(**values)


def on_floor(
    contact: ContactLaw,
    *,
    overlap: float = 0.0,
    gravity: tuple[float, float] = (0.0, -G),
    motion: Sequence[WallSegment] = (),
    x: float = 0.0,
    **disk: Any,
) -> Scene:
    """One disk above a floor through the origin; ``disk`` goes to `Disks`."""
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact, motion=tuple(motion))
    moved = some_disks(x=[[x, R - overlap]], **disk)
    return Scene(disks=moved, disk_disk=contact, walls=(floor,), gravity=gravity)


def resting_overlap(info: EngineInfo, mass: float = M) -> float:
    """Overlap at which springs carry a disk [m]; 0 for rigid contacts."""
    return mass * G / KN if has_springs(info) else 0.0


def free_flight(info: EngineInfo, **sampling: int) -> Probe:
    """A disk without forces: the state it was given, moved on. ``sampling`` goes to `Numerics`."""
    v, omega = np.array([1.5, -0.7]), 2.0
    moved = some_disks(x=[[0.3, 0.4]], v=[v], omega=[omega])
    scene = Scene(disks=moved, disk_disk=law(info))
    numerics = Numerics(dt=0.01, n_steps=17).replace(**sampling)
    eps = round_off(info)

    def closed_forms(history: History) -> list[ClosedForm]:
        t = numerics.sampled_steps() * numerics.dt
        why = "round-off: nothing acts"
        mend = "report positions in m, angles in rad, and the state at the sampled step itself"

        def closed(
            quantity: str, unit: str, value: ArrayLike, expected: ArrayLike, *, observed: bool = True
        ) -> ClosedForm:
            return ClosedForm(
                quantity=quantity,
                unit=unit,
                value=value,
                expected=expected,
                bound=10 * eps,
                why=why,
                mend=mend,
                observed=observed,
            )

        return [
            closed("x", "m", history.x[:, 0], [0.3, 0.4] + t[:, None] * v),
            closed("v", "m/s", history.v[:, 0], np.tile(v, (len(t), 1))),
            closed("angle", "rad", history.angle[:, 0], omega * t, observed=False),
            closed("omega", "rad/s", history.omega[:, 0], np.full(len(t), omega), observed=False),
        ]

    return Probe(title="free flight", setup=Setup(scene=scene, numerics=numerics, watch=()), closed_forms=closed_forms)


def falling_disk(info: EngineInfo) -> Probe:
    """A disk in a field that is no multiple of an axis: v to round-off, x to the first order of every scheme."""
    g = np.array([3.0, -G])
    moved = some_disks(x=[[0.0, 0.0]], v=[[0.2, 1.0]])
    scene = Scene(disks=moved, disk_disk=law(info), gravity=(3.0, -G))
    numerics = Numerics(dt=0.005, n_steps=40)

    def closed_forms(history: History) -> list[ClosedForm]:
        t = (numerics.sampled_steps() * numerics.dt)[:, None]
        lag = 0.5 * G * float(t[-1, 0]) * numerics.dt * (1.0 + 1e-6) + round_off(info)
        mend = "apply Scene.gravity as an acceleration [m/s^2] to both components, once a step"
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[:, 0], expected=[0.2, 1.0] + g * t, bound=10 * round_off(info),
                  why="a constant acceleration is exact in v", mend=mend),
            ClosedForm(quantity="x", unit="m", value=history.x[:, 0], expected=[0.2, 1.0] * t + 0.5 * g * t**2, bound=lag,
                  why="g t dt/2: half a step's lag of first-order schemes", mend=mend),
        ]  # fmt: skip

    return Probe(title="fall", setup=Setup(scene=scene, numerics=numerics, watch=()), closed_forms=closed_forms)


def resting_disks(info: EngineInfo) -> Probe:
    """Two disks of unlike mass at rest on a floor, watched in their own order: each contact carries its own weight."""
    masses = np.array([1.0, 3.0])
    overlap = np.array([resting_overlap(info, mass) for mass in masses])
    contact = law(info)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact)
    moved = some_disks(x=[[0.0, R - overlap[0]], [3.0, R - overlap[1]]], mass=masses)
    scene = Scene(disks=moved, disk_disk=contact, walls=(floor,), gravity=(0.0, -G))
    numerics = Numerics(dt=0.002, n_steps=20, sample_from=20)
    allowed, weight = contact_error(info), masses * G

    def closed_forms(history: History) -> list[ClosedForm]:
        fn, gap = history.fn[-1], history.gap[-1]
        sunk = [-overlap[1], -overlap[0], 3.0 - 2.0 * R]
        why = "equilibrium: round-off and the solver's tolerance"
        slack = 1e-9 if has_springs(info) else max(1e-3, allowed) * R
        return [
            ClosedForm(quantity="fn of the pairs (1, 2), (0, 2), (0, 1)", unit="N", value=fn, expected=[weight[1], weight[0], 0.0],
                  bound=float(allowed * weight.max()), why=why,
                  mend="give columns in the order of `watch`, forces in N (impulses divided by dt), compression positive, open contacts 0"),
            ClosedForm(quantity="gap of the same pairs", unit="m", value=gap, expected=sunk, bound=slack,
                  why="kn gap = weight" if has_springs(info) else "rigid disks may sink by a thousandth of their radius",
                  mend="gaps are positive where open, negative where bodies overlap: centre distance less radii"),
            ClosedForm(quantity="force on the floor", unit="N", value=history.wall_force[-1, 0], expected=[0.0, -float(weight.sum())],
                  bound=float(allowed * weight.sum()), why=why,
                  mend="wall_force is the force of the disks ON the wall, summed over them", observed=False),
        ]  # fmt: skip

    watch = ((1, 2), (0, 2), (0, 1))
    return Probe(title="weights", setup=Setup(scene=scene, numerics=numerics, watch=watch), closed_forms=closed_forms)


def sliding(info: EngineInfo, own: LeverArm, *, rotating: bool) -> Probe:
    """A disk thrown along a floor: it slows by mu g and, where it can turn, spins up by 2 mu g/R. The arm ``own`` is nearly R."""
    mu, speed = 0.1, 1.0
    numerics = Numerics(dt=0.002, n_steps=50, sliding="coulomb")
    contact = law(info, mu=mu, lever_arm=own)
    scene = on_floor(contact, overlap=resting_overlap(info), v=[[speed, 0.0]], rotating=rotating)
    end = numerics.dt * numerics.n_steps
    slow = mu * G * numerics.dt + contact_error(info) * mu * G * end

    def closed_forms(history: History) -> list[ClosedForm]:
        spin = -2.0 * mu * G * end / R if rotating else 0.0
        why = "friction may act one step less, in the first"
        return [
            ClosedForm(quantity="v along the floor", unit="m/s", value=history.v[-1, 0, 0], expected=speed - mu * G * end,
                       bound=slow, why=why,
                  mend="friction on a sliding disk is mu fn against its slip"),
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[-1, 0], expected=spin, bound=2.0 * slow / R, why=why,
                  mend="a disk's inertia is that of Disks.inertia; a blocked disk keeps its spin; counter-clockwise is positive"),
            ClosedForm(quantity="mean fs", unit="N", value=np.mean(history.fs[1:, 0]), expected=-mu * M * G, bound=slow / end * M,
                  why=why, observed=False,
                  mend="the shear force on the first body counts along t = (-n_y, n_x), n from the first body to the second"),
        ]  # fmt: skip

    name = "sliding" if rotating else "sliding without rotation"
    return Probe(title=name, setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), closed_forms=closed_forms)


def rebounding_disk(info: EngineInfo) -> Probe:
    """A disk that touches a floor at 2 m/s, faster than any engine's threshold of rebounds, and leaves at half of it.

    The springs and dashpots that represent such a contact give the same restitution.
    """
    e, speed = 0.5, 2.0
    beta = beta_of_restitution(e)
    scene = on_floor(
        ContactLaw(kn=KN, beta=beta, regularised=True, restitution=e), gravity=(0.0, 0.0), v=[[0.0, -speed]]
    )
    count = 2 + math.ceil(contact_duration(kn=KN, m_eff=M, beta=beta) / 0.001)
    numerics = Numerics(dt=0.001, contact_dt=5e-6, n_steps=count, impact="newton")
    bound, why = (
        (0.01, "first order in contact_dt: omega t omega contact_dt")
        if has_springs(info)
        else (contact_error(info), "the solver's tolerance")
    )

    def closed_forms(history: History) -> list[ClosedForm]:
        return [
            ClosedForm(quantity="v after the impact", unit="m/s", value=history.v[-1, 0, 1], expected=e * speed,
                       bound=bound * speed, why=why,
                  mend="the relative normal velocity after an impact is -restitution times that before"),
        ]  # fmt: skip

    return Probe(
        title="rebound", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), closed_forms=closed_forms
    )


def damped_disk(info: EngineInfo, form: str) -> Probe:
    """A disk in a viscous medium, which slows its spin, too: v0 exp(-xi t), its discrete form where the engine's scheme has one."""
    xi, speed = 2.0, 1.0
    scene = Scene(disks=some_disks(x=[[0.0, 0.0]], v=[[speed, 0.0]], omega=[speed]), disk_disk=law(info), xi=xi)
    numerics = Numerics(
        dt=0.01,
        contact_dt=0.01,
        n_steps=50,
        sample_from=50,
        theta=0.5,
        damping_form="central" if form == "central" else "lagged",
    )
    factor, bound, why = damping_factor(info, form, xi * numerics.dt, numerics.n_steps)

    def closed_forms(history: History) -> list[ClosedForm]:
        mend = "global damping is the force -xi m v (and the moment -xi I omega); see Numerics.damping_form for the velocity that it sees"
        return [
            ClosedForm(quantity=name, unit=unit, value=value, expected=speed * factor, bound=speed * bound, why=why, mend=mend,
                       observed=name == "v")
            for name, unit, value in (("v", "m/s", history.v[-1, 0, 0]), ("omega", "rad/s", history.omega[-1, 0]))
        ]  # fmt: skip

    return Probe(
        title=f"damping, {form}", setup=Setup(scene=scene, numerics=numerics, watch=()), closed_forms=closed_forms
    )


def damping_factor(info: EngineInfo, form: str, step: float, count: int) -> tuple[float, float, str]:
    """What ``count`` steps of global damping leave of a velocity, with ``step`` = xi dt; how much this may be off, and why."""
    second = step * count * step**2
    if form == "central":
        return math.exp(-step * count), second, "second order: xi t (xi dt)^2"
    if info.scheme == "central-difference":
        why = "the exact steps of v(n+1/2) = (1 - xi dt) v(n-1/2), to second order in the start"
        return (1.0 - 0.5 * step) ** 2 * (1.0 - step) ** (count - 1), second, why
    return math.exp(-step * count), step * count * step, "first order: xi t xi dt"


def impact(beta: float = 0.0) -> Probe:
    """A disk touches a floor at 0.1 m/s and is followed until half of the contact's duration."""
    speed = 0.1
    half = 0.5 * contact_duration(kn=KN, m_eff=M, beta=beta)
    scene = on_floor(ContactLaw(kn=KN, beta=beta), gravity=(0.0, 0.0), v=[[0.0, -speed]])
    numerics = Numerics(dt=half / STEPS, n_steps=STEPS, sample_from=STEPS // 2)
    deepest = speed / OMEGA

    def closed_forms(history: History) -> list[ClosedForm]:
        times = numerics.sampled_steps() * numerics.dt
        overlap, rate, force = contact_history(times[1:], kn=KN, m_eff=M, beta=beta, speed=speed)
        late = FIRST_ORDER + 0.5 * math.pi / STEPS
        # The dashpot acts in full from the first moment on, and a scheme of half steps feels it half a step late.
        strongest = KN * deepest * (1.0 + 2.0 * beta)
        return [
            ClosedForm(quantity="overlap", unit="m", value=R - history.x[1:, 0, 1], expected=overlap, bound=FIRST_ORDER * deepest, why=WHY,
                  mend="the normal force is kn overlap" + (" + c rate, c = 2 beta sqrt(m_eff kn)" if beta else "")),
            ClosedForm(quantity="v", unit="m/s", value=history.v[1:, 0, 1], expected=-rate, bound=late * speed, why=WHY),
            ClosedForm(quantity="fn", unit="N", value=history.fn[1:, 0], expected=force, bound=2.0 * late * strongest,
                  why=f"{WHY}, and the force of a step before or after",
                  mend="fn is a force in N at t, or the impulse of the step that ends at t divided by dt (force_meaning)"),
        ]  # fmt: skip

    name = "spring and dashpot" if beta else "spring"
    return Probe(title=name, setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), closed_forms=closed_forms)


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

    def closed_forms(history: History) -> list[ClosedForm]:
        x, v = float(history.x[-1, 0, 0]), float(history.v[-1, 0, 0])
        angle, spin, fs = float(history.angle[-1, 0]), float(history.omega[-1, 0]), float(history.fs[-1, 0])
        impulse = pull / omega if speed else -force / omega
        torque_seen = inertia * spin / (M * (v - speed)) if v != speed else math.nan
        slip_seen = (-fs / ks - x) / angle if angle else math.nan
        found = [
            ClosedForm(quantity="v", unit="m/s", value=v, expected=speed - impulse / M, bound=2.0 * FIRST_ORDER * abs(impulse) / M, why=WHY,
                  mend="the shear force grows by ks times the slip of each step; Scene.initial_shear is where it begins"),
            ClosedForm(quantity="arm of the torque, I omega / m (v - v0)", unit="m", value=torque_seen,
                  expected=torque_arm, bound=apart, why="a tenth of what the lever arms differ by",
                  mend="the shear torque's arm is that of ContactLaw.lever_arm; declare only the ones that the engine has"),
        ]  # fmt: skip
        if speed:
            found += [
                ClosedForm(quantity="fs", unit="N", value=fs, expected=-pull, bound=2.0 * FIRST_ORDER * pull, why=WHY),
                ClosedForm(quantity="arm of the slip, (-fs/ks - x)/angle", unit="m", value=slip_seen, expected=slip_arm,
                      bound=apart, why="a tenth of what the lever arms differ by",
                      mend="the slip by rotation uses the arm of ContactLaw.lever_arm"),
            ]  # fmt: skip
        return found

    name = f"preload, arm {arm}" if force else f"rolling, arm {arm}"
    return Probe(title=name, setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), closed_forms=closed_forms)


def passing_disk(info: EngineInfo, slip_at: SlipAt) -> Probe:
    """A disk flies past another one, deep in its contact, whose forces are too weak to turn it aside.

    It passes the other's centre at the distance h with the speed v: the slip is the integral of ``v h/r`` over the time, and the
    rectangle rule of the steps' ends adds ``dt/2`` times what its integrand grows by.
    """
    speed, height, distance, count = 1.0, 0.5 * R, 1.5 * R, 50
    dt = distance / speed / count
    # In the time T of the distance a contact moves disks by some kn overlap T^2/m: round-off of the distance.
    kn = 1e-12 * M * (speed / distance) ** 2
    # Slips of up to 0.9 R on overlaps of 0.4 R and more do not reach the cone.
    contact = ContactLaw(kn=kn, ks=kn, mu=10.0, slip_at=slip_at)
    turning = Capability.BLOCKED_ROTATION not in info.capabilities
    scene = Scene(
        disks=some_disks(
            x=[[0.0, 0.0], [-distance, height]], v=[[0.0, 0.0], [speed, 0.0]], rotating=[turning, turning]
        ),
        disk_disk=contact,
    )
    numerics = Numerics(dt=dt, n_steps=count, contact_dt=dt, sample_from=count)
    grown = speed * (1.0 - height / math.hypot(distance, height))
    slip = height * math.asinh(distance / height) + (0.5 * dt * grown if slip_at == "end" else 0.0)

    def closed_forms(history: History) -> list[ClosedForm]:
        return [
            ClosedForm(quantity="slip, -fs/ks", unit="m", value=-history.fs[-1, 0] / kn, expected=slip,
                  bound=0.125 * dt * grown, why="a quarter of what the two places in the step differ by",
                  mend="the slip of the half step's velocities is measured with the normal of ContactLaw.slip_at"),
        ]  # fmt: skip

    return Probe(
        title=f"passing, slip at the {slip_at}",
        setup=Setup(scene=scene, numerics=numerics, watch=((0, 1),)),
        closed_forms=closed_forms,
    )


def driven_disk(info: EngineInfo, motion: str) -> Probe:
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

    def closed_forms(history: History) -> list[ClosedForm]:
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
            ClosedForm(quantity="disk displacement", unit="m", value=history.x[:, 0, 1] - R, expected=carried,
                       bound=bound, why=why, mend=mend),
            ClosedForm(quantity="wall_point", unit="m", value=history.wall_point[:, 0], expected=np.column_stack([0.0 * t, height]),
                  bound=10 * eps, why="a prescribed motion", mend="wall_point is the wall's reference point, moved with it"),
            ClosedForm(quantity="wall_angle", unit="rad", value=history.wall_angle[:, 0], expected=0.5 * math.pi + turned, bound=10 * eps,
                  why="a prescribed motion", mend="wall_angle is the direction of the wall's normal [rad]"),
        ]  # fmt: skip

    return Probe(
        title=f"{motion} wall", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), closed_forms=closed_forms
    )


def squeezed_disk(info: EngineInfo) -> Probe:
    """The static limit: a disk between a floor and a lid that comes down takes half of the way at either contact."""
    contact = law(info, ks=0.0)
    displacement, count = 1e-3, 5
    lid = Wall(
        name="lid",
        point=(0.0, 2.0 * R),
        normal=(0.0, -1.0),
        law=contact,
        motion=(WallSegment(velocity=(0.0, -displacement)),),
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact)
    scene = Scene(disks=some_disks(x=[[0.0, R]]), disk_disk=contact, walls=(floor, lid))
    numerics = Numerics(dt=1.0, n_steps=count, regime="quasi-static")

    def closed_forms(history: History) -> list[ClosedForm]:
        down = 0.5 * displacement * numerics.sampled_steps()
        bound = contact_error(info)
        return [
            ClosedForm(quantity="fn", unit="N", value=history.fn, expected=np.column_stack([KN * down, KN * down]),
                  bound=bound * KN * float(down[-1]), why="the solver's tolerance", mend="each step ends in equilibrium"),
            ClosedForm(quantity="disk displacement", unit="m", value=R - history.x[:, 0, 1], expected=down, bound=bound * float(down[-1]),
                  why="the solver's tolerance"),
        ]  # fmt: skip

    return Probe(
        title="squeezed", setup=Setup(scene=scene, numerics=numerics, watch=((0, 1), (0, 2))), closed_forms=closed_forms
    )


def ellipse_at_rest(info: EngineInfo) -> Probe:
    """An ellipse of half-axes R and 0.6 R, given upright and turned by a right angle: it rests at the height of the smaller one."""
    from ninedisk.core.nurbs.mass import uniform_grain
    from ninedisk.core.nurbs.shapes import ellipse

    grain = uniform_grain(ellipse(FLAT * R, R), M / (math.pi * FLAT * R**2))
    overlap, contact = resting_overlap(info), law(info)
    given = grains([grain], [0], x=[[0.0, FLAT * R - overlap]], angle=0.5 * math.pi)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact)
    scene = Scene(**given, disk_disk=contact, walls=(floor,), gravity=(0.0, -G))
    numerics = Numerics(dt=0.002, n_steps=20, sample_from=20)
    allowed = contact_error(info)

    def closed_forms(history: History) -> list[ClosedForm]:
        why = "equilibrium: round-off and the solver's tolerance"
        mend = "the body's surface is its outline, turned by Disks.angle, not the circle of Disks.radius around it"
        return [
            ClosedForm(quantity="fn", unit="N", value=history.fn[-1], expected=[M * G], bound=allowed * M * G, why=why, mend=mend),
            ClosedForm(quantity="gap", unit="m", value=history.gap[-1], expected=[-overlap], bound=max(1e-9, allowed * overlap),
                  why=why, mend=mend),
            ClosedForm(quantity="angle", unit="rad", value=history.angle[-1], expected=[0.0], bound=allowed, why=why,
                  mend="the flat side is the stable one, and angles count from time 0"),
        ]  # fmt: skip

    return Probe(
        title="ellipse at rest", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), closed_forms=closed_forms
    )


def lens_on_floor() -> Probe:
    """A disk sunk into a floor by a tenth of its radius, weighing what the law of the common area gives there.

    The segment has the area ``A = R^2 acos(h/R) - h c/2``, h its distance from the centre and c its chord, and the energy
    ``(kn/2) (9 A^2/(32 R))^(2/3)``, whose slope in A, times the chord, is the force.
    """
    depth = 0.1 * R
    h = R - depth
    chord = 2.0 * math.sqrt(R**2 - h**2)
    area = R**2 * math.acos(h / R) - 0.5 * h * chord
    energy = 0.5 * KN * (9.0 * area**2 / (32.0 * R)) ** (2.0 / 3.0)
    force = 4.0 / 3.0 * energy / area * chord
    scene = on_floor(ContactLaw(kn=KN, contact="area"), overlap=depth, gravity=(0.0, -force / M))
    numerics = Numerics(dt=0.002, n_steps=5)

    def closed_forms(history: History) -> list[ClosedForm]:
        return [
            ClosedForm(quantity="fn", unit="N", value=history.fn[:, 0], expected=[force] * len(history.fn), bound=1e-9 * force,
                  why="round-off: the disk is in equilibrium", mend="fn = U'(A) times the chord, see ContactLaw.contact"),
            ClosedForm(quantity="gap", unit="m", value=history.gap[:, 0], expected=[-depth] * len(history.gap), bound=1e-9 * R,
                  why="round-off: the disk is in equilibrium"),
        ]  # fmt: skip

    return Probe(
        title="lens on a floor", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), closed_forms=closed_forms
    )


def held_disk(info: EngineInfo) -> Probe:
    """A disk whose x velocity is prescribed falls freely along y."""
    moved = some_disks(x=[[0.0, 0.0]], v=[[0.3, 0.0]], held=[[True, False]])
    scene = Scene(disks=moved, disk_disk=law(info), gravity=(1.0, -2.0))
    numerics = Numerics(dt=0.01, n_steps=20)

    def closed_forms(history: History) -> list[ClosedForm]:
        t = numerics.sampled_steps() * numerics.dt
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[:, 0], expected=np.column_stack([np.full(len(t), 0.3), -2.0 * t]),
                  bound=10 * round_off(info), why="round-off", mend="a held component keeps its velocity, the other one stays free"),
            ClosedForm(quantity="x", unit="m", value=history.x[:, 0, 0], expected=0.3 * t, bound=10 * round_off(info), why="round-off"),
        ]  # fmt: skip

    return Probe(title="held", setup=Setup(scene=scene, numerics=numerics, watch=()), closed_forms=closed_forms)


def fixed_disk(info: EngineInfo) -> Probe:
    """A disk at rest on top of a fixed one, which stays where it is; a second fixed one overlaps the first without a force."""
    sunk = resting_overlap(info)
    x = [[0.0, 0.0], [0.0, 2.0 * R - sunk], [0.0, -R]]
    still = [True, False, True]
    disks = some_disks(x=x, held=np.column_stack([still, still]), rotating=[False, True, False])
    scene = Scene(disks=disks, disk_disk=law(info), gravity=(0.0, -G))
    numerics = Numerics(dt=0.002, n_steps=20)
    allowed = contact_error(info)

    def closed_forms(history: History) -> list[ClosedForm]:
        why = "round-off: nothing moves it"
        slack = 1e-9 if has_springs(info) else max(1e-3, allowed) * R
        return [
            ClosedForm(quantity="x of the fixed disks", unit="m", value=history.x[-1, [0, 2]], expected=[x[0], x[2]], bound=round_off(info),
                  why=why, mend="a disk that is held at rest in both directions and does not turn stays: gravity and contacts move it not"),
            ClosedForm(quantity="v of the fixed disks", unit="m/s", value=history.v[-1, [0, 2]], expected=np.zeros((2, 2)),
                       bound=0.0, why=why),
            ClosedForm(quantity="y of the disk on top", unit="m", value=history.x[-1, 1, 1], expected=x[1][1], bound=slack,
                  why="kn gap = weight" if has_springs(info) else "rigid disks may sink by a thousandth of their radius",
                  mend="a fixed disk bears contacts as a wall does"),
            ClosedForm(quantity="fn of the pair (0, 1)", unit="N", value=history.fn[-1, 0], expected=M * G, bound=float(allowed * M * G),
                  why="equilibrium: round-off and the solver's tolerance"),
        ]  # fmt: skip

    return Probe(title="fixed", setup=Setup(scene=scene, numerics=numerics, watch=((0, 1),)), closed_forms=closed_forms)


def two_materials(info: EngineInfo, own: LeverArm) -> Probe:
    """Two disks of unlike materials thrown along a floor of a third: each slows by mu g of its own pair, not of the wall's law."""
    mu, speed = np.array([0.1, 0.2]), 1.0
    overlap = resting_overlap(info)
    floor = Wall(
        name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law(info, mu=0.4, lever_arm=own), material="ground"
    )
    thrown = some_disks(
        x=[[0.0, R - overlap], [3.0, R - overlap]], v=[[speed, 0.0], [speed, 0.0]], material=("smooth", "rough")
    )
    scene = Scene(
        disks=thrown,
        disk_disk=floor.law,
        walls=(floor,),
        gravity=(0.0, -G),
        laws={
            (name, "ground"): law(info, mu=float(each), lever_arm=own)
            for name, each in zip(("smooth", "rough"), mu, strict=True)
        },
    )
    numerics = Numerics(dt=0.002, n_steps=50, sliding="coulomb")
    end = numerics.dt * numerics.n_steps
    slow = float(mu[1]) * G * (numerics.dt + contact_error(info) * end)

    def closed_forms(history: History) -> list[ClosedForm]:
        return [
            ClosedForm(quantity="v along the floor", unit="m/s", value=history.v[-1, :, 0], expected=speed - mu * G * end, bound=slow,
                  why="friction may act one step less, in the first", mend="a contact obeys the law of its two materials in Scene.laws"),
        ]  # fmt: skip

    return Probe(title="materials", setup=Setup(scene=scene, numerics=numerics, watch=()), closed_forms=closed_forms)


def pushed_disk(info: EngineInfo) -> Probe:
    """A free disk under a force and a torque that begin and end inside steps: their impulse is exact all the same."""
    force, torque, v, omega = np.array([3.0, -1.0]), 0.2, np.array([0.4, 0.1]), 1.0
    span = BodyForce(disk=0, force=(3.0, -1.0), torque=torque, begin=0.0132, end=0.0573)
    scene = Scene(
        disks=some_disks(x=[[0.0, 0.0]], v=[v], omega=[omega]), disk_disk=law(info), forces=(span,), gravity=(0.0, 0.0)
    )
    numerics = Numerics(dt=0.01, n_steps=10, sample_from=10)
    lasts = span.end - span.begin

    def closed_forms(history: History) -> list[ClosedForm]:
        common: dict[str, Any] = {
            "bound": 10.0 * round_off(info), "why": "round-off: the impulse of a step is the mean force times the step",
            "mend": "a force in Scene.forces acts from begin to end; the step in which it begins gets its part",
        }  # fmt: skip
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1, 0], expected=v + force * lasts / M, **common),
            ClosedForm(quantity="omega", unit="rad/s", value=history.omega[-1, 0],
                       expected=omega + torque * lasts / (0.5 * M * R**2), **common),
        ]  # fmt: skip

    return Probe(title="forces", setup=Setup(scene=scene, numerics=numerics, watch=()), closed_forms=closed_forms)


def resisted_disk(info: EngineInfo, own: LeverArm, model: RollingModel) -> Probe:
    """A disk that rolls along a floor against a torque: m a + (I/R) a/R = mu fn, so that a = (2/3) mu g; on a spring kr it swings.

    The rolling spring of "elastic-plastic" is so soft that a quarter of a period lasts 0.1 s, and its cap is out of reach.
    """
    speed, end = 0.1 if model == "elastic-plastic" else 1.0, 0.1
    omega = 0.5 * math.pi / end
    mu = {"constant": 0.1, "viscous": 0.5, "elastic-plastic": 10.0}[model]
    rolling = Rolling(model=model, mu=mu, kr=1.5 * M * R**2 * omega**2 if model == "elastic-plastic" else 0.0)
    contact = law(info, mu=0.5, rolling=rolling, lever_arm=own)
    scene = on_floor(contact, overlap=resting_overlap(info), v=[[speed, 0.0]], omega=[-speed / R])
    numerics = Numerics(dt=end / STEPS, n_steps=STEPS, sample_from=STEPS, sliding="coulomb", theta=0.5)
    slowing = 2.0 / 3.0 * mu * G
    v, x = {
        "constant": (speed - slowing * end, speed * end - 0.5 * slowing * end**2),
        "viscous": (speed * math.exp(-slowing * end), speed * (1.0 - math.exp(-slowing * end)) / slowing),
        "elastic-plastic": (0.0, speed / omega),
    }[model]
    strongest = speed * omega if model == "elastic-plastic" else slowing * speed
    # The shear spring, of ks = KN, is not stretched at first: the disk swings about its motion with that spring's frequency.
    swing = 2.0 * strongest / math.sqrt(3.0 * KN / M) if has_springs(info) else 0.0
    bound = 2.0 * strongest * numerics.dt + swing + contact_error(info) * speed

    def closed_forms(history: History) -> list[ClosedForm]:
        why = "two steps without the torque, and the swing on the shear spring"
        mend = "the torque is mu R fn against the relative spin (see ContactLaw.rolling), on both bodies, R the reduced radius"
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1, 0, 0], expected=v, bound=bound, why=why, mend=mend),
            ClosedForm(quantity="x", unit="m", value=history.x[-1, 0, 0], expected=x, bound=bound * end, why=why, mend=mend),
        ]  # fmt: skip

    return Probe(
        title=f"rolling resistance {model}",
        setup=Setup(scene=scene, numerics=numerics, watch=()),
        closed_forms=closed_forms,
    )


def hertz_disk(info: EngineInfo) -> Probe:
    """A disk at rest on a floor by Hertz' law of a sphere: ``m g = (4/3) E* sqrt(R) overlap^(3/2)``."""
    e_star = 1e7
    sunk = (0.75 * M * G / (e_star * math.sqrt(R))) ** (2.0 / 3.0)
    scene = on_floor(ContactLaw(e_star=e_star), overlap=sunk)
    numerics = Numerics(dt=0.0005, n_steps=20)

    mend = "a contact of disks with e_star is that of spheres of the same radii: fn = (4/3) E* sqrt(R) overlap^(3/2)"
    return Probe(
        title="Hertz' law of a disk",
        setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)),
        closed_forms=_rests(info, sunk, mend),
    )


def _rests(info: EngineInfo, sunk: float, mend: str) -> Callable[[History], list[ClosedForm]]:
    """Overlap and force of a disk that rests on a floor, ``sunk`` [m] deep."""
    why, bound = "equilibrium: round-off", round_off(info)

    def closed_forms(history: History) -> list[ClosedForm]:
        return [
            ClosedForm(quantity="overlap", unit="m", value=R - history.x[:, 0, 1], expected=np.full(21, sunk), bound=bound * R,
                       why=why, mend=mend),
            ClosedForm(quantity="fn", unit="N", value=history.fn[-1, 0], expected=M * G, bound=1e3 * bound * M * G, why=why, mend=mend),
        ]  # fmt: skip

    return closed_forms


def stuck_deep(info: EngineInfo) -> Probe:
    """A disk at rest on a floor that half takes back what its spring gives: it lies twice as deep."""
    sunk = M * G / (0.5 * KN)
    scene = on_floor(ContactLaw(kn=KN, cohesion=0.5 * KN), overlap=sunk)
    numerics = Numerics(dt=0.0005, n_steps=20)

    mend = "cohesion is a force of -cohesion times the overlap beside kn times it; fn is both together"
    return Probe(
        title="cohesion",
        setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)),
        closed_forms=_rests(info, sunk, mend),
    )


def hanging_disk(info: EngineInfo) -> Probe:
    """A disk that hangs from a ceiling, whose contact takes twice its weight."""
    contact = ContactLaw(kn=KN, regularised=True, restitution=0.0, adhesion=2.0 * M * G)
    ceiling = Wall(name="ceiling", point=(0.0, 0.0), normal=(0.0, -1.0), law=contact)
    scene = Scene(disks=some_disks(x=[[0.0, -R]]), disk_disk=contact, walls=(ceiling,), gravity=(0.0, -G))
    numerics = Numerics(dt=0.002, n_steps=20, sample_from=20)

    def closed_forms(history: History) -> list[ClosedForm]:
        allowed = contact_error(info)
        mend = "a contact that is closed stays so until it is pulled harder than its adhesion"
        return [
            ClosedForm(quantity="y", unit="m", value=history.x[-1, 0, 1], expected=-R, bound=max(1e-3, allowed) * R,
                       why="rigid disks may sink by a thousandth of their radius", mend=mend),
            ClosedForm(quantity="fn", unit="N", value=history.fn[-1, 0], expected=-M * G, bound=allowed * M * G,
                       why="equilibrium: the solver's tolerance", mend=mend),
        ]  # fmt: skip

    return Probe(
        title="adhesion", setup=Setup(scene=scene, numerics=numerics, watch=(FLOOR,)), closed_forms=closed_forms
    )


THROWN_MU, THROWN_SPEED = 0.1, 1.0


def reported_losses(info: EngineInfo, own: LeverArm) -> Probe:
    """A disk thrown along a floor: friction takes mu m g times the slip, which shrinks by 3 mu g t."""
    scene = on_floor(law(info, mu=THROWN_MU, lever_arm=own), overlap=resting_overlap(info), v=[[THROWN_SPEED, 0.0]])
    return thrown_loss("energy budget", lambda numerics: Setup(scene=scene, numerics=numerics, watch=()), 3.0, info)


def thrown_loss(title: str, setup: Callable[[Numerics], Setup], rate: float, info: EngineInfo) -> Probe:
    """What friction takes of a body that is thrown along a floor, whose slip shrinks by ``rate`` mu g t."""
    numerics = Numerics(dt=0.002, n_steps=50, sample_from=50, sliding="coulomb", energy_budget=True)
    end = numerics.dt * numerics.n_steps
    lost = THROWN_MU * M * G * (THROWN_SPEED * end - 0.5 * rate * THROWN_MU * G * end**2)

    def closed_forms(history: History) -> list[ClosedForm]:
        found = history.energy.get("friction_loss", np.full(len(history.step), np.nan))
        return [
            ClosedForm(quantity="friction_loss", unit="J", value=found[-1], expected=lost,
                       bound=2.0 * THROWN_MU * M * G * THROWN_SPEED * numerics.dt + contact_error(info) * lost,
                       why="friction may act one step less, in the first",
                       mend="History.energy holds the losses since time 0 where Numerics.energy_budget asks for them"),
        ]  # fmt: skip

    return Probe(title=title, setup=setup(numerics), closed_forms=closed_forms)


def across_the_edge(info: EngineInfo) -> Probe:
    """Two disks that meet through an edge of a periodic cell only, exchange their velocities, and are back where they began."""
    speed, room = 0.5, 0.2
    contact = law(info, **({} if has_springs(info) else {"restitution": 1.0}))
    x = [[0.5 * room + R, 1.0], [4.0 - 0.5 * room - R, 1.0]]
    scene = Scene(disks=some_disks(x=x, v=[[-speed, 0.0], [speed, 0.0]]), disk_disk=contact, cell=Cell(size=(4.0, 3.0)))
    numerics = Numerics(dt=0.002, n_steps=200, sample_from=200, impact="newton")
    bound = 0.05

    def closed_forms(history: History) -> list[ClosedForm]:
        why = "a twentieth: the phase of the impact in the contact step"
        mend = "each disk has images one edge of Scene.cell away; positions are not put back into the cell"
        return [
            ClosedForm(quantity="v", unit="m/s", value=history.v[-1], expected=[[speed, 0.0], [-speed, 0.0]], bound=bound * speed,
                       why=why, mend=mend),
            ClosedForm(quantity="x", unit="m", value=history.x[-1], expected=x, bound=bound * room, why=why, mend=mend),
        ]  # fmt: skip

    return Probe(
        title="periodic cell", setup=Setup(scene=scene, numerics=numerics, watch=()), closed_forms=closed_forms
    )


def probe_in_plane(capability: Capability, info: EngineInfo) -> Probe:
    """The probe of a capability of the plane, in the engine's own kind of contact where it may be springs or rigid."""
    arms: dict[Capability, LeverArm] = {held_by: name for name, held_by in LEVER_ARMS.items()}
    own: LeverArm = next((arm for held_by, arm in arms.items() if held_by in info.capabilities), "radius")
    if capability in arms:
        return rolling(arms[capability])
    return {
        Capability.LINEAR_CONTACT: lambda: impact(),
        Capability.SHEAR_SPRING: lambda: rolling(own, sunk=SHALLOW),
        Capability.FRICTION: lambda: sliding(info, own, rotating=Capability.BLOCKED_ROTATION not in info.capabilities),
        Capability.CONTACT_DAMPING: lambda: impact(beta=0.2),
        Capability.RESTITUTION: lambda: rebounding_disk(info),
        Capability.GLOBAL_DAMPING_CENTRAL: lambda: damped_disk(info, "central"),
        Capability.GLOBAL_DAMPING_LAGGED: lambda: damped_disk(info, "lagged"),
        Capability.MOVING_WALLS: lambda: driven_disk(info, "moving"),
        Capability.ROTATING_WALLS: lambda: driven_disk(info, "turning"),
        Capability.CURVED_WALL_MOTION: lambda: driven_disk(info, "curved"),
        Capability.GRAVITY: lambda: falling_disk(info),
        Capability.BLOCKED_ROTATION: lambda: sliding(info, own, rotating=False),
        Capability.HELD_MOTION: lambda: held_disk(info),
        Capability.FIXED_DISKS: lambda: fixed_disk(info),
        Capability.QUASI_STATIC: lambda: squeezed_disk(info),
        Capability.PRELOAD: lambda: rolling(own, sunk=SHALLOW, speed=0.0, force=-1.0),
        Capability.DISK_INERTIA: lambda: sliding(info, own, rotating=True),
        Capability.SLIP_MIDDLE: lambda: passing_disk(info, "middle"),
        Capability.SLIP_END: lambda: passing_disk(info, "end"),
        Capability.MATERIALS: lambda: two_materials(info, own),
        Capability.BODY_FORCES: lambda: pushed_disk(info),
        Capability.ROLLING_CONSTANT: lambda: resisted_disk(info, own, "constant"),
        Capability.ROLLING_VISCOUS: lambda: resisted_disk(info, own, "viscous"),
        Capability.ROLLING_SPRING: lambda: resisted_disk(info, own, "elastic-plastic"),
        Capability.COHESION: lambda: stuck_deep(info),
        Capability.HERTZ_MINDLIN_2D: lambda: hertz_disk(info),
        Capability.ADHESION: lambda: hanging_disk(info),
        Capability.PERIODIC_CELL: lambda: across_the_edge(info),
        Capability.ENERGY_BUDGET: lambda: reported_losses(info, own),
        Capability.OUTLINES: lambda: ellipse_at_rest(info),
        Capability.AREA_CONTACT: lambda: lens_on_floor(),
    }[capability]()
