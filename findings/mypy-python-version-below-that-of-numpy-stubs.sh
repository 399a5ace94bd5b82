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
pip=("$folder/venv/bin/pip" --quiet --disable-pip-version-check)
"${pip[@]}" install mypy==2.4.1 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
# Only the stubs are read, so that the wheel is unpacked and need not be importable here.
"${pip[@]}" download --no-deps --only-binary :all: --python-version 3.13 --dest "$folder" numpy==2.5.5 2> "$folder/pip" ||
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
echo "mypy 2.4.1 on a file with numpy 2.5.5"
as_described=yes
for version in 3.11 3.12 3.13; do
  errors=$(venv/bin/python -m mypy --strict --python-version "$version" extent.py | grep -c ': error:' || true)
  echo "  python_version = $version: $errors errors"
  if [[ $version == 3.11 ]]; then wanted=2; else wanted=0; fi
  [[ $errors == "$wanted" ]] || as_described=no
done
venv/bin/python -m mypy --strict --python-version 3.11 extent.py | grep ': error:' | sed 's/^/  /' || true
if [[ $as_described == yes ]]; then echo "as described: errors for 3.11 alone"; else echo changed; exit 1; fi
