"""The judge of contact forces: solutions worked out by hand pass, and every planted mistake shows in the error that is its name."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.references.contact_law import Errors, errors_of_forces, errors_of_motion, friction_error, planar_bodies

# Three blocks of mass 2 without rotation, each on its own floor, in a step of 1 s: the first is pushed less than mu times its
# weight and sticks, the second more and slides, the third is lifted. v = M^-1 (f + H r), by hand.
MU = np.array([0.5, 0.5, 0.5])
M, F = np.diag([2.0] * 6), np.array([3.0, -10.0, 8.0, -10.0, 0.0, 6.0])  # x, y of each
H = np.zeros((6, 6))
for block in range(3):
    H[2 * block + 1, 2 * block], H[2 * block, 2 * block + 1] = 1.0, 1.0  # normal up, tangent to the right
R = np.array([10.0, -3.0, 10.0, -5.0, 0.0, 0.0])
V = np.array([0.0, 0.0, 1.5, 0.0, 0.0, 3.0])
U = np.array([0.0, 0.0, 0.0, 1.5, 3.0, 0.0])
W, Q = np.eye(6) / 2.0, np.array([-5.0, 1.5, -5.0, 4.0, 3.0, 0.0])
# Under the associated rule the second block lifts off while it slides: (1, -mu) . u = 0 with u = ((p - 10)/2, (8 - mu p)/2) gives
# p = 14/1.25.
P2 = 14.0 / 1.25
R_ASSOCIATED = np.array([10.0, -3.0, P2, -0.5 * P2, 0.0, 0.0])


def judged(r, u=None, v=None, associated=False):
    """By the forces alone, and with the bodies' motion: both must agree on all that both can see."""
    alone = errors_of_forces(W, Q, MU, r, u, associated=associated)
    moved = errors_of_motion(M, H, F, np.zeros(6), MU, r, v, u, associated=associated)
    if v is None:
        assert np.allclose(alone[:5], moved[:5], rtol=1e-12, atol=1e-15)
    return alone, moved


def test_solutions_by_hand_have_no_error():
    for errors in (*judged(R), *judged(R, U, V), *judged(R_ASSOCIATED, associated=True)):
        assert errors.worst < 1e-15
        assert errors.solved(1e-14)
    assert not any(errors.solved(1e-3) for errors in judged(R, associated=True))  # nor is one law the other
    assert not any(errors.solved(1e-3) for errors in judged(R_ASSOCIATED))


def test_a_small_force_beside_fast_slip_is_seen():
    """A millionth of a newton that slides at 2,000 m/s; of it and a slip as large as forces no square would show."""
    p, slip, mu = 1e-6, 2e3, 0.5
    q = np.array([-p / 2.0, slip + mu * p / 2.0])  # u = r/2 + q = (0, slip)
    assert errors_of_forces(W[:2, :2], q, MU[:1], np.array([p, -mu * p])).natural_map < 1e-14
    assert errors_of_forces(W[:2, :2], q, MU[:1], np.array([2.0 * p, -mu * p])).natural_map > 1e-10


def test_rounding_of_bodies_at_rest_is_no_error():
    """Velocities that weight and forces cancel to, given twice with other rounding; a millionth of what they cancel is one."""
    still = (M[:2, :2], H[:2, :2], F[:2], np.zeros(2), MU[:1], R[:2], np.array([0.0, 1e-17]))
    assert errors_of_motion(*still, np.array([3e-17, 0.0])).worst < 1e-15
    assert errors_of_motion(*still, np.array([1e-6, 0.0])).dynamics > 1e-7


def changed(values, **entries):
    found = values.copy()
    for at, value in entries.items():
        found[int(at[1:])] = value
    return found


