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
    ``wire_version``, ``engine_version`` (a string), ``timings`` (``setup, warm_up, advance`` in wall-clock seconds and,
    optionally, ``cpu``, the CPU seconds of ``advance`` over all threads), ``settings``
    (an object) and ``history``: the fields of `ninedisk.core.history.History` as nested lists (without ``pairs``, which
    are the request's). A number that the engine cannot observe is ``null``, and so is an array none of whose numbers it
    can observe; steps, times, positions and velocities must always be numbers. For large histories ``history`` is
    ``{"file": NAME, "force_meaning": ...}``, NAME an NPZ file in the folder of ``answer_file`` (see
    below). An engine that gives up answers ``{"wire_version": 1, "error": "what went wrong"}``
    instead, one that finds that it cannot express the scene ``{"wire_version": 1, "unsupported": "why"}``.

The same in JSON Schema: ``ninedisk schema --all --out DIR``.

Floats are written with the shortest digits that give the same double back, so that nothing is lost on the way. Messages are read
strictly: what is wrong with one is said with its key and what was expected.

The NPZ file of a large history holds its arrays by their names, ``step`` included, and energies as ``energy.NAME``; an array that
it does not hold was not observed. Positions and velocities are checked like any others.
"""

from __future__ import annotations

import json
import re
import sys
import zipfile
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.engine import EngineError, EngineRun, EngineUnsupportedError, Timings
from ninedisk.harness.api.text import one_line

ANSWER_KEYS = ("wire_version", "engine_version", "timings", "settings", "history")
TIMING_KEYS = ("setup", "warm_up", "advance")
OPTIONAL_TIMINGS = ("cpu",)
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


SETTINGS_DEPTH = 8
"""Levels of lists and objects within settings: more than any table needs."""

WIRE_VERSION = 1

_BARE_NUMBER = re.compile(r"[\[,:]\s*[-+]?(nan|inf(?:inity)?)\b", re.IGNORECASE)

_OBJECT = re.compile(r'\{\s*"')

_NEAR = 30

OPTIONAL_ARRAYS = ("stress", "quaternion", "moment")
HISTORY_FILE_KEYS = ("file", "force_meaning")

ENERGY = "energy."


@dataclass(frozen=True, kw_only=True)
class Request:
    """What an engine is asked to do."""

    scene: Scene | SphereScene
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
    in_space = isinstance(data["scene"], Mapping) and data["scene"].get("dimension") == 3
    scene: Scene | SphereScene = (SphereScene if in_space else Scene).from_dict(data["scene"])
    numerics = Numerics.from_dict(data["numerics"])
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
    fields = {
        name: _lists(getattr(history, name))
        for name in _shapes(history.x.shape[1], *_sizes(history), history.x.shape[2])
    }
    return json.dumps(
        {
            "wire_version": WIRE_VERSION,
            "engine_version": answer.engine_version,
            "timings": {
                key: value
                for key in (*TIMING_KEYS, *OPTIONAL_TIMINGS)
                if (value := getattr(run.timings, key)) is not None
            },
            "settings": dict(run.settings),
            "history": {
                "step": history.step.tolist(),
                **fields,
                "force_meaning": history.force_meaning,
                "energy": {name: _lists(series) for name, series in history.energy.items()},
                **{
                    name: _lists(values)
                    for name in OPTIONAL_ARRAYS
                    if (values := getattr(history, name)) is not None
                },
            },
        },
        allow_nan=False,
    )


def decode_answer(
    text: str, *, scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair], folder: Path | None = None
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
        If the engine answered with its own error, or its state stopped being finite (with the step).
    """
    data = parse_message(text, "answer")
    if "error" in data:
        raise EngineError(f"the engine gave up: {one_line(str(data['error']))}")
    if "unsupported" in data:
        expect_keys(data, ("wire_version", "unsupported"), "answer")
        raise EngineUnsupportedError(text_field(data["unsupported"], "unsupported"))
    expect_keys(data, ANSWER_KEYS, "answer")
    timings = data["timings"]
    expect_keys(timings, TIMING_KEYS, "timings", optional=OPTIONAL_TIMINGS)
    seconds: dict[str, Any] = {key: number(timings[key], f"timings.{key}", low=0.0) for key in timings}
    run = EngineRun(
        history=_history(data["history"], scene, numerics, tuple((int(i), int(j)) for i, j in watch), folder),
        timings=Timings(**seconds),
        settings=settings_field(data["settings"]),
    )
    return Answer(run=run, engine_version=text_field(data["engine_version"], "engine_version"))


def _history(
    data: Any, scene: Scene | SphereScene, numerics: Numerics, pairs: tuple[Pair, ...], folder: Path | None
) -> History:
    shapes = _shapes(len(scene.bodies), len(scene.walls), len(pairs), scene.dimension)
    if isinstance(data, Mapping) and "file" in data:
        expect_keys(data, HISTORY_FILE_KEYS, "history")
        found = read_history_file(data["file"], folder, (*shapes, *OPTIONAL_ARRAYS))
        data = {**found, "force_meaning": data["force_meaning"]}
    expect_keys(data, ("step", *shapes, "force_meaning", "energy"), "history", optional=OPTIONAL_ARRAYS)
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
    optional = {
        "stress": (2, scene.dimension, scene.dimension),
        "quaternion": (len(scene.bodies), 4),
        "moment": (len(pairs), 3),
    }
    for name, shape in optional.items():
        if data.get(name) is not None:
            fields[name] = float_array(data[name], f"history.{name}", (len(steps), *shape))
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


def _shapes(n: int, m: int, c: int, dimension: int) -> dict[str, tuple[int, ...]]:
    """Shape of one sample of every array, for n bodies, m walls and c watched pairs."""
    turn = () if dimension == 2 else (3,)
    return {
        "t": (),
        "x": (n, dimension),
        "v": (n, dimension),
        "angle": (n, *turn),
        "omega": (n, *turn),
        "gap": (c,),
        "fn": (c,),
        "fs": (c, *turn),
        "wall_point": (m, dimension),
        "wall_angle": (m, *turn),
        "wall_force": (m, dimension),
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


class WireError(EngineError):
    """A message does not keep to the wire format; the text names the key and what was expected there."""


def expect_keys(data: Any, keys: Sequence[str], where: str, *, optional: Sequence[str] = ()) -> None:
    """Raise `WireError` unless ``data`` is an object with exactly these keys; ``optional`` ones may be missing."""
    if not isinstance(data, Mapping):
        raise WireError(f"{where} must be an object with the keys {', '.join(keys)}, not {data!r:.80}")
    missing = [key for key in keys if key not in data]
    if missing:
        raise WireError(f"{where} lacks the key(s) {', '.join(missing)}; expected {', '.join(keys)}")
    unknown = sorted(set(data) - set(keys) - set(optional))
    if unknown:
        raise WireError(f"{where} has the unknown key(s) {', '.join(unknown)}; expected {', '.join(keys)}")


def number(value: Any, name: str, *, low: float) -> float:
    """A finite number not below ``low``."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= sys.float_info.max:
        raise WireError(f"{name} is {value!r}; expected a finite number >= {low:g}")
    return float(value)


def text_field(value: Any, name: str) -> str:
    """A string, without control characters and halves of characters, which no terminal and no file can show."""
    if not isinstance(value, str):
        raise WireError(f"{name} must be a string, not {value!r:.80}")
    return one_line(value)


def settings_field(value: Any) -> dict[str, Any]:
    """An object of settings as it can be stored and shown: texts printable, numbers beyond doubles and 64 bits as text."""
    if not isinstance(value, Mapping):
        raise WireError(f"settings must be an object, not {value!r:.80}")
    return {one_line(str(key)): _storable(entry, SETTINGS_DEPTH) for key, entry in value.items()}


def _storable(value: Any, depth: int) -> Any:
    if depth == 0:
        raise WireError(f"settings are nested more than {SETTINGS_DEPTH} deep: write them flat, or as text")
    if isinstance(value, str):
        return one_line(value)
    if isinstance(value, Mapping):
        return {one_line(str(key)): _storable(entry, depth - 1) for key, entry in value.items()}
    if isinstance(value, list):
        return [_storable(entry, depth - 1) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    if isinstance(value, int) and abs(value) >= 1 << 63:
        return f"{value:.17e}" if abs(value) < 10**300 else "beyond a double"
    return value


def step_array(value: Any, expected: NDArray[np.int64]) -> NDArray[np.int64]:
    """The sampled steps, which must be those of the request."""
    if isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "iu":
        value = value.tolist()
    if not isinstance(value, list) or any(isinstance(step, bool) or not isinstance(step, int) for step in value):
        raise WireError(f"history.step is {value!r:.80}; expected a list of whole numbers")
    if len(value) != len(expected):
        raise WireError(
            f"history.step has {len(value)} steps; expected the {len(expected)} sampled steps of the request"
        )
    for row, (step, wanted) in enumerate(zip(value, expected.tolist(), strict=True)):
        if step != wanted:
            raise WireError(f"history.step[{row}] is {step}; expected the sampled step {wanted}")
    return np.array(value, dtype=np.int64)


def float_array(value: Any, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Nested lists of numbers, null meaning NaN, as an array of this shape; null alone is an array of NaN.

    An array, as a file has it, is checked likewise.

    Raises
    ------
    WireError
        On another shape, ragged lists, or anything that is neither a number nor null.
    """
    if value is None:
        return np.full(shape, np.nan)
    if not isinstance(value, list | np.ndarray):
        raise WireError(f"{name} is {value!r:.80}; expected nested lists of numbers of shape {shape}")
    try:
        raw = np.array(value)
    except ValueError as error:
        raise WireError(f"{name} has rows of different lengths; expected nested lists of shape {shape}") from error
    if raw.size == 0 and 0 in shape and raw.shape == shape[: raw.ndim]:
        return np.empty(shape)
    if raw.shape != shape:
        raise WireError(f"{name} has shape {raw.shape}; expected {shape}")
    kinds = {type(entry) for entry in _entries(value, len(shape))}
    if not kinds <= {int, float, NoneType}:
        odd = next(entry for entry in _entries(value, len(shape)) if type(entry) not in (int, float, NoneType))
        raise WireError(f"{name} holds {odd!r:.80}; expected numbers, or null for what was not observed")
    try:
        return np.array(value, dtype=np.float64)
    except OverflowError:
        raise WireError(f"{name} holds a whole number beyond the range of a double") from None


def _entries(value: Any, depth: int) -> Iterable[Any]:
    """Entries of regular nested lists, as Python objects: NumPy would take true for 1 beside numbers."""
    if isinstance(value, np.ndarray):
        return [] if value.dtype.kind in "iuf" else value.astype(object).flat
    for _ in range(depth - 1):
        value = chain.from_iterable(value)
    return value  # type: ignore[no-any-return]


def parse_message(text: str, what: str) -> dict[str, Any]:
    """The JSON object of this wire version that ``text`` holds; ``what`` names the message in errors.

    Raises
    ------
    WireError
        Where there is none; the text says what is there in its place.
    """
    if not text.strip():
        raise WireError(f"the {what} is empty; expected one JSON object")
    try:
        data = json.loads(text)
    except ValueError as error:
        raise WireError(
            f"the {what} is not JSON, or was cut off ({error}); it has {len(text)} characters, begins with "
            f"{text[:60]!r} and ends with {text[-60:]!r}{_advice(text, error)}"
        ) from error
    except RecursionError:
        raise WireError(f"the {what} is nested too deeply; expected one JSON object") from None
    if not isinstance(data, dict):
        raise WireError(f"the {what} must be a JSON object, not {type(data).__name__}")
    version = data.get("wire_version")
    if version != WIRE_VERSION or isinstance(version, bool):
        raise WireError(f"wire_version of the {what} is {version!r}; this harness speaks version {WIRE_VERSION}")
    return data


def _advice(text: str, error: ValueError) -> str:
    """What probably happened, and the way out; empty where nothing is recognised."""
    found = _OBJECT.search(text)
    begin = found.start() if found else -1
    if begin > 0 and text[:begin].strip() and _object_ends(text, begin) is not None:
        return "; other text precedes the JSON object: print messages on standard error"
    end = _object_ends(text, begin) if begin >= 0 else None
    if end is not None:
        return (
            f"; other text follows the JSON object ({text[end:].strip()[:_NEAR]!r}): print messages on standard error"
        )
    at = getattr(error, "pos", 0)
    near = text[max(0, at - _NEAR) : at + _NEAR]
    if _BARE_NUMBER.search(near):
        return f"; near {near!r}: JSON has no NaN or infinity; write null for a number that cannot be observed"
    return f"; the fault is near {near!r}" if 0 < at < len(text) else ""


def _object_ends(text: str, begin: int) -> int | None:
    """Where the JSON object that begins at ``begin`` ends; None if there is none."""
    try:
        _, end = json.JSONDecoder().raw_decode(text, begin)
    except (ValueError, RecursionError):
        return None
    return end


def read_history_file(name: Any, folder: Path | None, arrays: Iterable[str]) -> dict[str, Any]:
    """The arrays of an NPZ file, None for those of ``arrays`` that it lacks, and its energies.

    Parameters
    ----------
    name : str
        Path as the engine gave it; relative ones begin at ``folder``.
    folder : Path or None
        The only folder in which the file may lie.
    arrays : iterable of str
        What a history may hold besides ``step`` and energies.

    Raises
    ------
    WireError
        If the file lies elsewhere, is none of this form, or holds arrays of other names or of objects.
    """
    named = text_field(name, "history.file")
    if folder is None:
        raise WireError(f"history.file is {named!r}, but this run has no folder for files: write the arrays themselves")
    path = (folder / named).resolve()
    if not path.is_relative_to(folder.resolve()) or not path.is_file():
        raise WireError(
            f"history.file is {named!r}; expected a file in the folder of the request's answer_file, which is removed after "
            f"the run"
        )
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {key: file[key] for key in file.files}
    except (OSError, ValueError, EOFError, TypeError, AttributeError, zlib.error, zipfile.BadZipFile) as error:
        raise WireError(f"history.file {named!r} is no NPZ file of plain arrays ({error})") from error
    allowed = ("step", *arrays)
    unknown = [key for key in found if key not in allowed and not key.startswith(ENERGY)]
    if unknown or "step" not in found:
        fault = f"has the unknown array(s) {', '.join(unknown)}" if unknown else "lacks the array step"
        raise WireError(f"history.file {named!r} {fault}; expected {', '.join(allowed)} and {ENERGY}NAME")
    energy = {key.removeprefix(ENERGY): array for key, array in found.items() if key.startswith(ENERGY)}
    return {"energy": energy} | {key: found.get(key) for key in allowed}
