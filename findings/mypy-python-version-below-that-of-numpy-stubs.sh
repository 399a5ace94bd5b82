#!/usr/bin/env bash
# What: with mypy's python_version = 3.11 NumPy 2.5's stubs make errors in correct code: x.max() "requires at least one argument".
#   No message names the version; with 3.12 the same file has no error.
# Versions: mypy 2.4.1, numpy 2.5.5 (PyPI; NumPy 2.5 needs Python 3.12)
# Why a good guess misses: python_version is the usual way to check a package for the oldest Python that it supports, and pip installs
#   NumPy 2.5 in an environment of Python 3.12 or newer. Stubs that need a newer Python than python_version are read without a warning.
# Documentation: mypy, "The mypy configuration file": python_version is "the Python version used to parse and check the target program".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet --disable-pip-version-check install mypy==2.4.1 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
# Only the stubs are read, so that the wheel is unpacked and need not be importable here.
"$folder/venv/bin/pip" --quiet --disable-pip-version-check download --no-deps --only-binary :all: --python-version 3.13 --dest "$folder" numpy==2.5.5 2> "$folder/pip" ||
  { cat "$folder/pip"; exit 1; }
site=$("$folder/venv/bin/python" -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')
"$folder/venv/bin/python" -m zipfile -e "$folder"/numpy-2.5.5-*.whl "$site"
cat > "$folder/extent.py" <<'PY'
import numpy as np
from numpy.typing import NDArray


def extent(x: NDArray[np.float64]) -> float:
    return float(x.max() - x.min())
PY
cd "$folder"
venv/bin/python - <<'PY'
import subprocess
import sys

print("mypy 2.4.1 on a file with numpy 2.5.5")
counts = {}
for version in ("3.11", "3.12", "3.13"):
    command = [sys.executable, "-m", "mypy", "--strict", "--python-version", version, "extent.py"]
    lines = subprocess.run(command, capture_output=True, text=True).stdout.splitlines()
    errors = [line for line in lines if ": error:" in line]
    counts[version] = len(errors)
    print(f"  python_version = {version}: {len(errors)} errors")
    for line in errors:
        print(f"    {line}")
as_described = counts == {"3.11": 2, "3.12": 0, "3.13": 0}
print("as described: errors for 3.11 alone" if as_described else "changed")
sys.exit(0 if as_described else 1)
PY