PLANTED = {
    "slip turned": (changed(R, _3=5.0), None, None, "slip"),
    "slip turned in the answer's velocities": (R, changed(U, _3=-1.5), None, "dynamics"),
    "contact pulled": (changed(R, _4=-1.0), None, None, "cone"),
    "force scaled": (changed(R, _0=10.1), None, None, "complementarity"),
    "force too small": (changed(R, _0=9.9, _1=-3.0), None, None, "opening"),
    "friction beyond the cone": (changed(R, _3=-6.0), None, None, "cone"),
    "friction too weak": (changed(R, _3=-4.0), None, None, "slip"),
    "sticks without friction": (changed(R, _1=0.0), None, None, "slip"),
    "body moves otherwise": (R, None, changed(V, _2=1.6), "dynamics"),
    "no number": (changed(R, _0=np.nan), None, None, "natural_map"),
    "nothing at all": (0.0 * R, None, None, "natural_map"),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_mistake_shows_where_it_belongs(name):
    r, u, v, field = PLANTED[name]
    for errors in judged(r, u, v)[1 if v is not None else 0 :]:
        assert getattr(errors, field) > 4e-3, errors
        assert not errors.solved(4e-3)


def test_in_space_friction_opposes_slip_in_its_plane():
    """One contact with W = 1: b_t = (3, 4), p = 2, so that friction of size 1 stands against the slip of size 4, along -(3, 4)/5."""
    b, right = np.array([-2.0, 3.0, 4.0]), np.array([2.0, -0.6, -0.8])
    exact = errors_of_forces(np.eye(3), b, [0.5], right)
    assert exact.worst < 1e-15
    assert exact.slip < 1e-15
    # Turned by an angle a: mu p |u_t| + q . u_t = 5 (1 - cos a) beside |u_t|, near 4, and E = b . r = 9; the natural map turns with it.
    for angle in (1e-3, 0.5, np.pi):
        cos, sin = np.cos(angle), np.sin(angle)
        q = np.array([[cos, -sin], [sin, cos]]) @ right[1:]
        errors = errors_of_forces(np.eye(3), b, [0.5], [2.0, *q])
        u_t = np.linalg.norm(b[1:] + q)
        work = max(abs(b @ [2.0, *q]), 4.0 + 1.0)
        assert errors.slip == pytest.approx(abs(u_t + q @ (b[1:] + q)) / work)
        assert errors.natural_map > 0.1 * angle
    # The associated rule opens the contact: u = (mu, -t) kappa.
    assert errors_of_forces(np.eye(3), b, [0.5], right, associated=True).worst > 0.1
    p = (2.0 + 0.5 * 5.0) / 1.25
    rule = errors_of_forces(np.eye(3), b, [0.5], [p, -0.3 * p, -0.4 * p], associated=True)
    assert rule.worst < 1e-15


def test_large_forces_elsewhere_hide_no_contact():
    """A self-stress, and a heavy body beside a light one: a contact that closes at the speed of the problem is no solution."""
    w = np.kron([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]], np.eye(3))
    stressed = errors_of_forces(
        w, [0.0] * 6 + [-1.0, 0.3, 0.0], [0.5] * 3, [1e9, 0.0, 0.0, 1e9, 0.0, 0.0, 0.0, 0.0, 0.0]
    )
    assert stressed.opening > 0.9
    light = errors_of_forces(
        np.kron(np.diag([1.0, 1e9]), np.eye(3)), [-1.0, 0.0, 0.0] * 2, [0.5] * 2, [1.0] + [0.0] * 5
    )
    assert light.opening > 0.99
    # What only rounding moves is not held against it: u of the first two contacts is b, beside forces that cancel.
    rounded = errors_of_forces(
        w, [1e-9] + [0.0] * 5 + [-1.0, 0.3, 0.0], [0.5] * 3, [1e9, 0.0, 0.0, 1e9, 0.0, 0.0, 1.0, -0.3, 0.0]
    )
    assert rounded.opening == 0.0


def test_errors_have_no_units():
    r = changed(R, _0=10.1)
    for force, speed in ((1e-9, 1.0), (1e12, 1e-6)):
        scaled = errors_of_forces(W * speed / force, Q * speed, MU, r * force)
        np.testing.assert_allclose(scaled[:6], errors_of_forces(W, Q, MU, r)[:6], rtol=1e-9, atol=1e-15)


