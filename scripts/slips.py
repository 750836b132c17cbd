#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Put plausible mistakes into a copy of the package, one at a time, and see whether tests fail.

    python scripts/slips.py [--only physics] [--slip NAME ...]

The slips are in scripts/slips/, one file per part of the package. Each names a file, a text that
occurs in it once, the text to put in its place, and the tests that must fail then. The checkout is
not touched.

Exit codes: 0 at least 90 % are caught in each part, 1 fewer, 2 a slip or its tests cannot be run.
"""

from __future__ import annotations

import argparse
import compileall
import os
import py_compile
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LISTS = ROOT / "scripts" / "slips"
PARTS = ("physics", "signal", "blender")
ENOUGH_CAUGHT = 0.9
#: Tests of one slip take seconds; a slip may send them round an endless loop [s].
TIME_LIMIT_S = 180.0
#: What tests of the package read.
COPIED = ("radarsim_addon", "tests", "scripts", "shaders", "docs", "pyproject.toml", "README.md")
CAUGHT, MISSED, CANNOT_RUN = 0, 1, 2


class CannotRunError(Exception):
    """A slip does not fit the code, or its tests fail without it."""


@dataclass(frozen=True)
class Slip:
    """One mistake: `old` in `file` becomes `new`; `tests` (pytest's arguments) must then fail."""

    part: str
    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    seen: str

    @property
    def path(self) -> str:
        """The file, from the checkout's root."""
        return f"radarsim_addon/{self.part}/{self.file}"


def read_slips(folder: Path = LISTS) -> list[Slip]:
    """Return the slips of all parts, in the order of their files."""
    slips = []
    for part in PARTS:
        data = tomllib.loads((folder / f"{part}.toml").read_text("utf-8"))
        for entry in data["slip"]:
            slips.append(Slip(part=part, **entry | {"tests": tuple(entry["tests"])}))
    return slips


def slipped_text(slip: Slip, root: Path) -> str:
    """Return the file's text with the slip in it."""
    text = (root / slip.path).read_text("utf-8")
    found = text.count(slip.old)
    if found != 1:
        raise CannotRunError(
            f"{slip.name}: {slip.old!r} occurs {found} times in {slip.path}; expected once. "
            f"Adapt scripts/slips/{slip.part}.toml to the code."
        )
    return text.replace(slip.old, slip.new)


def copy_checkout(tree: Path) -> None:
    """Copy what the tests need into an empty folder, with bytecode that follows the text."""
    unwanted = shutil.ignore_patterns("__pycache__", "*.pyc", "gui")
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, tree / name, ignore=unwanted)
        else:
            shutil.copy2(ROOT / name, tree / name)
    # By hash: a slip of the same length in the same second must not meet old bytecode.
    by_hash = py_compile.PycInvalidationMode.CHECKED_HASH
    compileall.compile_dir(tree / "radarsim_addon", quiet=2, invalidation_mode=by_hash)


def run_tests(
    tree: Path, tests: Iterable[str], time_limit_s: float | None = TIME_LIMIT_S
) -> tuple[int | None, str]:
    """Return pytest's exit code, None after the time limit, and what it printed."""
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            words,
            cwd=tree,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            timeout=time_limit_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None, f"stopped after {time_limit_s:g} s"
    return done.returncode, done.stdout


def is_caught(slip: Slip, tree: Path) -> bool:
    """Tell whether the tests of a slip fail with it in the tree; the tree is then as before."""
    path = tree / slip.path
    right = path.read_bytes()
    path.write_text(slipped_text(slip, tree), "utf-8")
    try:
        code, printed = run_tests(tree, slip.tests)
    finally:
        path.write_bytes(right)
    if code == 0:
        return False
    # Below 0: a signal. Above 1 pytest could not run: the slip is no Python, or a test is gone.
    if code is None or code == 1 or code < 0:
        return True
    raise CannotRunError(f"{slip.name}: pytest ended with {code}.\n{_tail(printed)}")


def check_without_slips(slips: Sequence[Slip], tree: Path) -> None:
    """Raise unless the tests of all slips pass as the code is."""
    tests = list(dict.fromkeys(test for slip in slips for test in slip.tests))
    # pytest would run a function twice if its file is named too.
    whole = {test for test in tests if "::" not in test}
    tests = [test for test in tests if test in whole or test.partition("::")[0] not in whole]
    code, printed = run_tests(tree, tests, None)
    if code:
        raise CannotRunError(f"tests fail without a slip:\n{_tail(printed)}")


def report(slips: Sequence[Slip], tree: Path) -> dict[str, list[bool]]:
    """Run all slips, print a line for each, and return what was caught by part."""
    results: dict[str, list[bool]] = {}
    for slip in slips:
        start = time.monotonic()
        caught = is_caught(slip, tree)
        results.setdefault(slip.part, []).append(caught)
        word = "caught" if caught else "MISSED"
        print(f"{word}  {slip.part}/{slip.name}  {time.monotonic() - start:.1f} s", flush=True)
        if not caught:
            print(f"        {slip.seen}", flush=True)
    for part, verdicts in results.items():
        print(f"{part}: {sum(verdicts)} of {len(verdicts)} caught")
    return results


def parse_arguments(argv: list[str] | None) -> argparse.Namespace:
    """Options of the command line; argparse exits with 2 for bad ones."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=PARTS, help="slips of this part of the package")
    parser.add_argument("--slip", nargs="+", metavar="NAME", help="these slips")
    parser.add_argument("--list", action="store_true", help="name the slips")
    return parser.parse_args(argv)


def chosen_slips(only: str | None, names: Sequence[str] | None) -> list[Slip]:
    """Return the slips of a part, or those of some names."""
    slips = [slip for slip in read_slips() if only in (None, slip.part)]
    unknown = sorted(set(names or ()) - {slip.name for slip in slips})
    if unknown:
        raise CannotRunError(f"there is no slip {unknown[0]!r}; --list names them")
    return [slip for slip in slips if not names or slip.name in names]


def main(argv: list[str] | None = None) -> int:
    """Run the chosen slips; return the exit code."""
    options = parse_arguments(argv)
    try:
        slips = chosen_slips(options.only, options.slip)
        if options.list:
            for slip in slips:
                print(f"{slip.part}/{slip.name}: {slip.seen}")
            return CAUGHT
        for slip in slips:
            slipped_text(slip, ROOT)
        with tempfile.TemporaryDirectory(prefix="slips_") as folder:
            tree = Path(folder)
            copy_checkout(tree)
            check_without_slips(slips, tree)
            results = report(slips, tree)
    except CannotRunError as error:
        print(f"slips: {error}", file=sys.stderr)
        return CANNOT_RUN
    enough = all(sum(caught) >= ENOUGH_CAUGHT * len(caught) for caught in results.values())
    return CAUGHT if enough else MISSED


def _tail(text: str) -> str:
    return "\n".join(text.strip().splitlines()[-15:])


if __name__ == "__main__":
    raise SystemExit(main())
