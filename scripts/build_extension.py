# SPDX-License-Identifier: GPL-3.0-or-later
"""Build dist/radarsim-VERSION-PLATFORM.zip, which Blender 4.3 and later install from disk.

    python scripts/build_extension.py [--platforms PLATFORM ...] [--out DIR]

One zip a platform: the add-on and the wheels of scripts/extension_wheels.txt. Built and validated
by Blender's own extension tool, which lies in bpy's wheel and needs no Blender program. The same
sources give the same bytes: entries are sorted and carry one fixed time (SOURCE_DATE_EPOCH, else
1980), whoever builds it and wherever.

Exit codes: 0 built and valid, 1 not (the message says why).
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "radarsim_addon"
#: What an extension carries; anything else in the package's folder is not the extension's.
SUFFIXES = {
    ".py", ".md", ".toml", ".json", ".txt", ".csv", ".npz", ".png", ".blend", ".osl", ".typed",
}  # fmt: skip
#: Platforms of the manifest, and what the names of their wheels match.
PLATFORMS = {
    "linux-x64": r"manylinux.*_x86_64|none-any",
    "windows-x64": r"win_amd64|none-any",
    "macos-arm64": r"macosx.*_arm64|none-any",
}
_EPOCH_1980 = 315532800


class BuildError(Exception):
    """The extension cannot be built; the message says why and how to fix it."""


def extension_tool() -> Path:
    """Blender's ``blender_ext.py``, found in bpy's wheel without importing it."""
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        raise BuildError(
            f"bpy is not installed for {sys.executable}; its wheel holds Blender's extension tool. "
            "Run `make extension`, or pip install '.[blender]' first."
        )
    pattern = "*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
    found = sorted(Path(spec.origin).parent.glob(pattern))
    if not found:
        raise BuildError(f"No {pattern} below {Path(spec.origin).parent}: install bpy again.")
    return found[-1]


def package_files() -> list[Path]:
    """The files of the package that belong to the extension, sorted, relative to the package."""
    return sorted(
        path.relative_to(PACKAGE)
        for path in PACKAGE.rglob("*")
        if path.is_file() and path.suffix in SUFFIXES and "__pycache__" not in path.parts
    )


def read_manifest() -> dict[str, object]:
    """The manifest, checked against the package's own version."""
    path = PACKAGE / "blender_manifest.toml"
    try:
        manifest = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise BuildError(f"{path} is missing: the extension needs its manifest.") from error
    except tomllib.TOMLDecodeError as error:
        raise BuildError(f"{path} is not TOML: {error}") from error
    version = package_version()
    if manifest.get("version") != version:
        raise BuildError(
            f"{path} has version {manifest.get('version')!r}, radarsim_addon/__init__.py has "
            f"{version!r}: write the same in both."
        )
    return manifest


def package_version() -> str:
    """``__version__`` as written in the package, read without importing it."""
    for line in (PACKAGE / "__init__.py").read_text(encoding="utf-8").splitlines():
        if line.startswith("__version__"):
            return line.split("=", 1)[1].strip().strip("\"'")
    raise BuildError(f"{PACKAGE / '__init__.py'} has no line __version__ = ...")


