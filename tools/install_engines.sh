#!/usr/bin/env bash
# Install the external engines that this machine can have: Debian packages, and Python packages into an environment.
# What it cannot have is said and left out; the cells of such an engine say not-installed, and everything else runs.
#
#   install_engines.sh PYTHON "DEBIAN PACKAGES" "PYTHON PACKAGES"
#
# It fails where an installation that should work does not, never because an engine does not exist for this machine.
set -euo pipefail
python=$1 debian=$2 packages=$3
left_out=()

leave_out() { left_out+=("$1: $2"); }

if [[ -z $debian ]]; then
  :
elif ! command -v apt-get >/dev/null; then
  for package in $debian; do leave_out "$package" "there is no apt-get here; Debian and its relatives only"; done
elif [[ $(id -u) != 0 ]] && ! command -v sudo >/dev/null; then
  for package in $debian; do leave_out "$package" "it needs root or sudo"; done
else
  as_root=(); [[ $(id -u) == 0 ]] || as_root=(sudo)
  "${as_root[@]}" apt-get -q -o Acquire::Retries=3 update
  known=()
  for package in $debian; do
    if apt-cache show "$package" >/dev/null 2>&1; then known+=("$package"); else leave_out "$package" "no such Debian package here"; fi
  done
  if ((${#known[@]})); then
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
      apt-get -q -y -o Acquire::Retries=3 install --no-install-recommends "${known[@]}"
  fi
fi

for package in $packages; do
  echo "Installing the Python package $package"
  # Wheels only: a build from source would need a compiler and most of an hour.
  if ! said=$("$python" -m pip --disable-pip-version-check --quiet install --only-binary :all: "$package" 2>&1); then
    if grep -qiE "no matching distribution|could not find a version" <<<"$said"; then
      leave_out "$package" "no wheel for this Python and platform"
    else
      printf '%s\n' "$said" >&2
      exit 1
    fi
  fi
done

if ((${#left_out[@]})); then
  echo "Left out:"
  printf '  %s\n' "${left_out[@]}"
fi
