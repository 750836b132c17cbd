# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs cases under one checkout, each command in a Python of its own."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scripts.comparison.cases import DATA, Case, Processing
from scripts.comparison.names import Renames, compared
from scripts.comparison.reading import COLUMNS_FILE, Place, Values, read_folder

#: Longest time of one command [s]; a case takes seconds, the demo a minute or two.
TIMEOUT_S = 1800
_PROBE = """
import json, sys, numpy, bpy, radarsim_addon
print(json.dumps({"package": radarsim_addon.__file__, "blender": bpy.app.version_string,
                  "python": sys.version.split()[0], "numpy": numpy.__version__}))
"""
#: Writes the columns of each table of paths next to it, whatever the form of its file.
_COLUMNS = """
import pathlib, sys, numpy
from radarsim_addon.signal.paths import open_frame_table
for sidecar in pathlib.Path(sys.argv[1]).glob("frames/*/paths.json"):
    table = open_frame_table(sidecar.parent, int(sidecar.parent.name.removeprefix("frame_")))[1]
    names = getattr(table, "dtype", None) and table.dtype.names or tuple(table)
    numpy.savez(sidecar.with_name(sys.argv[2]), **{name: table[name] for name in names})
"""


class CannotRunError(Exception):
    """A checkout, a case or a command that cannot be run; the message says why."""


@dataclass(frozen=True)
class Checkout:
    """A checkout of the project, and the Python with bpy that runs it.

    Attributes
    ----------
    root
        Folder that holds ``radarsim_addon``.
    python
        Interpreter.
    user_folder
        Folder in place of the user's own Blender settings.
    versions
        Of Blender, Python and numpy.
    options
        Options that ``process --help`` lists, with their choices.
    """

    root: Path
    python: str
    user_folder: Path
    versions: dict[str, str]
    options: Mapping[str, frozenset[str]]

    def environment(self) -> dict[str, str]:
        """For the commands: this checkout's package, one thread for sums, no user's settings."""
        return _environment(self.root, self.user_folder)


def _environment(root: Path, user_folder: Path) -> dict[str, str]:
    # How a sum over threads is split depends on the machine's cores, and so does its last bit.
    # Cycles' pixels do not: its threads stay.
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    return {
        **os.environ,
        **dict.fromkeys(threads, "1"),
        "PYTHONPATH": str(root),
        "PYTHONNOUSERSITE": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
        "BLENDER_USER_RESOURCES": str(user_folder),
        "NO_COLOR": "1",
        "COLUMNS": "200",
    }


def _call(words: list[str], environment: dict[str, str], folder: Path) -> str:
    """Run a command in a folder; returns its output, or raises CannotRunError."""
    try:
        done = subprocess.run(
            words, cwd=folder, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CannotRunError(f"{words[0]}: {error}") from error
    if done.returncode:
        last = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()][-8:]
        said = "\n    ".join(last)
        raise CannotRunError(f"{' '.join(words)} ended with {done.returncode}:\n    {said}")
    return done.stdout


def open_checkout(root: Path, python: str, work: Path) -> Checkout:
    """Look at a checkout: which Blender runs it, which options it knows.

    Raises
    ------
    CannotRunError
        No checkout, no bpy, or another package than the checkout's is imported.
    """
    root = root.resolve()
    if not (root / "radarsim_addon" / "__init__.py").is_file():
        raise CannotRunError(f"{root} is no checkout: it has no radarsim_addon.")
    work.mkdir(parents=True, exist_ok=True)
    user_folder = work / "blender_user"
    user_folder.mkdir(exist_ok=True)
    environment = _environment(root, user_folder)
    probed = json.loads(_call([python, "-c", _PROBE], environment, work).splitlines()[-1])
    package = Path(probed.pop("package")).resolve()
    if not package.is_relative_to(root):
        raise CannotRunError(f"{python} imports {package}, which is not in {root}.")
    text = _call([python, "-m", "radarsim_addon", "process", "--help"], environment, work)
    return Checkout(root, python, user_folder, probed, listed_options(text))


def listed_options(help_text: str) -> dict[str, frozenset[str]]:
    """Options that a help text lists, each with its choices; none: any value, or no value."""
    listed: dict[str, frozenset[str]] = {}
    for name, choices in re.findall(r"(--[a-z0-9][a-z0-9-]*)(?: \{([^}]*)\})?", help_text):
        found = frozenset(choices.split(",")) if choices else frozenset()
        listed[name] = listed.get(name, frozenset()) | found
    return listed


def option_words(
    given: tuple[str, ...], known: Mapping[str, frozenset[str]], renames: Renames, data: Path
) -> list[str]:
    """Options of a case as another version calls them.

    Parameters
    ----------
    given
        ``--name`` or ``--name=value``; ``{data}`` in a value is the folder `data`.
    known
        What the version's help lists, see `listed_options`.
    renames
        Its `options` say what to take instead of what is not listed.

    Raises
    ------
    CannotRunError
        The version knows neither name.
    """

    def is_known(word: str) -> bool:
        name, _, value = word.partition("=")
        return name in known and (not known[name] or value in known[name])

    words = []
    for word in given:
        name, equals, value = word.partition("=")
        other = f"{renames.options.get(name, name)}{equals}{value}"
        names = [word, renames.options.get(word, word), other]
        fitting = [candidate for candidate in names if is_known(candidate)]
        if not fitting:
            raise CannotRunError(
                f"process does not know {word}. Say in renames.json, options, what it is called."
            )
        words.append(fitting[0].replace("{data}", str(data)))
    return words


def run_case(case: Case, checkout: Checkout, folder: Path, renames: Renames) -> float:
    """Render and process a case into an empty folder; returns the seconds that it took.

    Raises
    ------
    CannotRunError
        A command failed.
    """
    folder.mkdir(parents=True)
    start = time.perf_counter()
    environment = checkout.environment()
    if case.scene is None:
        script = checkout.root / "scripts" / "demo.py"
        _call([checkout.python, str(script), "--out", str(folder / "demo")], environment, folder)
        return time.perf_counter() - start
    if not case.scene.is_file():
        raise CannotRunError(f"{case.scene} is missing.")
    script = checkout.root / "scripts" / "render_radar.py"
    command = [str(script)] if script.is_file() else ["-m", "radarsim_addon", "render"]
    run = folder / "run"
    _call(
        [checkout.python, *command, str(case.scene), "--out", str(run)],
        environment,
        folder,
    )
    columns = [checkout.python, "-c", _COLUMNS, str(run), COLUMNS_FILE]
    _call(columns, environment, folder)
    for processing in case.processings:
        _process(processing, checkout, run, folder / processing.name, renames)
    return time.perf_counter() - start


def _process(
    processing: Processing, checkout: Checkout, run: Path, out: Path, renames: Renames
) -> None:
    words = option_words(("--no-plots", *processing.options), checkout.options, renames, DATA)
    command = [checkout.python, "-m", "radarsim_addon", "process", str(run), "--out", str(out)]
    _call([*command, *words], checkout.environment(), out.parent)


def results_of(
    case: Case, checkout: Checkout, folder: Path, renames: Renames
) -> dict[Place, Values]:
    """Run a case and read all that is compared.

    Raises
    ------
    CannotRunError
        A command failed, or a file cannot be read.
    """
    seconds = run_case(case, checkout, folder, renames)
    try:
        found = compared(read_folder(folder))
    except (ValueError, OSError) as error:
        raise CannotRunError(str(error)) from error
    count = sum(values.size for values in found.values())
    print(f"{case.name}: {checkout.root.name}, {seconds:.1f} s, {count} values", file=sys.stderr)
    return found
