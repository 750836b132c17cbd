# SPDX-License-Identifier: GPL-3.0-or-later
"""Write Blender's render result to a file of any name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ...atomic_files import disk_of
from ...errors import OutputError, RenderError


def save_render(scene: Any, path: Path) -> None:
    """Write the last render in the scene's format; an existing file is replaced."""
    result = next((i for i in bpy.data.images if i.type == "RENDER_RESULT"), None)
    if result is None:
        raise RenderError(
            "Blender has no render result, so the frame is incomplete. Start the run again."
        )
    try:
        # write_still would expand # and {} in folder names.
        result.save_render(str(path), scene=scene)
    except RuntimeError as error:
        raise OutputError(
            f"Blender cannot write {path}: {str(error).strip()} Choose an output folder that is "
            f"writable, or make room on {disk_of(path)}."
        ) from error
