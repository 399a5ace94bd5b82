"""Paths, momentum and angular momentum: what a group of bodies that touched may exchange with walls and gravity."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.geometry import Cone, friction_rays, joined, norm, turning
from ninedisk.harness.audit.tally import State, Words
from ninedisk.harness.audit.touching import Interval, Touching, wall_sets

CONES = 200
"""Different cones of walls that turn whose sum is still formed."""


class MomentumChecks(Touching):
    """Checks of `Auditor` that need no energy."""

    def _motion(
        self, a: State | None, interval: Interval, d: State | None, r: FloatArray, ex: FloatArray, resolved: NDArray[np.bool_],
        reach: FloatArray,
    ) -> None:  # fmt: skip
        """Trapezoid of the velocities against the way, ``r`` and its digits ``ex`` [m]; the same of spins and angles."""
        from ninedisk.harness.audit.terms import bends, clock_sums

        scene, bodies = self.scene, self.bodies
        b, c, h, dt, use, touch, *_ = interval
        met = (touch.degree > 0) & use
        each_step = dt >= h * (1.0 - 1e-9)
        bend = np.empty(len(use))
        # A contact shorter than the sampling may begin in one interval and end in the next: differences cancel, the change itself counts.
        bends(
            b.v if a is None else a.v, b.v, c.v, c.v if d is None else d.v, _scale(h, a, b), _scale(h, c, d), scene.gravity, h,
            a is None or d is None or scene.kn is None, each_step, met, bend,
        )  # fmt: skip
        # A spring whose force comes and goes within the interval bends the way by at most h^2/4 of its acceleration, unseen by differences.
        pulse = np.where(
            met & resolved & (scene.kn is not None),
            0.25 * h * h * interval.squeeze * np.hypot(1.0, scene.mu or 0.0) / bodies.mass,
            0.0,
        )
        tally = self.tallies["motion"]
        sums = np.zeros(5)
        clock_sums(b.x, c.x, b.v, c.v, r, ex, h, use, met, sums)
        self._ways += sums[:2]
        if self.has_velocity:
            self._lag += [sums[2], sums[3], np.sqrt(sums[4])]
        if not self.has_velocity:
            tally.skip(1, "velocities are differences of the positions: add vx, vy")
            self._second_differences(a, b, c, use & ~met, h)
        else:
            at = np.flatnonzero(use)
            parts = {
                "digits of x, v and t": ex[at],
                "half a step's change of velocity, which engines of first order lag": (0.5 * dt * norm(c.v - b.v))[at],
                "one contact at an unknown instant, h/4 of the second differences of v": (0.25 * h * bend)[at],
                "springs' forces that come and go, h^2/4 of the acceleration": pulse[at],
                "contacts shorter than the sampling: what the energy lets a disk move": reach[at],
            }
            tally.judge(c, norm(r)[at], parts, lambda k: self._name(at[k]), lambda k: at[k : k + 1])
        if b.omega is not None and c.omega is not None and b.angle is not None and c.angle is not None:
            turn = c.angle - b.angle - 0.5 * h * (b.omega + c.omega)
            one = c.omega - b.omega
            second = sum(
                (norm(np.nan_to_num(one - other)) for other in self._spin_steps(a, b, c, d, h)), np.zeros(len(one))
            )
            whole = a is None or d is None or each_step or scene.kn is None
            second = np.maximum(second, 2.0 * norm(one)) if whole else second
            judged = np.flatnonzero(use & (~met | resolved))
            parts = {
                "digits of angle, omega and t": (
                    b.ea
                    + c.ea
                    + 0.5 * h * (b.eo + c.eo)
                    + self.eps * max(1.0, h / dt) * norm(c.angle)
                    + self._clock_error(b, c, h) * np.maximum(norm(b.omega), norm(c.omega))
                )[judged],
                "half a step's change of spin": 0.5 * dt * norm(one)[judged],
                "one contact at an unknown instant": np.where(met, 0.25 * h * second, 0.0)[judged],
            }
            self.tallies["turning"].judge(
                c, norm(turn)[judged], parts, lambda k: self._name(judged[k]), lambda k: judged[k : k + 1]
            )
            self.tallies["turning"].skip(
                int((use & met & ~resolved).sum()), "contacts are shorter than the sampling interval"
            )
        else:
            self.tallies["turning"].skip(1, "the file has no angles with spins: add angle, omega")

    def _second_differences(self, a: State | None, b: State, c: State, clear: NDArray[np.bool_], h: float) -> None:
        """Without velocities: in free flight the second differences of the positions are those of gravity, and of damping."""
        before, self._clear = self._clear, clear
        if a is None or before is None or not b.t > a.t:
            return
        scene = self.scene
        at = np.flatnonzero(before & clear)
        back = b.t - a.t
        change = (c.x - b.x) / h - (b.x - a.x) / back
        drag = scene.damping * (c.x - a.x) / 2.0
        parts = {
            "digits of x and t": ((a.ex + b.ex) / back + (b.ex + c.ex) / h + 2.0 * self.eps * norm(b.x) / min(h, back)
                                  + self._clock_error(b, c, h) * 2.0 * norm(b.v) / h)[at],
            "damping": (scene.damping * h * norm(change))[at],
        }  # fmt: skip
        value = norm(change - 0.5 * (h + back) * scene.gravity + drag)[at]
        self.tallies["free"].judge(c, value, parts, lambda k: self._name(at[k]), lambda k: at[k : k + 1])

    @staticmethod
    def _spin_steps(a: State | None, b: State, c: State, d: State | None, h: float) -> list[FloatArray]:
        found = []
        for one, two in ((a, b), (c, d)):
            if (
                one is not None
                and two is not None
                and one.omega is not None
                and two.omega is not None
                and two.t > one.t
            ):
                found.append((two.omega - one.omega) * (h / (two.t - one.t)))
        return found

    def _momentum(self, interval: Interval, ev: FloatArray) -> None:
        from ninedisk.harness.audit.terms import momentum_sums

        b, c, use, touch = interval.b, interval.c, interval.use, interval.touch
        bodies, groups = self.bodies, touch.groups
        got, allowed, mass = np.zeros((groups, b.v.shape[1])), np.zeros(groups), np.zeros(groups)
        momentum_sums(use, touch.label, bodies.mass, bodies.em, interval.dv, ev, touch.degree, got, allowed, mass)
        mass = np.maximum(mass, 1e-300)
        size = touch.size
        walls = wall_sets(touch, len(self.scene.walls))
        anchored = touch.held
        clear = (walls == 0) & ~anchored
        alone = np.flatnonzero(clear & (size == 1))
        who, members = self._group_words(touch, alone, use)
        if self.has_velocity:
            self.tallies["free"].judge(
                c, norm(got[alone]) / mass[alone], {"digits of v and t": allowed[alone] / mass[alone]}, who, members
            )
        self.tallies["free"].skip(int((size > 0).sum() - len(alone)), "the body may have touched something")
        tally = self.tallies["momentum"]
        several = np.flatnonzero(clear & (size > 1))
        who, members = self._group_words(touch, several, use)
        tally.judge(c, norm(got[several]), {"digits of v and t": allowed[several]}, who, members)
        tally.skip(int((anchored & (size > 0)).sum()), "bodies that are fixed, come or leave take momentum")
        pulls = self._pulls(interval)
        cones: dict[int, Cone | None] = {}
        for code in np.unique(walls[(walls > 0) & ~anchored & (size > 0)]):
            chosen = np.flatnonzero((walls == code) & ~anchored & (size > 0))
            cones[code] = cone = self._cone(int(code), b, c)
            if cone is None:
                tally.skip(
                    len(chosen),
                    "walls on several sides can push any way" if not self.scene.cohesive else "walls may pull",
                )
                continue
            who, members = self._group_words(touch, chosen, use)

            def impulse(k: int, who: Words = who, chosen: NDArray[np.int64] = chosen) -> str:
                given = ", ".join(f"{each:.4g}" for each in got[chosen[k]])
                return f"{who(k)}, to whom walls gave ({given}) N s"

            tally.judge(
                c,
                cone.distance(got[chosen]),
                {"digits of v and t": allowed[chosen], "dashpots that pull at the end of a contact": pulls[chosen]},
                impulse,
                members,
            )
        self._total_momentum(c, got, allowed, use, anchored, cones, float(pulls.sum()))

    def _total_momentum(
        self, c: State, got: FloatArray, allowed: FloatArray, use: NDArray[np.bool_], anchored: NDArray[np.bool_],
        cones: Mapping[int, Cone | None], pulls: float,
    ) -> None:  # fmt: skip
        """Sums since the start: what every interval hides in its digits adds up."""
        start = self._start
        if start is None or not np.array_equal(start["use"], use):
            self._start = start = {"use": use, "got": np.zeros(got.shape[1]), "pulls": 0.0, "cones": {}, "any": False}
            start["first"] = float(allowed.sum())
        if anchored.any() or any(cone is None for cone in cones.values()):
            start["any"] = True
        start["got"] = start["got"] + got.sum(axis=0)
        start["pulls"] += pulls
        if not start["any"]:
            start["cones"] |= {cone.rays.round(9).tobytes(): cone for cone in cones.values() if cone is not None}
            start["any"] = len(start["cones"]) > CONES
        if start["any"] or not use.any():
            return
        # Readings in between cancel; their digits count at both ends, an engine's round-off all the way.
        if start.get("joined", (0,))[0] != len(start["cones"]):
            start["joined"] = (len(start["cones"]), joined(list(start["cones"].values())))
        hull = start["joined"][1] if start["cones"] else None
        if hull is not None and hull.whole:
            start["any"] = True
            return
        value = hull.distance(start["got"][None]) if hull is not None else norm(start["got"])[None]
        # An engine rounds at each of its steps, not at each frame.
        steps = sum(self.intervals) / min(self.scene.dt or np.inf, min(self.intervals))
        mass = self.bodies.mass
        speed = np.nan_to_num(norm(c.v))
        parts = {"digits of v at both ends": np.array([max(start["first"], float(allowed.sum()))]),
                 "dashpots that pull at the ends of contacts": np.array([start["pulls"]]),
                 "round-off of the sum": np.array([self.eps * steps * float((mass * speed)[use].sum())])}  # fmt: skip
        at = np.flatnonzero(use)
        self.tallies["momentum"].judge(c, value, parts, lambda _: "all bodies since the start", lambda _: at)

    def _pulls(self, interval: Interval) -> FloatArray:
        """Impulse by which dashpots of walls may pull each group in an interval [N s]."""
        touch, c = interval.touch, interval.c
        on, w = touch.walled[:, 0], touch.walled[:, 1]
        if not len(on) or self.scene.pulling == 0.0:
            return np.zeros(touch.groups)
        # Only what separates at the end of the interval may have been pulled in it.
        poses = self.track.at(c.t)
        walls = poses.velocity[w] + turning(poses.rate[w], c.x[on] - poses.pivot[w])
        speed = np.maximum(((c.v[on] - walls) * poses.normal[w]).sum(axis=1), 0.0)
        friction = 1.0 + max([0.0, *(mu or 0.0 for mu in self.scene.wall_mu)])
        most = self.scene.pulling * friction * self.bodies.mass[on] * np.nan_to_num(speed)
        return np.bincount(touch.label[on], most, touch.groups).astype(float)

    def _cone(self, code: int, b: State, c: State) -> Cone | None:
        """Impulses that some walls may give; None: any."""
        if self.scene.cohesive:
            return None
        cones = []
        poses = [self.track.at(b.t + share * (c.t - b.t)) for share in (0.0, 0.5, 1.0)]
        for w in range(len(self.scene.walls)):
            if not code >> w & 1:
                continue
            normals = np.array([pose.normal[w] for pose in poses])
            mu = self.scene.wall_mu[w]
            turn = float(norm(normals[2] - normals[0]))
            if turn == 0.0 and (normals[1] == normals[0]).all():
                cones.append(Cone(friction_rays(normals[0], mu), (normals[0], mu)))
            else:
                # Cones of a normal between those of two samples bulge by the square of the turn in between.
                wide = None if mu is None else mu * (1.0 + turn * turn) + turn * turn / 8.0
                cones += [Cone(friction_rays(normal, wide)) for normal in normals]
        found = joined(cones)
        return None if found.whole else found


def _scale(h: float, one: State | None, two: State | None) -> float:
    """What makes a change between two frames one of an interval h; 0: there are not both."""
    if one is None or two is None:
        return 0.0
    return h / (two.t - one.t) if two.t > one.t else 1.0
