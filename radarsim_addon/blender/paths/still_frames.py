# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames that are as the one before: their files are written again, without a render.

Blender reports every data-block that it evaluates, also where its values stay the same. If it has
evaluated nothing since the last frame was begun, nothing depends on time, and nobody has changed
anything: renders with the same seeds would give the same rows, and nothing moves in the burst.
"""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import bpy

from ... import contract
from ...motion_record import MotionRecord
from ...sidecar import file_sha256, write_record
from ..scene import may_move_at_whole_frames
from ..state import watch_evaluations

#: Sources of images that change with the frame, which Blender does not report.
_PLAYED = {"SEQUENCE", "MOVIE"}


class StillFrames:
    """What Blender has evaluated since a frame, and the records of that frame.

    `folder` is the run's; `own` are the names of data-blocks that the run itself changes from
    render to render.
    """

    def __init__(self, folder: Path, own: frozenset[str]) -> None:
        self._folder, self._own = folder, own
        self._changed, self._alike = True, False
        self._records: dict[int, tuple[contract.PathsRecord, MotionRecord]] = {}
        self._stop = watch_evaluations(self._note)

    def restore(self) -> list[str]:
        """Stop noting evaluations; may be called again."""
        self._stop()
        return []

    def _note(self, depsgraph: Any) -> None:
        """Note an evaluation; None: some may have been missed."""
        items = [None] if depsgraph is None else [one.id.original for one in depsgraph.updates]
        # settings of the scene itself are the run's
        self._changed |= any(
            not isinstance(item, bpy.types.Scene) and getattr(item, "name", "") not in self._own
            for item in items
        )

    def begin(self) -> None:
        """Begin a frame; the scene shows it already."""
        self._alike = not self._changed and _is_steady()
        if not self._alike:
            self._records.clear()
        self._changed = False

    def holds(self, render: int, offset_s: float) -> bool:
        """Whether a render of this frame's burst would give what was kept; `offset_s` as there."""
        kept = self._records.get(render)
        if not self._alike or kept is None or kept[1].epoch_offset_s != offset_s:
            return False
        return (self._folder / contract.burst_dir(kept[0].frame, render)).is_dir()

    def keep(self, render: int, record: contract.PathsRecord, motion: MotionRecord) -> None:
        """Keep the records of a render."""
        self._records[render] = record, motion

    def write(self, render: int, frame: int, time_s: float) -> contract.PathsRecord:
        """Write the files of a render from those that were kept."""
        record, motion = self._records[render]
        source, target = (
            self._folder / contract.burst_dir(one, render) for one in (record.frame, frame)
        )
        for name in filter(None, (record.table_file, motion.still_bodies_file)):
            shutil.copyfile(source / name, target / name)
        motion_file = target / record.motion_file
        write_record(motion_file, dataclasses.replace(motion, frame=frame, time_s=time_s))
        record = dataclasses.replace(
            record,
            frame=frame,
            time_s=time_s,
            renders=0,
            render_time_s=0.0,
            motion_sha256=file_sha256(motion_file),
            findings=[item.in_frame(frame) for item in record.findings],
        )
        write_record(target / contract.PATHS_FILE, record)
        return record


def _is_steady() -> bool:
    """Whether nothing can change from frame to frame without an evaluation that Blender reports."""
    return not (
        may_move_at_whole_frames()
        or bpy.app.handlers.render_pre
        or any(image.source in _PLAYED for image in bpy.data.images)
        or any(map(_reads_settings, _shader_trees()))
    )


def _shader_trees() -> list[Any]:
    """Node trees of all materials, worlds and lamps, and the groups."""
    owners = (*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights)
    return [*bpy.data.node_groups, *(one.node_tree for one in owners if one.node_tree)]


def _reads_settings(tree: Any) -> bool:
    """Whether a shader reads settings of the scene, such as the frame, that are not radarsim's."""
    return any(
        node.bl_idname == "ShaderNodeScript"
        or (
            node.bl_idname == "ShaderNodeAttribute"
            and node.attribute_type == "VIEW_LAYER"
            and not node.attribute_name.startswith("radarsim_")
        )
        for node in tree.nodes
    )