def run_tool(*arguments: str) -> None:
    """Run Blender's extension tool.

    Raises
    ------
    BuildError
        The tool was not content; the message holds what it said.
    """
    done = subprocess.run(
        [sys.executable, str(extension_tool()), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    said = (done.stdout + done.stderr).strip()
    if done.returncode != 0 or "FATAL_ERROR" in said:
        raise BuildError(f"Blender's extension tool refused `{' '.join(arguments)}`:\n{said}")


def normalise(source: Path, target: Path) -> None:
    """Write the archive again with sorted entries and one fixed time, under a temporary name."""
    epoch = max(int(os.environ.get("SOURCE_DATE_EPOCH", _EPOCH_1980)), _EPOCH_1980)
    moment = time.gmtime(epoch)[:6]
    temporary = target.with_name(target.name + ".part")
    with (
        zipfile.ZipFile(source) as old,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as new,
    ):
        for name in sorted(n for n in old.namelist() if not n.endswith("/")):
            entry = zipfile.ZipInfo(name, moment)
            packed = name.endswith(".whl")
            entry.compress_type = zipfile.ZIP_STORED if packed else zipfile.ZIP_DEFLATED
            entry.create_system = 3  # Unix, also when built on Windows
            entry.external_attr = 0o100644 << 16
            new.writestr(entry, old.read(name))
    os.replace(temporary, target)


def wheels_of(platform: str) -> dict[str, str]:
    """The wheels that a platform's archive carries: SHA-256 by file name."""
    lines = (ROOT / "scripts/extension_wheels.txt").read_text(encoding="utf-8").splitlines()
    listed = (line.split() for line in lines if line and not line.startswith("#"))
    pattern = re.compile(PLATFORMS[platform])
    return {name: digest for digest, name in listed if pattern.search(name)}


def fetch_wheel(name: str, digest: str) -> Path:
    """A wheel of the list, downloaded the first time.

    Raises
    ------
    BuildError
        pip cannot download the wheel, or it is not the listed one.
    """
    folder = ROOT / ".cache/wheels"
    path = folder / name
    if not path.exists():
        package, version, python, abi, platforms = name.removesuffix(".whl").split("-")
        number = python.split(".")[-1].removeprefix("cp").removeprefix("py")
        words = ["--python-version", f"{number[0]}.{number[1:]}" if number[1:] else "3.13"]
        for tag in platforms.split("."):
            words += ["--platform", tag]
        done = subprocess.run(
            [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--abi", abi,
             "--only-binary=:all:", *words, "--dest", str(folder), f"{package}=={version}"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if not path.exists():
            raise BuildError(f"pip downloaded no {name}: {(done.stdout + done.stderr)[-500:]}")
    if hashlib.sha256(path.read_bytes()).hexdigest() != digest:
        raise BuildError(f"{path} has another SHA-256 than {digest}: remove it, and build again.")
    return path


def add_wheels(stage: Path, platform: str) -> None:
    """Put a platform's wheels into the staged extension, and name both in its manifest."""
    wheels = wheels_of(platform)
    (stage / "wheels").mkdir()
    for name, digest in wheels.items():
        shutil.copyfile(fetch_wheel(name, digest), stage / "wheels" / name)
    path = stage / "blender_manifest.toml"
    text = re.sub(r"(?m)^platforms = .*$", f'platforms = ["{platform}"]', path.read_text("utf-8"))
    listed = "".join(f'  "./wheels/{name}",\n' for name in sorted(wheels))
    path.write_text(text.replace("\n[", f"\nwheels = [\n{listed}]\n\n[", 1), encoding="utf-8")


def build(out: Path, platform: str) -> Path:
    """Build and validate the extension for a platform.

    Parameters
    ----------
    out
        Folder for the archive; made when missing.
    platform
        One of `PLATFORMS`.

    Returns
    -------
    Path
        ``out/ID-VERSION-PLATFORM.zip``
    """
    manifest = read_manifest()
    out.mkdir(parents=True, exist_ok=True)
    stem = f"{manifest['id']}-{manifest['version']}"
    target = out / f"{stem}-{platform.replace('-', '_')}.zip"
    with tempfile.TemporaryDirectory(prefix="radarsim-build-") as folder:
        stage = Path(folder) / "source"
        for name in package_files():
            (stage / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(PACKAGE / name, stage / name)
        shutil.copyfile(ROOT / "LICENSE", stage / "LICENSE")
        add_wheels(stage, platform)
        raw = Path(folder) / "raw.zip"
        run_tool("build", "--source-dir", str(stage), "--output-filepath", str(raw))
        final = Path(folder) / target.name
        normalise(raw, final)
        run_tool("validate", str(final))
        partial = target.with_name(target.name + ".part")
        shutil.copyfile(final, partial)
        os.replace(partial, target)
    return target


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of the archives")
    parser.add_argument(
        "--platforms", nargs="+", choices=PLATFORMS, default=list(PLATFORMS), metavar="PLATFORM",
        help=f"of {', '.join(PLATFORMS)} (default: all)",
    )  # fmt: skip
    arguments = parser.parse_args(argv)
    try:
        for platform in arguments.platforms:
            target = build(arguments.out, platform)
            print(f"{target}  ({target.stat().st_size / 1e6:.1f} MB, valid)")
    except (BuildError, OSError) as error:
        print(f"build_extension: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
