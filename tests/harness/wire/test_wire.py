"""The wire format: nothing is lost on the way, and every way to break it is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.engine import EngineError, EngineRun, Timings
from ninedisk.harness.wire.protocol import (
    Answer,
    Request,
    WireError,
    decode_answer,
    decode_request,
    encode_answer,
    encode_request,
)

LAW = ContactLaw(kn=1e5 / 3, ks=2e4, mu=0.3)
NUMERICS = Numerics(dt=0.1, n_steps=3)
WATCH = ((0, 1), (0, 2))


def scene() -> Scene:
    motion = (WallSegment(duration=0.1, velocity=(0.0, 1 / 3)), WallSegment())
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.6, 0.8), law=LAW, motion=motion)
    disks = Disks(x=[(0.1, 1.0), (2.0, 1.5)], radius=1.0, mass=[np.pi, 2.0], rotating=[True, False])
    return Scene(disks=disks, disk_disk=LAW, walls=(floor,), gravity=(0.0, -9.81), initial_shear={(0, 2): 0.1})


def history(seed: int = 1) -> History:
    rng = np.random.default_rng(seed)
    steps = NUMERICS.sampled_steps()
    made = History.empty(
        steps, steps * NUMERICS.dt, n_disks=2, n_walls=1, pairs=WATCH, force_meaning="step-mean", energies=("kinetic",)
    )
    for name in ("x", "v", "omega", "gap", "fn", "wall_point", "wall_angle"):
        array = getattr(made, name)
        array[...] = rng.normal(size=array.shape) * 10.0 ** rng.integers(-300, 300, size=array.shape)
    made.fn[1, 0] = np.nan
    made.energy["kinetic"][...] = [5e-324, 1.7976931348623157e308, 0.1, 1 / 3]
    return made


def text_of(made: History) -> str:
    run = EngineRun(history=made, timings=Timings(setup=0.1, warm_up=0.0, advance=2.5), settings={"slop": 0.0})
    return encode_answer(Answer(run=run, engine_version="1.2"))


def decode(text: str) -> Answer:
    return decode_answer(text, scene=scene(), numerics=NUMERICS, watch=WATCH)


def test_request_round_trip() -> None:
    sent = Request(scene=scene(), numerics=NUMERICS, watch=WATCH, answer_file="answer.json", extra={"k": 1})
    got = decode_request(encode_request(sent))
    assert got.scene.to_dict() == sent.scene.to_dict()
    assert (got.numerics, got.watch, got.answer_file, got.extra) == (NUMERICS, WATCH, "answer.json", {"k": 1})


def test_request_lists_the_sampled_steps() -> None:
    numerics = NUMERICS.replace(n_steps=10, sample_every=4)
    data = json.loads(encode_request(Request(scene=scene(), numerics=numerics, watch=WATCH, answer_file="a")))
    assert data["sampled_steps"] == [0, 4, 8, 10]


def test_answer_round_trip_is_exact_to_the_last_bit() -> None:
    made = history()
    got = decode(text_of(made))
    assert (got.engine_version, got.run.settings, got.run.timings.advance) == ("1.2", {"slop": 0.0}, 2.5)
    for name in ("step", "t", "x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        np.testing.assert_array_equal(getattr(got.run.history, name), getattr(made, name), strict=True)
    np.testing.assert_array_equal(got.run.history.energy["kinetic"], made.energy["kinetic"])
    assert got.run.history.pairs == WATCH
    assert got.run.history.force_meaning == "step-mean"


def test_not_observed_is_null_and_nan() -> None:
    data = json.loads(text_of(history()))
    assert data["history"]["fs"] is None
    assert data["history"]["fn"][1][0] is None
    assert np.isnan(decode(json.dumps(data)).run.history.fs).all()


def test_scene_without_walls_or_watched_pairs() -> None:
    bare = Scene(disks=Disks(x=[(0.0, 0.0)], radius=1.0, mass=1.0), disk_disk=LAW)
    steps = NUMERICS.sampled_steps()
    made = History.empty(steps, steps * NUMERICS.dt, n_disks=1, n_walls=0, pairs=())
    for array in (made.x, made.v):
        array[...] = 0.0
    got = decode_answer(text_of(made), scene=bare, numerics=NUMERICS, watch=())
    assert got.run.history.fn.shape == (4, 0)
    assert got.run.history.wall_force.shape == (4, 0, 2)


Change = Callable[[dict[str, Any]], None]


def drop(*path: str) -> Change:
    def change(data: dict[str, Any]) -> None:
        for key in path[:-1]:
            data = data[key]
        del data[path[-1]]

    return change


def put(value: Any, *path: str | int) -> Change:
    def change(data: Any) -> None:
        for key in path[:-1]:
            data = data[key]
        data[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (drop("history"), r"answer lacks the key\(s\) history; expected wire_version, engine_version"),
        (drop("history", "omega"), r"history lacks the key\(s\) omega"),
        (drop("timings", "advance"), r"timings lacks the key\(s\) advance"),
        (drop("wire_version"), r"wire_version of the answer is None; this harness speaks version 1"),
        (put(2, "wire_version"), r"wire_version of the answer is 2"),
        (put(True, "wire_version"), r"wire_version of the answer is True"),
        (put(1, "extra"), r"answer has the unknown key\(s\) extra"),
        (put(3, "engine_version"), r"engine_version must be a string, not 3"),
        (put([], "settings"), r"settings must be an object"),
        (put(-1.0, "timings", "advance"), r"timings.advance is -1.0; expected a finite number >= 0"),
        (put("fast", "timings", "setup"), r"timings.setup is 'fast'"),
        (put([], "history"), r"history must be an object with the keys step, t, x"),
        (put([0, 1, 2], "history", "step"), r"history.step has 3 steps; expected the 4 sampled steps"),
        (put([0, 1, 2, 4], "history", "step"), r"history.step\[3\] is 4; expected the sampled step 3"),
        (put([0, 1, 2, 3.0], "history", "step"), r"expected a list of whole numbers"),
        (put([0.0, 0.1, 0.2, 0.4], "history", "t"), r"history.t\[3\] is 0.4; expected step \* dt = 0.3"),
        (put([0.0, 0.1, 0.2, None], "history", "t"), r"history.t\[3\] is nan"),
        (put([[1.0]] * 4, "history", "x"), r"history.x has shape \(4, 1\); expected \(4, 2, 2\)"),
        (put([1.0, 2.0], "history", "x", 0), r"history.x has rows of different lengths"),
        (put("far", "history", "x"), r"history.x is 'far'; expected nested lists of numbers of shape"),
        (put("far", "history", "x", 0, 0, 0), r"history.x holds 'far'; expected numbers, or null"),
        (put("gas", "history", "force_meaning"), r"history.force_meaning is 'gas'; expected one of instantaneous"),
        (put([1.0], "history", "energy", "kinetic"), r"history.energy.kinetic has shape \(1,\); expected \(4,\)"),
        (put(float("inf"), "history", "gap", 1, 0), r"history.gap is infinite at step 1"),
    ],
)
def test_broken_answers_name_the_key(change: Change, message: str) -> None:
    data = json.loads(text_of(history()))
    change(data)
    with pytest.raises(WireError, match=message):
        decode(json.dumps(data))


@pytest.mark.parametrize("value", [float("nan"), float("inf"), None])
@pytest.mark.parametrize("name", ["x", "v"])
def test_state_that_stops_being_finite_names_the_step(name: str, value: float | None) -> None:
    data = json.loads(text_of(history()))
    for row in (2, 3):
        data["history"][name][row][1][0] = value
    with pytest.raises(EngineError, match=rf"stopped being finite: history.{name} of disk 1 is .* at step 2 "):
        decode(json.dumps(data))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the answer is empty"),
        ("Segmentation fault", r"not JSON, or was cut off .* begins with 'Segmentation fault'"),
        ("[1, 2]", "must be a JSON object, not list"),
        (text_of(history())[:500], r"not JSON, or was cut off .* it has 500 characters"),
    ],
)
def test_garbage(text: str, message: str) -> None:
    with pytest.raises(WireError, match=message):
        decode(text)


def test_engine_that_gives_up() -> None:
    with pytest.raises(EngineError, match="the engine gave up: out of memory"):
        decode('{"wire_version": 1, "error": "out of memory"}')
