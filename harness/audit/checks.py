"""Physics held against a trajectory, interval by interval: each check's value, and the allowance that digits, sampling and step give it.

What may have touched during an interval is grouped; a group that met no wall keeps its momentum and angular momentum and gains no energy,
whatever its contacts do inside, and what walls gave to one lies in the cone of their normals and friction. Nothing here integrates.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.energy import EnergyChecks
from ninedisk.harness.audit.geometry import norm
from ninedisk.harness.audit.momentum import MomentumChecks
from ninedisk.harness.audit.spin import SpinChecks
from ninedisk.harness.audit.tally import State
from ninedisk.harness.audit.torques import judge_torques
from ninedisk.harness.audit.touching import EPS, Interval

ROUNDS = 5
"""How often groups of coarse frames are widened: each hit may throw a body at another that none seemed to touch."""


class Auditor(MomentumChecks, SpinChecks, EnergyChecks):
    """Takes the states of a trajectory one after the other; three are held.

    Parameters
    ----------
    scene : AuditScene
    bodies : Bodies
    has_velocity : bool
        False: velocities are central differences, whose error contacts show.
    digits : mapping
        How each column was rounded, in words.
    """

    def feed(self, state: State) -> None:
        """Take the next state."""
        self.frames += 1
        self._held.append(state)
        held = self._held
        if len(held) == 1:
            self._check_state(state, None)
        elif len(held) == 3:
            self._interval(None, held[0], held[1], held[2])
        elif len(held) == 4:
            self._interval(held[0], held[1], held[2], held[3])
            del held[0]
            if self.has_velocity:
                held[0] = _without_places(held[0])

    def finish(self) -> None:
        """Judge what is left."""
        if not self.scene.conservative:
            self.tallies["kept"].skip(
                1, "energy is kept only with restitution = 1 and mu = 0, both given, and no damping"
            )
        held = self._held
        if len(held) == 2:
            self._interval(None, held[0], held[1], None)
        elif len(held) == 3:
            self._interval(held[0], held[1], held[2], None)
        if self.scene.dt is None or not (self.scene.kn or any(self.scene.wall_kn)):
            self.tallies["step"].skip(1, "how long contacts last needs time.dt and contact.kn")
        elif not self.tallies["step"].judged:
            self.tallies["step"].skip(1, "no bodies or walls of known stiffness overlap in any frame")

    def clock_hint(self) -> str:
        """How far positions move for what velocities say, where that is not once."""
        scale = self._ways[0] / self._ways[1] if self._ways[1] > 0.0 else 1.0
        if abs(scale - 1.0) < 0.01:
            return ""
        return f"; over all, positions move {scale:.4g} times as far as velocities say: is time.dt, time.interval or a unit wrong?"

    def velocity_remark(self) -> str:
        """Whether velocities in free flight are those of half a step before the positions, or after; empty: of the same instant.

        Then positions move by ``h (v0 + v1)/2`` and half a step of the change of velocity more, or less.
        """
        dt = self.scene.dt
        along, size, doubt = self._lag
        if dt is None or size == 0.0 or doubt > 0.05 * dt * size:
            return ""
        share = along / size / dt
        if abs(abs(share) - 0.5) > 0.1:
            return ""
        words = f"velocities are those of half a step {'before' if share > 0.0 else 'after'} the positions"
        return words + ("; those of the first frame are of its instant" if self._starts_whole else "")

    def _start_of_leapfrog(self, dv: FloatArray, noise: FloatArray, alone: NDArray[np.bool_]) -> None:
        """Take half a step of gravity out of the first change of velocity, where all bodies in flight show just that.

        An engine whose velocities are half a step off the positions starts from velocities of the instant.
        """
        kick = 0.5 * (self.scene.dt or 0.0) * self.scene.gravity
        if not self.has_velocity or not alone.any() or not norm(kick) > 2.0 * noise[alone].max():
            return
        for sign in (1.0, -1.0):
            if (norm(dv[alone] + sign * kick) <= noise[alone]).all():
                dv += sign * kick
                self._starts_whole = True

    # One interval, from b to c; a and d are its neighbours.

    def _interval(self, a: State | None, b: State, c: State, d: State | None) -> None:
        from ninedisk.harness.audit.terms import interval_terms

        scene, bodies = self.scene, self.bodies
        h = c.t - b.t
        if not h > 0.0:
            self._start = None
            return
        self.intervals.append(h)
        use = b.here & c.here & ~bodies.fixed
        dt = min(scene.dt or h, h)
        hidden = self.eps * max(1.0, h / dt)
        g = scene.gravity
        eh = self._clock_error(b, c, h) + 2.0 * EPS * abs(c.t)
        n = len(use)
        dv, r = np.empty_like(b.x), np.empty_like(b.x)
        speed, far, lag = np.empty(n), np.empty(n), np.empty(n)
        interval_terms(b.x, c.x, b.v, c.v, h, scene.damping, g, dv, r, speed, far, lag)
        ev = b.ev + c.ev + 4.0 * hidden * (speed + norm(g) * h) + eh * norm(g)
        ex = b.ex + c.ex + 2.0 * hidden * far + 0.5 * h * (b.ev + c.ev) + eh * speed
        bulge = 0.25 * h * norm(dv) + norm(r) + ex + 0.5 * dt * speed
        for _ in range(ROUNDS):
            touch = self._possible_contacts(b, c, use, bulge)
            resolved, reach = self._resolved_disks(b, c, use, touch, h, dt)
            wider = np.maximum(bulge, np.where(touch.degree > 1, reach, 0.0))
            if (wider <= bulge).all():
                break
            bulge = wider
        if len(self.intervals) == 1:
            self._start_of_leapfrog(dv, ev + lag, use & (touch.degree == 0))
        # What a body that one frame alone has brings in, or takes, is not known.
        reach = np.where(touch.passing[touch.label], np.inf, reach) if touch.passing.any() else reach
        squeeze = self._spring_forces(b, c)
        ev += 4.0 * hidden * (squeeze * h / bodies.mass)
        whole = Interval(b, c, h, dt, use, touch, dv, ev, hidden, squeeze)
        self._motion(a, whole, d, r, ex, resolved, reach)
        self._momentum(whole, ev + lag)
        if c.omega is not None and b.omega is not None:
            self._spin(whole)
        else:
            self.tallies["spin"].skip(
                1,
                "the file has no spins: add "
                + ("a column omega" if scene.dimension == 2 else "omegax, omegay, omegaz"),
            )
        judge_torques(self.tallies["torque"], scene, bodies, whole, eh)
        gain = self._energy(whole)
        self._check_state(c, gain)
        vrel = float(2.0 * np.nanmax(speed, initial=0.0))
        self._growth.append(
            (h, 2.0 * vrel / float(bodies.radius.min()) if len(touch.pairs) or len(touch.walled) else 0.0)
        )


def _without_places(state: State) -> State:
    """What the next but one interval needs of a state: velocities."""
    none = np.empty(0)
    return replace(
        state, x=np.empty((0, state.x.shape[1])), ex=none, ev=none, eo=none, ea=none, angle=None, torque=None, eq=none
    )
