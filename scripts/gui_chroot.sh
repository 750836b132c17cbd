#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make, or reuse, a Debian trixie chroot that holds Blender 4.3.2 and a virtual screen.
#
#   scripts/gui_chroot.sh [DIR]      default DIR: .cache/gui-chroot of this checkout
#
# Prints DIR on the last line. Needs root and debootstrap, about 1.3 GB and one to three minutes the
# first time; no mounts. The packages come from the Debian mirror that this machine's own apt uses
# (or DEBIAN_MIRROR=URL). Exit codes: 0 ready, 1 could not be made, 3 this machine cannot make one.
set -eu

root=$(cd "$(dirname "$0")/.." && pwd)
dir=${1:-$root/.cache/gui-chroot}
suite=trixie
packages="blender xvfb xauth xdotool x11-utils imagemagick python3-openimageio python3-numpy libgl1-mesa-dri libegl1 fonts-dejavu-core"
# The marker holds the list, so that a chroot made from an older list is made again.
marker=$dir/.radarsim-complete

if [ -f "$marker" ] && [ "$(cat "$marker")" = "$suite $packages" ]; then
    echo "$dir"
    exit 0
fi
if [ "$(id -u)" != 0 ]; then
    echo "gui_chroot: needs root (chroot and debootstrap do); run as root or skip 'make gui-test'." >&2
    exit 3
fi
if ! command -v debootstrap >/dev/null 2>&1; then
    echo "gui_chroot: debootstrap is not installed; on Debian or Ubuntu: apt-get install debootstrap" >&2
    exit 3
fi

# Debian's own archive among apt's sources: an address that ends in /debian.
mirror=${DEBIAN_MIRROR:-}
if [ -z "$mirror" ] && command -v apt-get >/dev/null 2>&1; then
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 2>/dev/null |
        grep -E '^https?://[^ ]*/debian/?$' | head -n 1 || true)
fi
if [ -z "$mirror" ]; then
    echo "gui_chroot: apt on this machine names no Debian mirror; give one: DEBIAN_MIRROR=http://HOST/debian" >&2
    exit 3
fi
# debootstrap fetches with wget, which does not know apt's proxy.
if [ -z "${http_proxy:-}" ] && command -v apt-config >/dev/null 2>&1; then
    eval "$(apt-config shell http_proxy Acquire::http::Proxy)"
    case "${http_proxy:-}" in '' | DIRECT) unset http_proxy ;; *) export http_proxy ;; esac
fi

mkdir -p "$(dirname "$dir")"
# Two runs at once must not write into one folder.
exec 9>"$dir.lock"
if command -v flock >/dev/null 2>&1; then
    flock 9
    if [ -f "$marker" ] && [ "$(cat "$marker")" = "$suite $packages" ]; then
        echo "$dir"
        exit 0
    fi
fi

log=$dir.log
echo "gui_chroot: making a $suite chroot with Blender 4.3.2 in $dir (log: $log)" >&2
# Debian's folder or none: never remove something that this script did not make.
if [ -e "$dir" ] && [ ! -e "$dir/.radarsim-chroot" ] && [ -n "$(ls -A "$dir")" ]; then
    echo "gui_chroot: $dir exists and was not made by this script; name another folder." >&2
    exit 1
fi
rm -rf "$dir"
mkdir -p "$dir"
touch "$dir/.radarsim-chroot"

fail() {
    echo "gui_chroot: $1 failed; the end of $log:" >&2
    tail -n 15 "$log" >&2
    exit 1
}

# minbase, then apt inside: apt resolves virtual packages that debootstrap's --include cannot.
debootstrap --variant=minbase "$suite" "$dir" "$mirror" >"$log" 2>&1 || fail debootstrap
in_chroot() {
    env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 \
        DEBIAN_FRONTEND=noninteractive ${http_proxy:+http_proxy="$http_proxy"} chroot "$dir" "$@"
}
# Manuals and translations are never read here.
printf 'path-exclude=/usr/share/%s/*\n' doc man locale info >"$dir/etc/dpkg/dpkg.cfg.d/radarsim"
# No services may be started inside.
printf '#!/bin/sh\nexit 101\n' >"$dir/usr/sbin/policy-rc.d"
chmod +x "$dir/usr/sbin/policy-rc.d"
# shellcheck disable=SC2086  # the list is meant to be split
in_chroot apt-get -o Acquire::Retries=3 -o Dpkg::Options::=--force-unsafe-io \
    install -y --no-install-recommends $packages >>"$log" 2>&1 || fail "apt-get install"
in_chroot apt-get clean >>"$log" 2>&1
in_chroot blender --version >>"$log" 2>&1 || fail "blender --version"
printf '%s' "$suite $packages" >"$marker"
echo "gui_chroot: $(in_chroot blender --version | head -n 1) ready" >&2
echo "$dir"
