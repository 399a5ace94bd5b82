"""Where foreign input enters: each target takes one damaged input and raises `FaultError` where the answer is no clean one.

A clean answer is a result, or an error of ours with a message. Not clean: any other exception, a traceback or an "internal
error" on the terminal, no answer within the time limit, a file or run that is only there in part.
"""

from __future__ import annotations

import atexit
import json
import shutil
import signal
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from random import Random
from types import FrameType

import numpy as np
from mutations import ODD_NUMBERS, ODD_TEXTS, damaged, damaged_bytes, damaged_text
from typer.testing import CliRunner

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.problem_files import Form, read_problem, write_problem
from ninedisk.core.dem.session import DemSession
from ninedisk.core.errors import CoreError
from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.registry import BUILTIN_CASES, BUILTIN_ENGINES, get_case
from ninedisk.harness.cli.app import app
from ninedisk.harness.cli.support import parse_settings
from ninedisk.harness.results.reader import read_run, run_ids
from ninedisk.harness.run import published
from ninedisk.harness.run.judge import blank_history
from ninedisk.harness.run.plan import plan_case, plan_matrix
from ninedisk.harness.wire.protocol import Answer, Request, decode_answer, decode_request, encode_answer, encode_request

OURS = (CoreError, UsageError, ParameterError, EngineError)
SECONDS = 30.0
EXIT_CODES = (0, 1, 2, 3)
Target = Callable[[Random, Path], None]


class FaultError(AssertionError):
    """An answer that is not clean."""


