"""Energies of groups and of all bodies, overlaps that they explain, and the most that walls can have worked."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.geometry import Cone, friction_rays, norm
from ninedisk.harness.audit.tally import State
from ninedisk.harness.audit.touching import Interval, Touching, groups_of, wall_sets

SHARE = 0.1
"""Share of its energy that a contact may gain or lose by the engine's step: about five steps a contact."""
STEP_UNKNOWN = "the engine's step may gain as much in contacts of unknown stiffness: give kn"


class EnergyChecks(Touching):
    """Checks of `Auditor` on energies and overlaps."""

    def _energy(self, interval: Interval) -> dict[str, float] | None:
        """Energy of each group, and the most that may have come into all: ``work`` of walls and ``order``, errors of the scheme."""
        from ninedisk.harness.audit.terms import energy_sums

        scene, bodies = self.scene, self.bodies
        b, c, _, dt, use, touch, dv, ev, hidden, squeeze = interval
        m, g = np.where(use, bodies.mass, 0.0), scene.gravity
        tally = self.tallies["energy"]
        mu = max([scene.mu or 0.0, *(each or 0.0 for each in scene.wall_mu)])
        size = touch.size
        walls = wall_sets(touch, len(scene.walls))
        gain, fall = np.zeros(touch.groups), np.zeros(touch.groups)
        parts = {
            name: np.zeros(touch.groups)
            for name in ("digits", "engine's step", "springs' step", "shear springs", "walls' work")
        }
        # Masses and radii of the file have digits as well: of what each body gained by itself.
        # Central differences keep the sum less dt^2/8 F^2/m; a contact that begins within a step errs by kn (v dt)^2/8 (its half step).
        energy_sums(
            use, touch.label, bodies.mass, bodies.em, c.x, b.v, c.v, self._body_energies(b)[0], self._body_energies(c)[0], squeeze, g,
            hidden, dt, mu, gain, parts["digits"], parts["engine's step"], parts["springs' step"], fall,
        )  # fmt: skip
        blind = np.zeros(touch.groups, dtype=bool)
        before = np.zeros(touch.groups, dtype=bool)
        last, now = (self._spring_energies(state, mu) for state in (b, c))
        gain += groups_of(touch, now["normal"] - last["normal"], use)
        parts["digits"] += groups_of(
            touch, self._body_energies(c)[1] + now["error"] + self._body_energies(b)[1] + last["error"], use
        )
        parts["shear springs"] += groups_of(touch, last["shear"], use)
        before[touch.label[use & (last["unknown"] > 0.0)]] = True
        blind[touch.label[use & (last["unknown"] + now["unknown"] > 0.0)]] = True
        if b.omega is not None and c.omega is not None:
            turned = np.abs(norm(c.omega) ** 2 - norm(b.omega) ** 2)
            parts["digits"] += groups_of(touch, bodies.inertia * turned * bodies.er / bodies.radius, use)
        # An engine of first order has velocities half a step off the positions.
        parts["engine's step"] += 0.5 * dt * np.abs(fall)
        i, j = touch.pairs[:, 0], touch.pairs[:, 1]
        near = np.maximum(((b.v[i] - b.v[j]) ** 2).sum(1), ((c.v[i] - c.v[j]) ** 2).sum(1))
        first = np.where(use[i], i, j)
        doubt = np.zeros(touch.groups)
        if scene.kn is None and not scene.rigid:
            own = bodies.mass[i] * bodies.mass[j] / (bodies.mass[i] + bodies.mass[j])
            reduced = np.where(use[i] & use[j], own, bodies.mass[first])
            doubt += np.bincount(touch.label[first], SHARE * 0.5 * reduced * near, touch.groups)
        on, w = touch.walled[:, 0], touch.walled[:, 1]
        speed = np.maximum((b.v[on] ** 2).sum(1), (c.v[on] ** 2).sum(1))
        unknown = np.array([each is None and not scene.rigid for each in scene.wall_kn], dtype=bool)
        doubt += np.bincount(
            touch.label[on], SHARE * 0.5 * bodies.mass[on] * speed * (unknown[w] if len(on) else 0.0), touch.groups
        )
        if scene.kn is not None:
            parts["springs' step"] += np.bincount(touch.label[first], scene.kn * near * dt * dt / 8.0, touch.groups)
            stiff = np.array([each or 0.0 for each in scene.wall_kn])[w] if len(on) else np.zeros(0)
            parts["springs' step"] += np.bincount(touch.label[on], stiff * speed * dt * dt / 8.0, touch.groups)
        touched = touch.label[use & (touch.degree > 0)]
        if scene.cohesive or (b.omega is None and scene.frictional):
            blind[touched] = before[touched] = True
        anchored = touch.held
        moving = self._moving_walls(b.t, c.t)
        unknown_work = anchored & bool((np.nan_to_num(norm(b.v))[bodies.fixed] > 0.0).any())
        unknown_work |= touch.passing
        for group in np.flatnonzero((walls & moving > 0) & (size > 0)):
            disks = np.flatnonzero((touch.label == group) & use)
            work = self._wall_work(
                int(walls[group]), disks, (m[disks, None] * dv[disks]).sum(axis=0), float((m * ev)[disks].sum()), b, c
            )
            if work is None:
                unknown_work[group] = True
            else:
                parts["walls' work"][group] = work
        real = size > 0
        judged = np.flatnonzero(real & ~before & ~unknown_work)
        shown = {name: part[judged] if part.any() else np.zeros(len(judged)) for name, part in parts.items()}
        open_ = _between(gain[judged], shown, doubt[judged])
        tally.skip(int(open_.sum()), STEP_UNKNOWN)
        judged = judged[~open_]
        shown = {name: part[~open_] for name, part in shown.items()}
        who, members = self._group_words(touch, judged, use)
        tally.judge(c, gain[judged], shown, who, members)
        tally.skip(int((real & before & ~unknown_work).sum()), "overlaps at the start may store energy: give kn (and ks), or rigid = true"
                   if not scene.cohesive else "cohesion may have stored energy")  # fmt: skip
        tally.skip(
            int((real & unknown_work).sum()),
            "moving walls on several sides, or of unknown friction, or bodies that are moved, come or leave, work",
        )
        if scene.conservative:
            still = np.flatnonzero(real & ~blind & ~unknown_work & (parts["walls' work"] == 0.0))
            who, members = self._group_words(touch, still, use)
            self.tallies["kept"].judge(
                c, -gain[still], {name: part[still] for name, part in parts.items()}, who, members
            )
            self.tallies["kept"].skip(int(real.sum()) - len(still), "springs of unknown stiffness, or moving walls")
        if (real & unknown_work).any() or (scene.cohesive and len(touched)) or (b.omega is None and scene.frictional):
            return None
        return {
            "work": float(parts["walls' work"].sum()),
            "order": float(parts["springs' step"].sum()),
            "doubt": float(doubt.sum()),
        }

    def _body_energies(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Kinetic and potential energy of each disk [J], and its error by the digits; NaN where a body lacks."""
        from ninedisk.harness.audit.terms import body_energies

        def made() -> tuple[FloatArray, FloatArray]:
            bodies = self.bodies
            own, err = np.empty_like(bodies.mass), np.empty_like(bodies.mass)
            omega = state.v if state.omega is None else state.omega
            body_energies(
                state.x, state.v, omega, state.ex, state.ev, state.eo, bodies.mass, bodies.inertia, self.scene.gravity,
                state.omega is not None, own, err,
            )  # fmt: skip
            return own, err

        found: tuple[FloatArray, FloatArray] = self._once(state, "energies", made)
        return found

    def _moving_walls(self, t0: float, t1: float) -> int:
        """Walls, as bits, that move between two times."""
        if not any(wall.motion for wall in self.scene.walls):
            return 0
        poses = [self.track.at(t) for t in (t0, 0.5 * (t0 + t1), t1)]
        return sum(
            1 << w
            for w in range(len(self.scene.walls))
            if any(
                (pose.point[w] != poses[0].point[w]).any() or (pose.normal[w] != poses[0].normal[w]).any()
                for pose in poses[1:]
            )
        )

    def _wall_work(
        self, code: int, bodies: NDArray[np.int64], impulse: FloatArray, err: float, b: State, c: State
    ) -> float | None:
        """Most that walls can have worked on bodies to which they gave an impulse [J]; None: any amount.

        A linear program: the impulse is a sum of rays, the edges of the walls' cones, and each ray works by its wall's velocity.
        """
        from scipy.optimize import linprog

        rays, speeds = [], []
        h = c.t - b.t
        plain = self._plain_work(code, impulse, err, b, c)
        if plain is not None:
            return plain
        for share, state in ((0.25, b), (0.75, c)):
            poses = self.track.at(b.t + share * h)
            for w in range(len(self.scene.walls)):
                if not code >> w & 1:
                    continue
                mu = self.scene.wall_mu[w]
                if mu is None:
                    return None
                normal = poses.normal[w]
                points = state.x[bodies] - self.bodies.radius[bodies, None] * normal
                velocity = poses.surface_velocity(w, points)
                for ray in friction_rays(normal, mu):
                    rays.append(ray)
                    speeds.append(float((velocity @ ray).max()))
        cone, speed = Cone(np.array(rays)), np.array(speeds)
        if cone.whole:
            return None
        impulse = cone.nearest(impulse)
        size = float(norm(impulse))
        if size == 0.0:
            return err * float(np.abs(speed).max())
        # A residual within the solver's tolerance would make it infeasible: the rays' own sum of the impulse starts inside.
        scale = float(np.abs(speed).max()) or 1.0
        result = linprog(-speed / scale, A_eq=cone.rays.T, b_eq=impulse / size, method="highs")
        if result.status == 3 or result.fun is None:
            return None
        best = -float(result.fun) * scale * size
        return max(best, 0.0) + (err + 1e-9 * size) * scale

    def _plain_work(self, code: int, impulse: FloatArray, err: float, b: State, c: State) -> float | None:
        """The work of one wall that does not turn and keeps its velocity; None: another case."""
        if code & (code - 1):
            return None
        w = code.bit_length() - 1
        mu = self.scene.wall_mu[w]
        one, two = (self.track.at(b.t + share * (c.t - b.t)) for share in (0.25, 0.75))
        if mu is None or one.rate[w].any() or two.rate[w].any() or (one.velocity[w] != two.velocity[w]).any():
            return None
        rays = friction_rays(one.normal[w], mu)
        impulse = Cone(rays, (one.normal[w], mu)).nearest(impulse)
        return max(float(impulse @ one.velocity[w]), 0.0) + err * float(np.abs(rays @ one.velocity[w]).max())

    def _check_state(self, c: State, gain: dict[str, float] | None) -> None:
        """One instant: overlaps, totals, and the energy of all disks against the least since the start."""
        from ninedisk.harness.audit.terms import state_totals

        scene, bodies = self.scene, self.bodies
        use = c.here & ~bodies.fixed
        mu = max([scene.mu or 0.0, *(each or 0.0 for each in scene.wall_mu)])
        own, err = (np.where(use, each, 0.0) for each in self._body_energies(c))
        store = self._spring_energies(c, mu)
        stored, doubt = float(store["normal"].sum()), float(err.sum() + store["error"].sum())
        low = float(own.sum()) + stored
        known = not (store["unknown"].any() or scene.cohesive)
        high = low + float(store["shear"].sum()) if known else np.inf
        squeeze = self._spring_forces(c)
        dt = scene.dt or (min(self.intervals) if self.intervals else 0.0)
        turns = 1 if scene.dimension == 2 else 3
        P, L, energies = np.zeros(scene.dimension), np.zeros(turns), np.zeros(2)
        omega = c.v if c.omega is None else c.omega
        state_totals(
            use, c.x, c.v, omega, bodies.mass, bodies.inertia, scene.gravity, c.omega is not None, P, L, energies
        )
        lag = 0.5 * dt * float(np.abs(P @ scene.gravity))
        lag += 0.5 * dt * float((squeeze * np.nan_to_num(norm(c.v))).sum())
        least = self._least
        if least is None or gain is None or not np.array_equal(least["use"], use):
            least = {"high": np.inf, "err": 0.0, "use": use, "doubt": 0.0}
        else:
            least = least | {
                "high": least["high"] + gain["work"] + gain["order"],
                "doubt": least["doubt"] + gain["doubt"],
            }
            if np.isfinite(least["high"]):
                parts = {
                    "digits at both ends": np.array([doubt + least["err"]]),
                    "engine's step": np.array([lag + least.get("lag", 0.0)]),
                }
                at = np.flatnonzero(use)
                grown = np.array([low - least["high"]])
                if _between(grown, parts, np.array([least["doubt"]])).any():
                    self.tallies["energy"].skip(1, STEP_UNKNOWN)
                else:
                    self.tallies["energy"].judge(
                        c, grown, parts, lambda _: "all bodies, since their least energy", lambda _: at
                    )
        budget = high
        if np.isfinite(least["high"]):
            budget = least["high"] + least["err"] + least.get("lag", 0.0)
        if high <= least["high"]:
            least = {"high": high, "err": doubt, "use": use, "lag": lag, "doubt": 0.0}
        self._least = least
        self._depths(c, budget - float(own.sum()) + doubt + lag)
        self._check_step(c)
        _, _, depth, _, _ = self._overlaps(c)
        self.totals.append({
            "t": c.t, **{f"p{axis}": float(value) for axis, value in zip("xyz", P, strict=False)},
            **{name: float(value) for name, value in zip(("L",) if turns == 1 else ("Lx", "Ly", "Lz"), L, strict=True)},
            "kinetic": float(energies[0]), "potential": float(energies[1]), "springs": stored,
            "overlap": float(depth.max()) if len(depth) else 0.0, "disks": int(c.here.sum()),
        })  # fmt: skip

    def _check_step(self, c: State) -> None:
        """Each contact lasts several steps: one that starts anywhere within a step errs by up to ``kn (v dt)^2/8`` of ``m v^2/2``."""
        tally, dt = self.tallies["step"], self.scene.dt
        n, mass = len(self.bodies.id), self.bodies.mass
        i, j, _, kn, _ = self._overlaps(c)
        at = np.flatnonzero(np.isfinite(kn))
        if dt is None or not len(at):
            return
        i, j, walled = i[at], np.minimum(j[at], n - 1), j[at] >= n
        share = 0.25 * dt * dt * kn[at] * (1.0 / mass[i] + np.where(walled, 0.0, 1.0 / mass[j]))

        def who(k: int) -> str:
            return (
                f"{self._name(i[k])}{' on a wall' if walled[k] else f' and {self._name(j[k])}'}, whose contact lasts "
                f"{0.5 * np.pi / np.sqrt(share[k]):.2g} steps; value: share of its energy that it may gain or lose"
            )

        allowed = {"a tenth, that of five steps": np.full(len(at), SHARE)}
        tally.judge(c, share, allowed, who, lambda k: np.array([i[k]] if walled[k] else [i[k], j[k]]))

    def _depths(self, c: State, left: float) -> None:
        """Overlaps: of rigid disks none, of springs what the energy left [J] can squeeze; of unknown ones short of a centre."""
        scene, bodies, tally = self.scene, self.bodies, self.tallies["overlap"]
        n = len(bodies.id)
        i, j, depth, kn, _ = self._overlaps(c)
        other = np.where(j < n, j, i)
        er = bodies.er
        err = c.ex[i] + er[i] + np.where(j < n, c.ex[other] + er[other], 0.0)
        swallowed = np.where(j < n, np.minimum(bodies.radius[i], bodies.radius[other]), bodies.radius[i])

        def who(k: int) -> str:
            return f"{self._name(i[k])} and {self._name(j[k]) if j[k] < n else f'wall {scene.walls[j[k] - n].name!r}'}"

        def members(k: int) -> NDArray[np.int64]:
            return np.array([i[k]] if j[k] >= n else [i[k], j[k]])

        if not len(depth):
            tally.judge(
                c,
                np.zeros(1),
                {"digits of x": np.full(1, 2.0 * float(np.nanmax(c.ex, initial=0.0)))},
                lambda _: "no contact",
                lambda _: i,
            )
            return
        if scene.rigid:
            tally.judge(c, depth, {"digits of x": err, "the given slop": np.full(len(i), scene.slop)}, who, members)
            return
        with np.errstate(invalid="ignore"):
            spring = np.sqrt(2.0 * max(left, 0.0) / kn)
        known = np.isfinite(spring)
        allowed = np.where(known, np.minimum(spring, swallowed), swallowed)
        decided = known | (depth > swallowed)
        at = np.flatnonzero(decided)
        tally.judge(
            c, depth[at], {"digits of x": err[at], "what the energy at hand squeezes, short of a centre": allowed[at]},
            lambda k: who(at[k]), lambda k: members(at[k]),
        )  # fmt: skip
        tally.skip(int((~decided).sum()), "how deep springs of unknown stiffness may go: give kn, or rigid = true")


def _between(value: FloatArray, parts: Mapping[str, FloatArray], doubt: FloatArray) -> NDArray[np.bool_]:
    """What exceeds its allowance by no more than a sound scheme may gain in contacts whose stiffness nobody gave."""
    allowed = sum(parts.values(), np.zeros(len(value)))
    return (value > allowed) & (value <= allowed + doubt)
