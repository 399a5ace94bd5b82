"""What often lies behind a violation: a diameter for a radius, spheres taken for disks, one stiffness for many."""

from __future__ import annotations

import numpy as np

from ninedisk.harness.audit.checks import Auditor
from ninedisk.harness.audit.geometry import close_pairs, norm

TWICE = (1.7, 2.05)
"""Distance over the sum of radii at which bodies push each other whose radii are halves of the right ones."""

ENERGIES = ("energy", "kept", "overlap")
"""Checks that inertias and stiffnesses enter by the energy."""


def radius_hints(auditor: Auditor) -> dict[str, str]:
    """Remarks on overlaps that half the radii would not show, and on pushes at a distance of twice the radii."""
    found = {}
    R = auditor.bodies.radius
    overlap, free = auditor.tallies["overlap"], auditor.tallies["free"]
    if overlap.beyond and (state := overlap.scene) is not None:
        at = np.flatnonzero(state.here)
        pairs, shift = close_pairs(state.x[at], R[at], state.cell)
        i, j = at[pairs[:, 0]], at[pairs[:, 1]]
        apart = norm(state.x[j] + shift - state.x[i])
        share = float((1.0 - apart / (0.5 * (R[i] + R[j]))).max(initial=-1.0))
        if len(pairs) and share < 0.1 and float((1.0 - apart / (R[i] + R[j])).max()) > 0.3:
            found["overlap"] = (
                "; with half of these radii no two bodies overlap by more than a tenth: are they diameters?"
            )
    if free.beyond and (state := free.scene) is not None and free.worst is not None:
        body = next(iter(free.worst["disks"]), None)
        others = np.flatnonzero(state.here & (np.arange(len(R)) != body))
        if body is not None and len(others):
            ratio = norm(state.x[others] - state.x[body]) / (R[others] + R[body])
            if TWICE[0] < float(ratio.min()) < TWICE[1]:
                near = auditor.bodies.id[others[int(np.argmin(ratio))]]
                found["free"] = (
                    f"; the nearest body, {near}, is {ratio.min():.3g} sums of radii away: are the radii halves of the right ones?"
                )
    return found


def inertia_hint(auditor: Auditor, check: str) -> str:
    """A remark on inertias that nobody gave, for a violated check that they enter."""
    scene, tallies = auditor.scene, auditor.tallies
    if scene.inertia_given or scene.dimension == 3:
        return ""
    turns = check in ("spin", "torque")
    if not turns and not (check in ENERGIES and any(tallies[name].beyond for name in ("spin", "torque"))):
        return ""
    return '; inertia is not given and that of disks, m R^2/2: spheres in a plane (LAMMPS, YADE) have 2/5, inertia = "sphere"'


def stiffness_hint(auditor: Auditor, check: str, hint: str) -> str:
    """A remark on one stiffness for contacts that may have many, where nothing else explains the energies."""
    others = any(auditor.tallies[name].beyond for name in ("free", "momentum", "motion"))
    if check not in ENERGIES or auditor.scene.kn is None or hint or others:
        return ""
    return "; if contacts have different stiffnesses (Hertz, YADE), take kn out of the TOML"
