#!/usr/bin/env bash
# Run a command in a clean Debian beside this one, on a clone of this tree.
#
#   sudo tools/clean_debian.sh FOLDER [RELEASE [COMMAND ...]]
#
# FOLDER gets the Debian release (trixie is 13, bookworm 12; debootstrap, some 2 GB with the engines), and in /opt/ninedisk a clone of
# HEAD. COMMAND runs there; without one, the two commands of the README that install ninedisk and give its first result. The settings of
# apt, pip, npm and of certificates come from this machine. A FOLDER that holds a release already is used again, with a new clone.
set -euo pipefail

usage() { sed -n '2,8s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"; }
case ${1:-} in
  -h | --help) usage; exit 0 ;;
  "" | -*) usage >&2; exit 2 ;;
esac
folder=$(realpath -m "$1")
release=${2:-trixie}
shift $(($# < 2 ? $# : 2))
tree=$(git -C "$(dirname "${BASH_SOURCE[0]}")" rev-parse --show-toplevel)

fail() { echo "clean_debian: $1" >&2; exit 2; }
[[ $(id -u) == 0 ]] || fail "debootstrap and chroot need root: run it with sudo"
command -v debootstrap >/dev/null || fail "debootstrap is not installed: apt-get install debootstrap"
[[ -e /usr/share/debootstrap/scripts/$release ]] || fail "debootstrap knows no release $release; for example trixie (13), bookworm (12)"
if [[ -e $folder && ! -e $folder/etc/debian_version && -n $(ls -A "$folder") ]]; then
  fail "$folder is not empty and holds no Debian: name another folder"
fi

if [[ ! -e $folder/etc/debian_version ]]; then
  mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' | head -1)
  debootstrap --variant=minbase --include=ca-certificates,git,python3,python3-venv "$release" "$folder" "$mirror"
fi

for at in proc sys dev; do
  mountpoint -q "$folder/$at" || mount --rbind "/$at" "$folder/$at"
  mount --make-rslave "$folder/$at"
done
trap 'for at in proc sys dev; do umount -l "$folder/$at"; done' EXIT

# What a machine behind a proxy or with packages of its own needs: resolver, certificates, settings of pip and npm.
for file in /etc/resolv.conf /etc/hosts /etc/pip.conf /etc/npmrc /etc/ssl/certs/ca-certificates.crt; do
  if [[ -e $file ]]; then mkdir -p "$folder${file%/*}" && cp -L "$file" "$folder$file"; fi
done
if [[ -d /etc/apt/apt.conf.d ]]; then cp -n /etc/apt/apt.conf.d/* "$folder/etc/apt/apt.conf.d/"; fi

rm -rf "$folder/opt/ninedisk"
git clone --quiet "$tree" "$folder/opt/ninedisk"
first='python3 -m venv /opt/venv && . /opt/venv/bin/activate && pip install -q . && ninedisk check-engine --engine-cmd "python3 docs/examples/spring_dem.py"'
if (($# == 0)); then set -- bash -c "$first"; fi
echo "clean_debian: Debian $(cat "$folder/etc/debian_version"), $(chroot "$folder" python3 --version)"
chroot "$folder" bash -c 'cd /opt/ninedisk && exec "$@"' bash "$@"