def test_bodies_of_the_notation_page():
    """A disk of radius 2 on an elastic floor, rolling; a blocked unknown is left out; the inertia is 0.5 m R^2."""
    planar = planar_bodies(
        mass=np.array([[2.0, 2.0, 4.0], [np.inf, 2.0, np.inf]]),
        force=np.array([[3.0, -10.0, 0.0], [0.0, 1.0, 0.0]]),
        bodies=np.array([[0, -1], [0, 1]]),
        normal=np.array([[0.0, -1.0], [0.0, 1.0]]),
        arms=np.array([[0.0, 0.0, 2.0, 0.0], [0.0, 0.0, 2.0, 0.0]]),
        offset=np.zeros((2, 2)),
        compliance=np.array([[0.25, 0.0], [0.0, 0.0]]),
        shear_0=np.zeros(2),
    )
    np.testing.assert_array_equal(planar.m.diagonal(), [2.0, 2.0, 4.0, 2.0, 4.0])
    # On the floor n = -y and t = x: the disk opens with v_y and slides with v_x + R omega; the other disk is above it.
    np.testing.assert_array_equal(
        planar.h.toarray().T, [[0, 1, 0, 0, 1], [1, 0, 2, 0, 0], [0, -1, 0, 1, 0], [-1, 0, 2, 0, 0]]
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((W, Q[:4], MU, R), "w or q has 4 numbers"),
        ((W[:4, :4], Q, MU, R), "W has shape"),
        ((W, Q, -MU, R), "mu must be"),
    ],
)
def test_what_does_not_fit_is_named(arguments, said):
    with pytest.raises(ValueError, match=said):
        errors_of_forces(*arguments)


def test_rounding_excuses_little():
    assert not Errors(1e-7, 0, 0, 0, 0, 0, np.nan, 1e-8).solved(1e-12)
    assert errors_of_forces(W * 1e-20, Q, MU, R * 1e20 * (1 + 1e-6)).floor < 1e-8


# Contacts that bear 10, 10, 20 and 0 with mu = 0.5: one slips ahead, one back, one sticks, one is open.
FN, SLIP = np.array([10.0, 10.0, 20.0, 0.0]), np.array([3.0, -1e-9, 0.0, 2.0])
FS = np.array([-5.0, 5.0, 7.0, 0.0])


@pytest.mark.parametrize(
    ("fs", "expected"),
    [
        (FS, 0.0),
        (np.array([0.0, 5.0, 7.0, 0.0]), 5.0 / 20.0),  # slides without friction
        (np.array([5.0, 5.0, 7.0, 0.0]), 10.0 / 20.0),  # pushed along
        (np.array([-5.0, 4.0, -13.0, 0.0]), (1.0 + 3.0) / 20.0),  # too weak in a slow slip; sticks outside the cone
        (np.array([-5.0, 5.0, 7.0, 1.0]), 1.0 / 20.0),  # rubs without pressure
    ],
)
def test_friction_error_in_closed_form(fs, expected):
    assert friction_error(FN, fs, SLIP, 0.5) == pytest.approx(expected, abs=1e-15)
    assert friction_error(1e6 * FN, 1e6 * fs, 1e-3 * SLIP, 0.5) == pytest.approx(expected, abs=1e-15), "no units"
    # The natural map with a rho that makes the slowest slip large beside the forces.
    natural = np.abs(fs - np.clip(fs - 1e12 * SLIP, -0.5 * FN, 0.5 * FN)).sum() / (0.5 * FN).sum()
    assert natural == pytest.approx(expected, abs=1e-15)


def test_friction_error_of_a_sign_turned_everywhere_is_two():
    assert friction_error(FN[:2], -FS[:2], SLIP[:2], [0.5, 0.5]) == pytest.approx(2.0)


def test_friction_error_at_the_edges():
    assert friction_error([], [], [], []) == 0.0
    assert friction_error([0.0, -1.0], [0.0, 0.0], [1.0, 1.0], 0.5) == 0.0
    assert friction_error([-1.0], [0.5], [1.0], 0.5) == np.inf  # tension bears nothing
    for lost in ((np.nan, 1.0, 1.0), (1.0, np.nan, 1.0), (1.0, 1.0, np.nan)):
        assert np.isnan(friction_error(*([10.0, each] for each in lost), 0.5))
    with pytest.raises(ValueError, match="mu must be"):
        friction_error(FN, FS, SLIP, -0.5)
