# SPDX-License-Identifier: GPL-3.0-or-later
"""Acquisition "paths": one path per pixel, tile by tile, until the error or the time is reached.

Driven like :class:`.render_job.RenderJob`: ``pending`` yields renders, each goes through
``start``, ``render`` and ``finish``. Which render comes next depends on the last one.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import contract
from ..errors import OutputError, RadarSimError, SchemaError
from ..physics.radar_equation import effective_area_m2
from ..sidecar import file_sha256, read_record, write_record
from ..signal.cameras import pixel_rays
from ..signal.pathtable import PathRows, write_table
from . import output_folder, scene_truth
from .acquisition import Extent, Instant, Plan, make_plan
from .isolation import SURFACE_TYPES
from .measurement import Measurement
from .nodes import is_radar_material
from .object_motion import ObjectMotion, Poses
from .path_gates import RenderRequest, TraceLimits, View, trace_view
from .path_options import FINEST_PITCH, PathOptions
from .path_quality import QualitySums
from .path_rows import rows_of_view
from .path_scene import PathScene, ViewWindow
from .path_tiles import CellGrid, ErrorBudget, quarters, shift_px, split_frame, view_seed
from .path_unseen import unseen_warning
from .poses import camera_record, emitter_record
from .recorder import Recorder
from .render_job import RenderJob
from .render_settings import MeasurementSettings

#: Ranges may exceed the scene's geometric extent by optical delays.
_RANGE_MARGIN = 1.25
#: Share of the squared error that one round of refinement goes for.
_ROUND_SHARE = 0.8


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


class PathJob(RenderJob):
    """A run that measures paths. Parameters as `RenderJob`, and how paths are followed."""

    unit = "tiles"
    any_projection = True
    blocking = True

    def __init__(
        self,
        scene: Any,
        view_layer: Any,
        measurement: Measurement,
        folder: Path,
        options: PathOptions,
        **keywords: Any,
    ) -> None:
        # One sample a pixel; bounces follow from the order.
        measurement = dataclasses.replace(measurement, samples=1, max_bounces=options.max_order - 1)
        super().__init__(scene, view_layer, measurement, folder, **keywords)
        self._options = options
        self._path_scene: PathScene | None = None
        self._view: View | None = None
        self._code_world = _needs_world_code(scene, options)
        self._numbers = Recorder()

    # -- before the first render -------------------------------------------------------------------

    def _make_plan(self, extent: Extent) -> Plan:
        if self._code_world:
            depsgraph = scene_truth.evaluated_depsgraph(self._view_layer)
            extent = extent.union(
                scene_truth.scene_extent(depsgraph, self.rig, self._metres_per_unit(), True)
            )
        if not self._measurement.rings:
            reach_m = max(extent.from_emitter_m, extent.from_receiver_m) * _RANGE_MARGIN
            self._measurement = dataclasses.replace(
                self._measurement, rings=1, ring_step_m=max(reach_m, self._metres_per_unit() * 1e-3)
            )
        return make_plan(
            self._measurement,
            self._metres_per_unit(),
            self._fps(),
            extent,
            acquisition="paths",
            options=repr(self._options) + (" world" if self._code_world else " materials"),
        )

    def _open_folder(self, digests: list[str]) -> None:
        super()._open_folder(digests)
        if not (self.folder / contract.RUN_FILE).exists():  # cleared, or a first run
            for name in (contract.PATHS_FILE, contract.PATHS_TABLE):
                for path in (self.folder / contract.FRAMES_DIR).glob(f"frame_*/{name}"):
                    path.unlink(missing_ok=True)

    def _make_settings(self) -> MeasurementSettings:
        return MeasurementSettings(
            self._scene, self._view_layer, self.rig, self.plan, any_material=self._code_world
        )

    def prepare(self) -> None:
        """As `RenderJob.prepare`, and the scene set for one path per pixel."""
        super().prepare()
        try:
            self._path_scene = PathScene(
                self._scene,
                self._view_layer,
                self.rig.camera,
                self.rig.emitter,
                self.plan.metres_per_unit,
                self.plan.code_length_m,
                self._code_world,
            )
            self._path_scene.apply()
        except BaseException:
            self.restore()
            raise
        frames = self._measurement.frames
        self._frames_left = [n for n in frames if not self._is_done(n)]
        side = self._options.tile_px
        tiles = -(-self._measurement.width_px // side) * -(-self._measurement.height_px // side)
        # More where tiles are refined: the total grows as they are split.
        self.total = tiles * len(frames)
        self.done = tiles * (len(frames) - len(self._frames_left))

    def _is_done(self, frame: int) -> bool:
        folder = self.folder / contract.frame_dir(frame)
        try:
            record = read_record(folder / contract.PATHS_FILE, contract.PathsRecord)
            return file_sha256(folder / record.table_file) == record.table_sha256
        except (RadarSimError, SchemaError, OSError):
            return False

    # -- renders -----------------------------------------------------------------------------------

    def pending(self) -> Iterator[Any]:
        """Renders that are still to be made; each depends on the ones before."""
        for frame in self._frames_left:
            yield from self._frame_tasks(frame)
        self.total = self.done

    def start(self, task: Any) -> None:
        """Set the gates of a render."""
        assert self._path_scene is not None
        self._path_scene.begin(task.request, self._vertex_map)

    def render(self, task: Any) -> None:
        """Render and wait for the end (not for use in the UI)."""
        assert self._path_scene is not None
        self._path_scene.render()

    def finish(self, task: Any) -> None:
        """Read what was rendered."""
        assert self._path_scene is not None
        self._view = self._path_scene.end()
        self._rendered += 1

    @property
    def seconds_left(self) -> float | None:
        """Unknown: how many renders are needed shows as they are made."""
        return None

    def restore(self) -> None:
        """Give the user's scene back."""
        if self._path_scene is not None:
            self.unrestored += self._path_scene.restore()
        super().restore()

    # -- one radar frame ---------------------------------------------------------------------------

    def _frame_tasks(self, frame: int) -> Generator[PathTask, None, None]:
        assert self._path_scene is not None
        start = time.monotonic()
        output_folder.make_frame_folder(self.folder, frame)
        self._write_scene(frame)
        instants = self.plan.instants(frame)
        units = self.plan.metres_per_unit
        motion = None
        if len(instants) > 1:
            later = ObjectMotion.poses(self._show(instants[1]), self.rig, units)
            dt_s = instants[1].time_s - instants[0].time_s
        depsgraph = self._show(instants[0])
        now = ObjectMotion.poses(depsgraph, self.rig, units)
        if len(instants) > 1:
            motion = ObjectMotion(self._path_scene.objects, now, later, dt_s, depsgraph, units)
        camera = camera_record(
            self.rig, depsgraph, units, self._measurement.width_px, self._measurement.height_px
        )
        emitter = emitter_record(self.rig, depsgraph, units)
        self._path_scene.place(depsgraph)
        self._vertex_map = _vertex_map(self.plan.extent, camera, units)
        work = _FrameWork(self, frame, instants[0], camera, emitter, motion, now)
        yield from work.run(start)

    def view_tasks(
        self,
        frame: int,
        instant: Instant,
        tile: int,
        window: ViewWindow,
        shift: int,
        emitter_m: NDArray[np.float64],
        quality: QualitySums,
    ) -> Generator[PathTask, None, PathRows]:
        """All renders of one view; returns its rows."""
        assert self._path_scene is not None
        options = self._options
        seed = view_seed(self._measurement.seed, window, shift)
        record = self._path_scene.look(window, shift_px(shift), seed)
        rays = pixel_rays(record, window.width_px, window.height_px)
        limits = TraceLimits(
            max_order=options.max_order,
            max_depth=options.max_depth,
            residual=options.residual,
            lottery_free=not self._code_world,
            world_code=self._code_world,
            amplitude=options.amplitude,
            probe=shift == 0,
            opaque=self._path_scene.opaque,
        )
        trace = trace_view(limits, rays.solid_angle_sr)
        request = next(trace)
        while True:
            yield PathTask(frame, instant, tile, shift, request)
            assert self._view is not None
            try:
                request = trace.send(self._view)
            except StopIteration as stop:
                traced = stop.value
                break
        area_m2 = float(effective_area_m2(self._measurement.waveform.wavelength_m))
        share = 1 / options.shifts
        quality.add_view(traced, area_m2 * share / self.plan.metres_per_unit**2, options.shifts)
        return rows_of_view(
            traced,
            rays,
            record,
            emitter_m,
            self.plan.code_length_m,
            self.plan.metres_per_unit,
            self._vertex_map,
            area_m2,
            share,
            tile,
            shift,
        )


