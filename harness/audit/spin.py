"""Angular momentum: of groups, of pairs by the arms of their shear forces, of bodies on a wall; forces and torques of one frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.geometry import cross, norm
from ninedisk.harness.audit.tally import State, Tally
from ninedisk.harness.audit.touching import Contacts, Interval, Touching, first_members, groups_of, wall_sets

TURNED = 0.2
"""Turn of a normal within an interval [rad] up to which arms of single bodies are named."""


ARMS_UNKNOWN = "arms of R could feed groups of several bodies: give kn and mu, or contact.lever_arm"


class SpinChecks(Touching):
    """Checks of `Auditor` on spins and torques."""

    def _spin(self, interval: Interval) -> None:
        from ninedisk.harness.audit.terms import spin_change

        scene, bodies, tally = self.scene, self.bodies, self.tallies["spin"]
        b, c, _, _, use, touch, dv, ev, hidden, _ = interval
        assert b.omega is not None
        assert c.omega is not None
        m = np.where(use, bodies.mass, 0.0)
        turned, err = np.empty_like(b.omega), np.empty(len(use))
        spin_change(
            use, b.omega, c.omega, b.eo, c.eo, bodies.mass, bodies.radius, bodies.inertia, bodies.em, bodies.er, hidden, turned, err
        )  # fmt: skip
        if not scene.frictional and not scene.rolling and scene.damping == 0.0:
            at = np.flatnonzero(use)
            for each in (tally, self.radius_arms):
                each.judge(c, norm(turned[at]), {"digits of omega": err[at]}, lambda k: f"{self._name(at[k])}, without friction",
                           lambda k: at[k : k + 1])  # fmt: skip
        if scene.damping > 0.0:
            tally.skip(1, "global damping takes angular momentum")
            return
        walls = wall_sets(touch, len(scene.walls))
        size = touch.size
        anchored = touch.held
        change, noise = self._moments(interval, turned, err)
        free = (walls == 0) & ~anchored & (size > 0)
        tally.skip(
            int((free & touch.across).sum()), "contacts across a periodic edge carry angular momentum through the box"
        )
        clear = np.flatnonzero(free & ~touch.across)
        words, members = self._group_words(touch, clear, use)
        pair_of = self._pairs_alone(touch, size, clear)
        normal, turn = self._normals(touch, b, c)

        def who(k: int) -> str:
            pair = pair_of.get(int(clear[k]))
            return (
                words(k)
                if pair is None
                else words(k) + self._arm_words(touch, pair, turned, m[:, None] * dv, normal, turn)
            )

        tally.judge(c, norm(change[clear]), {"digits of omega, x and v": noise[clear]}, who, members)
        self._radius_arms(interval, clear, pair_of, turned, err, change, noise, who)
        lone = np.flatnonzero((walls > 0) & (walls & (walls - 1) == 0) & ~anchored & (size == 1))
        if scene.rolling:
            tally.skip(len(lone), "rolling resistance turns bodies on walls")
        elif len(lone):
            body = first_members(touch, use)[lone]
            wall = np.log2(walls[lone]).astype(int)
            n0, n1 = (self.track.at(state.t).normal[wall] for state in (b, c))
            impulse = m[body, None] * dv[body]
            R = bodies.radius[body]
            expected = -R[:, None] * cross(0.5 * (n0 + n1), impulse)
            depth = self._depth_on_wall(body, wall, b, c)
            parts = {
                "digits of omega and v": err[body] + R * m[body] * ev[body],
                "arm between R and R less the overlap": depth * norm(cross(n1, impulse)),
                "the wall's turning": norm(n1 - n0) * R * norm(impulse),
            }
            for each in (tally, self.radius_arms):
                each.judge(
                    c,
                    norm(turned[body] - expected),
                    parts,
                    lambda k: f"{self._name(body[k])} on a wall",
                    lambda k: body[k : k + 1],
                )
        tally.skip(
            int(((walls > 0) & (size > 0)).sum() - len(lone)), "several bodies or walls: the walls' torque is not known"
        )
        tally.skip(int((anchored & (size > 0)).sum()), "fixed bodies take angular momentum")

    def _moments(self, interval: Interval, turned: FloatArray, err: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of the angular momentum of each group about its centre, and its digits."""
        from ninedisk.harness.audit.terms import arm_noise, centre_sums, moment_sums

        b, c, h, _, use, touch, dv, ev, hidden, squeeze = interval
        m, em = self.bodies.mass, self.bodies.em
        change, noise = groups_of(touch, turned, use), groups_of(touch, err, use)
        arms = np.zeros(len(use))
        mass, X, V = np.empty(touch.groups), *(np.empty((touch.groups, b.x.shape[1])) for _ in range(2))
        xi, u = np.empty(b.x.shape[1]), np.empty(b.x.shape[1])
        for state, sign in ((c, 1.0), (b, -1.0)):
            centre_sums(use, touch.label, m, state.x, state.v, mass, X, V)
            moment_sums(
                use,
                touch.label,
                m,
                em,
                state.x,
                state.v,
                state.ex,
                state.ev,
                dv,
                X,
                V,
                hidden,
                sign,
                xi,
                u,
                change,
                noise,
                arms,
            )
        # An engine forms arms out of coordinates: their rounding times the impulses.
        arm_noise(use, touch.label, m, arms, ev, b.ev, c.ev, dv, b.x, c.x, squeeze, h, self.eps, noise)
        return change, noise

    def _pairs_alone(self, touch: Contacts, size: NDArray[Any], clear: NDArray[np.int64]) -> dict[int, int]:
        """Group -> its one pair, of groups of two bodies."""
        two = np.zeros(touch.groups, dtype=bool)
        two[clear] = size[clear] == 2
        at = np.flatnonzero(two[touch.label[touch.pairs[:, 0]]]) if len(touch.pairs) else np.empty(0, dtype=np.int64)
        return dict(zip(touch.label[touch.pairs[at, 0]].tolist(), at.tolist(), strict=True))

    @staticmethod
    def _normals(touch: Any, b: State, c: State) -> tuple[FloatArray, FloatArray]:
        """Mean normal of each pair, from its first to its second body, and by how much it turns [rad]."""
        i, j = touch.pairs[:, 0], touch.pairs[:, 1]
        ends = []
        for state in (b, c):
            apart = state.x[j] - state.x[i]
            ends.append(apart / np.maximum(norm(apart), 1e-300)[:, None])
        mean = ends[0] + ends[1]
        return mean / np.maximum(norm(mean), 1e-300)[:, None], norm(ends[1] - ends[0])

    def _arm_words(
        self, touch: Any, pair: int, turned: FloatArray, impulse: FloatArray, normal: FloatArray, turn: FloatArray
    ) -> str:
        """The arms that the spins of two bodies show, the one farthest from its radius named."""
        moment = cross(normal[pair], impulse[touch.pairs[pair, 0]])
        if turn[pair] > TURNED or not norm(moment) > 0.0:
            return ""
        shown = {
            int(body): float(turned[body] @ moment / (moment @ moment)) / float(self.bodies.radius[body])
            for body in touch.pairs[pair]
        }
        worst = max(shown, key=lambda body: abs(shown[body] - 1.0))
        other = next(body for body in shown if body != worst)
        return (
            f", the shear force turns {self._name(worst)} by an arm of {shown[worst]:.4g} R "
            f"and {self._name(other)} by one of {shown[other]:.4g} R"
        )

    def _radius_arms(
        self, interval: Interval, clear: NDArray[np.int64], pair_of: dict[int, int], turned: FloatArray, err: FloatArray,
        change: FloatArray, noise: FloatArray, who: Any,
    ) -> None:  # fmt: skip
        """The same for arms equal to the radii: both of a pair have the same I dw/R, and gain at most overlap times that."""
        scene, tally = self.scene, self.radius_arms
        touch, R = interval.touch, self.bodies.radius
        place = np.full(touch.groups, -1, dtype=np.int64)
        place[clear] = np.arange(len(clear))
        pairs = [(place[group], *touch.pairs[k]) for group, k in pair_of.items() if place[group] >= 0]
        if pairs:
            at, i, j = np.array(pairs, dtype=np.int64).T
            per = [turned[body] / R[body][:, None] for body in (i, j)]
            mean = 0.5 * (R[i] + R[j])
            members = lambda k: np.array([i[k], j[k]])  # noqa: E731
            if not scene.rolling:
                digits = {"digits of omega": mean * (err[i] / R[i] + err[j] / R[j])}
                tally.judge(interval.c, mean * norm(per[0] - per[1]), digits, lambda k: who(at[k]), members)
            depth = self._depth_of_pairs(i, j, interval)
            shear = np.maximum(norm(per[0]), norm(per[1]))
            # The shear force may turn round within an interval: then what it fed is more than its impulse shows.
            turns = (
                4.0 * shear
                if scene.kn is None
                else (1.0 if scene.mu is None else scene.mu) * scene.kn * depth * interval.h
            )
            gain = depth * np.maximum(shear, turns)
            parts = {"digits of omega, x and v": noise[clear[at]], "arms of R: overlap times the shear impulse": gain}
            tally.judge(interval.c, norm(change[clear[at]]), parts, lambda k: who(at[k]), members)
        size = touch.size
        several = np.flatnonzero(size[clear] > 1)
        several = several[~np.isin(clear[several], list(pair_of))]
        if len(several) and scene.kn and scene.mu is not None:
            i, j = touch.pairs[:, 0], touch.pairs[:, 1]
            depth = self._depth_of_pairs(i, j, interval)
            fed = np.bincount(touch.label[i], scene.mu * scene.kn * depth**2 * interval.h, touch.groups)
            parts = {"digits of omega, x and v": noise[clear[several]],
                     "arms of R: overlap times mu fn, all the time": fed[clear[several]]}  # fmt: skip
            tally.judge(interval.c, norm(change[clear[several]]), parts, lambda k: who(several[k]),
                        lambda k: np.flatnonzero(touch.label == clear[several[k]]))  # fmt: skip
        elif len(several):
            over = norm(change[clear[several]]) > noise[clear[several]]
            tally.skip(int(over.sum()), ARMS_UNKNOWN)
        alone = np.flatnonzero(size[clear] == 1)
        tally.judge(interval.c, norm(change[clear[alone]]), {"digits of omega, x and v": noise[clear[alone]]},
                    lambda k: who(alone[k]), lambda k: np.flatnonzero(touch.label == clear[alone[k]]))  # fmt: skip

    def _depth_of_pairs(self, i: NDArray[np.int64], j: NDArray[np.int64], interval: Interval) -> FloatArray:
        """Deepest overlap of pairs: at both ends, and what the speed makes of a spring in between."""
        b, c = interval.b, interval.c
        R, m = self.bodies.radius, self.bodies.mass
        depth = np.zeros(len(i))
        for state in (b, c):
            depth = np.maximum(depth, R[i] + R[j] - norm(state.x[j] - state.x[i]))
        speed = np.maximum(norm(b.v[i] - b.v[j]), norm(c.v[i] - c.v[j]))
        if self.scene.kn:
            depth = np.hypot(depth, speed * np.sqrt(m[i] * m[j] / (m[i] + m[j]) / self.scene.kn))
        elif not self.scene.rigid:
            depth = np.maximum(depth, np.minimum(speed * interval.h, np.minimum(R[i], R[j])))
        return depth

    def settle_arms(self) -> str:
        """Choose between the two conventions of arms, what the scene does not say; a remark for the verdict."""
        given, tight, radius = self.scene.lever_arm, self.tallies["spin"], self.radius_arms
        if given == "radius":
            self._take_radius_arms()
            if radius.beyond and not tight.beyond:
                return '; arms of R less half the overlap fit: is it lever_arm = "overlap"?'
            return ""
        if not tight.beyond:
            return ""
        unknown = radius.why_not.get(ARMS_UNKNOWN, 0)
        fits = radius.beyond == 0 and (radius.judged > 0 or unknown > 0)
        if given is not None:
            return '; arms of R fit: is it lever_arm = "radius"?' if fits and not unknown else ""
        if fits and unknown:
            self._take_radius_arms()
            return ""
        if fits:
            self._take_radius_arms()
            return (
                "; the arms of shear forces are the radii, with which contacts of two bodies feed angular momentum: overlap times fs; "
                'state lever_arm = "radius" if it is meant'
            )
        return ""

    def _take_radius_arms(self) -> None:
        """The verdict on arms of R, with what could not be judged either way."""
        found: Tally = self.radius_arms
        for why, count in self.tallies["spin"].why_not.items():
            found.skip(count, why)
        self.tallies["spin"] = found
