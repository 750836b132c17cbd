# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``radarsim`` command, which joins both halves: ``python -m radarsim_addon`` is the same.

Exit codes: 0 done, 1 failed, 2 bad arguments, 130 stopped by Ctrl-C, 143 by SIGTERM; on stderr
``radarsim: Name: message``.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

from .errors import MissingDependencyError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["render"]:
        return render_command(words[1:])
    if words[:1] == ["selfcheck"]:
        return selfcheck_command(words[1:])
    from .signal.pipeline import main as process_main

    if arguments is None:  # killed politely: what is half written is removed
        signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    others = {"render": "measure the radar frames of a .blend file (needs bpy)"}
    others["selfcheck"] = "check that a device gives what measurements stand on (needs bpy)"
    return process_main(words, others)


def render_command(
    words: list[str], prog: str = "radarsim render", needs_blend: bool = True
) -> int:
    """Measure a .blend file; ends the process with the exit code once Blender runs in it."""
    from .blender.plan import parse_render_arguments

    parsed = parse_render_arguments(words, prog, needs_blend)  # exits with 0 (--help) or 2
    try:
        from .blender.headless.render import run_and_leave
    except ModuleNotFoundError as error:
        if error.name != "bpy":
            raise
        return _no_bpy(error)
    run_and_leave(parsed)
    return 0


def selfcheck_command(words: list[str]) -> int:
    """Check a device; return the exit code."""
    try:
        from .blender.headless.selfcheck import main as selfcheck
    except ModuleNotFoundError as error:
        if error.name != "bpy":
            raise
        return _no_bpy(error)
    return selfcheck(words)


def _no_bpy(error: ModuleNotFoundError) -> int:
    message = (
        f"bpy cannot be imported ({error}). Install it with pip install '.[blender]' (Python "
        "3.13 or 3.11), or run blender -b FILE -P scripts/render_radar.py -- --out DIR."
    )
    print(f"radarsim: {MissingDependencyError.__name__}: {message}", file=sys.stderr)
    return MissingDependencyError.exit_code


if __name__ == "__main__":
    sys.exit(main())
