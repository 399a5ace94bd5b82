"""The wire format between the harness and an engine in another process.

Request (one JSON object on the engine's standard input)
    ``wire_version``
        `WIRE_VERSION`.
    ``scene``, ``numerics``
        ``Scene.to_dict()`` and ``Numerics.to_dict()``.
    ``watch``
        Pairs ``[i, j]`` of bodies whose contact is reported.
    ``sampled_steps``
        Steps ``dt`` at which a sample is taken.
    ``answer_file``
        Path of the file into which the engine writes its answer. Standard output and standard error are free for
        banners and messages.
    ``extra``
        Additions of one adapter for its own driver; other engines ignore it.

Answer (one JSON object in ``answer_file``)
    ``wire_version``, ``engine_version`` (a string), ``timings`` (``setup, warm_up, advance`` in seconds), ``settings``
    (an object) and ``history``: the fields of `ninedisk.core.history.History` as nested lists (without ``pairs``, which
    are the request's). A number that the engine cannot observe is ``null``, and so is an array none of whose numbers it
    can observe; steps, times, positions and velocities must always be numbers. For large histories ``history`` is
    ``{"file": NAME, "force_meaning": ...}``, NAME an NPZ file in the folder of ``answer_file``, see
    `ninedisk.harness.wire.wire_files`. An engine that gives up answers ``{"wire_version": 1, "error": "what went wrong"}``
    instead, one that finds that it cannot express the scene ``{"wire_version": 1, "unsupported": "why"}``.

The same in JSON Schema: ``ninedisk schema --all --out DIR``.

Floats are written with the shortest digits that give the same double back, so that nothing is lost on the way.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.engine import EngineError, EngineRun, EngineUnsupportedError, Timings
from ninedisk.harness.api.text import printable
from ninedisk.harness.wire.wire_fields import (
    WireError,
    expect_keys,
    float_array,
    number,
    settings_field,
    step_array,
    text_field,
)
from ninedisk.harness.wire.wire_files import HISTORY_FILE_KEYS, read_history_file
from ninedisk.harness.wire.wire_text import WIRE_VERSION, parse_message

ANSWER_KEYS = ("wire_version", "engine_version", "timings", "settings", "history")
TIMING_KEYS = ("setup", "warm_up", "advance")
MEANINGS = ("instantaneous", "step-mean")

__all__ = [
    "WIRE_VERSION",
    "Answer",
    "Request",
    "WireError",
    "decode_answer",
    "decode_request",
    "encode_answer",
    "encode_request",
]


@dataclass(frozen=True, kw_only=True)
class Request:
    """What an engine is asked to do."""

    scene: Scene
    numerics: Numerics
    watch: tuple[Pair, ...]
    answer_file: str
    extra: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Answer:
    """A finished run and the version that the engine says it has."""

    run: EngineRun
    engine_version: str


def encode_request(request: Request) -> str:
    """Text of a request."""
    return json.dumps(
        {
            "wire_version": WIRE_VERSION,
            "scene": request.scene.to_dict(),
            "numerics": request.numerics.to_dict(),
            "watch": [[int(i), int(j)] for i, j in request.watch],
            "sampled_steps": request.numerics.sampled_steps().tolist(),
            "answer_file": request.answer_file,
            "extra": dict(request.extra),
        },
        allow_nan=False,
    )


def decode_request(text: str) -> Request:
    """Inverse of `encode_request`, for engines written in Python.

    Raises
    ------
    WireError
        If the text is not a request of this wire version.
    CoreError
        If the scene or its numerics are not allowed.
    """
    data = parse_message(text, "request")
    expect_keys(
        data, ("wire_version", "scene", "numerics", "watch", "sampled_steps", "answer_file", "extra"), "request"
    )
    scene, numerics = Scene.from_dict(data["scene"]), Numerics.from_dict(data["numerics"])
    if not isinstance(data["watch"], list) or not all(isinstance(pair, list) for pair in data["watch"]):
        raise WireError(f"watch must be a list of pairs of body numbers, not {data['watch']!r:.80}")
    if data["sampled_steps"] != numerics.sampled_steps().tolist():
        raise WireError(f"sampled_steps are {data['sampled_steps']!r:.80}; expected those that the numerics ask for")
    for key, kind, name in (("answer_file", str, "a string"), ("extra", dict, "an object")):
        if not isinstance(data[key], kind):
            raise WireError(f"{key} must be {name}, not {data[key]!r:.80}")
    return Request(
        scene=scene,
        numerics=numerics,
        watch=tuple(scene.check_pair(pair) for pair in data["watch"]),
        answer_file=data["answer_file"],
        extra=data["extra"],
    )


def encode_answer(answer: Answer) -> str:
    """Text of an answer, for engines written in Python."""
    run, history = answer.run, answer.run.history
    fields = {name: _lists(getattr(history, name)) for name in _shapes(history.x.shape[1], *_sizes(history))}
    return json.dumps(
        {
            "wire_version": WIRE_VERSION,
            "engine_version": answer.engine_version,
            "timings": vars(run.timings),
            "settings": dict(run.settings),
            "history": {
                "step": history.step.tolist(),
                **fields,
                "force_meaning": history.force_meaning,
                "energy": {name: _lists(series) for name, series in history.energy.items()},
            },
        },
        allow_nan=False,
    )


def decode_answer(
    text: str, *, scene: Scene, numerics: Numerics, watch: Sequence[Pair], folder: Path | None = None
) -> Answer:
    """Check an answer against its request and turn it into an `EngineRun`.

    Parameters
    ----------
    text : str
    scene, numerics, watch
        Of the request.
    folder : Path, optional
        Where the engine may have left a file with its history; None: nowhere.

    Raises
    ------
    WireError
        Naming the key at fault and what was expected there.
    EngineUnsupportedError
        If the engine answered that it cannot express the scene.
    EngineError
        If the engine answered with an error of its own, or its state stopped being finite (with the step).
    """
    data = parse_message(text, "answer")
    if "error" in data:
        raise EngineError(f"the engine gave up: {printable(str(data['error']))}")
    if "unsupported" in data:
        expect_keys(data, ("wire_version", "unsupported"), "answer")
        raise EngineUnsupportedError(text_field(data["unsupported"], "unsupported"))
    expect_keys(data, ANSWER_KEYS, "answer")
    timings = data["timings"]
    expect_keys(timings, TIMING_KEYS, "timings")
    run = EngineRun(
        history=_history(data["history"], scene, numerics, tuple((int(i), int(j)) for i, j in watch), folder),
        timings=Timings(**{key: number(timings[key], f"timings.{key}", low=0.0) for key in TIMING_KEYS}),
        settings=settings_field(data["settings"]),
    )
    return Answer(run=run, engine_version=text_field(data["engine_version"], "engine_version"))


def _history(data: Any, scene: Scene, numerics: Numerics, pairs: tuple[Pair, ...], folder: Path | None) -> History:
    shapes = _shapes(len(scene.disks), len(scene.walls), len(pairs))
    if isinstance(data, Mapping) and "file" in data:
        expect_keys(data, HISTORY_FILE_KEYS, "history")
        found = read_history_file(data["file"], folder, shapes)
        data = {**found, "force_meaning": data["force_meaning"]}
    expect_keys(data, ("step", *shapes, "force_meaning", "energy"), "history")
    steps = step_array(data["step"], numerics.sampled_steps())
    arrays = {name: float_array(data[name], f"history.{name}", (len(steps), *shape)) for name, shape in shapes.items()}
    _check_state(arrays, steps, numerics)
    if data["force_meaning"] not in MEANINGS:
        raise WireError(f"history.force_meaning is {data['force_meaning']!r}; expected one of {', '.join(MEANINGS)}")
    if not isinstance(data["energy"], Mapping):
        raise WireError(f"history.energy must be an object of arrays, not {data['energy']!r:.80}")
    energy = {
        name: float_array(series, f"history.energy.{name}", (len(steps),)) for name, series in data["energy"].items()
    }
    fields: dict[str, Any] = {**arrays}
    return History(step=steps, pairs=pairs, force_meaning=data["force_meaning"], energy=energy, **fields)


def _check_state(arrays: Mapping[str, NDArray[np.float64]], steps: NDArray[np.int64], numerics: Numerics) -> None:
    """Times are those of the steps, the state is finite, and nothing is infinite."""
    for name, unit in (("x", "m"), ("v", "m/s")):
        bad = ~np.isfinite(arrays[name]).all(axis=(1, 2))
        if bad.any():
            row = int(np.argmax(bad))
            disk = int(np.argmax(~np.isfinite(arrays[name][row]).all(axis=1)))
            raise EngineError(
                f"the state stopped being finite: history.{name} of disk {disk} is {arrays[name][row, disk].tolist()} {unit} "
                f"at step {steps[row]} (the first sampled step that is not finite); a smaller contact_dt is the usual way out"
            )
    for name, array in arrays.items():
        if np.isinf(array).any():
            row = int(np.argwhere(np.isinf(array))[0][0])
            raise WireError(
                f"history.{name} is infinite at step {steps[row]}; expected a number, or null for not observed"
            )
    t, expected = arrays["t"], steps * numerics.dt
    wrong = ~(np.abs(t - expected) <= 1e-9 * numerics.dt * np.maximum(steps, 1))  # round-off of summing steps
    if wrong.any():
        row = int(np.argmax(wrong))
        raise WireError(f"history.t[{row}] is {t[row]}; expected step * dt = {expected[row]} at step {steps[row]}")


def _shapes(n: int, m: int, c: int) -> dict[str, tuple[int, ...]]:
    """Shape of one sample of every array, for n disks, m walls and c watched pairs."""
    return {
        "t": (),
        "x": (n, 2),
        "v": (n, 2),
        "angle": (n,),
        "omega": (n,),
        "gap": (c,),
        "fn": (c,),
        "fs": (c,),
        "wall_point": (m, 2),
        "wall_angle": (m,),
        "wall_force": (m, 2),
    }


def _sizes(history: History) -> tuple[int, int]:
    return history.wall_point.shape[1], len(history.pairs)


def _lists(array: NDArray[np.float64]) -> Any:
    """Nested lists with null for NaN; null alone where everything is NaN."""
    missing = np.isnan(array)
    if not missing.any():
        return array.tolist()
    if missing.all():
        return None
    entries = array.astype(object)
    entries[missing] = None
    return entries.tolist()
