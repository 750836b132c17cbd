#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Print the path of the newest Python that Blender's module (bpy) has a wheel for.
#
#   scripts/find_python.sh [VERSION...]     default: 3.13 3.11, the newest first
#   PYTHON=/path/to/python scripts/find_python.sh
#
# A name on PATH proves nothing: pyenv's shims exist for every version and fail for all but the one
# chosen. So each candidate is run and asked for its version, and for venv and pip. Looked through:
# PATH, the versions next to pyenv's shims, pyenv's, uv's and the system's usual folders.
# Exit codes: 0 found, 2 there is none (the message says what to install).
set -u
supported="3.13 3.11"
wanted=${*:-$supported}

# Prints the real interpreter behind $1 if it is CPython $2 with venv and ensurepip.
probe() {
    [ -x "$1" ] || return 1
    PYTHONPATH='' PYTHONHOME='' "$1" -I -c '
import sys, sysconfig
if "%d.%d" % sys.version_info[:2] != sys.argv[1]: sys.exit(1)
if sys.implementation.name != "cpython" or sys.maxsize < 2**32: sys.exit(1)
if sysconfig.get_config_var("Py_GIL_DISABLED"): sys.exit(1)  # bpy has no free-threaded wheel
import venv, ensurepip
print(getattr(sys, "_base_executable", None) or sys.executable)
' "$2" 2>/dev/null </dev/null
}

if [ -n "${PYTHON:-}" ]; then
    path=$(command -v "$PYTHON" 2>/dev/null) || path=$PYTHON
    for version in $wanted; do
        if found=$(probe "$path" "$version"); then
            echo "$found"
            exit 0
        fi
    done
    echo "find_python: PYTHON=$PYTHON is not a working CPython $(echo "$wanted" | sed 's/ / or /g')" \
        "with venv and pip (it says: $("$path" --version 2>&1 | head -n 1))." \
        "Name another, or leave PYTHON empty to have one looked for." >&2
    exit 2
fi

# Folders to look in, in order: PATH itself first.
folders=$(printf '%s\n' "${PATH:-}" | tr ':' '\n')
space_ifs=$IFS
# A folder may hold a space: split at line ends alone.
IFS='
'
extra=
for folder in $folders; do
    # With another HOME the shims on PATH are the only trace of pyenv: look next to them.
    case $folder in */shims) extra="$extra
${folder%/shims}/versions" ;; esac
done
for root in $extra "${PYENV_ROOT:-/nonexistent}/versions" "${HOME:-/nonexistent}/.pyenv/versions" \
    "${UV_PYTHON_INSTALL_DIR:-/nonexistent}" \
    "${XDG_DATA_HOME:-${HOME:-/nonexistent}/.local/share}/uv/python" /opt/python /opt; do
    for folder in "$root"/*/bin; do
        [ -d "$folder" ] && folders="$folders
$folder"
    done
done
folders="$folders
/usr/local/bin
/usr/bin
/opt/homebrew/bin
/Library/Frameworks/Python.framework/Versions/Current/bin"

IFS=$space_ifs
for version in $wanted; do
    IFS='
'
    for folder in $folders; do
        for name in "python$version" python3 python; do
            if found=$(probe "$folder/$name" "$version"); then
                echo "$found"
                exit 0
            fi
        done
    done
    IFS=$space_ifs
done

echo "find_python: no Python $(echo "$wanted" | sed 's/ / or /g') with venv and pip was found." >&2
cat >&2 <<'MESSAGE'
Blender's Python module (bpy) exists for exactly two of the current versions:
  Python 3.13  -> Blender 5.2 LTS  (best)
  Python 3.11  -> Blender 5.0
There is none for 3.12. Install one of the two, for example
  uv python install 3.13          or    pyenv install 3.13
  apt-get install python3.13-venv (Debian trixie)   python3.11-venv (Debian bookworm)
  brew install python@3.13        (macOS)
and run make again, or name an interpreter: make PYTHON=/path/to/python3.13
MESSAGE
exit 2
