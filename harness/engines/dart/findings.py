"""What DART is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import (
    creeps_at_rest,
    elastic_bounces_grow,
    free_rotation_gains,
    overlap_of_impact_stays,
)

FINDINGS = (
    Finding(
        id="dart/contacts-give-way",
        versions="6.20.0",
        what=(
            "Every contact constraint is regularised (constraint force mixing): an elastic gas cools with every collision."
        ),
        size=Size(
            case="gas/elastic",
            variant="rows=3",
            quantity="kinetic_final",
            truth="analytic",
            over=1e-09,
            sign=-1,
            over_why="elastic impacts keep the energy to the round-off of some hundred collisions",
        ),
        command="ninedisk run gas/elastic --engine dart",
    ),
    elastic_bounces_grow("dart", "6.20.0"),
    overlap_of_impact_stays("dart", "6.20.0"),
    free_rotation_gains("dart", "6.20.0"),
    Finding(
        id="dart/missed-tolerance-gives-a-pyramid",
        versions="6.20.0",
        what=(
            "A step in which Gauss-Seidel misses its tolerance is solved anew by dantzig, without a word: for that step friction is a "
            "pyramid, and a box that should stand near its tipping gets a spin."
        ),
        size=Size(
            case="box/incline",
            variant="mu=0.8,slope_deg=20,aspect=0.38,turned_deg=0",
            quantity="turning",
            truth="analytic",
            over=1e-5,
            over_why="contacts give way by 1e-5, at a corner six times as much, of 2 m/s over 0.2 m",
        ),
        command="ninedisk run box/incline --engine dart --set mu=0.8 --set aspect=0.38",
    ),
    creeps_at_rest("dart", "6.20.0", "Friction is regularised (constraint force mixing)"),
    Finding(
        id="dart/arm-less-the-overlap",
        versions="6.20.0",
        what=(
            "Friction of a sphere on a plane acts at the plane, at an arm that the overlap shortens: after an impact, whose step made an "
            "overlap of up to the speed times dt, the sphere spins the less for it."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9",
            quantity="spin_final",
            truth="analytic",
            over=1e-4,
            sign=-1,
            over_why="contacts give way by 1e-5, twice in an elastic impact; Bullet and Siconos spin up to round-off",
        ),
    ),
    Finding(
        id="dart/friction-pyramid",
        versions="6.20.0",
        what=(
            "With DART's own solver, dantzig, friction is a pyramid along the axes of space: across its edges it is 1.41 times mu fn and "
            "up to 45 degrees off the slip."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9*dart.solver=dantzig*",
            quantity="vt_final",
            truth="analytic",
            over=1e-4,
            sign=-1,
            over_why="Coulomb's cone is the same in all directions: 1e-5 is left by the solver nsgs",
            fails=True,
        ),
        command="ninedisk run spheres/thornton --engine dart --set law=linear --set incidence=9 --option dart.solver=dantzig",
    ),
)
