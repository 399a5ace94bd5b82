"""Constitutive law of dense flows of disks in the plane, as fitted to simulations of others: bands, no closed form."""

from __future__ import annotations

from typing import NamedTuple

from ninedisk.references._validate import not_negative


class DenseFlow(NamedTuple):
    """Effective friction (shear stress over pressure) and solid fraction."""

    friction: float
    fraction: float


def simple_shear(*, inertial_number: float) -> DenseFlow:
    """Rough disks in steady simple shear: ``mu* = 0.25 + 1.1 I``, ``phi = 0.81 - 0.3 I``.

    Parameters
    ----------
    inertial_number : float
        ``I = rate sqrt(m/P)`` with the mean mass m [kg] and the pressure P [N/m], >= 0; the fit is for 1e-3 to 0.2.

    Notes
    -----
    Source: da Cruz, Emam, Prochnow, Roux & Chevoir, Phys. Rev. E 72 (2005) 021309: disks of some +-20 % of sizes, friction 0.4, stiff
    contacts, restitution 0.1; results scatter by some hundredths about the lines, and friction of other sizes shifts them as much.
    """
    not_negative(inertial_number=inertial_number)
    return DenseFlow(0.25 + 1.1 * inertial_number, 0.81 - 0.3 * inertial_number)
