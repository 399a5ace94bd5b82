"""Orders of convergence of the explicit scheme against closed solutions of continuous time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scenes import KN, floor_scene, numerics, orders, pair_scene, run

from ninedisk.core import ContactLaw, Disks, History, Scene, Wall, WallSegment
from ninedisk.references.analytic.compression import continuous_row
from ninedisk.references.analytic.spring_dashpot import contact_history, restitution_of_beta

REFINEMENTS = (40, 80, 160, 320)
ELASTIC = ContactLaw(kn=KN)


def errors(
    build: Scene,
    end: float,
    exact: Callable[[History], np.ndarray],
    value: Callable[[History], np.ndarray],
    **how: object,
) -> list[float]:
    """Largest error at ten common times for each refinement of the step."""
    found = []
    for n in REFINEMENTS:
        history = run(build, numerics(end / n, n, sample_every=n // 10, **how))
        found.append(float(np.max(np.abs(value(history) - exact(history)))))
    return found


def oscillation(t: np.ndarray, omega: float, start: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of a harmonic oscillator."""
    c, s = np.cos(omega * t), np.sin(omega * t)
    return start * c + rate / omega * s, rate * c - start * omega * s


def test_pair_within_one_contact_is_second_order() -> None:
    """Initial overlap and closing speed: a full first kick instead of half a one would be first order."""
    scene = pair_scene(ELASTIC, overlap=0.01, closing=1.0)
    omega = np.sqrt(2.0 * KN)

    def overlap(h: History) -> np.ndarray:
        return oscillation(h.t, omega, 0.01, 1.0)[0]

    def rate(h: History) -> np.ndarray:
        return oscillation(h.t, omega, 0.01, 1.0)[1]

    end = 2.0 / omega
    position = errors(scene, end, overlap, lambda h: 2.0 - (h.x[:, 1, 0] - h.x[:, 0, 0]))
    velocity = errors(scene, end, rate, lambda h: h.v[:, 0, 0] - h.v[:, 1, 0])
    force = errors(scene, end, lambda h: KN * overlap(h), lambda h: h.fn[:, 0])
    for found in (position, velocity, force):
        assert orders(found) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("xi", [0.0, 30.0])
def test_bounce_under_gravity_within_one_contact_is_second_order(xi: float) -> None:
    omega, g, end = np.sqrt(KN), 50.0, 0.02
    scene = floor_scene(ELASTIC, height=0.995, v=(0.0, -1.0), gravity=(0.0, -g), xi=xi)
    rest, wd, a = 1.0 - g / KN, np.sqrt(omega**2 - xi**2 / 4.0), xi / 2.0

    def height(t: np.ndarray) -> np.ndarray:
        y = 0.995 - rest
        return rest + np.exp(-a * t) * (y * np.cos(wd * t) + (-1.0 + a * y) / wd * np.sin(wd * t))

    def speed(t: np.ndarray) -> np.ndarray:
        y = 0.995 - rest
        b = (-1.0 + a * y) / wd
        return np.exp(-a * t) * ((b * wd - a * y) * np.cos(wd * t) - (y * wd + a * b) * np.sin(wd * t))

    position = errors(scene, end, lambda h: height(h.t), lambda h: h.x[:, 0, 1])
    velocity = errors(scene, end, lambda h: speed(h.t), lambda h: h.v[:, 0, 1])
    assert orders(position) == pytest.approx(2.0, abs=0.1)
    assert orders(velocity) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("form", "order"), [("central", 2.0), ("lagged", 1.0)])
def test_global_damping_of_velocity_and_spin(form: str, order: float) -> None:
    """Free flight from v0 != 0 under gravity: ``v' = g - xi v``; the spin decays as ``exp(-xi t)``."""
    xi, g, end = 4.0, -10.0, 0.5
    disks = Disks(x=[[0.0, 0.0]], v=[[3.0, 5.0]], omega=[7.0], radius=1.0, mass=2.0)
    scene = Scene(disks=disks, disk_disk=ELASTIC, gravity=(0.0, g), xi=xi)
    cases = (
        (lambda h: g / xi + (5.0 - g / xi) * np.exp(-xi * h.t), lambda h: h.v[:, 0, 1]),
        (lambda h: g / xi * h.t + (5.0 - g / xi) * (1.0 - np.exp(-xi * h.t)) / xi, lambda h: h.x[:, 0, 1]),
        (lambda h: 7.0 * np.exp(-xi * h.t), lambda h: h.omega[:, 0]),
        (lambda h: 7.0 * (1.0 - np.exp(-xi * h.t)) / xi, lambda h: h.angle[:, 0]),
    )
    for exact, value in cases:
        assert orders(errors(scene, end, exact, value, damping_form=form)) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize(("form", "order"), [("central", 2.0), ("lagged", 1.0)])
@pytest.mark.parametrize("beta", [0.1, 0.5, 1.0])
def test_dashpot_within_one_contact(form: str, order: float, beta: float) -> None:
    """An impact that touches at time 0 by a hair, so that the force at time 0 is the dashpot's."""
    omega = np.sqrt(2.0 * KN)
    hair = 1e-13
    scene = pair_scene(ContactLaw(kn=KN, beta=beta), overlap=hair, closing=1.0)

    def exact(h: History) -> np.ndarray:
        return contact_history(h.t, kn=KN, m_eff=0.5, beta=beta, speed=1.0)[0]

    found = errors(scene, 0.9 / omega, exact, lambda h: 2.0 - (h.x[:, 1, 0] - h.x[:, 0, 0]), damping_form=form)
    assert orders(found) == pytest.approx(order, abs=0.15)


