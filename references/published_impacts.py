"""Curves of Chung & Ooi's figures, as the authors of Kratos' DEM tests read them off: facts of a figure and no truth of a law.

Numbers are those of ``applications/DEMApplication/test_examples/basic_benchmarks/paper_data`` of Kratos Multiphysics (BSD-4-Clause),
rounded to a tenth of what they can be trusted for. Of test 7 Kratos has no reading: its numbers there are the exact ones, to eight digits.
"""

from __future__ import annotations

from typing import NamedTuple

READER = "the authors of Kratos' DEM tests"
SOURCE = "Chung & Ooi (2011), Granular Matter 13, 643"


class Reading(NamedTuple):
    """A curve of a figure.

    Parameters
    ----------
    test : int
        Number of the test.
    quantity : str
        What the figure shows, in the words of this package: ``tangential_restitution`` (velocity along the plane after over before),
        ``spin`` [rad/s], ``rebound_angle`` [deg] of the point of contact, ``slip_scaled`` (slip after over mu times the normal velocity
        after), ``spin_scaled`` (R spin over mu times the normal velocity before), ``surface_restitution`` (slip after over before, turned)
        or ``recoil`` (slip after over the normal velocity after).
    name : str
        Name in the figure's legend.
    x, y : tuple of float
        Points: over the angle of incidence [deg] in test 4, slip before over mu times the normal velocity in test 5, ``7/2 mu (1 + e)``
        times the normal velocity over the slip for ``surface_restitution``, and slip before over the normal velocity for ``recoil``.
    """

    test: int
    quantity: str
    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


UNCERTAINTY = {
    "tangential_restitution": 0.005,
    "spin": 7.0,
    "rebound_angle": 0.6,
    "slip_scaled": 0.07,
    "spin_scaled": 0.07,
    "surface_restitution": 0.02,
    "recoil": 0.05,
}
"""Half-width of what a reading errs by: a little above the farthest that readings of DEM lie from the closed form where the sphere slides
all through the impact, which holds for every law."""

# fmt: off
_FOUR = (5.1, 10.0, 15.0, 20.0, 25.0, 30.1, 35.0, 40.0, 50.0, 60.0, 70.0, 80.0, 85.0)
_SIX = (
    0.176,
    0.352,
    0.551,
    0.771,
    0.969,
    1.189,
    1.454,
    1.740,
    2.093,
    2.489,
    2.996,
    3.634,
    4.515,
    5.749,
    7.819,
    11.89,
    24.01,
)
_OUT = (
    0.085,
    0.173,
    0.268,
    0.363,
    0.465,
    0.574,
    0.696,
    0.838,
    1.001,
    1.198,
    1.429,
    1.734,
    2.149,
    2.747,
    3.733,
    5.677,
    6.106,
)
_EIGHT = (
    0.187,
    0.358,
    0.551,
    0.765,
    0.979,
    1.214,
    1.492,
    1.770,
    2.091,
    2.519,
    2.989,
    3.631,
    4.508,
    5.770,
    7.845,
    11.91,
    23.97,
)
_BACK = (
    0.077,
    0.166,
    0.263,
    0.366,
    0.456,
    0.573,
    0.690,
    0.842,
    1.0,
    1.186,
    1.427,
    1.730,
    2.144,
    2.750,
    3.721,
    5.664,
    7.104,
)
_EIGHT_Y = (-0.815, -0.626, -0.439, -0.238, -0.017, 0.096, 0.111, 0.090, 0.058, 0.006, -0.049, -0.103, -0.139, -0.162)

