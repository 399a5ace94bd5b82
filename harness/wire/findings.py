"""What engines that are known by their commands do otherwise (``docs/examples``); see `ninedisk.harness.api.finding`.

No registered engine is behind these ids: they are measured where a store has cells that ``--engine-cmd`` ran.
"""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import elastic_bounces_grow

FINDINGS = (
    elastic_bounces_grow(
        "planck",
        "1.5.0",
        thread="https://github.com/piqnt/planck.js/issues/223",
        command="ninedisk run impact/bouncing-disk --engine-cmd 'node docs/examples/planck/planck_engine.mjs' --set restitution=1",
    ),
    Finding(
        id="rapier/friction-without-the-rebound",
        versions="0.21.0",
        what=(
            "At a rebound friction is bounded by mu times the impulse that stops the approach, without the one of restitution: a "
            "disk with restitution 1 gets half of the spin that it should."
        ),
        size=Size(
            case="impact/oblique",
            variant="vt=3,restitution=1",
            quantity="spin_final",
            truth="analytic",
            over=0.01,
            sign=-1,
            fails=True,
            over_why="Coulomb's law bounds friction by mu times the whole normal impulse, at e = 1 twice that of the approach",
        ),
        command=(
            "ninedisk run impact/oblique --engine-cmd 'node docs/examples/rapier/rapier_engine.mjs' --set vt=3 --set restitution=1"
        ),
    ),
    Finding(
        id="rapier/touching-row-loses-energy",
        versions="0.21.0",
        what="A row of touching elastic disks loses a sixth of its energy with three disks, more with five: all rebound at once.",
        size=Size(
            case="chain/newton-cradle",
            variant="*gap=0",
            quantity="energy_final",
            truth="analytic",
            over=0.01,
            sign=-1,
            fails=True,
            over_why="elastic impacts keep the energy, whatever order they are taken in: rigid contacts to round-off, springs to 1e-4",
        ),
        command="ninedisk run chain/newton-cradle --engine-cmd 'node docs/examples/rapier/rapier_engine.mjs' --set gap=0",
    ),
    Finding(
        id="rapier/elastic-gas-loses-energy",
        versions="0.21.0",
        what="An elastic gas loses energy with its collisions.",
        cause_tested=True,
        size=Size(
            case="gas/elastic",
            variant="rows=3",
            quantity="kinetic_final",
            truth="analytic",
            over=1e-3,
            sign=-1,
            fails=True,
            over_why="elastic impacts keep the energy to round-off, 1e-7 for each of some hundred collisions in single precision",
        ),
        command="ninedisk run gas/elastic --engine-cmd 'node docs/examples/rapier/rapier_engine.mjs'",
    ),
)
