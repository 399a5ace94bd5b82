"""Shaken floor and shuttling disk: the equations of motion, starts, ends, and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.contact.driven_contact import shaken_contact, shuttle

FLOOR = {"kn": 1e6, "mass": 2.0, "beta": 0.2, "g": 10.0, "amplitude": 2e-5, "frequency": 300.0, "phase": 0.7}


@pytest.mark.parametrize("beta", [0.0, 0.2, 0.9])
def test_the_shaken_contact_obeys_its_equation(beta):
    floor = {**FLOOR, "beta": beta}
    h = 1e-6
    t = np.arange(0, 20001) * h
    found = shaken_contact(t, **floor)
    omega = math.sqrt(floor["kn"] / floor["mass"])
    z = found.overlap - floor["mass"] * floor["g"] / floor["kn"]
    second = (found.rate[2:] - found.rate[:-2]) / (2.0 * h)
    angle = floor["frequency"] * t + floor["phase"]
    forced = -floor["amplitude"] * floor["frequency"] ** 2 * np.sin(angle)
    left = second + (2.0 * beta * omega * found.rate + omega**2 * z - forced)[1:-1]
    assert np.abs(left).max() < (omega * h) ** 2 * np.abs(second).max()
    assert np.abs((found.overlap[2:] - found.overlap[:-2]) / (2.0 * h) - found.rate[1:-1]).max() < 1e-6 * np.ptp(
        found.rate
    )
    assert z[0] == pytest.approx(0.0, abs=1e-18)
    assert found.rate[0] == pytest.approx(floor["amplitude"] * floor["frequency"] * math.cos(floor["phase"]), rel=1e-12)
    assert floor["kn"] * np.abs(z).max() <= found.swing


def test_the_shuttle_goes_to_and_fro():
    path = {"speed": 2.0, "gap": 0.3, "path": 1.0, "omega_first": 5.0, "omega_second": 4.0}
    period = math.pi / 5.0 + math.pi / 4.0 + 1.0
    touch = 0.15
    t = np.array(
        [0.0, touch, touch + math.pi / 10.0, touch + math.pi / 5.0, touch + math.pi / 5.0 + 0.5 + math.pi / 8.0]
    )
    found = shuttle(t, **path)
    np.testing.assert_allclose(found.place, [-0.3, 0.0, 0.4, 0.0, -1.5], atol=1e-12)
    np.testing.assert_allclose(found.velocity, [2.0, 2.0, 0.0, -2.0, 0.0], atol=1e-12)
    assert found.age[2] == pytest.approx(math.pi / 10.0)
    assert np.isnan(found.age[[0, 4]]).all()
    again = shuttle(t + period, **path)
    np.testing.assert_allclose(again.place, found.place, atol=1e-12)
    np.testing.assert_allclose(
        found.changes[:4],
        [touch, touch + math.pi / 5, touch + math.pi / 5 + 0.5, touch + math.pi / 5 + 0.5 + math.pi / 4],
    )


@pytest.mark.parametrize(
    ("change", "word"),
    [({"beta": 1.0}, "beta = 1.0"), ({"kn": 0.0}, "kn"), ({"beta": 0.0, "frequency": 1e3, "mass": 1.0}, "its|own")],
)
def test_what_has_no_such_form_is_refused(change, word):
    with pytest.raises(ValueError, match=word):
        shaken_contact(np.zeros(1), **{**FLOOR, **change})
