"""The published schemas are those of the real data: same keys, same choices, same bounds, and what they admit is read."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_args

import pytest
from jsonschema import Draft202012Validator

from ninedisk.core.errors import CoreError
from ninedisk.core.history import History
from ninedisk.core.law import (
    CONTACTS,
    LEVER_ARMS,
    ONLY_IN,
    ROLLING_MODELS,
    SLIP_AT,
    SURFACES,
    UNLOADING,
    WALL_VELOCITY_AT,
    ContactLaw,
    SphereLaw,
)
from ninedisk.core.numerics import DampingForm, Impact, Numerics, Regime, Sliding
from ninedisk.core.options import Option
from ninedisk.core.scene import (
    BodyForce,
    Cell,
    Disks,
    PlaneSegment,
    PlaneWall,
    Rolling,
    Scene,
    Spheres,
    SphereScene,
    Wall,
    WallSegment,
)
from ninedisk.harness.api.capabilities import LEVER_ARMS as ARMS_OF_LAWS
from ninedisk.harness.api.capabilities import Capability, wire_name
from ninedisk.harness.api.engine import Difference, EngineError, EngineInfo
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import case_table, engine_table, get_case, get_engine
from ninedisk.harness.api.support import NOTE_SOFT
from ninedisk.harness.wire.command import read_description
from ninedisk.harness.wire.example import example_request
from ninedisk.harness.wire.protocol import (
    ANSWER_KEYS,
    OPTIONAL_TIMINGS,
    TIMING_KEYS,
    WIRE_VERSION,
    Request,
    decode_answer,
    decode_request,
    encode_request,
)
from ninedisk.harness.wire.schemas import NAMES, fault, schema_text, validator, write_schemas

SCHEMAS = {name: json.loads(schema_text(name)) for name in NAMES}
SCENE = SCHEMAS["scene"]["$defs"]
REQUEST_JUNK: tuple[Any, ...] = (None, True, -1, -0.5, 0, "x", [], {}, [[1.0]])
LEFT_OUT = {"cpu", "outlines", "outline", "angle", "contact", "slip_at", "material", "laws", "forces", "cell"}
LEFT_OUT |= {"rolling", "cohesion", "adhesion", "energy_budget", "stress", "e_star", "g_star", "unloading"}
LEFT_OUT |= {"half_sizes", "quaternion", "moment"}
"""Keys that scenes leave out where they have their default value."""
JUNK: tuple[Any, ...] = (*REQUEST_JUNK, float("inf"), 2**70)
TOGETHER = "it must have shape|one for|m behind wall|the first body is a disk|zero normal|that the numerics ask for"
TOGETHER += "|the first body is a sphere|is made of the material|give kn for the linear law|rolling kr = 0"
ABOUT = {"wire_version": 1, "id": "mine", "version": "1", "contact": "spring", "scheme": "none", "capabilities": []}


def names(record: type) -> set[str]:
    return {each.name for each in fields(record)}


def keys(schema: Mapping[str, Any], left_out: Collection[str] = LEFT_OUT) -> set[str]:
    assert schema["additionalProperties"] is False
    assert set(schema["properties"]) - set(schema["required"]) <= set(left_out)
    return set(schema["properties"])


@pytest.mark.parametrize("name", NAMES)
def test_they_are_schemas_of_this_wire_version(name: str) -> None:
    Draft202012Validator.check_schema(SCHEMAS[name])
    assert SCHEMAS[name]["$id"] == f"urn:ninedisk:wire:{WIRE_VERSION}:{name}"


def test_keys_are_the_fields_of_the_dataclasses() -> None:
    assert keys(SCENE["plane"]) == names(Scene)
    assert keys(SCENE["disks"]) == names(Disks)
    assert keys(SCENE["law"]) == names(ContactLaw) - set(ONLY_IN[3])
    assert keys(SCENE["wall"]) == names(Wall)
    assert keys(SCENE["segment"]) == names(WallSegment)
    assert keys(SCENE["force"]) == keys(SCENE["sphere_force"]) == names(BodyForce)
    assert keys(SCENE["plane"]["properties"]["cell"]) == keys(SCENE["space"]["properties"]["cell"]) == names(Cell)
    assert keys(SCENE["law"]["properties"]["rolling"]) == names(Rolling)
    assert keys(SCENE["space"], LEFT_OUT | {"xi", "initial_shear"}) == names(SphereScene) | {"dimension"}
    assert keys(SCENE["spheres"]) == names(Spheres)
    assert keys(SCENE["plane_wall"]) == names(PlaneWall)
    assert keys(SCENE["plane_segment"]) == names(PlaneSegment)
    assert set(SCENE["sphere_law"]["properties"]) == names(ContactLaw) - set(ONLY_IN[2])
    assert set(SCENE["resistance"]["properties"]) == names(Rolling)
    assert keys(SCHEMAS["numerics"]) == names(Numerics)
    assert keys(SCHEMAS["request"]) == names(Request) | {"wire_version", "sampled_steps"}
    # Pairs are the request's, and outside engines report every disk.
    assert keys(SCHEMAS["history"]) == names(History) - {"pairs", "particles"}
    finished = SCHEMAS["answer"]["oneOf"][0]
    assert keys(finished) == set(ANSWER_KEYS)
    assert keys(finished["properties"]["timings"]) == {*TIMING_KEYS, *OPTIONAL_TIMINGS}


def test_choices_are_those_of_the_code() -> None:
    law, numerics = SCENE["law"]["properties"], SCHEMAS["numerics"]["properties"]
    assert law["lever_arm"]["enum"] == list(LEVER_ARMS)
    assert law["wall_velocity_at"]["enum"] == list(WALL_VELOCITY_AT)
    assert law["slip_at"]["enum"] == list(SLIP_AT)
    assert law["contact"]["enum"] == list(CONTACTS)
    assert law["rolling"]["properties"]["model"]["enum"] == list(ROLLING_MODELS)
    assert law["unloading"]["enum"] == list(UNLOADING)
    assert SCENE["resistance"]["properties"]["model"]["enum"] == list(ROLLING_MODELS)
    law = SCENE["sphere_law"]["properties"]
    for name, choices in (
        ("lever_arm", LEVER_ARMS),
        ("slip_at", SLIP_AT),
        ("unloading", UNLOADING),
        ("surface", SURFACES),
    ):
        assert law[name]["enum"] == list(choices)
    literals = {"damping_form": DampingForm, "impact": Impact, "sliding": Sliding, "regime": Regime}
    for name, literal in literals.items():
        assert numerics[name]["enum"] == list(get_args(literal))
    about = SCHEMAS["describe"]["properties"]
    one = about["capabilities"]["items"]
    assert one["enum"] == [wire_name(capability) for capability in Capability]
    assert one["description"] == "; ".join(f"{wire_name(each)}: {each}" for each in Capability) + "."
    differences = {each.name.lower() for each in Difference}
    assert set(about) - names(EngineInfo) == {"wire_version", "approximations"} | differences
    # Whatever an adapter in Python can say of its engine, a command can say of itself; these the harness says of it.
    assert names(EngineInfo) - set(about) == {
        "how_it_runs",
        "not_installed_because",
        "reference",
        "differences",
        "profile",
    }
    arms = [wire_name(arm) for arm in ARMS_OF_LAWS.values()]
    assert about["turns_exactly_with"]["items"]["enum"] == about["arms_at_walls"]["items"]["enum"] == arms
    kinds = about["options"]["additionalProperties"]["oneOf"]
    assert set().union(*(kind["properties"] for kind in kinds)) == names(Option)


@pytest.mark.parametrize("case_id", list(case_table()))
def test_requests_of_every_case_keep_to_the_schema(case_id: str) -> None:
    case = get_case(case_id)
    for row in case.matrix():
        setup = case.build(resolve(case, row).params)
        request = Request(scene=setup.scene, numerics=setup.numerics, watch=setup.watch, answer_file="answer.json")
        assert fault("request", json.loads(encode_request(request))) is None
    shown = json.loads(example_request(case_id, {}))
    assert fault("request", shown) is None
    assert shown["numerics"]["contact_dt"] > 0.0


def places(data: Any) -> Iterator[tuple[Callable[[], Any], Callable[[Any], None]]]:
    """Getter and setter of every entry of nested data; of a list, the first entry represents all."""
    entries: Any = list(data) if isinstance(data, dict) else range(min(1, len(data)))
    for key in entries:
        yield (lambda key=key: data[key]), (lambda value, key=key: data.__setitem__(key, value))
        if isinstance(data[key], dict | list):
            yield from places(data[key])


def moved_request() -> dict[str, Any]:
    """A small request in which every part of a scene occurs."""
    request: dict[str, Any] = json.loads(example_request("nine-disk/compression", {"cycles": "2", "xi": "0"}))
    request["scene"]["walls"][0]["motion"][0]["pivot"] = [0.0, 0.0]
    disks = request["scene"]["disks"]
    request["scene"]["disks"] = {key: values[:2] for key, values in disks.items()}
    request["scene"]["walls"] = request["scene"]["walls"][:1]
    request["watch"] = [[0, 1]]
    request["scene"]["initial_shear"] = [[0, 1, 0.5]]
    return request


def request_in_space() -> dict[str, Any]:
    """A small request in which every part of a scene in space occurs, Hertz-Mindlin at the wall."""
    resistance = Rolling(model="elastic-plastic", mu=0.1, kr=2.0, beta=0.1)
    linear = SphereLaw(
        kn=1e5, ks=1e5, mu=0.3, beta=0.1, lever_arm="overlap", slip_at="end", rolling=resistance, cohesion=10.0
    )
    hertz = SphereLaw(
        e_star=1e7,
        g_star=4e6,
        unloading="none",
        twisting=resistance,
        surface_energy=0.1,
        surface="jkr",
        friction_pull=2.0,
        restitution=0.5,
        regularised=True,
    )
    motion = PlaneSegment(
        duration=1.0, velocity=(0.1, 0.0, 0.0), angular_velocity=(0.0, 0.0, 1.0), pivot=(0.0, 0.0, 0.0)
    )
    scene = SphereScene(
        spheres=Spheres(
            x=[(0, 0, 0.5), (1.1, 0, 0.5)], radius=0.5, mass=1.0, omega=[(0, 1, 0)] * 2, material=("a", "b")
        ),
        sphere_sphere=linear,
        walls=(
            PlaneWall(
                name="floor",
                point=(0, 0, 0),
                normal=(0, 0, 1),
                law=hertz,
                material="c",
                motion=(motion, PlaneSegment()),
            ),
        ),
        gravity=(0, 0, -9.81),
        laws={("a", "b"): hertz, ("b", "c"): linear},
        xi=0.5,
        initial_shear={(0, 1): (0.0, 1.0, 2.0)},
        forces=[BodyForce(disk=1, force=(1.0, 2.0, 3.0), torque=(0.1, 0.2, 0.3), end=1.0)],
    )
    numerics = Numerics(dt=0.01, n_steps=2, contact_dt=0.001)
    request = Request(scene=scene, numerics=numerics, watch=((0, 1),), answer_file="answer.json")
    found: dict[str, Any] = json.loads(encode_request(request))
    assert decode_request(json.dumps(found)).scene == scene
    return found


@pytest.mark.parametrize("make", [moved_request, request_in_space])
def test_what_the_schema_admits_the_code_reads(make: Callable[[], dict[str, Any]]) -> None:
    """Every single entry of a request, replaced by junk: what the code refuses, the schema refuses.

    The code alone knows how parts belong together: lengths of arrays, walls that overlap, bodies that exist, steps that divide.
    """
    request = make()
    assert fault("request", request) is None
    valid = validator("request").is_valid
    tried, admitted = 0, []
    for get, put in places(request):
        good = get()
        for junk in REQUEST_JUNK:
            put(junk)
            try:
                decode_request(json.dumps(request))
            except (CoreError, EngineError) as error:
                if valid(request):
                    admitted.append(str(error))
            tried += 1
        put(good)
    assert tried > 400
    unexpected = [text for text in admitted if not re.search(TOGETHER, text)]
    assert unexpected == [], "\n".join(unexpected)
    assert admitted


def test_scenes_of_grains_keep_to_the_schema() -> None:
    """Outlines, angles and the area law as the code writes them; what is wrong in them breaks the schema, too."""
    from ninedisk.core.nurbs.mass import uniform_grain
    from ninedisk.core.nurbs.shapes import ellipse

    grain = uniform_grain(ellipse(1.0, 0.6), 1.0)
    disks = Disks(x=[(0, 0)], radius=grain.radius, mass=1.0, inertia=1.0, outline=0, angle=0.5)
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1.0, contact="area"), outlines=(grain.outline,))
    request = moved_request()
    request["scene"], request["watch"] = json.loads(json.dumps(scene.to_dict())), []
    assert fault("request", request) is None
    assert decode_request(json.dumps(request)).scene.to_dict() == scene.to_dict()
    for part, key, wrong in (
        (request["scene"]["disks"], "outline", [-2]),
        (request["scene"]["disks"], "angle", ["x"]),
        (request["scene"]["disk_disk"], "contact", "volume"),
        (request["scene"]["outlines"][0], "degree", 0),
        (request["scene"]["outlines"][0], "weights", [0.0]),
    ):
        good = part[key]
        part[key] = wrong
        assert fault("request", request) is not None, key
        part[key] = good


@pytest.mark.parametrize("make", [moved_request, request_in_space])
def test_no_answer_breaks_the_reader(make: Callable[[], dict[str, Any]]) -> None:
    """Every entry of an answer, replaced by junk or left out, is read or refused in words, whatever it is."""
    request = decode_request(json.dumps(make()))
    steps, n, m, c = [0, 1, 2], 2, 1, 1
    vector = [0.0] * request.scene.dimension
    turn: Any = 0.0 if request.scene.dimension == 2 else vector
    rows = {
        "gap": (c, 0.0),
        "fn": (c, 0.0),
        "fs": (c, turn),
        "angle": (n, turn),
        "omega": (n, turn),
        "wall_angle": (m, turn),
    }
    rows |= {"x": (n, vector), "v": (n, vector), "wall_point": (m, vector), "wall_force": (m, vector)}
    history: dict[str, Any] = {name: [copy.deepcopy([one] * size) for _ in steps] for name, (size, one) in rows.items()}
    history |= {"step": steps, "t": [step * request.numerics.dt for step in steps], "force_meaning": "instantaneous"}
    history["energy"] = {"kinetic": [0.0, None, 0.0]}
    answer = {
        "wire_version": 1, "engine_version": "1", "settings": {"a": 1}, "history": history,
        "timings": {"setup": 0.0, "warm_up": 0.0, "advance": 0.0},
    }  # fmt: skip
    assert fault("answer", answer) is None

    def read() -> bool:
        try:
            decode_answer(json.dumps(answer), scene=request.scene, numerics=request.numerics, watch=request.watch)
        except EngineError:
            return False
        return True

    assert read()
    outcomes = set()
    for get, put in places(answer):
        good = copy.deepcopy(get())
        for junk in JUNK:
            put(junk)
            outcomes.add(accepted := read())
            finite = "Infinity" not in json.dumps(answer) and "NaN" not in json.dumps(answer)
            assert not accepted or not finite or fault("answer", answer) is None, (good, junk)
        put(good)
    assert outcomes == {True, False}


def test_a_description_is_read_as_its_schema_says() -> None:
    told = {**ABOUT, "contact": "soft", "softness": 0.005, "capabilities": ["gravity"], "approximations": ["soft"]}
    found = read_description(json.dumps(told), how_it_runs="x")
    assert found.info.softness == 0.005
    assert found.info.capabilities == {Capability.GRAVITY}
    assert found.approximations == ("soft",)
    del told["approximations"]
    assert read_description(json.dumps(told), how_it_runs="x").approximations == (NOTE_SOFT,)
    for softness in (1, 0.02, -0.1):
        with pytest.raises(EngineError, match=r"softness: .* \(it must lie between 0 and 0.01\)"):
            read_description(json.dumps(told | {"softness": softness}), how_it_runs="x")
    with pytest.raises(
        EngineError, match="softness with contact = 'impulse': leave it out, or declare contact = 'soft'"
    ):
        read_description(json.dumps(told | {"contact": "impulse"}), how_it_runs="x")
    for key in ABOUT:
        with pytest.raises(EngineError, match=key):
            read_description(json.dumps({k: v for k, v in ABOUT.items() if k != key}), how_it_runs="x")


def reported_by(info: EngineInfo) -> dict[str, Any]:
    """The description of an engine in the words of the wire: every field that is not as the field has it by default."""
    told: dict[str, Any] = {"wire_version": 1}
    for each in fields(EngineInfo):
        value = getattr(info, each.name)
        if each.name in ("how_it_runs", "not_installed_because", "reference") or value == each.default:
            continue
        if each.name == "options":
            value = {name: {f.name: list(v) if isinstance(v, tuple) else v for f in fields(option)
                            if (v := getattr(option, f.name)) != f.default} for name, option in value.items()}  # fmt: skip
        elif each.name == "differences":
            told |= {difference.name.lower(): True for difference in value}
            continue
        elif each.name == "out_of_scope":
            value = {wire_name(capability): link for capability, link in value.items()}
        elif isinstance(value, frozenset):
            value = sorted(map(wire_name, value))
        told[each.name] = value
    return told


@pytest.mark.parametrize("engine_id", list(engine_table()))
def test_a_command_can_say_whatever_a_built_in_engine_says(engine_id: str) -> None:
    info = replace(get_engine(engine_id).info(), version="1")
    found = read_description(json.dumps(reported_by(info)), how_it_runs=info.how_it_runs).info
    # The wire says that an engine differs, not why.
    differences = {each: str(each) for each in info.differences}
    assert found == replace(info, not_installed_because="", reference=False, differences=differences)


def test_what_is_out_of_scope_is_no_capability() -> None:
    told = {**ABOUT, "capabilities": ["gravity"], "out_of_scope": {"friction": "https://example.org/scope"}}
    assert dict(read_description(json.dumps(told), how_it_runs="x").info.out_of_scope) == {
        Capability.FRICTION: "https://example.org/scope"
    }
    for wrong, why in (
        ({"gravity": "https://example.org"}, "'gravity' among capabilities"),
        ({"grvity": "x"}, "grvity"),
    ):
        with pytest.raises(EngineError, match=why):
            read_description(json.dumps({**told, "out_of_scope": wrong}), how_it_runs="x")


def test_options_of_every_kind_are_described_by_the_wire() -> None:
    options = {
        "part": {"default": 0.5, "why": "w", "high": 1.0, "low_open": True, "high_open": True},
        "most": {"default": None, "why": "w", "low": 1, "whole": True, "none": "its own"},
        "file": {"default": "", "why": "w", "text": True},
        "kind": {"default": "a", "why": "w", "choices": ["a", "b"]},
    }
    found = read_description(json.dumps({**ABOUT, "options": options}), how_it_runs="x").info.options
    assert [option.allowed for option in found.values()] == [
        "a number in (0, 1)",
        "a whole number >= 1, or none (its own)",
        "a text",
        "one of a, b",
    ]
    for name, wrong in (("part", 1.0), ("most", 0), ("file", None)):
        with pytest.raises(EngineError):
            read_description(
                json.dumps({**ABOUT, "options": {name: {**options[name], "default": wrong}}}), how_it_runs="x"
            )


def test_they_are_written_whole(tmp_path: Path) -> None:
    written = write_schemas(NAMES, tmp_path / "new" / "folder")
    assert [json.loads(path.read_text())["$id"] for path in written] == [SCHEMAS[name]["$id"] for name in NAMES]
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be written"):
        write_schemas(NAMES, tmp_path / "file")
