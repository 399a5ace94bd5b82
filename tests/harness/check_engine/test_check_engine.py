"""`ninedisk check-engine` passes sound adapters and finds each planted defect."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import Capability, capabilities_asked, capabilities_needed
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Support, SupportLevel
from ninedisk.harness.api.registry import case_table, get_case, get_engine
from ninedisk.harness.cases.adapter.probe_of import probe_of
from ninedisk.harness.check_engine.check import check_engine
from ninedisk.harness.check_engine.outcomes import FAIL, PASS, REFUSED, UNSEEN, Fault
from ninedisk.harness.check_engine.verdict import CASE_OF, print_verdict
from ninedisk.harness.cli.app import app
from ninedisk.harness.engines.dem.adapter import DemEngine
from ninedisk.harness.selftest.declared import DECLARED, Declared
from ninedisk.harness.selftest.setups import first_segment, laws_of_first_wall, like_first, spins_swapped

Change = Callable[[Any], Any]


class Planted(DemEngine):
    """The in-house DEM with one defect: in its facts, in what it runs, or in what it answers."""

    def __init__(
        self,
        *,
        facts: dict[str, Any] | None = None,
        scene: Change = lambda scene: scene,
        numerics: Change = lambda numerics: numerics,
        answer: Change = lambda run: run,
        support: Support | None = None,
    ) -> None:
        self.facts, self.scene, self.numerics, self.answer, self.support = facts or {}, scene, numerics, answer, support

    def info(self) -> EngineInfo:
        return replace(super().info(), **self.facts)

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        return self.support or super().supports(scene, numerics)

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        own = self.numerics(numerics).replace(options={})  # the DEM knows none of the options that are planted
        return self.answer(super().run(self.scene(scene), own, watch))


def history(**changes: Change) -> Change:
    """An answer whose arrays are changed, by name."""

    def change(run: EngineRun) -> EngineRun:
        made = {name: how(getattr(run.history, name)) for name, how in changes.items()}
        return replace(run, history=replace(run.history, **made))

    return change


def plain(edit: Callable[[dict[str, Any]], object]) -> Change:
    """A scene whose plain data are edited."""

    def change(scene: Scene) -> Scene:
        data = scene.to_dict()
        edit(data)
        return type(scene).from_dict(data)

    return change


def laws(**values: Any) -> Change:
    """A scene all of whose contact laws have other values."""

    def edit(data: dict[str, Any]) -> None:
        for law in (
            data["disk_disk"] if "disk_disk" in data else data["sphere_sphere"],
            *(w["law"] for w in data["walls"]),
        ):
            law.update(values)

    return plain(edit)


def as_spheres(scene: SphereScene) -> SphereScene:
    """Boxes replaced by the spheres that enclose them."""
    spheres = scene.spheres
    if not spheres.boxes.any():
        return scene
    return scene.replace(spheres=replace(spheres, half_sizes=None, quaternion=None, inertia=spheres.inertia[:, 0]))


def disks(**values: Any) -> Change:
    return plain(lambda data: data["disks"].update({k: [v] * len(data["disks"]["x"]) for k, v in values.items()}))


def motion(**values: Any) -> Change:
    return plain(lambda data: [wall["motion"][0].update(values) for wall in data["walls"]])


def first_rows_late(x: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.concatenate([x[1:2], x[1:]])


SHARED = np.zeros((18, 1, 2))


def into_shared_memory(x: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    SHARED[:] = x + SHARED[0] * 0.0 + (SHARED[1, 0, 0] != 0.0)
    return SHARED


def spoil_input(scene: Scene) -> Scene:
    object.__setattr__(scene, "xi", scene.xi + 1.0)
    return scene.replace(xi=scene.xi - 1.0)


class Obliging(Planted):
    """Answers about contacts that do not exist."""

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        return super().run(scene, numerics, [pair for pair in watch if pair[1] < scene.n_bodies])


class Deaf(Planted):
    """Has an option that it does not heed."""

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        run = super().run(scene, numerics, watch)
        return replace(run, settings={**run.settings, "dem.sweeps": 10})


RANDOM = np.random.default_rng(1)
SWEEPS = {"sweeps": Option(default=10, whole=True, why="planted")}

EXACT = Support(SupportLevel.EXACT, notes=("so it says",))


def spheres_like_the_first(name: str) -> Callable[[SphereScene], SphereScene]:
    """Every sphere has this value of the first."""

    def like(scene: SphereScene) -> SphereScene:
        values = getattr(scene.spheres, name)
        return replace(scene, spheres=replace(scene.spheres, **{name: np.full_like(values, values[0])}))

    return like


PLANTED = {
    "an id of another": ("facts", Planted(facts={"id": "mine"}), "info().id is 'mine'"),
    "a kind of contact that nobody knows": ("facts", Planted(facts={"contact": "sticky"}), "contact is 'sticky'"),
    "single precision": ("form", Planted(answer=history(x=lambda x: x.astype(np.float32))), "x is of type float32"),
    "no velocities": ("form", Planted(answer=history(v=lambda v: v * np.nan)), "v is not finite"),
    "a row too few": ("form", Planted(answer=history(fn=lambda fn: fn[1:])), "answered fn of shape"),
    "forces of a third kind": (
        "form",
        Planted(answer=history(force_meaning=lambda _: "guess")),
        "force_meaning is 'guess'",
    ),
    "every step sampled": ("sampling", Planted(numerics=lambda n: n.replace(sample_every=1)), "steps [0, 4, 5, 6"),
    "times in ms": ("sampling", Planted(answer=history(t=lambda t: 1e3 * t)), "times are off"),
    "samples of the next one": ("sampling", Planted(answer=history(x=first_rows_late)), "x is"),
    "one state for all samples": (
        "copies",
        Planted(answer=history(x=lambda x: np.broadcast_to(x[-1], x.shape))),
        "every sample of x",
    ),
    "arrays of the run before": (
        "copies",
        Planted(answer=history(x=into_shared_memory)),
        "x changed with the next run",
    ),
    "v and x in one buffer": (
        "copies",
        Planted(answer=lambda run: replace(run, history=replace(run.history, v=run.history.x))),
        "x and v share memory",
    ),
    "nothing on record": ("settings", Planted(answer=lambda run: replace(run, settings={})), "no settings"),
    "an option that is not heeded": (
        "settings",
        Deaf(facts={"options": SWEEPS}),
        "dem.sweeps = 20 was asked for, 10 is recorded",
    ),
    "an option that is not recorded": (
        "settings",
        Planted(facts={"options": SWEEPS}),
        "the option sweeps is not recorded",
    ),
    "settings of no plain kind": (
        "settings",
        Planted(answer=lambda run: replace(run, settings={"law": object()})),
        "the setting 'law' is",
    ),
    "dice": (
        "determinism",
        Planted(answer=history(fn=lambda fn: fn + 1e-12 * RANDOM.random(fn.shape))),
        "two runs differ in fn",
    ),
    "a scene that is changed": ("input", Planted(scene=spoil_input), "changed"),
    "a warm-up that moves": ("warm-up", Planted(answer=history(x=first_rows_late)), "x at step 0 is off"),
    "pairs that do not exist": ("refusals", Obliging(), "a watched pair of bodies that do not exist is answered"),
    "any step at all": (
        "refusals",
        Planted(numerics=lambda n: n.replace(allow_unstable=True)),
        "answered with a rebound",
    ),
    "degrees": ("units: flight", Planted(answer=history(angle=np.degrees)), "angle is"),
    "clockwise": ("units: flight", Planted(answer=history(omega=np.negative)), "omega is"),
    "kilonewtons": ("units: weights*", Planted(answer=history(fn=lambda fn: 1e-3 * fn)), "fn of the pairs"),
    "impulses for forces": ("units: weights*", Planted(answer=history(fn=lambda fn: 2e-3 * fn)), "fn of the pairs"),
    "pairs in an order of its own": (
        "units: weights*",
        Planted(answer=history(fn=lambda fn: fn[:, ::-1])),
        "fn of the pairs",
    ),
    "overlaps for gaps": ("units: weights*", Planted(answer=history(gap=np.negative)), "gap of the same pairs"),
    "force of the wall": ("units: weights*", Planted(answer=history(wall_force=np.negative)), "force on the floor"),
    "no kn": ("supports: LINEAR_CONTACT", Planted(scene=laws(kn=2e6)), "overlap is"),
    "half of ks": ("supports: SHEAR_SPRING", Planted(scene=laws(ks=0.5 * 2.0 * 9.81 / (1e-4 * 0.5))), "fs is"),
    "half of mu": ("supports: FRICTION", Planted(scene=laws(mu=0.05)), "v along the floor"),
    "shear the other way": ("supports: FRICTION", Planted(answer=history(fs=np.negative)), "mean fs is"),
    "no dashpot": ("supports: CONTACT_DAMPING", Planted(scene=laws(beta=0.0)), "overlap is"),
    "no restitution": (
        "supports: RESTITUTION",
        Planted(scene=laws(beta=0.0), support=EXACT),
        "v after the impact",
    ),
    "lagged for central": (
        "supports: GLOBAL_DAMPING_CENTRAL",
        Planted(numerics=lambda n: n.replace(damping_form="lagged")),
        "v is",
    ),
    "central for lagged": (
        "supports: GLOBAL_DAMPING_LAGGED",
        Planted(numerics=lambda n: n.replace(damping_form="central")),
        "v is",
    ),
    "walls at rest": (
        "supports: MOVING_WALLS",
        Planted(scene=plain(lambda d: [w.update(motion=[]) for w in d["walls"]])),
        "disk displacement",
    ),
    "walls that do not turn": (
        "supports: ROTATING_WALLS",
        Planted(scene=plain(lambda d: [w.update(motion=[]) for w in d["walls"]])),
        "wall_angle",
    ),
    "a chord for a curve": (
        "supports: CURVED_WALL_MOTION",
        Planted(scene=motion(amplitude=[0.0, 0.0], velocity=[0.0, 0.1])),
        "disk displacement",
    ),
    "gravity along y only": (
        "supports: GRAVITY",
        Planted(scene=lambda s: s.replace(gravity=(0.0, s.gravity[1]))),
        "v is",
    ),
    "disks that turn all the same": ("supports: BLOCKED_ROTATION", Planted(scene=disks(rotating=True)), "omega is"),
    "nothing held": (
        "supports: HELD_MOTION",
        Planted(scene=disks(held=[False, False]), support=EXACT),
        "v is",
    ),
    "fixed disks that fall": (
        "supports: FIXED_DISKS",
        Planted(scene=disks(held=[False, False]), support=EXACT),
        "x of the fixed disks",
    ),
    "inertia in the static limit": (
        "supports: QUASI_STATIC",
        Planted(numerics=lambda n: n.replace(regime="dynamic"), support=EXACT),
        "fn is",
    ),
    "no preload": ("supports: PRELOAD", Planted(scene=lambda s: s.replace(initial_shear={})), "v is"),
    "spheres": ("supports: DISK_INERTIA", Planted(scene=disks(inertia=0.4 * 2.0 * 0.25)), "omega is"),
    "another arm than R": ("supports: LEVER_ARM_RADIUS", Planted(scene=laws(lever_arm="overlap")), "arm of the torque"),
    "another arm than R - overlap/2": (
        "supports: LEVER_ARM_OVERLAP",
        Planted(scene=laws(lever_arm="torque-overlap")),
        "arm of the slip",
    ),
    "another arm than LAMMPS'": (
        "supports: LEVER_ARM_TORQUE",
        Planted(scene=laws(lever_arm="radius")),
        "arm of the torque",
    ),
    "slip of the step's end": ("supports: SLIP_MIDDLE", Planted(scene=laws(slip_at="end")), "slip, -fs/ks is"),
    "slip of the middle of the step": ("supports: SLIP_END", Planted(scene=laws(slip_at="middle")), "slip, -fs/ks is"),
    "circles for outlines": ("supports: OUTLINES", Planted(scene=disks(outline=-1)), "fn is"),
    "outlines that are not turned": ("supports: OUTLINES", Planted(scene=disks(angle=0.0)), "fn is"),
    "chords for areas": ("supports: AREA_CONTACT", Planted(scene=laws(contact="chord")), "fn is"),
    "one law for all materials": (
        "supports: MATERIALS",
        Planted(scene=lambda s: s.replace(laws={}), support=EXACT),
        "v along the floor",
    ),
    "no forces": ("supports: BODY_FORCES", Planted(scene=lambda s: s.replace(forces=()), support=EXACT), "v is"),
    "no constant torque": ("supports: ROLLING_CONSTANT", Planted(scene=laws(rolling=None), support=EXACT), "v is"),
    "no viscous torque": ("supports: ROLLING_VISCOUS", Planted(scene=laws(rolling=None), support=EXACT), "v is"),
    "no viscous torque on a sphere": (
        "supports: ROLLING_VISCOUS_3D",
        Planted(scene=laws(rolling=None), support=EXACT),
        "v is",
    ),
    "no rolling spring": ("supports: ROLLING_SPRING", Planted(scene=laws(rolling=None), support=EXACT), "v is"),
    "no cohesion": ("supports: COHESION", Planted(scene=laws(cohesion=0.0), support=EXACT), "overlap is"),
    "another modulus": (
        "supports: HERTZ_MINDLIN_2D",
        Planted(scene=laws(e_star=1.01e7)),
        "overlap is",
    ),
    "no adhesion": ("supports: ADHESION", Planted(scene=laws(adhesion=0.0), support=EXACT), "y is"),
    "no images of spheres": (
        "supports: PERIODIC_CELL_3D",
        Planted(scene=lambda s: s.replace(cell=None), support=EXACT),
        "v is",
    ),
    "no images": ("supports: PERIODIC_CELL", Planted(scene=lambda s: s.replace(cell=None), support=EXACT), "v is"),
    "no losses told": (
        "supports: ENERGY_BUDGET",
        Planted(numerics=lambda n: n.replace(energy_budget=False), support=EXACT),
        "friction_loss is",
    ),
    "axes of its own": ("supports: SPHERES", Planted(answer=history(omega=lambda w: w[..., ::-1])), "omega is"),
    "spheres for boxes": (
        "supports: BOXES",
        Planted(
            facts={"capabilities": DemEngine().info().capabilities | {Capability.BOXES}},
            scene=as_spheres,
            support=EXACT,
        ),
        "gap is",
    ),
    "a plane for a sphere": (
        "supports: SPHERES",
        Planted(answer=history(wall_force=np.negative)),
        "force on the floor",
    ),
    "masses of the first": ("pairs: oblique impact", Planted(scene=like_first("mass")), "vx_1_final is"),
    "inertias of the first": (
        "pairs: oblique impact that sticks",
        Planted(scene=like_first("inertia")),
        "spin_2_final is",
    ),
    "heavy disks of one mass": ("pairs: impact of heavy disks", Planted(scene=like_first("mass")), "vx_2 is"),
    "a belt that never stops": ("walls: belt", Planted(scene=first_segment), "v_block is"),
    "spins in the wrong order": ("pairs: six around one", Planted(scene=spins_swapped), "misfit is"),
    "small disks with a large one's inertia": (
        "pairs: nine around one",
        Planted(scene=like_first("inertia")),
        "misfit is",
    ),
    "a law for all walls": ("walls: four laws", Planted(scene=laws_of_first_wall), "misfit is"),
    "no dashpot at a wall that moves": ("walls: pushed", Planted(scene=laws(beta=0.0)), "fn is"),
    "angles modulo a turn": (
        "pairs: three revolutions",
        Planted(answer=history(angle=lambda a: np.arctan2(np.sin(a), np.cos(a)))),
        "angle_1 is",
    ),
    "no friction after reopening": ("pairs: reopening", Planted(scene=laws(mu=0.0)), " instead of "),
    "half of the reduced modulus": ("supports: HERTZ_MINDLIN", Planted(scene=laws(e_star=5e6)), "overlap is"),
    "a force that shrinks": ("supports: UNLOADING_FORCE", Planted(scene=laws(unloading="rescale")), "fs is"),
    "a spring that is not scaled": ("supports: UNLOADING_RESCALE", Planted(scene=laws(unloading="none")), "fs is"),
    "a force that is kept": ("supports: UNLOADING_NONE", Planted(scene=laws(unloading="force")), "fs is"),
    "no twisting torque": ("supports: TWISTING_CONSTANT", Planted(scene=laws(twisting=None)), "omega is"),
    "no twisting spring": ("supports: TWISTING_SPRING", Planted(scene=laws(twisting=None)), "omega is"),
    "half of the surface energy": ("supports: SURFACE_DMT", Planted(scene=laws(surface_energy=2.5)), "fn is"),
    "spheres that nothing damps": (
        "supports: GLOBAL_DAMPING_CENTRAL_3D",
        Planted(scene=lambda s: s.replace(xi=0.0), support=EXACT),
        "v is",
    ),
    "spheres damped twice": (
        "supports: GLOBAL_DAMPING_LAGGED_3D",
        Planted(scene=lambda s: s.replace(xi=2.0 * s.xi), support=EXACT),
        "v is",
    ),
    "no preload of spheres": ("supports: PRELOAD_3D", Planted(scene=lambda s: s.replace(initial_shear={})), "v is"),
    "no torque on a sphere": (
        "supports: BODY_FORCES_3D",
        Planted(scene=lambda s: s.replace(forces=tuple(replace(f, torque=0.0) for f in s.forces))),
        "omega is",
    ),
    "spheres without cohesion": (
        "supports: COHESION_3D",
        Planted(scene=laws(cohesion=0.0), support=EXACT),
        "overlap is",
    ),
    "DMT for JKR": ("supports: SURFACE_JKR", Planted(scene=laws(surface="dmt"), support=EXACT), "fn is"),
    "one mass for all": (
        "unequal spheres: impacts of springs",
        Planted(scene=spheres_like_the_first("mass")),
        "pair_vt_final",
    ),
    "one radius for all": (
        "unequal spheres: elastic impacts",
        Planted(scene=spheres_like_the_first("radius")),
        "pair_force_max",
    ),
    "one inertia for all": (
        "unequal spheres: impacts that slide",
        Planted(scene=spheres_like_the_first("inertia")),
        "spin_final",
    ),
    "angles of half a turn": (
        "unequal spheres: flight",
        Planted(answer=history(angle=lambda a: np.remainder(a + math.pi, 2.0 * math.pi) - math.pi)),
        "angle_1x",
    ),
    "a belt at rest": (
        "unequal spheres: belt",
        Planted(scene=plain(lambda d: [w.update(motion=[]) for w in d["walls"]])),
        "plane_x",
    ),
    "spheres that turn all the same": (
        "unequal spheres: held",
        Planted(scene=lambda s: replace(s, spheres=replace(s.spheres, rotating=True))),
        "omega_1x",
    ),
    "spheres that stick in a crowd": ("unequal spheres: crowd", Planted(answer=history(v=np.zeros_like)), "v_0x"),
    "no torque against rolling": ("unequal spheres: resisted", Planted(scene=laws(rolling=None)), "omega_0x"),
    "no torque against twisting": (
        "unequal spheres: resisted by springs",
        Planted(scene=laws(twisting=None)),
        "omega_0x",
    ),
    "more than its facts": (
        "supports: ADHESION",
        Planted(support=Support(SupportLevel.EXACT)),
        "info() lacks ADHESION",
    ),
    "no without a reason": ("supports: GRAVITY", Planted(support=Support(SupportLevel.NO)), "supported"),
    "a crash": ("supports: GRAVITY", Planted(answer=lambda _: 1 / 0), "ZeroDivisionError"),
}


@pytest.mark.parametrize("defect", PLANTED)
def test_a_planted_defect_is_found(defect: str) -> None:
    check, engine, said = PLANTED[defect]
    findings = check_engine(engine, only=["scenes" if defect == "no without a reason" else check])
    assert [each.status for each in findings] == [FAIL]
    assert said in findings[0].found
    if defect != "a crash":
        assert findings[0].mend


def test_probes_are_in_no_list_of_cases() -> None:
    probes = [probe_of(asked, DemEngine().info()) for asked in Capability]
    assert all(probe.id.startswith("adapter/") for probe in probes)
    assert not any(name.startswith("adapter/") for name in case_table())


def test_losses_of_an_engine_of_spheres_alone_are_asked_in_space() -> None:
    engine = DemEngine()
    probe = probe_of(Capability.ENERGY_BUDGET, replace(engine.info(), plane=False))
    for told in (True, False):
        setup = probe.setup
        history = engine.run(setup.scene, setup.numerics.replace(energy_budget=told), setup.watch).history
        (form,) = probe.closed_forms(history)
        assert bool(abs(form.value - form.expected) <= form.bound) is told


def test_every_check_has_been_seen_failing() -> None:
    names = {each.check for each in check_engine(DemEngine())}
    caught = {name for name in names for check, _, _ in PLANTED.values() if name == check or check.rstrip("*") in name}
    assert names - caught == set()


def test_a_refusal_needs_a_reason_that_its_facts_share() -> None:
    class Fickle(DemEngine):
        answer = Support(SupportLevel.NO)

        def supports(self, scene: Scene, numerics: Numerics) -> Support:
            return super().supports(scene, numerics) if not any(scene.gravity) else self.answer

    for answer, status, said in (
        (Support(SupportLevel.NO), FAIL, "without a reason"),
        (Support(SupportLevel.NO, (Capability.GRAVITY,)), FAIL, "refused for GRAVITY, which info() declares"),
        (Support(SupportLevel.NO, (Capability.GRAVITY,), ("not today",)), REFUSED, "lacks GRAVITY (declared"),
    ):
        Fickle.answer = answer
        (found,) = check_engine(Fickle(), only=["supports: GRAVITY"])
        assert found.status == status
        assert said in found.found


def test_what_is_approximate_may_be_off_by_a_convention_and_no_more() -> None:
    near = Support(SupportLevel.APPROXIMATE, notes=("near",))
    for mu, status in ((0.09, PASS), (0.02, FAIL)):
        (found,) = check_engine(Planted(scene=laws(mu=mu), support=near), only=["supports: FRICTION"])
        assert found.status == status


@pytest.mark.parametrize("asked", Capability)
def test_a_probe_asks_for_its_capability(asked: Capability) -> None:
    setup = probe_of(asked, DemEngine().info()).setup
    needed = capabilities_needed(setup.scene, setup.numerics)
    assert asked in needed or (asked is Capability.RESTITUTION and setup.scene.walls[0].law.restitution == 0.5)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("engine_id", ["dem", "cd", "pymunk"])
def test_engines_of_this_process_are_sound(engine_id: str) -> None:
    wrong = [each for each in check_engine(get_engine(engine_id)) if each.status == FAIL]
    assert wrong == []


EXTERNAL = (
    "siconos",
    "bullet",
    "dart",
    "box2d",
    "jolt",
    "sapien",
    "mujoco",
    "drake",
    "drake-sap",
    "drake-lagged",
    "yade",
    "lammps",
    "kratos",
    "liggghts",
    "esys-particle",
)


# One run of each check on every engine takes minutes; these find a broken adapter, and the matrix judges the rest.
BASIC = ("facts", "form", "sampling", "settings", "units: *")


@pytest.mark.slow
@pytest.mark.parametrize("engine_id", EXTERNAL)
def test_external_engines_are_sound(engine_id: str) -> None:
    engine = get_engine(engine_id)
    if not engine.info().installed:
        pytest.skip(engine.info().not_installed_because)
    wrong = [each for each in check_engine(engine, only=BASIC) if each.status == FAIL]
    assert wrong == []


def ninedisk(*arguments: str) -> Any:
    return CliRunner().invoke(app, list(arguments), prog_name="ninedisk")


def test_the_command(tmp_path: Path) -> None:
    done = ninedisk("check-engine", "pymunk", "--json", str(tmp_path / "found.json"))
    assert done.exit_code == 0, done.output
    assert "supports: GRAVITY" in done.stdout
    data = json.loads((tmp_path / "found.json").read_text())
    assert data["engine"] == "pymunk"
    assert {each["status"] for each in data["findings"]} == {PASS, REFUSED}
    assert [path.name for path in tmp_path.iterdir()] == ["found.json"]


@pytest.mark.usefixtures("fakes")
@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("pymonk",), 2, "Did you mean 'pymunk'"),
        (("pymunk", "--json", "no/where.json"), 2, "cannot be written"),
        (("pymunk", "--check", "nonsense"), 2, "no check matches 'nonsense'"),
        (("fake-absent",), 2, "not installed (it was never built); install it with: pip install fake"),
        (("fake-broken",), 2, "cannot be loaded"),
        (("fake-shy",), 3, "must not fail, it says RuntimeError: no facts"),
        (("fake-wrong", "--check", "supports: GRAVITY"), 1, "1 of 1 checks fail"),
    ],
)
def test_exit_codes(arguments: tuple[str, ...], code: int, said: str) -> None:
    done = ninedisk("check-engine", *arguments)
    assert done.exit_code == code, done.output
    assert said in done.output


class Heavy(Declared):
    """Gravity is a tenth too strong."""

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        gx, gy = scene.gravity
        return super().run(scene.replace(gravity=(1.1 * gx, 1.1 * gy)), numerics, watch)


@pytest.mark.parametrize("contact", DECLARED)
def test_what_contacts_are_declared_as_does_not_hide_gravity(contact: str) -> None:
    checks = ("supports: GRAVITY", "units: weights and pairs", "supports: FIXED_DISKS", "supports: FRICTION")
    assert {found.status for found in check_engine(Declared(contact), only=checks)} == {PASS}
    assert {found.status for found in check_engine(Heavy(contact), only=checks)} == {FAIL}


NOTHING = history(fn=lambda fn: fn * np.nan, fs=lambda fs: fs * np.nan, wall_force=lambda force: force * np.nan)
"""Forces that the engine does not report, as the protocol allows."""


def test_what_is_not_observed_is_no_failure() -> None:
    silent = Planted(answer=lambda run: history(gap=lambda gap: gap * np.nan)(NOTHING(run)))
    found = {each.check: each for each in check_engine(silent, only=["form", "units: *", "supports: S*"])}
    assert {name: each.status for name, each in found.items() if each.status != PASS} == {
        "units: weights and pairs": UNSEEN,
        **{f"supports: {name}": UNSEEN for name in ("SLIP_MIDDLE", "SLIP_END")},
    }
    assert found["supports: SPHERES"].unseen == ("fn", "force on the floor")
    assert found["units: weights and pairs"].row()["not_observed"] == list(found["units: weights and pairs"].unseen)


def test_what_is_not_observed_hides_nothing_that_is() -> None:
    for engine, check, said in (
        (Planted(answer=NOTHING, scene=laws(mu=0.05)), "supports: FRICTION", "v along the floor"),
        (Planted(answer=lambda run: history(x=lambda x: x * np.nan)(NOTHING(run))), "supports: SPHERES", "x is nan"),
        (Planted(answer=NOTHING, numerics=lambda n: n.replace(energy_budget=False)), "supports: ENERGY_BUDGET", "friction_loss"),
        (Planted(answer=NOTHING, scene=laws(mu=0.0, ks=0.0)), "supports: SHEAR_SPRING", "arm of the torque"),
    ):  # fmt: skip
        (found,) = check_engine(engine, only=[check])
        assert found.status == FAIL
        assert said in found.found


class Lacking(Planted):
    """Has some capabilities less, and refuses every scene that asks for them."""

    def __init__(self, *less: Capability, claims: Capability | None = None, **planted: Any) -> None:
        super().__init__(facts={"capabilities": DemEngine().info().capabilities - set(less)}, **planted)
        self.less, self.claims = set(less), claims

    def info(self) -> EngineInfo:
        info = super().info()
        return replace(info, capabilities=info.capabilities | ({self.claims} if self.claims else set()))

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        missing = capabilities_needed(scene, numerics) & self.less
        return Support(SupportLevel.NO, tuple(sorted(missing))) if missing else super().supports(scene, numerics)


@pytest.mark.parametrize(
    "less",
    [
        {Capability.BLOCKED_ROTATION},
        {Capability.LEVER_ARM_RADIUS},
        {Capability.BLOCKED_ROTATION, Capability.LEVER_ARM_RADIUS},
    ],
)
def test_friction_is_tested_without_what_it_does_not_need(less: set[Capability]) -> None:
    for mu, status in ((0.1, PASS), (0.05, FAIL)):
        (found,) = check_engine(Lacking(*less, scene=laws(mu=mu)), only=["supports: FRICTION"])
        assert found.status == status


def said(engine: DemEngine, capsys: pytest.CaptureFixture[str], *only: str) -> list[str]:
    outcomes = check_engine(engine, only=only)
    capsys.readouterr()
    print_verdict(engine, engine.info(), outcomes, ["--engine", "dem"])
    return [line.strip() for line in capsys.readouterr().out.splitlines() if line.strip()]


def test_the_verdict_comes_first_with_numbers_and_what_to_run(capsys: pytest.CaptureFixture[str]) -> None:
    lines = said(Planted(answer=history(wall_force=np.negative)), capsys, "units: *", "supports: GRAVITY")
    assert lines[0].endswith(": 1 of 3 checks fail")
    assert lines[2] == "look at this first: units: weights and pairs"
    assert "force on the floor is 39.24 instead of -39.24 N" in lines[3]
    assert lines[3].endswith("the sign is reversed")
    assert "again: ninedisk check-engine dem --check 'units: weights and pairs'" in lines
    assert lines[-1] == "next: ninedisk run impact/bouncing-disk --engine dem"


def test_the_fault_in_the_simplest_scene_comes_first_and_its_echoes_once(capsys: pytest.CaptureFixture[str]) -> None:
    """Gravity that is twice too strong spoils every scene with a weight."""
    heavy = Planted(scene=lambda s: s.replace(gravity=tuple(2.0 * g for g in s.gravity)))
    lines = said(heavy, capsys, "units: *", "supports: GRAVITY", "supports: FRICTION", "supports: BLOCKED_ROTATION")
    assert lines[0].endswith(": 4 of 5 checks fail")
    assert "look at this first: supports: GRAVITY" in lines
    shown = " ".join(lines)
    assert "twice too large" in shown
    assert "supports: FRICTION" in shown
    assert "supports: BLOCKED_ROTATION" not in shown


def test_a_capability_that_no_passing_check_uses_is_suspected(capsys: pytest.CaptureFixture[str]) -> None:
    ball = Planted(scene=disks(inertia=0.4 * 2.0 * 0.25))
    lines = said(
        ball, capsys, "units: *", *(f"supports: {name}" for name in ("SHEAR_SPRING", "FRICTION", "DISK_INERTIA"))
    )
    assert "look at this first: supports: DISK_INERTIA" in lines
    assert any(line.startswith("suspect: DISK_INERTIA") for line in lines)


def test_what_is_declared_and_not_tested_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    class Wayward(DemEngine):
        def supports(self, scene: Scene, numerics: Numerics) -> Support:
            if isinstance(scene, Scene) and scene.xi > 0.0:
                return Support(SupportLevel.NO, notes=("not today",))
            return super().supports(scene, numerics)

    lines = said(Wayward(), capsys, "units: *", "supports: GLOBAL*", "supports: ADHESION")
    for name in ("GLOBAL_DAMPING_CENTRAL", "GLOBAL_DAMPING_LAGGED"):
        assert f"declared, tested NOWHERE: {name} (not today (declared, but not in this scene))" in lines
    assert "not declared, so not tested (1): ADHESION" in lines
    assert not any("refused" in line for line in lines)
    assert said(Planted(answer=NOTHING), capsys, "units: w*")[2] == (
        "not observed: fn of the pairs (1, 2), (0, 2), (0, 1) (in units: weights and pairs)"
    )


@pytest.mark.parametrize(
    ("value", "expected", "words"),
    [(-2.0, 2.0, "reversed"), (0.001, 2.0, "zero"), (4.0, 2.0, "twice"), (2.6, 2.0, ""), (0.5, 0.0, "")],
)
def test_a_simple_relation_is_named(value: float, expected: float, words: str) -> None:
    likeness = Fault(found="", value=value, expected=expected, allowed=0.01).likeness
    assert words in likeness
    assert bool(words) is bool(likeness)


@pytest.mark.parametrize("asked", CASE_OF)
def test_the_case_of_a_capability_asks_for_it(asked: Capability) -> None:
    case = get_case(CASE_OF[asked])
    for changes in case.matrix():
        setup = case.build({each.name: each.default for each in case.parameters} | dict(changes))
        if asked in capabilities_asked(setup.scene, setup.numerics):
            return
    pytest.fail(f"no variant of {case.id} asks for {asked.name}")