class _FrameWork:
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
    ) -> None:
        self._job, self._frame, self._instant = job, frame, instant
        self._camera, self._emitter, self._motion = camera, emitter, motion
        self._poses = poses
        self._emitter_m = np.array(emitter.matrix_world, dtype=np.float64)[:3, 3]
        self._folder = job.folder / contract.frame_dir(frame)
        self._tiles: dict[int, _Tile] = {}
        self._next_number = 0
        self._quality: dict[int, QualitySums] = {}
        self._budget = ErrorBudget()
        resolution_m = job._measurement.waveform.range_resolution_m
        reach_m = job.plan.rings * job._measurement.ring_step_m
        self._grid = CellGrid(resolution_m, min(int(reach_m / resolution_m) + 1, 1 << 20))

    def run(self, start_s: float) -> Generator[PathTask, None, None]:
        options = self._job._options
        measurement = self._job._measurement
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
        options = self._job._options
        while True:
            if options.error_target and self._budget.relative_error() <= options.error_target:
                return "error target"
            open_tiles = [
                number
                for number, tile in self._tiles.items()
                if tile.level < options.max_level and tile.window.pitch / 2 >= FINEST_PITCH
            ]
            worst = self._budget.worst(open_tiles, _ROUND_SHARE)
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

    def _measure(self, tile: _Tile) -> Generator[PathTask, None, None]:
        number, self._next_number = self._next_number, self._next_number + 1
        quality = QualitySums()
        shifts = []
        for shift in range(self._job._options.shifts):
            rows = yield from self._job.view_tasks(
                self._frame,
                self._instant,
                number,
                tile.window,
                shift,
                self._emitter_m,
                quality,
            )
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
        wavelength_m = job._measurement.waveform.wavelength_m
        scene = job._path_scene
        assert scene is not None
        warnings = quality.warnings(wavelength_m, scene.objects)
        unseen = unseen_warning(
            self._poses,
            scene.objects,
            quality.seen | quality.echoing,
            self._camera,
            job._measurement.width_px,
        )
        if unseen:
            warnings.append(unseen)
        record = contract.PathsRecord(
            frame=self._frame,
            time_s=self._instant.time_s,
            metres_per_unit=job.plan.metres_per_unit,
            code_length_m=job.plan.code_length_m,
            extinction_length_m=job.plan.extinction_length_m,
            code="world" if job._code_world else "materials",
            coloured=quality.coloured,
            amplitude_channel=job._options.amplitude,
            carrier_hz=job._measurement.waveform.carrier_hz,
            camera=self._camera,
            emitter=self._emitter,
            width_px=job._measurement.width_px,
            height_px=job._measurement.height_px,
            max_order=job._options.max_order,
            residual=job._options.residual,
            seed=job._measurement.seed,
            tiles=len(self._tiles),
            shifts=job._options.shifts,
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
        write_record(self._folder / contract.PATHS_FILE, record)


def _vertex_map(
    extent: Extent, camera: contract.CameraRecord, metres_per_unit: float
) -> tuple[NDArray[np.float64], float]:
    """Origin and scale that bring every point of the scene to colours from 1/2 to 3/2."""
    position = np.array(camera.matrix_world, dtype=np.float64)[:3, 3] / metres_per_unit
    reach = max(extent.from_receiver_m + extent.baseline_m, 1e-6) / metres_per_unit
    return position.astype(np.float32).astype(np.float64), float(np.float32(0.5 / reach))


def _needs_world_code(scene: Any, options: PathOptions) -> bool:
    """Whether something that can echo has another material than the Radar Material."""
    if options.code != "auto":
        return options.code == "world"
    for item in bpy.data.objects:
        if item.type not in SURFACE_TYPES or item.hide_render:
            continue
        if not item.material_slots:
            return True
        if any(
            s.material is None or not is_radar_material(s.material) for s in item.material_slots
        ):
            return True
    return False