def test_dashpot_on_an_oscillating_floor_is_second_order() -> None:
    """The wall's velocity in the dashpot belongs to ``t_n`` as the disk's does.

    ``y'' = -k (y - w) - c (y' - w') - g`` with ``w = A sin(f t)``: the particular solution is one complex amplitude.
    """
    k, beta, amplitude, f = KN, 0.2, 1e-3, 60.0
    c = 2.0 * beta * np.sqrt(k)
    motion = (WallSegment(amplitude=(0.0, amplitude), frequency=f),)
    gain = (k + 1j * f * c) / (k - f**2 + 1j * f * c)
    start = 1.0 - 0.01
    # Begin on the periodic solution: no transient, and the contact stays closed.
    y0, v0 = start + amplitude * gain.imag, amplitude * f * gain.real
    scene = floor_scene(ContactLaw(kn=k, beta=beta), height=y0, v=(0.0, v0), gravity=(0.0, -0.01 * k), motion=motion)
    found = errors(scene, 0.1, lambda h: start + amplitude * (gain * np.exp(1j * f * h.t)).imag, lambda h: h.x[:, 0, 1])
    assert orders(found) == pytest.approx(2.0, abs=0.1)


def test_smooth_nine_disks_are_second_order() -> None:
    """Four smooth walls squeeze nine disks; by symmetry every row is one damped oscillator."""
    kn, mass, xi, speed, load = KN, 1.0, 20.0, 0.5, 0.02
    law, wall_law = ContactLaw(kn=kn, ks=kn, mu=0.5), ContactLaw(kn=kn)
    x = [[2.0 * i, 2.0 * j] for j in (-1, 0, 1) for i in (-1, 0, 1)]
    walls = []
    for name, normal in (("left", (1, 0)), ("right", (-1, 0)), ("bottom", (0, 1)), ("top", (0, -1))):
        motion = (WallSegment(duration=load, velocity=(speed * normal[0], speed * normal[1])),)
        walls.append(
            Wall(name=name, point=(-3.0 * normal[0], -3.0 * normal[1]), normal=normal, law=wall_law, motion=motion)
        )
    scene = Scene(disks=Disks(x=x, radius=1.0, mass=mass), disk_disk=law, walls=tuple(walls), xi=xi)
    errors_of = {"disk-disk": [], "wall": []}
    for n in REFINEMENTS:
        history = run(scene, numerics(0.1 / n, n, sample_every=n // 20), [(3, 4), (1, 4), (3, 9), (0, 11)])
        inner, outer = continuous_row(history.t, kn=kn, mass=mass, xi=xi, v_wall=speed, t_wall=load)
        errors_of["disk-disk"].append(np.max(np.abs(history.fn[:, :2] - inner[:, None])))
        errors_of["wall"].append(np.max(np.abs(history.fn[:, 2:] - outer[:, None])))
    for found in errors_of.values():
        # The onset of the load is a kink; the coarsest of the four refinements still feels it.
        assert orders(found)[1:] == pytest.approx(2.0, abs=0.1)


def collisions(dt: float, phases: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and energy errors of an elastic collision whose touch falls at each of ``phases`` places in the step."""
    mass, speed = np.pi, 1.0
    law = ContactLaw(kn=KN)
    momentum, energy = [], []
    for phase in np.arange(phases) / phases:
        gap = speed * dt * (3.0 + phase)
        disks = Disks(x=[[-1.0 - gap, 0.0], [1.0, 0.0]], v=[[speed, 0.0], [0.0, 0.0]], radius=1.0, mass=mass)
        steps = int(np.ceil(1.2 * np.pi * np.sqrt(0.5 * mass / KN) / dt)) + 6
        history = run(Scene(disks=disks, disk_disk=law), numerics(dt, steps, sample_every=steps))
        assert history.gap[-1, 0] > 0.0
        momentum.append(mass * history.v[-1, :, 0].sum() / (mass * speed) - 1.0)
        energy.append(history.energy["kinetic"][-1] / history.energy["kinetic"][0] - 1.0)
    return np.array(momentum), np.array(energy)


def test_elastic_collision_keeps_momentum_and_its_energy_error_is_second_order() -> None:
    """The error depends on the phases of touch and parting, so the contact lasts a whole number and a half of every step."""
    lasts = np.pi * np.sqrt(0.5 * np.pi / KN)
    worst = []
    for dt in (lasts / (n + 0.5) for n in (10, 20, 40, 80)):
        momentum, energy = collisions(dt)
        assert np.abs(momentum).max() < 1e-13
        worst.append(np.abs(energy).max())
    assert worst[-1] > 0.0
    assert orders(worst) == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("beta", [0.1, 0.5, 1.0, 2.0])
def test_restitution_of_a_damped_collision(beta: float) -> None:
    """omega dt = 2e-4; the touch by a hair keeps the scheme second order, so its error is some 1e-8, round-off apart."""
    hair = 1e-13
    scene = pair_scene(ContactLaw(kn=KN, beta=beta), overlap=hair, closing=1.0)
    dt = 2e-4 / np.sqrt(2.0 * KN)
    history = run(scene, numerics(dt, 20_000, sample_every=20_000))
    assert history.fn[-1, 0] == 0.0
    assert history.v[-1, 1, 0] - history.v[-1, 0, 0] == pytest.approx(restitution_of_beta(beta), abs=1e-6)
