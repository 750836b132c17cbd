#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Run the tests under every Blender that radarsim supports: 4.5 LTS, 5.0 and 5.2 LTS; or, with
# DO=validate, the validation: the report is that of 5.2, with a table of what the others found.
#
#   scripts/test_all_blenders.sh [PYTEST ARGUMENT...]
#   DO=validate scripts/test_all_blenders.sh
#
# Each has its own environment, .venv-blender-VERSION, because a Python holds one bpy. A version
# whose Python is not on this machine is left out and named.
# BLENDERS="4.5.15 5.2.3" chooses. Exit codes: 0 all passed, 1 some failed, 2 none could be run.
set -u
cd "$(dirname "$0")/.." || exit 2
root=$PWD
ran=
failed=
left_out=

run() { # PYTHON VERSION [PYTEST ARGUMENT...]
    interpreter=$1 version=$2
    shift 2
    case ${DO:-test}-$version in
    validate-5.2.*) "$interpreter" scripts/validate.py ;;
    validate-*) "$interpreter" scripts/validate.py --other-blender ;;
    *) "$interpreter" -m pytest -q "$@" ;;
    esac
}

# The tests of one version start where the last ended: bpy is heavy on memory and cores.
for version in ${BLENDERS:-4.5.15 5.0.1 5.2.3}; do
    case $version in
    4.5.* | 5.0.*) python=3.11 numpy='numpy<2' ;;
    5.2.*) python=3.13 numpy='numpy>=2.2' ;;
    *)
        echo "test_all_blenders: bpy $version is not known here; expected 4.5.x, 5.0.x or 5.2.x" >&2
        exit 2
        ;;
    esac
    if ! interpreter=$(PYTHON='' scripts/find_python.sh $python 2>/dev/null); then
        echo "== Blender $version: left out, no Python $python found"
        left_out="$left_out $version"
        continue
    fi
    venv=$root/.venv-blender-$version
    stamp=$venv/.radarsim-installed
    if [ ! -x "$venv/bin/python" ] || [ ! -f "$stamp" ] || [ "$stamp" -ot pyproject.toml ]; then
        echo "== Blender $version: installing into $venv with Python $python ($interpreter)"
        if ! { [ -x "$venv/bin/python" ] || "$interpreter" -m venv --clear "$venv"; } ||
            ! "$venv/bin/python" -m pip install -q -q --disable-pip-version-check --retries 5 \
                --editable '.[dev]' "bpy==$version" "$numpy" ||
            ! "$venv/bin/python" scripts/check_system.py; then
            echo "== Blender $version: FAILED to install" >&2
            failed="$failed $version"
            continue
        fi
        touch "$stamp"
    fi
    echo "== Blender $version"
    if run "$venv/bin/python" "$version" "$@"; then
        ran="$ran $version"
    else
        failed="$failed $version"
    fi
done

echo "== passed:${ran:- none}; failed:${failed:- none}; left out:${left_out:- none}"
[ -z "$failed" ] || exit 1
[ -n "$ran" ] || exit 2
