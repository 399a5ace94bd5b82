"""The pyramid of ``contact/holding`` can rest: a linear program finds contact forces in equilibrium and within Coulomb's cone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from ninedisk.harness.cases.contact.holding import CASE, GRAVITY, MASS, MU, RADIUS


def can_rest(mu: float, *, rows: bool) -> bool:
    """Whether forces exist; without ``rows`` disks of one layer do not press each other."""
    x = CASE.build({each.name: each.default for each in CASE.parameters} | {"kind": "pyramid"}).scene.disks.x
    n = len(x)
    contacts = [(-1, i, np.array([0.0, 1.0])) for i in range(n) if x[i, 1] < 1.001 * RADIUS]
    for i in range(n):
        for j in range(i + 1, n):
            away = x[j] - x[i]
            if np.hypot(*away) < 2.001 * RADIUS and (rows or abs(away[1]) > 0.1):
                contacts.append((i, j, away / np.hypot(*away)))
    balance, cone = np.zeros((3 * n, 2 * len(contacts))), []
    for k, (i, j, normal) in enumerate(contacts):
        for column, force in ((2 * k, normal), (2 * k + 1, np.array([-normal[1], normal[0]]))):
            balance[3 * j : 3 * j + 2, column] += force
            if i >= 0:
                balance[3 * i : 3 * i + 2, column] -= force
        for body in (i, j):
            if body >= 0:
                balance[3 * body + 2, 2 * k + 1] -= RADIUS
        for side in (1.0, -1.0):
            cone.append(np.zeros(2 * len(contacts)))
            cone[-1][2 * k : 2 * k + 2] = -mu, side
    load = np.tile([0.0, MASS * GRAVITY, 0.0], n)
    bounds = [(0.0, None), (None, None)] * len(contacts)
    found = linprog(np.zeros(len(bounds)), np.array(cone), np.zeros(len(cone)), balance, load, bounds)
    return bool(found.status == 0)


@pytest.mark.parametrize("rows", [True, False])
def test_the_pyramids_can_rest_and_with_less_friction_could_not(rows: bool) -> None:
    assert can_rest(MU["pyramid"], rows=rows)
    assert can_rest(MU["rough-pyramid"], rows=rows)
    assert can_rest(0.474, rows=rows)
    assert not can_rest(0.472, rows=rows)
