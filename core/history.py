"""What a run gives back: sampled states, watched contacts, walls and energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray

Pair = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class History:
    """Observations at the sampled steps; s samples, n disks or spheres, m walls, c watched pairs.

    Shapes are those of the plane. In space positions, velocities, points and forces of walls have three components; so have ``angle`` (the
    integral of the spin) and ``omega``, ``fs`` (the shear force on the first body) and ``wall_angle`` (the wall's unit normal).

    A quantity that an engine cannot observe is filled with NaN, never with a guess.

    Parameters
    ----------
    step : ndarray of int, shape (s,)
        Step numbers (multiples of ``Numerics.dt``).
    t : ndarray, shape (s,)
        Times [s].
    x, v : ndarray, shape (s, n, 2)
        Centres [m] and velocities [m/s], both at ``t``.
    angle, omega : ndarray, shape (s, n)
        Rotations [rad] since time 0 and spins [rad/s]; the angle of an outline is ``Disks.angle`` more.
    pairs : tuple of pairs
        The watched contacts, as body numbers.
    gap, fn, fs : ndarray, shape (s, c)
        Gap [m], normal and shear contact force [N] of the watched pairs (sign conventions of `ninedisk.core.scene`). Bodies with
        outlines, and boxes, can touch at several places: the gap is then the smallest one, ``fn`` and ``fs`` are sums over the
        contacts, each of which has its own normal and tangent.
    force_meaning : {"instantaneous", "step-mean"}
        Whether ``fn, fs`` are forces at ``t`` or impulses of the step that ends at ``t`` divided by its length.
    wall_point : ndarray, shape (s, m, 2)
        A material point of each wall [m].
    wall_angle : ndarray, shape (s, m)
        Direction of each wall's normal [rad].
    wall_force : ndarray, shape (s, m, 2)
        Force of the disks on each wall [N].
    energy : mapping from name to ndarray, shape (s,)
        Energies [J]: those of the state (``translation``, ``rotation`` and their sum ``kinetic``; ``elastic_normal``, ``elastic_shear``,
        ``elastic_rolling`` and their sum ``elastic``; ``gravity``), what was fed since time 0 (``wall_work``, ``force_work`` by
        `Scene.forces`, ``cell_work`` by the deforming cell), and with `Numerics.energy_budget` what was lost since time 0, each > 0 where
        energy is lost: ``friction_loss``, ``dashpot_loss``, ``rolling_loss``, ``damping_loss`` (global damping), ``impact_loss`` (rigid
        impacts), and of the DEM ``law_loss`` (of a law whose shear force works with other arms than its slip has, or whose shear spring
        changes its stiffness with the contact radius; < 0: feeds). Kinetic,
        elastic, gravity and losses together grow by what was fed. Of contact dynamics also ``impact_gain``, what impacts under Newton's
        law fed since time 0, which friction alone lets them do: summed over the contacts that feed; and with the budget ``held_work``,
        what was fed by what holds disks in their course, and ``scheme_loss``, what the implicit scheme itself takes (< 0: feeds): with
        these two the budget closes to round-off.
    quaternion : ndarray, shape (s, n, 4), or None
        Of scenes with boxes: rotations from the bodies' frames to the scene's, unit quaternions ``(w, x, y, z)`` of either sign. None:
        the scene has no box, or it was not observed.
    moment : ndarray, shape (s, c, 3), or None
        Of scenes with boxes: torque [N m] of the contact forces of a watched pair on its first body, about that body's centre. With
        the force it says where a face is loaded. None: the scene has no box, or it was not observed.
    stress : ndarray, shape (s, 2, d, d), or None
        Of a periodic cell: stress [N/m], in 3D [Pa], compression positive, by contact forces (first) and by velocities beside the
        cell's affine flow and the bodies' mean one (second); row a, column b is the force along a on an edge or face whose normal is
        b. None: there is no cell, or it was not observed.
    particles : tuple of int or None
        Disks that ``x``, ``v``, ``angle`` and ``omega`` hold, in this order; None: all n of them.

    Examples
    --------
    Two samples of three disks, and the contact of disk 0 with the first wall, body 3:

    >>> history = History.empty(np.array([0, 10]), np.array([0.0, 0.1]), n_disks=3, n_walls=1, pairs=((0, 3),))
    >>> history.x.shape, history.fn.shape, history.contact((0, 3))
    ((2, 3, 2), (2, 1), 0)
    """

    step: NDArray[np.int64]
    t: FloatArray
    x: FloatArray
    v: FloatArray
    angle: FloatArray
    omega: FloatArray
    pairs: tuple[Pair, ...]
    gap: FloatArray
    fn: FloatArray
    fs: FloatArray
    force_meaning: Literal["instantaneous", "step-mean"]
    wall_point: FloatArray
    wall_angle: FloatArray
    wall_force: FloatArray
    energy: Mapping[str, FloatArray] = field(default_factory=dict)
    particles: tuple[int, ...] | None = None
    stress: FloatArray | None = None
    quaternion: FloatArray | None = None
    moment: FloatArray | None = None

    def contact(self, pair: Pair) -> int:
        """Return the column of a watched pair in ``gap``, ``fn`` and ``fs``; KeyError if it was not watched."""
        try:
            return self.pairs.index(pair)
        except ValueError:
            raise KeyError(f"pair {pair} was not watched; watched: {self.pairs}") from None

    @classmethod
    def empty(
        cls,
        step: NDArray[np.int64],
        t: FloatArray,
        *,
        n_disks: int,
        n_walls: int,
        pairs: tuple[Pair, ...],
        force_meaning: Literal["instantaneous", "step-mean"] = "instantaneous",
        energies: tuple[str, ...] = (),
        dimension: int = 2,
        boxes: bool = False,
    ) -> History:
        """Make a history of the right shapes, filled with NaN, for an engine to write into; ``boxes``: the scene has some."""
        s, c = len(step), len(pairs)
        turn = () if dimension == 2 else (3,)

        def blank(*shape: int) -> FloatArray:
            return np.full((s, *shape), np.nan)

        return cls(
            step=step,
            t=t,
            x=blank(n_disks, dimension),
            v=blank(n_disks, dimension),
            angle=blank(n_disks, *turn),
            omega=blank(n_disks, *turn),
            pairs=pairs,
            gap=blank(c),
            fn=blank(c),
            fs=blank(c, *turn),
            force_meaning=force_meaning,
            wall_point=blank(n_walls, dimension),
            wall_angle=blank(n_walls, *turn),
            wall_force=blank(n_walls, dimension),
            energy={name: blank() for name in energies},
            quaternion=blank(n_disks, 4) if boxes else None,
            moment=blank(c, 3) if boxes else None,
        )