@contextmanager
def clean(what: str, *, seconds: float = SECONDS) -> Iterator[None]:
    """Errors of ours pass; anything else, and a block that takes too long, is a `FaultError`."""

    def late(_: int, __: FrameType | None) -> None:
        raise FaultError(f"{what}: no answer within {seconds:g} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # arithmetic that went wrong before anyone looked
            yield
    except OURS as error:
        if not str(error).strip():
            raise FaultError(f"{what}: {type(error).__name__} without a message") from error
    except FaultError:
        raise
    except Exception as error:
        raise FaultError(f"{what}: {type(error).__name__}: {error}") from error
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@cache
def requests() -> tuple[Request, ...]:
    """A request of the first variant of every case."""
    found = []
    for case_id in BUILTIN_CASES:
        setup = plan_case(case_id, "dem", dict(get_case(case_id).matrix()[0])).setup
        assert not isinstance(setup, Exception)
        found.append(
            Request(scene=setup.scene, numerics=setup.numerics, watch=setup.watch, answer_file="answer", extra={})
        )
    return tuple(found)


def scene_json(rng: Random, _: Path) -> None:
    given = rng.choice(requests()).scene
    data = damaged(rng, given.to_dict(), rng.randrange(1, 4))
    with clean(f"{type(given).__name__}.from_dict({data!r:.300})"):
        scene = type(given).from_dict(data)
        again = type(given).from_dict(json.loads(json.dumps(scene.to_dict())))
        assert again.to_dict() == scene.to_dict(), "an accepted scene does not survive a round trip"


def numerics_json(rng: Random, _: Path) -> None:
    data = damaged(rng, rng.choice(requests()).numerics.to_dict(), rng.randrange(1, 4))
    with clean(f"Numerics.from_dict({data!r})"):
        numerics = Numerics.from_dict(data)
        if numerics.n_steps < 10**6:
            assert numerics.sampled_steps()[-1] == numerics.n_steps


def wire_request(rng: Random, _: Path) -> None:
    text = encode_request(rng.choice(requests()))
    text = damaged_text(rng, text) if rng.random() < 0.5 else json.dumps(damaged(rng, json.loads(text), 2))
    with clean(f"decode_request({text[:200]!r})"):
        decode_request(text)


@cache
def answer() -> tuple[str, Request]:
    """An answer to a short request, with the request."""
    cell = plan_case("incline-block", "pymunk", {"duration": "0.05"})
    assert not isinstance(cell.setup, Exception)
    assert not isinstance(cell.engine, Exception)
    setup = cell.setup
    run = cell.engine.run(setup.scene, setup.numerics, setup.watch)
    request = Request(scene=setup.scene, numerics=setup.numerics, watch=setup.watch, answer_file="", extra={})
    return encode_answer(Answer(run=run, engine_version="7")), request


def wire_answer(rng: Random, _: Path) -> None:
    text, request = answer()
    text = damaged_text(rng, text) if rng.random() < 0.4 else json.dumps(damaged(rng, json.loads(text), 2))
    with clean(f"decode_answer({text[:200]!r})"):
        found = decode_answer(text, scene=request.scene, numerics=request.numerics, watch=request.watch)
        assert np.isfinite(found.run.history.x).all()


def odd_setting(rng: Random, case_id: str) -> str:
    """``NAME=VALUE`` for a parameter of the case, or something like it."""
    parameter = rng.choice(get_case(case_id).parameters)
    name = parameter.name if rng.random() < 0.92 else str(rng.choice(ODD_TEXTS))
    choices = [str(parameter.default), *map(str, parameter.choices), *parameter.words]
    value = str(rng.choice([*ODD_NUMBERS, *ODD_TEXTS, *choices, rng.uniform(-1, 1), 10 ** rng.uniform(-20, 20)]))
    unit = rng.choice(("", "", "", " s", " ms", " m", " kN/m", " deg", " m/s^2", "%", " foo"))
    return f"{name}={value}{unit}" if rng.random() < 0.98 else name + value


def settings(rng: Random, _: Path) -> None:
    case_id = rng.choice(list(BUILTIN_CASES))
    given = [odd_setting(rng, case_id) for _ in range(rng.randrange(1, 4))]
    with clean(f"--set {given!r:.300} of {case_id}"):
        cell = plan_case(case_id, "dem", parse_settings(given))
        if isinstance(cell.setup, Exception):
            raise cell.setup
        observed = cell.case.observe(cell.variant.params, cell.setup, blank_history(cell.setup))
        assert not isinstance(cell.engine, Exception)
        cell.case.checks(cell.variant.params, cell.setup, observed, cell.engine.info())


CURVE = """case = "nine-disk/compression"
params = { load_case = "a1", xi = 3 }
quantity = "fn_wall_mid"
abscissa = "step"
unit = "N"
uncertainty = 5e5
title = "Cundall & Strack"
source = "figure read with a digitiser"
"""
TABLE = "step,force\n0,0\n50,2.5e7\n100,4.9e7\n"


def curve_files(rng: Random, folder: Path) -> None:
    toml, csv = CURVE, TABLE
    if rng.random() < 0.6:
        toml = damaged_text(rng, toml)
    if toml == CURVE or rng.random() < 0.3:
        csv = damaged_text(rng, csv)
    (folder / "c.toml").write_bytes(toml.encode("utf-8", "surrogatepass"))
    (folder / "c.csv").write_bytes(csv.encode("utf-8", "surrogatepass"))
    published._curves.cache_clear()
    with clean(f"--published with {toml!r} and {csv!r}"):
        published.check_folder(folder, plan_matrix(["nine-disk/compression"], ["dem"], {}))


@cache
def checkpoint() -> bytes:
    """A checkpoint after ten steps."""
    request = requests()[0]
    session = DemSession(request.scene, request.numerics.replace(n_steps=20, sample_until=None), request.watch)
    session.advance(10)
    with tempfile.TemporaryDirectory() as folder:
        session.save(Path(folder) / "c.npz")
        return (Path(folder) / "c.npz").read_bytes()


def checkpoint_file(rng: Random, folder: Path) -> None:
    (folder / "c.npz").write_bytes(damaged_bytes(rng, checkpoint()))
    with clean("DemSession.load"):
        DemSession.load(folder / "c.npz")


FORMS: tuple[Form, ...] = ("npz", "fc2d", "fclib")


@cache
def problem(form: Form) -> bytes:
    """The contact problem of a disk on an incline, as the solver would keep it."""
    problem = ContactProblem(
        mass=np.ones((1, 3)),
        force=np.array([[0.3, -1.0, 0.0]]),
        bodies=np.array([[0, -1]]),
        normal=np.array([[0.0, -1.0]]),
        arms=np.array([[0.0, 0.0, 1.0, 0.0]]),
        offset=np.zeros((1, 2)),
        mu=np.array([0.3]),
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "p"
        write_problem(file, problem, form)
        return file.read_bytes()


def problem_file(rng: Random, folder: Path) -> None:
    content = damaged_bytes(rng, problem(rng.choice(FORMS)))
    (folder / "p").write_bytes(content)
    with clean("read_problem"):
        found = read_problem(folder / "p")
        found.save(folder / "again")
        if found.form != "fclib":  # whose bytes are kept
            assert read_problem(folder / "again").problem.n_contacts == found.problem.n_contacts


@cache
def stored() -> Path:
    """A store with two small runs, and exports of them."""
    folder = Path(tempfile.mkdtemp(prefix="ninedisk-fuzz-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for number in ("0.36", "0.4"):
        argv = ["run", "incline-block", "-e", "pymunk", "--set", f"mu={number}", "--set", "duration=0.05"]
        assert invoke([*argv, "--store", str(folder / "results")])[0] in (0, 1)
    for kind in ("csv", "json", "parquet"):
        invoke(["export", f"--{kind}", str(folder / f"all.{kind}"), "--store", str(folder / "results")])
    return folder


def invoke(argv: list[str]) -> tuple[int, str]:
    """Exit code and output of a command in this process; `FaultError` where it is not a clean one."""
    result = CliRunner().invoke(app, argv)
    output = result.output
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise FaultError(f"{argv!r:.400}: {type(result.exception).__name__}: {result.exception}") from result.exception
    if "Traceback" in output or "internal error" in output:
        raise FaultError(f"{argv!r:.400}: {output[-600:]}")
    if result.exit_code not in EXIT_CODES:
        raise FaultError(f"{argv!r:.400}: exit code {result.exit_code}")
    if result.exit_code == 2 and not output.strip():
        raise FaultError(f"{argv!r:.400}: exit code 2 and not a word")
    return result.exit_code, output


def whole(store: Path) -> None:
    """Every visible run of a store can be read."""
    for run_id in run_ids(store):
        read_run(store, run_id)


READERS = (
    ["runs"],
    ["compare", "latest~1", "latest"],
    ["compare", "latest~1", "latest", "--all"],
    ["export", "--csv", "out.csv"],
    ["export", "--json", "out.json"],
    ["prune", "--unreadable"],
    ["merge", "STORE", "--store", "merged"],
)


def store_files(rng: Random, folder: Path) -> None:
    store = folder / "results"
    shutil.copytree(stored() / "results", store)
    files = sorted(path for path in store.rglob("*") if path.is_file())
    for path in rng.sample(files, rng.randrange(1, 3)):
        how = rng.randrange(5)
        if how == 0:
            path.unlink()
        elif how == 1 and path.suffix == ".json":
            path.write_text(json.dumps(damaged(rng, json.loads(path.read_text()), 2)))
        elif how == 2:
            others = [other for other in files if other.exists()]
            path.write_bytes(rng.choice(others).read_bytes())
        else:
            path.write_bytes(damaged_bytes(rng, path.read_bytes()))
    argv = [word.replace("STORE", str(store)) for word in rng.choice(READERS)]
    argv = [str(folder / word) if word.startswith(("out.", "merged")) else word for word in argv]
    if "merge" not in argv:
        argv += ["--store", str(store)]
    with clean(f"{argv}"):
        code, _ = invoke(argv)
        made = [path for path in (folder / "out.csv", folder / "out.json") if path.exists()]
        if code == 2 and made:
            raise FaultError(f"{argv}: exit code 2, and yet {made[0].name} is there")
        whole(folder / "merged")


def export_file(rng: Random, folder: Path) -> None:
    kind = rng.choice(("csv", "json", "parquet"))
    path = folder / f"x.{kind}"
    data = (stored() / f"all.{kind}").read_bytes()
    if kind == "json" and rng.random() < 0.5:
        path.write_text(json.dumps(damaged(rng, json.loads(data), 3)))
    elif kind == "csv" and rng.random() < 0.5:
        path.write_bytes(damaged_text(rng, data.decode()).encode("utf-8", "surrogatepass"))
    else:
        path.write_bytes(damaged_bytes(rng, data))
    with clean(f"compare with a damaged {kind}"):
        invoke(["compare", str(path), str(stored() / "all.parquet")])


COMMANDS: tuple[tuple[str, ...], ...] = (
    ("list", "cases", "?"),
    ("list", "engines", "?"),
    ("run", "?", "-e", "pymunk", "--set", "duration=0.05"),
    ("run", "incline-block", "-e", "?", "--set", "duration=0.05"),
    ("run", "incline-block", "-e", "pymunk", "--set", "?"),
    ("run", "incline-block", "-e", "pymunk", "--set", "duration=0.05", "--option", "?"),
    ("run", "incline-block", "-e", "pymunk", "--set", "duration=0.05", "--set", "dt=0.01", "--json", "?"),
    ("run", "incline-block", "-e", "pymunk", "--set", "duration=0.05", "--set", "dt=0.01", "--published", "?"),
    ("run", "slip-to-roll", "-e", "dem", "--set", "duration=0.02", "--set", "dt=0.01", "--set", "?"),
    ("converge", "incline-block", "-e", "pymunk", "--set", "duration=0.05", "--halvings", "?"),
    ("converge", "?", "-e", "pymunk"),
    ("compare", "?", "latest", "--store", "STORE"),
    ("compare", "latest", "?", "--store", "STORE"),
    ("compare", "latest", "latest", "--store", "?"),
    ("export", "?", "--csv", "out.csv", "--store", "STORE"),
    ("export", "--json", "?", "--store", "STORE"),
    ("prune", "--keep", "?", "--store", "STORE"),
    ("prune", "--before", "?", "--store", "STORE"),
    ("runs", "--store", "?"),
    ("report", "--store", "?"),
    ("dashboard", "--store", "?"),
    ("dashboard", "--last", "?", "--store", "STORE"),
    ("bench", "?", "--repeats", "1"),
    ("bench", "dem", "--time-limit", "?", "--problem", "nothing-like-this"),
    ("?",),
)


def option_values(rng: Random, folder: Path) -> None:
    """A command with an odd word in one place; options that begin runs are fixed, so that each is short."""
    form = rng.choice(COMMANDS)
    odd = str(
        rng.choice(
            [*ODD_TEXTS, *ODD_NUMBERS, *BUILTIN_CASES, *BUILTIN_ENGINES, "latest~1", "latest~99..latest", "/", "."]
        )
    )
    if "--set" in form and form[form.index("?") - 1] == "--set":
        odd = odd_setting(rng, form[1])
    if form[0] == "run" and form[1] == "?" and odd in ("*", "?", "", "-", "["):
        odd = "no*thing"  # a pattern that matches everything is a long run, not an odd word
    if form[0] == "converge" and odd in ("10", "11", "12"):
        odd = "3"
    argv = [odd if word == "?" else word for word in form]
    argv = [str(stored() / "results") if word == "STORE" else word for word in argv]
    argv = [str(folder / word) if word == "out.csv" else word for word in argv]
    store = folder / "results"
    if form[0] == "run":
        argv += ["--store", str(store)]
    with clean(repr(argv)[:400]):
        code, _ = invoke(argv)
        whole(store)
        if code == 2 and run_ids(store):
            raise FaultError(f"{argv}: wrong usage, and yet a run was stored")


TARGETS: dict[str, tuple[Target, int]] = {
    "scene_json": (scene_json, 22),
    "numerics_json": (numerics_json, 10),
    "wire_request": (wire_request, 8),
    "wire_answer": (wire_answer, 12),
    "settings": (settings, 24),
    "curve_files": (curve_files, 8),
    "checkpoint_file": (checkpoint_file, 3),
    "problem_file": (problem_file, 2),
    "store_files": (store_files, 4),
    "export_file": (export_file, 3),
    "option_values": (option_values, 4),
}
"""Targets and their share of a hundred inputs: the dear ones less often."""


def attempt(name: str, seed: int) -> None:
    """One input: the same for the same seed, in its own folder."""
    target, _ = TARGETS[name]
    with tempfile.TemporaryDirectory(prefix="ninedisk-fuzz-") as folder:
        target(Random(f"{name} {seed}"), Path(folder))
