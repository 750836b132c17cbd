# SPDX-License-Identifier: GPL-3.0-or-later
"""Say which system libraries Blender's Python module lacks, and which packages bring them.

    python scripts/check_system.py [--quiet]

bpy's wheel carries most libraries, but not those of the X window system, which a bare server or
container does not have; importing bpy would then end in an ImportError that names one of them.
The dynamic loader is asked (``ldd``) without importing anything. Standard library only.

Exit codes: 0 all there (or no way to tell), 1 something is missing.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

#: Debian and Ubuntu packages by library; the same sonames hold on both.
DEBIAN_PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libGLX.so.0": "libglx0",
    "libGLdispatch.so.0": "libglvnd0",
    "libICE.so.6": "libice6",
    "libSM.so.6": "libsm6",
    "libX11.so.6": "libx11-6",
    "libXau.so.6": "libxau6",
    "libXcursor.so.1": "libxcursor1",
    "libXdmcp.so.6": "libxdmcp6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXinerama.so.1": "libxinerama1",
    "libXrandr.so.2": "libxrandr2",
    "libXrender.so.1": "libxrender1",
    "libXt.so.6": "libxt6",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libbsd.so.0": "libbsd0",
    "libdecor-0.so.0": "libdecor-0-0",
    "libgcc_s.so.1": "libgcc-s1",
    "libgomp.so.1": "libgomp1",
    "libmd.so.0": "libmd0",
    "libstdc++.so.6": "libstdc++6",
    "libuuid.so.1": "libuuid1",
    "libwayland-client.so.0": "libwayland-client0",
    "libxcb.so.1": "libxcb1",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libz.so.1": "zlib1g",
}

_MISSING = re.compile(r"^\s*(\S+) => not found")
_OLD = re.compile(r"version `(\S+)' not found")


def parse_ldd(output: str) -> tuple[list[str], list[str]]:
    """Read what ``ldd`` prints.

    Returns
    -------
    tuple
        Libraries that were not found, and symbol versions (``GLIBC_2.28``) that the ones found
        are too old for; both sorted, each once.
    """
    missing = {m[1] for line in output.splitlines() if (m := _MISSING.match(line))}
    old = {m[1] for line in output.splitlines() if (m := _OLD.search(line))}
    return sorted(missing), sorted(old)


def report(missing: Iterable[str], too_old: Iterable[str] = ()) -> str:
    """The message for a user: libraries by name, the command that brings them. Empty: all there."""
    missing, too_old = list(missing), list(too_old)
    lines: list[str] = []
    if missing:
        lines.append("Blender's Python module (bpy) needs system libraries that are not installed:")
        width = max(len(name) for name in missing)
        for name in missing:
            package = DEBIAN_PACKAGES.get(name, "(search: apt-file search " + name + ")")
            lines.append(f"  {name:<{width}}  {package}")
        packages = sorted({DEBIAN_PACKAGES[name] for name in missing if name in DEBIAN_PACKAGES})
        if packages:
            lines.append("On Debian or Ubuntu, as root:")
            lines.append("  apt-get update && apt-get install -y " + " ".join(packages))
        lines.append("Elsewhere, the packages that hold the libraries named at the left.")
    if too_old:
        lines.append(
            "This system's C or C++ library is too old for bpy: it lacks "
            + ", ".join(too_old)
            + ". Use a newer system (Blender asks for glibc 2.28 or later), or Python 3.11, "
            "which gets an older Blender."
        )
    return "\n".join(lines)


def bpy_library() -> Path | None:
    """bpy's shared library as installed for this Python, found without importing it."""
    spec = importlib.util.find_spec("bpy")
    return Path(spec.origin) if spec and spec.origin else None


def check(library: Path, ldd: str = "ldd") -> str:
    """The report for one shared library; empty where all is there or there is no ``ldd``."""
    program = shutil.which(ldd)
    if program is None:
        return ""
    done = subprocess.run(
        [program, str(library)],
        capture_output=True,
        text=True,
        check=False,
        env={"LC_ALL": "C", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"},
    )
    # musl (Alpine) says "Error loading shared library X: No such file or directory".
    musl = re.findall(r"Error loading shared library (\S+?):", done.stdout + done.stderr)
    missing, too_old = parse_ldd(done.stdout + done.stderr)
    return report(sorted({*missing, *musl}), too_old)


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quiet", action="store_true", help="say nothing when all is there")
    arguments = parser.parse_args(argv)
    library = bpy_library()
    if library is None:
        print(
            f"check_system: bpy is not installed for {sys.executable}. "
            "Install it with: pip install '.[blender]' (Python 3.13 or 3.11).",
            file=sys.stderr,
        )
        return 1
    message = check(library) if sys.platform.startswith("linux") else ""
    if message:
        print(message, file=sys.stderr)
        return 1
    if not arguments.quiet:
        print(f"check_system: bpy {importlib.metadata.version('bpy')} finds its system libraries")
    return 0


if __name__ == "__main__":
    sys.exit(main())
