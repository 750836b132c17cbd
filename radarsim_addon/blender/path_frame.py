# SPDX-License-Identifier: GPL-3.0-or-later
"""One radar frame of the acquisition "paths": its tiles measured, refined, joined into a table."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import contract
from ..errors import OutputError
from ..sidecar import file_sha256, write_record
from ..signal.pathtable import write_table
from .acquisition import Instant
from .object_motion import ObjectMotion, Poses
from .path_gates import RenderRequest
from .path_options import FINEST_PITCH
from .path_quality import QualitySums
from .path_scene import ViewWindow
from .path_tiles import CellGrid, ErrorBudget, quarters, split_frame
from .path_unseen import Rectangle, unseen_warning, view_rectangles
from .vertex_objects import VertexObjects

if TYPE_CHECKING:
    from .path_job import PathJob

#: Share of the squared error that one round of refinement goes for.
_ROUND_SHARE = 0.8
#: Pixels across an object's shorter side below which it may slip between the rays.
_PIXELS_ACROSS = 2.0
#: In a scene of more objects in sight, none of them is looked after by itself.
_MOST_RECTANGLES = 256


@dataclasses.dataclass(frozen=True)
class PathTask:
    """One render of a view."""

    frame: int
    instant: Instant
    tile: int
    shift: int
    request: RenderRequest

    @property
    def exr_path(self) -> str:
        """What an error message calls this render."""
        return f"{contract.frame_dir(self.frame)}, tile {self.tile}, shift {self.shift}"


@dataclasses.dataclass
class _Tile:
    window: ViewWindow
    level: int
    parts: list[Path] = dataclasses.field(default_factory=list)


class FrameWork:
    """Tiles of one radar frame: measured, refined, joined into one table."""

    def __init__(
        self,
        job: PathJob,
        frame: int,
        instant: Instant,
        camera: contract.CameraRecord,
        emitter: contract.EmitterRecord,
        motion: ObjectMotion | None,
        poses: Poses,
        labels: VertexObjects | None,
    ) -> None:
        self._job, self._frame, self._instant = job, frame, instant
        self._camera, self._emitter, self._motion = camera, emitter, motion
        self._poses, self._labels = poses, labels
        self._emitter_m = np.array(emitter.matrix_world, dtype=np.float64)[:3, 3]
        self._folder = job.folder / contract.frame_dir(frame)
        self._tiles: dict[int, _Tile] = {}
        self._rectangles = view_rectangles(
            poses, job.path_scene.objects if job.path_scene else [], camera, _MOST_RECTANGLES
        )
        self._next_number = 0
        self._quality: dict[int, QualitySums] = {}
        resolution_m = job.measurement.waveform.range_resolution_m
        reach_m = job.plan.rings * job.measurement.ring_step_m
        self._grid = CellGrid(resolution_m, min(int(reach_m / resolution_m) + 1, 1 << 20))
        self._budget = ErrorBudget(self._grid.first_object, job.options.refine_by)

    def run(self, start_s: float) -> Generator[PathTask, None, None]:
        options = self._job.options
        measurement = self._job.measurement
        whole = ViewWindow(
            self._camera.left,
            self._camera.right,
            self._camera.bottom,
            self._camera.top,
            measurement.width_px,
            measurement.height_px,
        )
        try:
            for window in split_frame(whole, options.tile_px):
                yield from self._measure(_Tile(window, 0))
            reached = "all tiles"
            if options.refines:
                reached = yield from self._refine(start_s)
            self._write(reached, time.monotonic() - start_s)
        finally:
            for tile in self._tiles.values():
                for part in tile.parts:
                    part.unlink(missing_ok=True)

    def _refine(self, start_s: float) -> Generator[PathTask, None, str]:
        """Split the worst tiles until a limit is reached; returns which one it was."""
        options = self._job.options
        while True:
            open_tiles = [
                number
                for number, tile in self._tiles.items()
                if tile.level < options.max_level and tile.window.pitch / 2 >= FINEST_PITCH
            ]
            worst = self._blind(open_tiles) or self._budget.worst(open_tiles, _ROUND_SHARE)
            done = self._budget.relative_error() <= options.error_target
            if options.error_target and done and not self._blind(open_tiles):
                return "error target"
            if not worst:
                return "finest pixels"
            self._job.total += 4 * len(worst)
            for number in worst:
                if options.time_budget_s and time.monotonic() - start_s > options.time_budget_s:
                    return "time budget"
                # The four take the tile's place only when all of them are measured.
                parent = self._tiles[number]
                for window in quarters(parent.window):
                    yield from self._measure(_Tile(window, parent.level + 1))
                del self._tiles[number], self._budget.powers[number], self._quality[number]
                for part in parent.parts:
                    part.unlink(missing_ok=True)

    def _blind(self, open_tiles: list[int]) -> list[int]:
        """Tiles that cannot know the error of an object in them.

        An object that slips between all rays of a tile leaves no trace there, not in its error
        either. So tiles with pixels larger than half an object in sight are split; and the parts
        of an object of up to two tiles are measured with pixels of one size, or a corner of it in
        a coarser tile would be missing.
        """
        wanted = set()
        for seen in self._rectangles:
            touched = [n for n, tile in self._tiles.items() if _overlap(tile.window, seen)]
            finest = max((self._tiles[n].level for n in touched), default=0)
            side = min(seen.right - seen.left, seen.top - seen.bottom)
            for number in touched:
                window = self._tiles[number].window
                small = side < _PIXELS_ACROSS * window.pitch
                split = self._tiles[number].level < finest and (
                    seen.right - seen.left <= 2 * (window.right - window.left)
                    and seen.top - seen.bottom <= 2 * (window.top - window.bottom)
                )
                if small or split:
                    wanted.add(number)
        return [number for number in open_tiles if number in wanted]

    def _measure(self, tile: _Tile) -> Generator[PathTask, None, None]:
        number, self._next_number = self._next_number, self._next_number + 1
        quality = QualitySums()
        shifts = []
        for shift in range(self._job.options.shifts):
            rows = yield from self._job.view_tasks(
                self._frame,
                self._instant,
                number,
                tile.window,
                shift,
                self._emitter_m,
                quality,
            )
            if self._labels is not None:
                self._labels.label(rows)
            if self._motion is not None:
                receiver_m = np.array(self._camera.matrix_world)[:3, 3]
                self._motion.fill_range_rates(rows, receiver_m, self._emitter_m)
            quality.add_rows(rows)
            shifts.append(rows)
        self._tiles[number] = tile
        self._quality[number] = quality
        self._budget.powers[number] = self._grid.powers(shifts)
        part = self._folder / f"paths_{number:07d}.npy.part"
        try:
            with open(part, "wb") as stream:
                np.save(stream, np.concatenate(shifts), allow_pickle=False)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise OutputError(
                f"Cannot write {part}: {error.strerror or error}. "
                "Choose an output folder that exists, is writable and has room."
            ) from error
        tile.parts.append(part)
        self._job.done += 1

    def _write(self, reached: str, seconds: float) -> None:
        job = self._job
        table = self._folder / contract.PATHS_TABLE
        parts = (np.load(part) for tile in self._tiles.values() for part in tile.parts)
        rows = write_table(table, parts)
        quality = QualitySums.joined(self._quality.values())
        wavelength_m = job.measurement.waveform.wavelength_m
        scene = job.path_scene
        assert scene is not None
        warnings = quality.warnings(wavelength_m, scene.objects)
        unseen = unseen_warning(
            self._poses,
            scene.objects,
            quality.seen | quality.echoing,
            self._camera,
            job.measurement.width_px,
        )
        if unseen:
            warnings.append(unseen)
        record = contract.PathsRecord(
            frame=self._frame,
            time_s=self._instant.time_s,
            metres_per_unit=job.plan.metres_per_unit,
            code_length_m=job.plan.code_length_m,
            extinction_length_m=job.plan.extinction_length_m,
            code="world" if job.code_world else "materials",
            coloured=quality.coloured,
            amplitude_channel=job.options.amplitude,
            carrier_hz=job.measurement.waveform.carrier_hz,
            camera=self._camera,
            emitter=self._emitter,
            width_px=job.measurement.width_px,
            height_px=job.measurement.height_px,
            max_order=job.options.max_order,
            residual=job.options.residual,
            seed=job.measurement.seed,
            tiles=len(self._tiles),
            shifts=job.options.shifts,
            finest_level=max((tile.level for tile in self._tiles.values()), default=0),
            renders=scene.renders,
            render_time_s=seconds,
            rows=rows,
            objects=scene.objects,
            total_power_w=quality.total_w,
            left_order_share=quality.share(quality.left_order_w),
            left_depth_share=quality.share(quality.left_depth_w),
            mixed_share=quality.share(quality.mixed_w),
            no_code_share=quality.share(quality.no_code_w),
            mixed_bias_bound_m=quality.mixed_bias_bound_m,
            length_sigma_m=quality.length_sigma_m,
            length_sigma_wavelengths=quality.length_sigma_m / wavelength_m,
            relative_error=self._budget.relative_error(),
            reached=reached,
            table_file=table.name,
            table_sha256=file_sha256(table),
            warnings=warnings,
            versions=job.versions,
        )
        job.warnings += record.warnings
        job.summary = (
            f"{rows:,} paths, standard error {100 * record.relative_error:.2g} %, lengths known to "
            f"{record.length_sigma_wavelengths:.2g} wavelengths; ended by {reached}"
        )
        write_record(self._folder / contract.PATHS_FILE, record)


def _overlap(window: ViewWindow, seen: Rectangle) -> bool:
    # A pixel more to each side: shifts move the grid by half a pixel.
    margin = window.pitch
    return (
        seen.left < window.right + margin
        and seen.right > window.left - margin
        and seen.bottom < window.top + margin
        and seen.top > window.bottom - margin
    )
