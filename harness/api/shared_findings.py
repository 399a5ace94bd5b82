"""Findings that several engines share: what happens and how it is measured, said once; an engine's `findings` names those it has."""

from __future__ import annotations

from ninedisk.harness.api.finding import Finding, Size


def ratchet(engine: str, versions: str, *, variant: str, documented: str = "", thread: str = "") -> Finding:
    """Describe shear forces that drift along a path to and fro.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.
    variant : str
        Retraced loop on which it is seen.
    documented : str
        Where the engine's documentation says so.
    thread : str
        Address of an upstream issue or discussion.

    Returns
    -------
    Finding

    Examples
    --------
    >>> ratchet("acme", "1.0", variant="dt=0.01").size.over
    1e-05
    """
    return Finding(
        id=f"{engine}/ratchet",
        versions=versions,
        what=(
            "A contact that goes to and fro on one path does not return to the shear force that it began with: slip of half steps is "
            "added along the normal of the step's end, an error of first order that grows with every cycle."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant=variant,
            column="value",
            quantity="drift",
            per="1",
            over=1e-05,
            over_why=(
                "net slip is 0; with the normal of the middle of a step O(dt^4) remains, 1e-10 of the amplitude here, and 2e-6 of an "
                "iterative solver"
            ),
        ),
        documented=documented,
        thread=thread,
    )


def free_rotation_gains(engine: str, versions: str) -> Finding:
    """Describe a free rotation that gains energy.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.

    Returns
    -------
    Finding

    Examples
    --------
    >>> free_rotation_gains("acme", "1.0").id
    'acme/free-rotation-gains-energy'
    """
    return Finding(
        id=f"{engine}/free-rotation-gains-energy",
        versions=versions,
        what=(
            "The gyroscopic torque is that of the step's begin, Euler's explicit rule: a box that turns freely about no axis of its own "
            "gains energy and angular momentum, in proportion to the step."
        ),
        size=Size(
            table="headlines",
            case="box/free",
            variant="spin=any,dt=0.005*",
            quantity="energy of a free rotation",
            over=1e-3,
            sign=1,
            over_why="MuJoCo, in substeps of a 200th, keeps it to 1e-4; a rule of second order to less",
        ),
    )


def friction_while_pulled(engine: str, versions: str) -> Finding:
    """Describe Coulomb's bound by the size of a normal force that pulls.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.

    Returns
    -------
    Finding

    Examples
    --------
    >>> friction_while_pulled("acme", "1.0").size.case
    'spheres/thornton'
    """
    return Finding(
        id=f"{engine}/friction-while-pulled",
        versions=versions,
        what=(
            "Friction is cut off at mu times the size of the normal force. A dashpot that pulls at the end of a contact therefore rubs as "
            "hard as one that pushes: an oblique rebound loses mu (e_0 - e) of the normal speed too much along the surface."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9*restitution=0.5*",
            quantity="vt_final",
            truth="analytic",
            over=0.004,
            sign=-1,
            over_why="the step's own error is at most 0.0098 m/s of the first 2.25 m/s along the plane and 1 m/s across it",
        ),
        command=f"ninedisk run spheres/thornton --engine {engine} --set law=linear --set incidence=9 --set restitution=0.5",
    )


def dashpot_never_pulls(engine: str, versions: str, laws: str) -> Finding:
    """Describe rebounds of dashpots without tension.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.
    laws : str
        Contact laws of the engine that have such dashpots.

    Returns
    -------
    Finding

    Examples
    --------
    >>> dashpot_never_pulls("acme", "1.0", "hertz").size.sign  # too fast
    1
    """
    return Finding(
        id=f"{engine}/dashpot-never-pulls",
        versions=versions,
        what=(
            f"Dashpots of spheres ({laws}) are cut off where they would pull, though their damping ratio is derived for dashpots that do: "
            "rebounds are faster than the restitution asked for."
        ),
        size=Size(
            case="spheres/chung-ooi/3",
            variant="*restitution=0.2*",
            quantity="restitution_effective",
            truth="converged",
            over=0.01,
            sign=1,
            over_why="the step's own error is below 2e-3 of the restitution, and the damping ratio has it exactly where dashpots may pull",
            fails=True,
        ),
    )


def plane_at_rest_at_first(engine: str, versions: str) -> Finding:
    """Describe a moving plane that the first step takes for one at rest.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.

    Returns
    -------
    Finding

    Examples
    --------
    >>> plane_at_rest_at_first("acme", "1.0").id
    'acme/plane-at-rest-at-first'
    """
    return Finding(
        id=f"{engine}/plane-at-rest-at-first",
        versions=versions,
        what=(
            "A plane that moves along its normal from the begin of a run, together with what rests on it, gives that a kick in the first "
            "step: the speed that its dashpots see is that of a plane at rest."
        ),
        size=Size(
            case="spheres/invariance/galilei",
            variant="scene=heap,frame_vx=3,frame_vy=-2,frame_vz=1",
            quantity="down",
            truth="analytic",
            over=1.6e-6,
            over_why="what springs that begin without shear move the heap by, 7.9e-7 m, over the radius",
            fails=True,
        ),
    )


