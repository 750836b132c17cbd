#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make a virtual environment and install radarsim with Blender and the developers' tools into it.
#
#   scripts/install.sh VENV [PYTHON] [PIP_FLAGS]      called by make
set -eu
cd "$(dirname "$0")/.."
venv=$1
flags=${3:-}
start=$(date +%s)

python=$(PYTHON="${2:-}" scripts/find_python.sh)
version=$("$python" -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])')
echo "radarsim: using Python $version ($python)"
echo "radarsim: installing into $venv; Blender's module is about 400 MB to fetch the first time"
# An environment made with another version of Python is no use: its packages would not be found.
if ! "$venv/bin/python" -c "import sys; sys.exit('%d.%d.%d' % sys.version_info[:3] != '$version')" 2>/dev/null; then
    "$python" -m venv --clear "$venv"
fi
# shellcheck disable=SC2086  # the flags are meant to be split
if ! "$venv/bin/python" -m pip install $flags --editable '.[blender,dev]'; then
    echo "radarsim: pip could not install what pyproject.toml names (see above); run make" \
        "again to resume" >&2
    exit 1
fi
"$venv/bin/python" scripts/check_system.py
echo "radarsim: installed in $(($(date +%s) - start)) s"
