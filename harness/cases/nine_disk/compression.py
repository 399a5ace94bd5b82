"""Nine disks between four walls that move in (appendix A.1.1): scene and truths."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import WallSegment
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.matched import core_history
from ninedisk.harness.cases.nine_disk.converged import FirstOrder, Limit, consensus_checks, converged_checks
from ninedisk.harness.cases.nine_disk.figures import COMPRESSION_CLAIMS, COMPRESSION_FIGURES
from ninedisk.harness.cases.nine_disk.scene import (
    CENTRE,
    DAMPING_FORM,
    LEFT,
    LEVER_ARM,
    LOAD_CASES,
    MASS,
    NINE_DISK_CD,
    RADIUS,
    SLIP_AT,
    LoadCase,
    cd_settings,
    contact_laws,
    friction,
    nine_disks,
    shear_growth,
)
from ninedisk.harness.cases.nurbs.grains import SHAPE, as_disks, as_outlines, overlap_error
from ninedisk.references.analytic.assembly.compression import (
    continuous_row,
    row_frequency,
    steady_force,
    undamped_amplitude,
)
from ninedisk.references.exact_steps.cd_row import smooth_row_cd
from ninedisk.references.exact_steps.compression import smooth_row

WATCH = ((3, CENTRE), (0, 1), (3, LEFT), (0, LEFT))
"""Contacts of `HISTORIES`, in order: centre row, edge row, wall/middle disk, wall/corner disk, all along x."""


Rows = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Forces [N] of a half row after each cycle: disk-disk, wall."""

OVERLAP_ROUND_OFF = 1e-12
"""Of the radius, what rounding leaves of an intersection of outlines; forces, kn times that, are far below `ROUND_OFF`."""

HISTORIES = ("fn_disk_disk_centre", "fn_disk_disk_edge", "fn_wall_mid", "fn_wall_corner")

ROUND_OFF = 1e-9
"""Of the largest value: the forces are kn times differences of positions near 300 m, so one unit in the last place of a position
(6e-14 m) is 1e-12 of the force; some hundred steps add up to less than 1e-9."""