def shear_keeps_twist(engine: str, versions: str, *, kind: str = "spun", axis: str = "across") -> Finding:
    """Describe shear forces that do not turn about the normal.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.
    kind, axis : str
        Turned pair on which it is seen.

    Returns
    -------
    Finding

    Examples
    --------
    >>> shear_keeps_twist("acme", "1.0").command
    'ninedisk run spheres/turned --engine acme --set kind=spun'
    """
    sets = f"--set kind={kind}" + ("" if axis == "across" else f" --set axis={axis}")
    return Finding(
        id=f"{engine}/shear-keeps-twist",
        versions=versions,
        what=(
            "Shear forces of spheres turn with the normal and not about it: where bodies in contact turn as one about an axis along the "
            "normal, the force keeps a direction that both have left."
        ),
        size=Size(
            table="headlines",
            case="spheres/turned",
            variant=f"kind={kind},axis={axis}",
            quantity="shear force that turned",
            over=0.02,
            over_why="forces turned to first order are off by half the square of each step's rotation, 1 % of the force in a turn",
        ),
        command=f"ninedisk run spheres/turned --engine {engine} {sets}",
    )


def elastic_bounces_grow(engine: str, versions: str, *, thread: str = "", command: str = "") -> Finding:
    """Describe restitution 1 that gives back what gravity added within the step of the impact.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.
    thread : str
        Address of an upstream issue or discussion.
    command : str
        Complete command that shows it; "": that of the case.

    Returns
    -------
    Finding

    Examples
    --------
    >>> elastic_bounces_grow("acme", "1.0").command
    'ninedisk run impact/bouncing-disk --engine acme --set restitution=1'
    """
    return Finding(
        id=f"{engine}/elastic-bounces-grow",
        versions=versions,
        what=(
            "A disk with restitution 1 bounces higher every time: the step of the impact adds gravity's whole step to the approach, and "
            "restitution gives it back."
        ),
        size=Size(
            case="impact/bouncing-disk",
            variant="restitution=1",
            quantity="energy",
            truth="analytic",
            over=0.002,
            sign=1,
            over_why=(
                "a step's fall is g dt = 0.07 % of the speed of impact: 0.13 % of the energy, once; what exceeds that has grown from "
                "bounce to bounce"
            ),
        ),
        thread=thread,
        command=command,
    )


def overlap_of_impact_stays(engine: str, versions: str) -> Finding:
    """Describe the overlap of an inelastic impact within a step, left for good.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.

    Returns
    -------
    Finding

    Examples
    --------
    >>> overlap_of_impact_stays("acme", "1.0").size.sign  # too deep
    -1
    """
    return Finding(
        id=f"{engine}/overlap-of-impact-stays",
        versions=versions,
        what=(
            "An inelastic impact leaves the overlap that the step of the impact made, up to the speed times dt, for good: velocities "
            "alone are made to vanish."
        ),
        size=Size(
            case="impact/bouncing-disk",
            variant="restitution=0,dt=0.002",
            column="abs_error",
            quantity="gap_final",
            per="gap",
            over=0.0001,
            sign=-1,
            over_why=(
                "at rest a spring of the scene's kn overlaps by m g/kn, 7e-5 of the height of fall, and a rigid contact by nothing"
            ),
        ),
    )


def creeps_at_rest(engine: str, versions: str, why: str, *, documented: str = "") -> Finding:
    """Describe sticking that creeps.

    Parameters
    ----------
    engine : str
        Id of the engine.
    versions : str
        Versions in which it was seen.
    why : str
        What friction is in this engine: the start of the sentence.
    documented : str
        Where the engine's documentation says so.

    Returns
    -------
    Finding

    Examples
    --------
    >>> creeps_at_rest("acme", "1.0", "Friction is viscous").what
    'Friction is viscous: a block that should stick creeps down the incline at a steady rate.'
    """
    return Finding(
        id=f"{engine}/creeps-at-rest",
        versions=versions,
        what=f"{why}: a block that should stick creeps down the incline at a steady rate.",
        size=Size(
            table="headlines",
            case="incline-block",
            variant="mu=0.4,dt=0.01",
            quantity="distance down the incline",
            over=1e-9,
            sign=1,
            over_why="a stuck block rests; engines with rigid contacts or shear springs leave it where it is, to round-off",
        ),
        documented=documented,
    )
