# SPDX-License-Identifier: GPL-3.0-or-later
"""Modules of this package as processes of their own. Does not import bpy."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from ... import errors


def python_program() -> str | None:
    """The Python that Blender brings; None where it names another program."""
    return sys.executable if "python" in Path(sys.executable or "").name.lower() else None


def start_worker(module: str, *words: str, **options: Any) -> subprocess.Popen[Any]:
    """Start a module of this package, named from its root; `options` are those of Popen."""
    root = Path(errors.__file__).parent
    return subprocess.Popen(
        [str(python_program()), "-m", f"{root.name}.{module}", *words],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(root.parent), *sys.path])},
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        **options,
    )
