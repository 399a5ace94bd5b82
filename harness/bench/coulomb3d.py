"""Suite ``coulomb3d``: contact problems in space from files, solved by ours and by Siconos' solvers.

Everything else is as in the suite ``coulomb`` (`ninedisk.harness.bench.coulomb`): each solver climbs the same ladder of its own
tolerances, and an independent judge decides which of its answers meets a target.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from ninedisk.core.cd.delassus import DelassusProblem
from ninedisk.core.cd.problem_files import read_problem, write_problem
from ninedisk.core.cd.solvers.by_matrix.cone import load_kernels
from ninedisk.core.errors import CoreError
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.text import one_line
from ninedisk.harness.bench.coulomb import BASE, Given, Racer, own_climbs, race, siconos_climbs
from ninedisk.harness.bench.measure import Reporter
from ninedisk.harness.engines.process import SYSTEM_PYTHON
from ninedisk.harness.engines.siconos.adapter import installed_siconos
from ninedisk.harness.results.schema import Row
from ninedisk.harness.terminal import console


def racers() -> list[Racer]:
    """All solvers, installed or not: one that is not says so when it is asked."""
    import ninedisk

    siconos = installed_siconos(SYSTEM_PYTHON)[0] or ""
    return [
        Racer(BASE["coulomb"], "coulomb", partial(own_climbs, "coulomb"), ninedisk.__version__),
        Racer("siconos nsgs", "coulomb", partial(siconos_climbs, "NSGS", 3), siconos, matrix="sparse blocks of 3 x 3"),
        Racer("siconos newton", "coulomb", partial(siconos_climbs, "NSN_AC", 3), siconos, matrix="sparse matrix"),
        Racer("siconos admm", "coulomb", partial(siconos_climbs, "ADMM", 3), siconos, matrix="sparse matrix"),
    ]


def problem_files(folder: Path) -> dict[str, Path]:
    """Files of a folder that hold a contact problem in space, by name; each other one is printed with the reason.

    Raises
    ------
    UsageError
        If the folder cannot be read or holds none.
    """
    if not folder.is_dir():
        raise UsageError(
            f"--files {str(folder)!r} is no folder: give one with contact problems that `ninedisk solve` reads"
        )
    found, left_out = {}, []
    for path in sorted(each for each in folder.iterdir() if each.is_file()):
        try:
            problem = read_problem(path).problem
        except CoreError as error:
            left_out.append(f"{path.name}: {error}")
            continue
        if isinstance(problem, DelassusProblem) and problem.dimension == 3 and problem.n_contacts:
            found[path.name] = path
        else:
            left_out.append(f"{path.name}: its problem is of the plane, or has no contacts")
    if not found:
        why = f" ({left_out[0]})" if left_out else ""
        raise UsageError(f"--files {str(folder)!r} holds no contact problem in 3D{why}")
    for each in left_out:
        console().print(one_line(f"left out: {each}"))
    return found


def run_file(
    path: Path, chosen: Sequence[Racer], *, repeats: int, time_limit: float, notify: Reporter
) -> Iterator[list[Row]]:
    """Rows of the problem in one file: one for each solver and target."""
    problem = read_problem(path).problem
    if not isinstance(problem, DelassusProblem):
        raise TypeError(f"{path} holds bodies of the plane")
    _ = problem.rho, problem.blocks  # made once, by nobody's clock
    load_kernels()
    with tempfile.TemporaryDirectory(prefix="ninedisk-bench-") as folder:
        file = Path(folder) / "problem.npz"
        write_problem(file, problem, "npz")
        facts = {"file": path.name, "disks": 0, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        given = [Given(problem, file, facts)]
        yield race("coulomb3d", given, chosen, repeats=repeats, time_limit=time_limit, notify=notify)
