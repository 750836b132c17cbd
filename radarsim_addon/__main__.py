# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``radarsim`` command, which joins both halves: ``python -m radarsim_addon`` is the same.

Exit codes: 0 done, 1 failed, 2 bad arguments, 130 stopped by Ctrl-C, 143 by SIGTERM; on stderr
``radarsim: Name: message``.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from typing import Any

from .errors import MissingDependencyError, RadarSimError
from .findings import exit_code
from .options import Share, share_of
from .terminal import error_line


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        # A BLAS rounds otherwise with each number of threads: results would depend on the machine.
        os.environ.setdefault(name, "1")
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["render"]:
        return render_command(words[1:])
    if words[:1] == ["coverage"]:
        return coverage_command(words[1:])
    if words[:1] == ["selfcheck"]:
        return selfcheck_command(words[1:])
    from .processes import keep_freed_memory
    from .signal.pipeline import main as process_main

    keep_freed_memory()
    if arguments is None:  # killed politely: what is half written is removed
        signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    others = {"render": "measure the radar frames of a .blend file (needs bpy)"}
    others["coverage"] = "coverage diagram of a radar over its ground (needs bpy)"
    others["selfcheck"] = "check that a device gives what measurements stand on (needs bpy)"
    return process_main(words, others)


def render_command(
    words: list[str], prog: str = "radarsim render", needs_blend: bool = True
) -> int:
    """Measure a .blend file; ends the process with the exit code once Blender runs in it."""
    from .processes import importing

    with importing():
        from .blender.plan import parse_render_arguments

    parsed = parse_render_arguments(words, prog, needs_blend)  # exits with 0 (--help) or 2
    share = share_of(parsed)
    if share.by_workers and not (parsed.frame_worker or parsed.plan_only):
        return _render_by_workers(words, share, parsed.process)
    if parsed.frame_worker:  # in a Blender program; Python runs the module itself
        from .frame_worker import serve

        return serve(os.getcwd(), ["render", *words])
    try:
        with importing():
            from .blender.headless.render import run_and_leave
    except ModuleNotFoundError as error:
        return _no_bpy(error)
    run_and_leave(parsed)
    return 0


def _render_by_workers(words: list[str], share: Share, process: bool) -> int:
    """Give the frames to workers. This process needs no Blender, unless it runs in that program."""
    from .coordinator import run_frames

    if process:  # what is missing is told before the renders; else the workers start sooner
        from .signal.pipeline import main as process_main
    command = None
    if "bpy" in sys.modules:  # the program, with a file open: its workers are such programs
        from .blender.headless.session import check_workers

        bpy: Any = sys.modules["bpy"]
        try:
            check_workers(opened_here=not bpy.data.filepath)
        except RadarSimError as error:
            print(error_line(error), file=sys.stderr)
            return error.exit_code
        words = [bpy.data.filepath, *words]
        own = sys.argv if "--" in sys.argv else [*sys.argv, "--"]
        command = [bpy.app.binary_path, *own[1:], "--frame-worker"]
    try:
        replies: list[dict[str, Any]] = []
        about = run_frames(["render", *words], share, sys.stdout, replies.append, command)
    except RadarSimError as error:
        print(error_line(error), file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt as stop:
        print(
            "radarsim: Interrupted; the same command resumes the run (without --overwrite).",
            file=sys.stderr,
        )
        return getattr(stop, "exit_code", 130)
    from .signal.runs import done_before_text, frame_findings, open_run

    run = open_run(about["folder"])
    if earlier := sorted(reply["frame"] for reply in replies if reply.get("earlier")):
        print(f"radarsim: {done_before_text(run, earlier)}", flush=True)
    print(f"radarsim: wrote {about['folder']}", flush=True)
    processed = process_main(["process", about["folder"], *share.words]) if process else 0
    found = [*run.record.findings, *frame_findings(run.path, about["frames"])]
    return max(processed, exit_code(found, about["frames"]))


def selfcheck_command(words: list[str]) -> int:
    """Check a device; return the exit code."""
    from .blender.plan import parse_selfcheck_arguments

    kind = parse_selfcheck_arguments(words)  # exits with 0 (--help) or 2
    try:
        from .blender.headless.selfcheck import main as selfcheck
    except ModuleNotFoundError as error:
        return _no_bpy(error)
    return selfcheck(kind)


def coverage_command(words: list[str]) -> int:
    """Draw the coverage diagram of a .blend file; ends the process once Blender runs in it."""
    from .blender.plan import parse_coverage_arguments

    parsed = parse_coverage_arguments(words)  # exits with 0 (--help) or 2
    try:
        from .blender.headless.coverage import run_and_leave
    except ModuleNotFoundError as error:
        return _no_bpy(error, "press Radar > Results > Coverage Diagram in Blender")
    run_and_leave(parsed)
    return 0


def _no_bpy(
    error: ModuleNotFoundError,
    instead: str = "run blender -b FILE -P scripts/render_radar.py -- --out DIR",
) -> int:
    """Tell that bpy is missing; raise an error about any other module again."""
    if error.name != "bpy":
        raise error
    remedy = "Install it with pip install '.[blender]'"
    if sys.version_info[:2] not in ((3, 13), (3, 11)):
        own = ".".join(map(str, sys.version_info[:2]))
        remedy = (
            f"There is none for Python {own}. Use Python 3.13 or 3.11, for example by "
            "uv python install 3.13, uv venv --python 3.13 and uv pip install '.[blender]'"
        )
    message = f"bpy cannot be imported ({error}). {remedy}. Or {instead}."
    print(f"radarsim: {MissingDependencyError.__name__}: {message}", file=sys.stderr)
    return MissingDependencyError.exit_code


if __name__ == "__main__":
    sys.exit(main())