READINGS: tuple[Reading, ...] = (
    Reading(4, "tangential_restitution", "alumina", _FOUR,
            (0.948, 0.687, 0.624, 0.616, 0.634, 0.684, 0.737, 0.781, 0.845, 0.893, 0.932, 0.966, 0.983)),
    Reading(4, "tangential_restitution", "experiment",
            (2.2, 4.2, 9.8, 20.2, 30.4, 39.5, 49.6, 71.1, 79.2, 85.2),
            (0.797, 0.746, 0.675, 0.599, 0.690, 0.774, 0.848, 0.937, 0.970, 0.979)),
    Reading(4, "spin", "alumina", _FOUR,
            (-19.3, -213.0, -377.8, -510.6, -599.4, -616.5, -582.3, -544.8, -457.0, -357.5, -246.2, -126.3, -63.1)),
    Reading(4, "spin", "experiment",
            (5.9, 10.9, 21.1, 31.1, 39.0, 50.2, 60.1, 70.0, 78.6, 84.3),
            (-134.9, -261.2, -573.7, -612.2, -595.1, -449.5, -375.7, -243.0, -142.4, -70.6)),
    Reading(4, "rebound_angle", "alumina", (4.9, 10.0, 14.9, 20.0, 25.0, 29.9, 35.0, 39.9, 49.8, 60.0, 69.7, 79.8, 84.8),
            (3.8, -1.6, -5.5, -7.5, -7.5, -3.5, 3.4, 11.6, 29.4, 47.8, 64.6, 78.7, 84.5)),
    Reading(4, "rebound_angle", "experiment",
            (2.1, 3.9, 9.7, 20.3, 30.2, 39.1, 49.5, 59.9, 70.5, 78.9, 84.8),
            (0.8, 0.8, -1.1, -8.5, -2.6, 9.9, 30.0, 50.0, 66.9, 78.9, 85.7)),
    Reading(5, "slip_scaled", "steel",
            (0.066, 0.332, 0.671, 1.009, 1.335, 1.662, 2.0, 2.350, 2.991, 3.341, 4.006, 4.997, 6.0, 9.988, 12.961),
            (-0.08, -0.28, -0.493, -0.747, -1.0, -1.267, -1.533, -1.813, -2.44, -2.693, -2.787, -2.0, -1.013, 3.013, 6.013)),
    Reading(5, "slip_scaled", "polyethylene",
            (0.079, 0.344, 0.671, 0.997, 1.347, 1.674, 2.012, 2.326, 2.991, 3.341, 3.994, 4.997, 5.988, 10.0, 12.961),
            (-0.08, -0.293, -0.573, -0.88, -1.12, -1.44, -1.76, -2.053, -2.68, -2.947, -2.933, -2.0, -1.0, 3.0, 6.013)),
    Reading(5, "slip_scaled", "finite elements",
            (0.006, 0.272, 0.586, 0.876, 1.190, 1.553, 1.915, 2.314, 2.785, 3.317, 3.970, 4.755, 5.758, 7.124, 9.118, 12.356, 12.961),
                        (-0.027, -0.027, -0.027, -0.08, -0.213, -0.373, -0.627, -0.947, -1.253, -1.52, -1.72, -1.707, -1.2, 0.133,
             2.147, 5.427, 6.013)),
    Reading(5, "spin_scaled", "steel",
            (0.058, 0.353, 0.682, 0.994, 1.341, 1.688, 2.0, 2.329, 2.988, 3.318, 3.994, 5.0, 6.006, 10.012, 20.0),
            (-0.106, -0.430, -0.820, -1.250, -1.664, -2.094, -2.524, -2.978, -3.904, -4.293, -4.837, -5.007, -5.006, -5.004, -4.991)),
    Reading(5, "spin_scaled", "polyethylene",
            (0.075, 0.353, 0.682, 0.994, 1.341, 1.688, 2.017, 2.347, 3.023, 3.335, 4.012, 5.0, 6.006, 9.994, 20.0),
            (-0.097, -0.438, -0.901, -1.331, -1.761, -2.216, -2.670, -3.116, -4.050, -4.456, -4.934, -4.966, -4.958, -4.963, -4.942)),
    Reading(5, "spin_scaled", "finite elements",
            (0.006, 0.318, 0.595, 0.890, 1.185, 1.532, 1.896, 2.277, 2.763, 3.301, 3.890, 4.688, 5.659, 7.029, 9.040, 12.335, 18.803),
                        (0.0, -0.187, -0.406, -0.665, -0.982, -1.355, -1.793, -2.321, -2.856, -3.441, -4.041, -4.569, -4.941, -4.941,
             -4.972, -4.970, -4.975)),
    Reading(6, "surface_restitution", "aluminium", _SIX,
                        (-0.820, -0.633, -0.445, -0.243, -0.028, 0.097, 0.119, 0.100, 0.058, 0.005, -0.050, -0.100, -0.140, -0.175,
             -0.208, -0.258, -0.342)),
    Reading(6, "surface_restitution", "nylon", _SIX,
                        (-0.824, -0.638, -0.443, -0.243, -0.026, 0.093, 0.119, 0.117, 0.095, 0.056, 0.007, -0.056, -0.120, -0.159,
             -0.118, -0.113, -0.116)),
    Reading(6, "recoil", "aluminium", _OUT,
            (0.022, 0.062, 0.089, 0.102, 0.089, 0.089, 0.050, -0.031, -0.151, -0.271, -0.351, -0.377, 0.052, 1.272, 3.241, 7.127, 7.985)),
    Reading(6, "recoil", "nylon", _OUT,
                        (0.022, 0.049, 0.049, 0.089, 0.062, 0.036, -0.031, -0.124, -0.231, -0.324, -0.377, -0.377, 0.052, 1.272, 3.255,
             7.127, 7.998)),
    Reading(8, "surface_restitution", "case A", _EIGHT, (*_EIGHT_Y, -0.204, -0.248, -0.318)),
    Reading(8, "surface_restitution", "case B", _EIGHT, (*_EIGHT_Y, -0.106, -0.108, -0.106)),
    Reading(8, "recoil", "case A", _BACK,
            (0.014, 0.046, 0.079, 0.112, 0.112, 0.112, 0.063, -0.019, -0.101, -0.297, -0.396, -0.412, 0.095, 1.307, 3.271, 7.151, 10.0)),
    Reading(8, "recoil", "case B", _BACK,
            (0.014, 0.046, 0.079, 0.112, 0.112, 0.112, 0.063, -0.019, -0.101, -0.183, -0.248, -0.281, 0.095, 1.307, 3.271, 7.151, 10.0)),
)
# fmt: on
