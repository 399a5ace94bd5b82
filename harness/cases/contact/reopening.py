"""Spinning disks whose rough contact opens and closes again: the second contact starts without shear force."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    KnownDifference,
    Observed,
    Parameter,
    ParameterError,
    Setup,
    TruthKind,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import at_observed
from ninedisk.harness.cases.differences import FINDING_WORDS
from ninedisk.harness.cases.nine_disk.scene import NINE_DISK_CD, cd_settings
from ninedisk.references.analytic.contact.driven_contact import shuttle
from ninedisk.references.exact_steps.normal_contact import Plane, normal_contact_central

RADIUS, MASS = 0.5, 1.0
CONTACTS = 4
"""Contacts with either plane that a run has, the last begun one included."""


class Reopening:
    """A spinning disk between a rough and a smooth plane, or a spinning pair between smooth ones.

    The rough contact lasts half a period of its spring, opens, and closes again when the disk comes back from the smooth plane. Shear is
    so much softer than the normal spring that it changes neither spins nor motion: its force is the spring times the slip at a
    constant rate, from nothing in each contact anew. By mirror symmetry the pair's disks see a plane in their middle, twice as stiff.
    """

    id = "contact/reopening"
    version = 2
    title = "Rough contact that opens and closes again"
    beside_headlines = (("angle_*", "an angle that is reported moves nothing: spins are what disks turn by"),)
    source = "Cundall & Strack, Geotechnique 29 (1979): a contact that opens loses its shear force"
    requirement = (
        "shear grows by ks times the slip from nothing whenever a contact closes; normal forces are half sines"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="pair", default="disks", choices=("disks", "wall"), in_id=True, help="rough contact: of two disks, or with a wall"),
        Parameter(
            name="arm", default="radius", choices=("radius", "overlap"), in_id=True,
            help="lever arm of the shear force: R, or R - overlap/2",
        ),
        Parameter.positive("speed", 1.0, unit="m/s", help="speed of each disk"),
        Parameter(name="spin", default=2.0, low=-1e3, high=1e3, unit="rad/s", help="spin of the disk, mean spin of two"),
        Parameter(name="kn", default=1e6, low=1e3, unit="N/m", help="normal stiffness of every contact"),
        Parameter.positive("ks_over_kn", 1e-6, high=1e-4,
                           help="shear over normal stiffness: so small that shear forces do not change the motion"),
        Parameter.positive("mu", 0.5, unit="-", help="friction coefficient of the rough contact"),
        Parameter.positive("dt", 5e-6, unit="s", help="step of every engine"),
        *NINE_DISK_CD,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Disk with disk and disk with wall, either lever arm."""
        return [{"pair": pair, "arm": arm} for pair in ("disks", "wall") for arm in ("radius", "overlap")]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Disks on the y axis; the rough contact lies in the origin, smooth walls beyond."""
        speed, dt, gap, path = params["speed"], params["dt"], *_plane_distances(params)
        if _omega(params, first=True) * dt > 0.2:
            raise ParameterError(
                f"dt = {dt:g} s is not allowed: a contact must last many steps; use at most {0.2 / _omega(params, first=True):g} s"
            )
        at = "mid-overlap" if params["arm"] == "overlap" else "surface"
        rough = ContactLaw(
            kn=params["kn"], ks=params["ks_over_kn"] * params["kn"], mu=params["mu"],
            lever_arm=params["arm"], wall_velocity_at=at,  # type: ignore[arg-type]
        )  # fmt: skip
        smooth = ContactLaw(kn=params["kn"])
        # The disk's lower side starts at gap and turns back where its upper side has gone way beyond the contact.
        height, top = RADIUS + gap, 2.0 * RADIUS + path
        disks: dict[str, Any] = {"radius": RADIUS, "mass": MASS}
        ceiling = Wall(name="ceiling", point=(0.0, top), normal=(0.0, -1.0), law=smooth)
        if params["pair"] == "disks":
            disks |= {"x": [(0.0, height), (0.0, -height)], "v": [(0.0, -speed), (0.0, speed)], "omega": _spins(params)}
            walls = (Wall(name="floor", point=(0.0, -top), normal=(0.0, 1.0), law=smooth), ceiling)
            labels = {"rough": (0, 1), "smooth": (0, 3)}
        else:
            disks |= {"x": [(0.0, height)], "v": [(0.0, -speed)], "omega": _spins(params)}
            walls = (Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rough), ceiling)
            labels = {"rough": (0, 1), "smooth": (0, 2)}
        scene = Scene(disks=Disks(**disks), disk_disk=rough, walls=walls)
        # Until the disk is moving from the second contact.
        lasts = 2.0 * (math.pi / _omega(params, first=True) + path / speed) + math.pi / _omega(params, first=False)
        numerics = Numerics(
            dt=dt, n_steps=math.ceil((lasts + (gap + 0.5 * path) / speed) / dt), contact_dt=dt, **cd_settings(params)
        )
        return Setup(scene=scene, numerics=numerics, watch=tuple(labels.values()), labels=labels)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Forces and gap of the rough contact, load of the smooth wall, rotation, and energies as the engine reports them."""
        rough, smooth = (history.contact(setup.labels[name]) for name in ("rough", "smooth"))
        blank = np.full(len(history.step), np.nan)
        series = {
            "fn": ("N", history.fn[:, rough]),
            "fs": ("N", history.fs[:, rough]),
            "gap": ("m", history.gap[:, rough]),
            "fn_smooth": ("N", history.fn[:, smooth]),
            "load_ceiling": ("N", history.wall_force[:, 1, 1]),
            "load_floor": ("N", -history.wall_force[:, 0, 1]),
            "angle_first": ("rad", history.angle[:, 0]),
            "angle_last": ("rad", history.angle[:, -1]),
            "energy_kinetic": ("J", np.asarray(history.energy.get("kinetic", blank))),
            "energy_elastic": ("J", np.asarray(history.energy.get("elastic", blank))),
        }
        scalars = {"fs_largest": ("N", float(np.abs(series["fs"][1]).max()))}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:
        """Half sines of the scene's springs and the shear force that grows from nothing in each contact, continuous in time."""
        if params["regime"] == "quasi-static":
            return ()
        lasts = math.pi / _omega(params, first=True)
        fn = _continuous(params, setup, 0.0)["fn"][observed.step]
        depth = (2.0 if params["pair"] == "disks" else 1.0) * params["speed"] / _omega(params, first=True)
        # Half a sine has the mean 2/pi.
        slips = abs(float(_slip(params, np.array([2.0 * depth / math.pi]))[0])) * lasts
        path, scale_is = (
            (slips, "slip in a contact") if slips else (params["speed"] * lasts, "distance in a contact's time")
        )
        ks = params["ks_over_kn"] * params["kn"]
        return (
            Headline(name="largest shear force", use="impacts", quantity="fs_largest", expected=ks * slips,
                     source="slip of one contact, from nothing", scale=ks * path, scale_is=f"ks times the {scale_is}"),
            Headline(name="normal force", use="impacts", quantity="fn", expected=fn, source="half sines between uniform flights",
                     scale=float(fn.max()), scale_is="largest normal force"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps of central differences, half sines and ramps for all with contact springs."""
        if params["regime"] == "quasi-static":
            return []
        found: list[Check] = []
        if engine.scheme == "central-difference":
            found += _curve_checks(params, setup, observed, engine, _stepped(params, setup), "exact-step", 0.0)
        phase = _omega(params, first=True) * setup.numerics.dt
        relative = phase**2 if engine.scheme == "central-difference" else phase
        truth = _continuous(params, setup, relative)
        return [*found, *_curve_checks(params, setup, observed, engine, truth, "analytic", relative)]


def _plane_distances(params: Mapping[str, Any]) -> tuple[float, float]:
    """Distance to the rough contact at time 0 and to the smooth plane from there [m]: as far as a contact's time takes it."""
    path = params["speed"] * math.pi / _omega(params, first=True)
    return 0.613 * path, path


def _omega(params: Mapping[str, Any], *, first: bool) -> float:
    """Angular frequency [rad/s] of the rough contact, or of that with the smooth plane."""
    twice = 2.0 if first and params["pair"] == "disks" else 1.0
    return math.sqrt(twice * params["kn"] / MASS)


def _spins(params: Mapping[str, Any]) -> list[float]:
    """Spins [rad/s]: of two disks unequal ones, whose sum alone enters the slip."""
    return [1.5 * params["spin"], 0.5 * params["spin"]] if params["pair"] == "disks" else [params["spin"]]


def _slip(params: Mapping[str, Any], overlap: FloatArray) -> FloatArray:
    """Slip velocity [m/s] of the rough contact with this overlap [m], spins unchanged."""
    bodies = 2.0 if params["pair"] == "disks" else 1.0
    shorter = 0.5 * overlap if params["arm"] == "overlap" else 0.0 * overlap
    return np.asarray(bodies * params["spin"] * (RADIUS - shorter), dtype=np.float64)


def _curves(
    params: Mapping[str, Any], place: FloatArray, velocity: FloatArray, fs: FloatArray
) -> dict[str, FloatArray]:
    """Quantities by the place of the disk beyond the rough plane [m]."""
    pair = params["pair"] == "disks"
    depth, far = (2.0 if pair else 1.0) * place, -place - _plane_distances(params)[1]
    fn, fn_smooth = params["kn"] * np.maximum(depth, 0.0), params["kn"] * np.maximum(far, 0.0)
    disks = 2.0 if pair else 1.0
    spinning = 0.5 * (0.5 * MASS * RADIUS**2) * sum(spin**2 for spin in _spins(params))
    return {
        "fn": fn,
        "fs": fs,
        "gap": -depth,
        "fn_smooth": fn_smooth,
        "load_ceiling": fn_smooth,
        "load_floor": fn_smooth if pair else fn,
        "energy_kinetic": disks * 0.5 * MASS * velocity**2 + spinning,
        "energy_elastic": (0.5 * fn**2 + disks * 0.5 * fn_smooth**2) / params["kn"],
    }


def _stepped(params: Mapping[str, Any], setup: Setup) -> dict[str, FloatArray]:
    """Central differences: in each step the shear force changes by the whole step's slip, and nothing is left of it while open."""
    (gap, path), numerics = _plane_distances(params), setup.numerics
    rest = np.zeros(numerics.n_steps + 1)
    twice = 2.0 if params["pair"] == "disks" else 1.0
    planes = (Plane(1, rest, rest, twice * params["kn"]), Plane(-1, rest + path, rest, params["kn"]))
    steps = normal_contact_central(
        planes, mass=MASS, g=0.0, y=gap, vy=-params["speed"], dt=numerics.dt, n_steps=numerics.n_steps
    )
    ks, fs, force = params["ks_over_kn"] * params["kn"], np.zeros(numerics.n_steps + 1), 0.0
    slip = _slip(params, twice * np.maximum(steps.overlap[:, 0], 0.0))
    for n, overlap in enumerate(steps.overlap[:, 0]):
        cap = params["mu"] * twice * params["kn"] * max(overlap, 0.0)
        force = min(max(force - ks * slip[n] * numerics.dt, -cap), cap)
        fs[n] = force
    return _curves(params, -steps.y, steps.vy, fs)


def _continuous(params: Mapping[str, Any], setup: Setup, relative: float) -> dict[str, FloatArray]:
    (gap, path), numerics = _plane_distances(params), setup.numerics
    t = np.arange(numerics.n_steps + 1) * numerics.dt
    omega = _omega(params, first=True)
    found = shuttle(
        t, speed=params["speed"], gap=gap, path=path, omega_first=omega, omega_second=_omega(params, first=False)
    )
    closed = np.nan_to_num(found.age)
    # The slip of the shorter arm by the integral of the overlap, half a sine.
    depth = (2.0 if params["pair"] == "disks" else 1.0) * params["speed"] / omega
    mean = depth * (1.0 - np.cos(omega * closed)) / np.where(closed > 0.0, omega * closed, 1.0)
    fs = -params["ks_over_kn"] * params["kn"] * _slip(params, mean) * closed
    curves = _curves(params, found.place, found.velocity, fs)
    # Where a contact ends its shear force falls to nothing: a sample as near to that as contacts may be late says nothing.
    near = np.abs(t[:, None] - found.changes).min(axis=1) <= _delay(params, setup, relative) + 1.5 * numerics.dt
    curves["fs"] = np.where(near, np.nan, fs)
    return curves


def _delay(params: Mapping[str, Any], setup: Setup, relative: float) -> float:
    """Time [s] by which a contact may begin or end late.

    ``relative`` is the part by which a scheme's step changes a contact's length and the speed after it, and so the length of the
    flights: ``omega dt``, or, as the sums of central differences integrate a force with kinks to second order, its square. Each contact
    adds the same part of its own inverse frequency.
    """
    return relative * (setup.numerics.n_steps * setup.numerics.dt + CONTACTS / _omega(params, first=True))


def _ramp_error(params: Mapping[str, Any], engine: EngineInfo) -> float:
    """What shear itself does to the slip, relative, and an arm that is not the scene's.

    In a contact's time ``pi/omega`` the force ``ks slip t`` slows spins and moves centres such that the slip changes by
    ``(1/m_t) ks t^2/2`` of itself, ``1/m_t`` at most 6/m: at most ``3 pi^2 ks/kn``, in each contact again.
    """
    shear = CONTACTS * 3.0 * math.pi**2 * float(params["ks_over_kn"])
    arms = engine.arms_at_walls if params["pair"] == "wall" else None
    if LEVER_ARMS[params["arm"]] in (engine.capabilities if arms is None else arms):
        return shear
    return shear + 2.0 * float(params["speed"]) / _omega(params, first=True) / RADIUS


def _curve_checks(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo,
    curves: Mapping[str, FloatArray], truth: TruthKind, relative: float,
) -> list[Check]:  # fmt: skip
    """Checks of all curves that the engine reports; ``relative`` as for `_delay`, 0 for exact steps."""
    speed, omega, dt = params["speed"], _omega(params, first=True), setup.numerics.dt
    late, slipping = _delay(params, setup, relative), _ramp_error(params, engine)
    rounding = float(np.spacing(2.0 * RADIUS)) * (8.0 + setup.numerics.n_steps)
    deepest, slow = speed / omega, 2.0 * relative
    of_place = 2.0 * (speed * late + slow * deepest + rounding)
    of_speed = speed * (omega * late + slow) + omega * rounding
    ramp = params["ks_over_kn"] * params["kn"] * abs(float(_slip(params, np.zeros(1))[0]))
    force, energy = params["kn"] * of_place, 2.0 * MASS * (speed + of_speed) * of_speed
    # Elastic energy of an overlap that is off, and what shear takes from the spins.
    energy += slipping * MASS * (RADIUS * params["spin"]) ** 2 + 2.0 * MASS * speed**2 * slipping
    atol = {
        "fn": force, "fn_smooth": force, "load_ceiling": force, "load_floor": force, "gap": of_place,
        "fs": ramp * (slipping * math.pi / omega + (late + dt if relative else 0.0)) + 1e-9 * ramp * math.pi / omega,
        "energy_kinetic": energy, "energy_elastic": energy,
    }  # fmt: skip
    why = "round-off of the coordinates, added up; shear forces change the motion by some ks/kn"
    source = "central differences of one disk between planes"
    if relative:
        why = f"a step changes lengths of contacts and speeds by {relative:.2g} (omega dt, or its square); each delays what follows"
        source = "half sines between uniform flights"
    found = []
    expected = dict(curves)
    if not relative:
        t = np.arange(setup.numerics.n_steps + 1) * dt
        for name, spin in zip(("angle_first", "angle_last"), (_spins(params)[0], _spins(params)[-1]), strict=True):
            expected[name] = np.asarray(spin * t, dtype=np.float64)
            # Either disk receives the torque of both spins' slip.
            atol[name] = 2.0 * slipping * abs(params["spin"]) * float(t[-1]) + 1e-12
    for name, curve in expected.items():
        if atol[name] >= float(np.nanmax(np.abs(curve))):
            continue  # a bound beyond the quantity itself would let anything pass
        shown = at_observed(observed, engine, name, curve[observed.step])
        opens = name == "fs" and params["pair"] == "disks"
        kept = None
        if opens and Difference.KEEPS_OPENED_SHEAR in engine.differences:
            kept = KnownDifference(
                finding=f"{engine.id}/{FINDING_WORDS[Difference.KEEPS_OPENED_SHEAR]}",
                size=atol[name] + ramp * math.pi / omega * (CONTACTS / 2 - 1),
                why=f"{engine.differences[Difference.KEEPS_OPENED_SHEAR]}: the ramps of the rough contacts before, half of all",
            )
        found.append(
            Check(
                quantity=name,
                norm="max",
                truth=truth,
                expected=shown,
                source=source,
                atol=atol[name],
                why=why,
                known=kept,
            )
        )
    return found


CASE = Reopening()
