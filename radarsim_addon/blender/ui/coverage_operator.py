# SPDX-License-Identifier: GPL-3.0-or-later
"""Operator that draws the coverage diagram of the active radar over its ground."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...errors import ConfigError, OutputError
from ...signal.pipeline import write_coverage
from ..headless import scene_coverage
from ..plan import CoverageRequest
from .picture_images import COVERAGE_IMAGE, as_image, show_images
from .result_pictures import draw_coverage
from .shown_findings import report_findings, reported


class RADARSIM_OT_coverage(bpy.types.Operator):
    """Draw the echo of a target over the ground below the radar: height against range"""

    bl_idname = "radarsim.coverage"
    bl_label = "Coverage Diagram"
    bl_options = {"REGISTER"}

    lowest: bpy.props.FloatProperty(
        name="Lowest Target [m]", default=0.0, min=0.0, description="Set the first height"
    )
    highest: bpy.props.FloatProperty(
        name="Highest Target [m]", default=60.0, min=0.0, description="Set the last height"
    )
    nearest: bpy.props.FloatProperty(
        name="Nearest Range [m]", default=500.0, min=0.0, description="Set the first range"
    )
    farthest: bpy.props.FloatProperty(
        name="Farthest Range [m]", default=20_000.0, min=0.0, description="Set the last range"
    )
    steps: bpy.props.IntProperty(
        name="Steps", default=400, min=2, max=1500, description="Set the steps of both axes"
    )
    flat: bpy.props.BoolProperty(
        name="Flat Earth",
        default=False,
        description="Take the Earth for flat, as a render does. Off: 4/3 of its radius",
    )
    folder: bpy.props.StringProperty(
        name="Folder",
        default="//",
        subtype="DIR_PATH",
        description="Write picture and numbers there; // is the folder of the .blend file",
    )

    def invoke(self, context: Any, event: Any) -> set[str]:
        return context.window_manager.invoke_props_dialog(self)  # type: ignore[no-any-return]

    def execute(self, context: Any) -> set[str]:
        with reported(self):
            if self.folder.startswith("//") and not bpy.data.filepath:
                raise OutputError(
                    f"The folder {self.folder!r} is relative to the .blend file, which was never "
                    "saved. Save the file, or choose an absolute folder."
                )
            found = scene_coverage(context.scene, context.view_layer, self._request())
            files = write_coverage(found, Path(bpy.path.abspath(self.folder)))
            with np.errstate(divide="ignore"):
                level_db = 10 * np.log10(found.factor)
            picture = draw_coverage(found.range_m, found.height_m, level_db, found.title)
            report_findings(self, list(found.findings))
            self.report({"INFO"}, f"Wrote {', '.join(map(str, files))}")
            image = as_image(COVERAGE_IMAGE, picture)
            if not bpy.app.background:
                show_images(context, [image])
            return {"FINISHED"}
        return {"CANCELLED"}

    def _request(self) -> CoverageRequest:
        for name, low, high in (
            ("heights", self.lowest, self.highest),
            ("ranges", self.nearest, self.farthest),
        ):
            if not low < high:
                raise ConfigError(
                    f"The {name} go from {low:g} to {high:g} m; expected the first below the last."
                )
        return CoverageRequest(
            np.linspace(self.lowest, self.highest, self.steps + 1),
            np.linspace(self.nearest, self.farthest, self.steps + 1),
            flat=self.flat,
        )


CLASSES: tuple[type, ...] = (RADARSIM_OT_coverage,)