class Compression:
    """All four walls move in, then rest; the contact forces oscillate and settle.

    Without wall friction each row is one damped oscillator with an exact solution in discrete time. With it the side disks
    rub on the moving walls and the rows share the load unequally. By symmetry no disk turns, so the lever arm of the shear
    torque has no effect; the default is the one that every engine has.
    """

    id = "nine-disk/compression"
    version = 1
    title = "Nine disks, uniform compression"
    beside_headlines = tuple(
        (name, "with rough walls only the whole history has a converged limit")
        for name in ("fn_*", "row_sum_*", "symmetry_error")
    )
    source = "appendix A.1.1, Table A.1, Figures A.2 and A.3"
    requirement = "Contact forces of the explicit scheme follow the exact recurrence and settle at kn v T/2."
    figures = COMPRESSION_FIGURES
    claims = COMPRESSION_CLAIMS
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="load_case", default="a1", choices=tuple(LOAD_CASES), in_id=True, help="row of Table A.1: kn, dt, v, T"
        ),
        Parameter(name="xi", default=3.0, low=0.0, unit="1/s", in_id=True, help="global damping"),
        Parameter(
            name="wall_mu",
            default=0.0,
            words=("mu",),
            low=0.0,
            in_id=True,
            help="friction of the walls; the word mu means the disks' own tan(phi)",
        ),
        Parameter(name="phi_deg", default=15.0, low=0.0, high=89.0, unit="deg", help="angle of friction between disks"),
        Parameter(name="ks_over_kn", default=1.0, low=0.0, help="shear over normal contact stiffness"),
        Parameter(name="cycles", default=200, low=1, whole=True, help="cycles of the recorded history"),
        Parameter(
            name="settle_cycles",
            default=4000,
            low=0,
            whole=True,
            help="cycle at which the settled forces are read (damped runs only); 0: at the end of the history",
        ),
        Parameter(name="substeps", default=1, low=1, whole=True, help="contact steps in one cycle"),
        replace(LEVER_ARM, default="overlap"),
        DAMPING_FORM,
        SLIP_AT,
        SHAPE,
        *NINE_DISK_CD,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Four load cases, damped and not, smooth and rough walls; theta = 1 and the static limit of contact dynamics; outlines."""
        rows: list[Mapping[str, Value]] = [
            {"load_case": load_case, "xi": xi, "wall_mu": wall_mu}
            for wall_mu in (0.0, "mu")
            for xi in (3.0, 0.0)
            for load_case in LOAD_CASES
        ]
        rows += [{"load_case": "a1", "theta": 1.0}]
        rows += [{"load_case": "a1", "wall_mu": wall_mu, "regime": "quasi-static"} for wall_mu in (0.0, "mu")]
        return [*rows, *({"load_case": "a1", "wall_mu": wall_mu, "shape": "nurbs"} for wall_mu in (0.0, "mu"))]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Scene of Figure A.1 with the walls' motion of Table A.1."""
        load = LOAD_CASES[params["load_case"]]
        duration, v = load.load_cycles * load.dt, load.v_wall
        motions = {
            name: (WallSegment(duration=duration, velocity=(v * nx, v * ny)),)
            for name, nx, ny in (("left", 1, 0), ("right", -1, 0), ("bottom", 0, 1), ("top", 0, -1))
        }
        disk_law, wall_law = contact_laws(params, load.kn)
        scene = nine_disks(disk_law, wall_law, motions, params["xi"])
        if params["shape"] == "nurbs":
            scene = as_outlines(scene)
        cycles = params["cycles"]
        last = max(cycles, params["settle_cycles"]) if params["xi"] > 0.0 else cycles
        numerics = Numerics(
            dt=load.dt,
            n_steps=last,
            contact_dt=load.dt / params["substeps"],
            sample_until=cycles,
            damping_form=params["damping_form"],
            **cd_settings(params),
        )
        return Setup(scene=scene, numerics=numerics, watch=WATCH, labels=dict(zip(HISTORIES, WATCH, strict=True)))

    def slips(self, params: Mapping[str, Any]) -> bool:
        """Smooth walls leave every contact without slip: by symmetry each row moves along itself."""
        return bool(params["wall_mu"] != 0.0)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Force histories over cycles 0..cycles; settled values and their sums by row, peaks, amplitudes, symmetry."""
        load = LOAD_CASES[params["load_case"]]
        shown = history.step <= params["cycles"]
        step, t = history.step[shown], history.t[shown]
        series, scalars = {}, {}
        for name, pair in setup.labels.items():
            force = history.fn[:, history.contact(pair)]
            series[name] = ("N", force[shown])
            scalars[f"{name}_settled"] = ("N", float(force[-1]) if params["xi"] > 0.0 else math.nan)
            scalars |= peaks(name, step, force[shown], load.load_cycles)
        scalars |= row_sums(scalars)
        middle = 0.5 * (history.x + history.x[:, ::-1, :]) - history.x[:, CENTRE : CENTRE + 1, :]
        scalars["symmetry_error"] = ("m", float(np.abs(middle).max()))
        scalars["overlap_error"] = ("m", overlap_error(setup, history))
        return Observed(step=step, t=t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Forces of the centre row, of elastic contacts kn: closed form for smooth walls, fine-step limit for rough ones.

        The static limit is asked for by its own setting: its truth is the equilibrium of every step, known for smooth walls.
        """
        load, name = LOAD_CASES[params["load_case"]], "fn_disk_disk_centre"
        t_wall = load.load_cycles * load.dt
        steady = steady_force(kn=load.kn, v_wall=load.v_wall, t_wall=t_wall)
        history: float | NDArray[np.float64] = math.nan
        settled, source = math.nan, "no closed form: rough walls in the static limit"
        static = params["regime"] == "quasi-static"
        if friction(params)[1] == 0.0:
            ramp = steady * np.minimum(observed.step, load.load_cycles) / load.load_cycles
            row = continuous_row(observed.t, kn=load.kn, mass=MASS, xi=params["xi"], v_wall=load.v_wall, t_wall=t_wall)
            history, settled = ramp if static else row[0], steady
            source = "equilibrium of the smooth row" if static else "damped oscillator under a ramp that stops"
        elif not static and (limit := Limit.of(self.id, params, observed)):
            history, settled, source = limit.series(name), limit.number(f"{name}_settled"), limit.source
        common: dict[str, Any] = {
            "source": source,
            "scale": steady,
            "scale_is": "force kn v T/2 at which smooth rows settle",
        }
        return (
            Headline(name="force in the centre row", use="moving-walls", quantity=name, expected=history, **common),
            Headline(name="settled force", use="rest", quantity=f"{name}_settled",
                     expected=settled if params["xi"] > 0.0 else math.nan, **common),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact recurrence and analytic forces for smooth walls, converged histories for rough ones."""
        return compression_checks(params, setup, observed, engine)


def compression_checks(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
) -> Sequence[Check]:
    """Truths that bind ``engine`` on a variant of the compression."""
    load = LOAD_CASES[params["load_case"]]
    found = []
    static = engine.contact == "cd" and params["regime"] == "quasi-static"
    smooth = friction(params)[1] == 0.0
    if smooth and static:
        found += _static_checks(params, observed, load)
    elif smooth:
        if engine.scheme == "central-difference":
            rows = _rows(params, load, int(observed.step[-1]), smooth_row, form=params["damping_form"])
            found += _exact_checks(observed, load, rows, "central differences")
        elif engine.scheme == "theta":
            rows = _rows(params, load, int(observed.step[-1]), smooth_row_cd, theta=params["theta"])
            found += _exact_checks(
                observed, load, rows, f"the theta scheme, theta = {params['theta']:g}, elastic contacts"
            )
        found += _analytic_checks(params, setup, observed, load, engine)
    elif not static:
        found += converged_checks(
            "nine-disk/compression",
            params,
            observed,
            engine,
            series=HISTORIES,
            scalars=[f"{name}_settled" for name in HISTORIES],
            first_order=_first_order(params, setup, observed, load, engine),
        )
    if params["xi"] > 0.0:
        found += _row_sum_checks(setup, load)
    found.append(
        Check(
            quantity="symmetry_error",
            norm="scalar",
            truth="analytic",
            expected=0.0,
            source="the set-up is its own image under a half turn",
            atol=ROUND_OFF * RADIUS,
            why="round-off of positions: 6e-14 m each, amplified over the run to less than 1e-9 radii",
            scale=RADIUS,
        )
    )
    outlined = params["shape"] == "nurbs"
    if outlined:
        found.append(outline_check())
    if engine.scheme == "central-difference" and (outlined or not engine.reference):
        history = core_history(as_disks(setup) if outlined else setup, engine)
        at = np.searchsorted(history.step, observed.step)
        expected = {name: history.fn[at, history.contact(pair)] for name, pair in setup.labels.items()}
        growth = shear_growth(history, engine, setup.scene.disk_disk)
        rtol, why = 1e-10, "same scheme, same arithmetic up to round-off (1e-12 a step, 200 steps)"
        if outlined:
            rtol, why = (
                ROUND_OFF,
                "circles as outlines: round-off of positions near 300 m (see ROUND_OFF) in each intersection",
            )
        if growth:
            why += f"; the engine turns shear forces to first order, which adds at most {growth:.1g}"
        found += consensus_checks(observed, expected, rtol=rtol + growth, why=why)
    return found


def outline_check() -> Check:
    """Overlaps of outlines that are circles, against the formula of disks."""
    return Check(
        quantity="overlap_error",
        norm="scalar",
        truth="analytic",
        expected=0.0,
        source="equation (2.5): Ri + Rj - |xj - xi|",
        atol=OVERLAP_ROUND_OFF * RADIUS,
        why="round-off: a last place of positions near 300 m is 1e-15 radii, an intersection takes some hundred operations",
        scale=RADIUS,
    )


def peaks(
    name: str, step: NDArray[np.int64], force: NDArray[np.float64], load_cycles: int
) -> dict[str, tuple[str, float]]:
    """Peak, its cycle, and half the range after the walls have stopped; NaN where nothing was observed."""
    after = force[step > load_cycles]
    peak, cycle, amplitude = math.nan, math.nan, math.nan
    if np.isfinite(force).all():
        peak, cycle = float(force.max()), float(step[int(np.argmax(force))])
        if len(after):
            amplitude = 0.5 * float(after.max() - after.min())
    return {
        f"{name}_peak": ("N", peak),
        f"{name}_peak_cycle": ("cycle", cycle),
        f"{name}_amplitude": ("N", amplitude),
    }


def _rows(
    params: Mapping[str, Any], load: LoadCase, n_steps: int, solution: Callable[..., Rows], **setting: Any
) -> Rows:
    """Exact time-discrete forces after cycles 0..n_steps, from the solution of the engine's scheme."""
    k = params["substeps"]
    disk_disk, wall = solution(
        kn=load.kn,
        mass=MASS,
        xi=params["xi"],
        dt=load.dt / k,
        n_load=load.load_cycles * k,
        v_wall=load.v_wall,
        n_steps=n_steps * k,
        **setting,
    )
    return disk_disk[::k], wall[::k]


def row_sums(scalars: Mapping[str, tuple[str, float]]) -> dict[str, tuple[str, float]]:
    """Settled forces of a half row's two contacts together: centre row, edge row."""
    pairs = {"centre": ("fn_disk_disk_centre", "fn_wall_mid"), "edge": ("fn_disk_disk_edge", "fn_wall_corner")}
    return {
        f"row_sum_{row}": ("N", sum(scalars[f"{name}_settled"][1] for name in names)) for row, names in pairs.items()
    }


def _row_sum_checks(setup: Setup, load: LoadCase) -> list[Check]:
    """A half row bears ``kn w``, w the displacement of its wall, however wall friction shares it among the contacts.

    The middle disk of each row keeps its x by symmetry, so that the wall's displacement w is what the two contacts between it and the wall
    are closed by along x: the sum of their overlaps where both lie along x, as they do in the centre row. In the edge row friction
    lets the middle disk and the corner disk move differently along y, by ``w/2`` at most as either lies between its neighbours;
    a contact tilted by ``dy`` over the distance 2R has an overlap that is smaller by ``dy^2/(4R)``.
    """
    displacement = load.v_wall * load.dt * min(setup.numerics.n_steps, load.load_cycles)
    tilt = load.kn * (0.5 * displacement) ** 2 / (4.0 * RADIUS)
    common = {"norm": "scalar", "truth": "analytic", "expected": load.kn * displacement, "rtol": ROUND_OFF}
    common["source"] = "the two contacts of a half row are closed by their wall's way: kn v T"
    why = "round-off of positions near 300 m (see ROUND_OFF)"
    return [
        Check(quantity="row_sum_centre", why=why, **common),  # type: ignore[arg-type]
        Check(quantity="row_sum_edge", atol=tilt, why=f"{why}; tilt of the contact by w/2 over 2R", **common),  # type: ignore[arg-type]
    ]


def _static_checks(params: Mapping[str, Any], observed: Observed, load: LoadCase) -> list[Check]:
    """Equilibrium in every step: both springs of a half row bear half the wall's displacement."""
    displacement = load.v_wall * load.dt * np.minimum(observed.step, load.load_cycles)
    common = {
        "truth": "analytic",
        "source": "equilibrium of the smooth row: kn w/2",
        "why": "round-off of positions near 300 m (see ROUND_OFF); the static balance is solved to 1e-10",
        "rtol": ROUND_OFF,
    }
    found = [Check(quantity=name, norm="max", expected=0.5 * load.kn * displacement, **common) for name in HISTORIES]  # type: ignore[arg-type]
    if params["xi"] > 0.0:
        steady = steady_force(kn=load.kn, v_wall=load.v_wall, t_wall=load.load_cycles * load.dt)
        found += [Check(quantity=f"{name}_settled", norm="scalar", expected=steady, **common) for name in HISTORIES]  # type: ignore[arg-type]
    return found


def _exact_checks(observed: Observed, load: LoadCase, rows: Rows, scheme: str) -> list[Check]:
    disk_disk, wall = rows
    source = f"exact recurrence of the smooth row under {scheme}"
    found = []
    for name in HISTORIES:
        row = (disk_disk if "disk_disk" in name else wall)[observed.step]
        scale = float(np.abs(row).max())
        common = {"truth": "exact-step", "source": source, "why": "round-off of positions near 300 m (see ROUND_OFF)"}
        found.append(Check(quantity=name, norm="max", expected=row, rtol=ROUND_OFF, **common))  # type: ignore[arg-type]
        for key, (unit, value) in peaks(name, observed.step, row, load.load_cycles).items():
            atol = ROUND_OFF * scale if unit == "N" else 0.0
            if math.isfinite(value):
                found.append(Check(quantity=key, norm="scalar", expected=value, atol=atol, **common))  # type: ignore[arg-type]
    return found


def _analytic_checks(
    params: Mapping[str, Any], setup: Setup, observed: Observed, load: LoadCase, engine: EngineInfo
) -> list[Check]:
    """Steady force, continuous history and undamped amplitude, with the error that the step explains.

    The amplitude is that of two oscillations, from the walls' start and stop: it changes with the phase between these, ``|sin(omega
    T/2)|``; a sampled crest is lower by ``1 - cos(omega dt/2)`` at most, and a scheme either raises or damps it.
    """
    t_wall, xi = load.load_cycles * load.dt, params["xi"]
    omega = row_frequency(kn=load.kn, mass=MASS)
    steady = steady_force(kn=load.kn, v_wall=load.v_wall, t_wall=t_wall)
    step = step_error(params, setup, engine, omega)
    swing = load.kn * load.v_wall / omega
    error = _history_error(params, setup, observed, load, engine) + ROUND_OFF * steady
    amplitude = undamped_amplitude(kn=load.kn, mass=MASS, v_wall=load.v_wall, t_wall=t_wall)
    turned = 0.5 * step.drift * omega * t_wall
    turned = abs(math.cos(0.5 * omega * t_wall)) * turned + 0.5 * turned**2
    lower = 1.0 - math.cos(0.5 * omega * load.dt) * math.exp(-step.decay * omega * float(observed.t[-1]))
    bound = swing * turned + (amplitude + swing * turned) * max(step.amplitude, lower)
    disk_disk, wall = continuous_row(observed.t, kn=load.kn, mass=MASS, xi=xi, v_wall=load.v_wall, t_wall=t_wall)
    found = [
        Check(
            quantity=name,
            norm="max",
            truth="analytic",
            expected=disk_disk if "disk_disk" in name else wall,
            source="damped oscillator under a ramp that stops, continuous in time",
            atol=error,
            why=f"{step.why}: drift of the oscillation and its amplitude",
        )
        for name in HISTORIES
    ]
    for name in HISTORIES:
        if xi > 0.0:
            left = swing * math.exp(-0.5 * xi * (max(params["settle_cycles"], params["cycles"]) * load.dt - t_wall))
            found.append(
                Check(
                    quantity=f"{name}_settled",
                    norm="scalar",
                    truth="analytic",
                    expected=steady,
                    source="kn v T/2: two equal springs share the wall's displacement",
                    rtol=ROUND_OFF,
                    atol=left,
                    why="round-off, plus what damping has left of the oscillation by then",
                )
            )
        elif params["cycles"] > load.load_cycles and bound < 0.5 * amplitude:
            # A bound near the amplitude itself would let almost anything pass.
            found.append(
                Check(
                    quantity=f"{name}_amplitude",
                    norm="scalar",
                    truth="analytic",
                    expected=amplitude,
                    source="(kn v/omega) |sin(omega T/2)|",
                    atol=bound,
                    why=f"{step.why}: phase between the walls' start and stop; crests between samples, 1 - cos(omega dt/2)",
                )
            )
    return found


def _history_error(
    params: Mapping[str, Any], setup: Setup, observed: Observed, load: LoadCase, engine: EngineInfo
) -> float:
    """Largest error [N] that the step makes of the oscillation of the forces: it is damped, shifted in phase, and begins otherwise."""
    omega = row_frequency(kn=load.kn, mass=MASS)
    step = step_error(params, setup, engine, omega)
    error = step.after(omega * observed.t) * np.exp(-0.5 * params["xi"] * observed.t)
    return load.kn * load.v_wall / omega * float(error.max())


def _first_order(
    params: Mapping[str, Any], setup: Setup, observed: Observed, load: LoadCase, engine: EngineInfo
) -> FirstOrder:
    """Rough walls make no oscillation larger or faster; what friction keeps of one's error is no larger than that."""
    error = _history_error(params, setup, observed, load, engine)
    omega = row_frequency(kn=load.kn, mass=MASS)
    why = f"{step_error(params, setup, engine, omega).why}: the changed oscillation, which friction may keep; at most omega dt/2"
    return FirstOrder(force=error, length=error / load.kn, lag=0.5 * omega * load.dt, why=why)


class StepError(NamedTuple):
    """What a scheme's step does to an oscillation of unit amplitude.

    Per radian its phase drifts by ``drift`` and the logarithm of its amplitude falls by ``decay``; it begins with an error
    ``offset``, and an amplitude too large by ``amplitude``.
    """

    drift: float
    decay: float
    offset: float
    amplitude: float
    why: str

    def after(self, radians: NDArray[np.float64]) -> NDArray[np.float64]:
        """Largest error of the oscillation after these angles: what is damped, and the phase of what is left; same shape."""
        left = np.exp(-self.decay * radians)
        return np.asarray(1.0 - left + left * np.minimum(self.drift * radians + self.offset, 2.0))


def step_error(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, omega: float) -> StepError:
    """Of the oscillator of angular frequency ``omega`` [rad/s] under the engine's scheme.

    Central differences turn by ``2 asin(h/2)`` a step, ``h = omega dt``, fast by ``h^2/24``, and swing by ``1/sqrt(1 - h^2/4)`` of the
    amplitude. Third-order Runge-Kutta multiplies by ``exp(z) - z^4/24``, ``z = i h``: the amplitude shrinks by ``h^3/24`` per radian,
    the phase by less. The theta scheme multiplies by l, ``|l|^2 = 1/(1 + theta h^2)``, ``Re l = (1 - (1 - theta) h^2/2)/(1 + theta
    h^2)`` (`ninedisk.references.exact_steps.cd_row`), and begins half a step late or early. Other schemes are of first order.
    """
    h = omega * setup.numerics.dt / params["substeps"]
    if engine.scheme == "runge-kutta-3":
        h = min(h, float(engine.option("phase", setup.numerics)))
        return StepError(0.0, h**3 / 24.0, 0.0, h**3, f"third order, omega h <= {h:.3g}")
    if engine.scheme == "central-difference" and (params["damping_form"] == "central" or params["xi"] == 0.0):
        return StepError(
            h**2 / 24.0, 0.0, h**2, 1.0 / math.sqrt(1.0 - h**2 / 4.0) - 1.0, f"second order, omega dt = {h:.3g}"
        )
    if engine.scheme == "theta":
        theta, grown = params["theta"], 1.0 + params["theta"] * h**2
        turn = math.acos((1.0 - (1.0 - theta) * h**2 / 2.0) / math.sqrt(grown))
        return StepError(abs(1.0 - turn / h), math.log(grown) / (2.0 * h), h, h**2, f"first order, omega dt = {h:.3g}")
    return StepError(h / 2.0, h / 2.0, h, h**2, f"first order, omega dt = {h:.3g}")


CASE = Compression()
